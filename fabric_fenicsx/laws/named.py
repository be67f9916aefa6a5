"""The laws of a measured fabric by their names, as command lines and scene files choose them."""

from ..errors import InputError
from ..fabrics import Fabric
from . import Law, Poisson
from .bending import Bending
from .potential import Potential
from .printed import Printed
from .svk import StVenantKirchhoff
from .woven import Woven

THESIS = {"continuous": Woven, "printed": Printed}
"""Chapter 6 as a continuous function of strain, and to the letter."""
MEASURED = {**THESIS, "potential": Potential}
"""Laws of the whole measured behaviour."""
DEFAULT = "potential"
"""The law of scenes and command lines that name none."""
NAMES = (*MEASURED, "svk")
"""All names; svk is linear elasticity with the fabric's first moduli."""


BENDING = ("own", "layers")
"""How a sheet of a fabric bends: as it was measured, or is assumed; or as the law does in layers of its thickness."""


def bending(name: str, fabric: Fabric) -> Bending | None:
    """The bending law of this name, one of `BENDING`; None for layers."""
    return Bending.from_fabric(fabric) if name == "own" else None


def law(
    name: str,
    fabric: Fabric,
    poisson: Poisson = "measured",
    shear_hysteresis: bool = True,
    *,
    ramp: float | None = None,
) -> Law:
    """The law of this name, one of `NAMES`; poisson: "measured" or "lowered". Raises KeyError for another name.

    ramp: strain over which a modulus changes after a reversal, instead of the law's own; InputError for one without,
    and for a fabric whose shear has friction that the law would leave out.
    """
    if name in THESIS and shear_hysteresis and fabric.shear_friction:
        raise InputError(
            f"{fabric.name}: the law {name!r} knows nothing of friction_MPa, softening and the like of its [shear]; "
            "take the law 'potential', leave those keys out, or shear_hysteresis = false."
        )
    if ramp is not None and name in ("svk", "printed"):
        raise InputError(f"ramp = {ramp:g} cannot be chosen for the law {name!r}; leave it out, or take another law.")
    if name == "svk":
        return StVenantKirchhoff.from_fabric(fabric, poisson)
    width = {} if ramp is None else {"ramp": ramp}
    return MEASURED[name](fabric, poisson, shear_hysteresis=shear_hysteresis, **width)
