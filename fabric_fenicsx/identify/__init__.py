"""From test records to a fabric: Chapter 3, section 7.1 and Appendix A of the thesis.

    found = identify(read("tests.toml"))
    page.write(found, "report.pdf")        # one page, `report.page`
    path, fabric = fabric_file.write(found, ".")  # fabric.toml, as `fabrics.load` takes it

The list of tests is told in `fabric_fenicsx.identify.listing`, and `fabric-fenicsx identify --keys` prints it; the
files that it names in `fabric_fenicsx.identify.files.records`. Folders: `files` reads them, `tensile`, `shear`,
`bending` and `sheets` make curves of them, `joint` fits all in one, `report` tells it, `synthetic` makes records of a
known fabric. Only simulated strips, `tensile.inverse` and `tensile.simulated`, need FEniCSx.
"""

from .identification import Identified, identify
from .listing import Tests, read

__all__ = ["Identified", "Tests", "identify", "read"]
