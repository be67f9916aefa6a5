"""Boundaries between files of the package that one residual of a shell goes over, there and back.

    python .setup/hops.py

It counts Python's calls and returns; compiled kernels are not among them. Of another version: with PYTHONPATH at the
folder that holds it, from outside of this one.
"""

import sys
from itertools import pairwise
from pathlib import Path

import fabric_fenicsx
from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.laws.woven import Woven

ROOT = Path(fabric_fenicsx.__file__).parent
if (ROOT / "supports.py").exists():  # version 0.1
    from fabric_fenicsx import meshing, supports
else:
    from fabric_fenicsx.surfaces import meshing
    from fabric_fenicsx.terms import supports
MESH = next(folder / "meshes" / "strip.geo" for folder in (ROOT, ROOT.parent) if (folder / "meshes/strip.geo").exists())


def main():
    """Of a clamped strip of the law of Chapter 6, at its second residual."""
    fabric = fabrics.load("blend")
    domain = meshing.read(MESH, nx=3, ny=2)
    cloth = sheet.Sheet(domain, Woven(fabric), fabric.thickness, (1e6, 1e6))
    solver = cloth.equilibrium(supports.clamp(domain, cloth.space, "fixed_end"))
    x, way = solver.begin(), []

    def inside(frame):
        """This frame of the package, or the nearest one that called it."""
        while frame and not frame.f_code.co_filename.startswith(str(ROOT)):
            frame = frame.f_back
        return frame

    def look(frame, event, _):
        if event in ("call", "return") and inside(frame) is frame:
            there = frame if event == "call" else inside(frame.f_back)
            way.extend([there.f_code.co_filename] if there else [])

    solver.residual(x)
    x.array_w[0] += 1e-9
    sys.setprofile(look)
    solver.residual(x)
    sys.setprofile(None)
    hops = sum(a != b for a, b in pairwise(way))
    print(f"{len(set(way))} files, {hops} boundaries: {', '.join(Path(p).name for p in dict.fromkeys(way))}")


if __name__ == "__main__":
    main()
