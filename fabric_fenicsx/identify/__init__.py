"""From test records to a fabric: Chapter 3, section 7.1 and Appendix A of the thesis.

    found = identify(read("tests.toml"))
    report.write(found, "report.pdf")      # one page
    path, fabric = fabric_file.write(found, ".")  # fabric.toml, as `fabrics.load` takes it

The list of tests is told in `fabric_fenicsx.identify.listing`, and `fabric-fenicsx identify --keys` prints it; the
files that it names in `fabric_fenicsx.identify.records`. Only `inverse`, shear from a bias test without photographs,
needs FEniCSx.
"""

from .identification import Identified, identify
from .listing import Tests, read

__all__ = ["Identified", "Tests", "identify", "read"]
