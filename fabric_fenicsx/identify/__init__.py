"""From test records to a fabric: Chapter 3, section 7.1 and Appendix A of the thesis.

    found = identify(read("tests.toml"))   # see `listing` for the list of tests, `records` for the files it names
    report.write(found, "report.pdf")      # one page
    path, fabric = fabric_file.write(found, ".")  # fabric.toml, as `fabrics.load` takes it

Only `inverse`, shear from a bias test without photographs, needs FEniCSx.
"""

from .identification import Identified, identify
from .listing import Tests, read

__all__ = ["Identified", "Tests", "identify", "read"]
