"""Woven fabric as a thin shell with measured hysteresis, on FEniCSx (DOLFINx 0.11)."""

import sys
from importlib.util import find_spec
from pathlib import Path

__version__ = "0.1.0"
MISSING = ""

try:
    if find_spec("dolfinx_solver"):
        import dolfinx_solver  # noqa: F401  the wheel's DOLFINx finds its MPI only after this
    import dolfinx

    if not dolfinx.__version__.startswith("0.11."):
        raise ImportError(f"DOLFINx is version {dolfinx.__version__}")
except ImportError as error:
    MISSING = (
        f"fabric_fenicsx needs DOLFINx 0.11 ({error}): run 'make setup' in its source folder, or take it "
        "from the pip extra fabric_fenicsx[wheel], conda-forge's fenics-dolfinx, Debian's python3-dolfinx or "
        "the dolfinx/dolfinx container."
    )
    if Path(sys.argv[0]).stem != "fabric-fenicsx":  # whose doctor tells what is missing
        raise ImportError(MISSING) from error
