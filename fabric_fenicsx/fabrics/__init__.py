"""Measured woven fabrics as data: the four of R. W. Williams' 2010 thesis, and a user's own from a TOML file.

`load("blend")` or `load("my_fabric.toml")` returns a `Fabric` in SI units; `names()` lists the fabrics that
come with the package, and `compare` draws several. A file that is incomplete or contradicts physics is refused in
one sentence (`InputError`).
The built-in files, beside this one, are the pattern for a user's own.

Where the thesis contradicts itself, these files follow the reading that its own numbers support:

- Table 7.1, denim: D1 is printed as a function of E22; it is of E11.
- Table 7.2: the densities of muslin and denim are swapped (350, 370); Table 3.3 has 370 and 350 kg/m3, and
  denim's mass per area over its thickness, 390 g/m2 / 1.12 mm = 348 kg/m3, agrees.
- Table 7.3: the argument "E12" is the tensor component, so the table is dS12/dE12, and G12 = dS12/d(2 E12) is
  half of it; the unloading column likewise. With 2 E12 as its argument denim's modulus would turn negative
  inside the tested range; and half of the constants, which are rounded to 1 MPa, agrees within that rounding
  with the initial moduli of Table 7.5 for blend, muslin and denim (duck's 0.82 MPa is off: it would have to lie
  in 0.25 ... 0.75). The reading is one key of the file, `shear.strain`: "tensor", or "engineering" where
  argument and value are 2 E12 and G12 themselves.
- Poisson's ratios: nu12 is the contraction along weft per stretch along warp, as in (3.3) and (6.11), not as
  the misprinted (3.4), (7.3) would have it. "lowered" holds Table 7.4, used there for duck and muslin.

- How stiff a fabric is in biaxial tension was not measured; `transverse` of a file, with its source, is for that.
  Where a file has none it is assumed.

- How shear comes back past zero stress, and what a second shear lacks of the first one, was not measured either: the
  optional keys of [shear] tell it (`curve_reading`), and these four have none of them.

Bending was not measured in the thesis, and these four have none. A user's file may have it (`bending_reading` tells the
keys of its table [bending]); where it has not, `Fabric.bending_or_estimate` gives what 618 published fabrics of the
same mass have, with the word "assumed" in all that it prints.

The calibrated range of a curve ends at E = d + d^2/2, (3.2), with d = displacement / gauge length of its test,
or at the file's `limit_strain`. For shear, E is the tensor component E12 of the bias test: the yarns hardly
stretch there, E11 + E22 = 0, so that the axial strain (E11 + E22)/2 + E12 is E12.
"""

from fabric_fenicsx.fabrics.bending import BendingCurve, BendingCurves, estimated_bending
from fabric_fenicsx.fabrics.data import Curve, Fabric, compare
from fabric_fenicsx.fabrics.friction import ShearFriction
from fabric_fenicsx.fabrics.reading import load, names

__all__ = [
    "BendingCurve",
    "BendingCurves",
    "Curve",
    "Fabric",
    "ShearFriction",
    "compare",
    "estimated_bending",
    "load",
    "names",
]
