"""A fabric's linear numbers under the names and in the units of three programs that simulate cloth.

All three are linear and alike along warp and weft in some of their numbers; each says in `lost` what of the fabric it
does not take along, and the numbers below solve their own formulas for the fabric's stiffness at rest:

- ppf-contact-solver (github.com/st-tech/ppf-contact-solver; docs/blender_addon/workflow/params/material.md, energy.cu):
  young-mod and poiss-rat give mu and lambda as in three dimensions; the Baraff-Witkin model has mu/2 (stretch - 1)^2
  along each yarn and lambda/2 (warp . weft)^2, times the density in kg/m2; a hinge has the stiffness
  1.28e-5 bend density L^2/(A1 + A2);
- newton (github.com/newton-physics/newton; ModelBuilder.add_cloth_mesh, solvers/vbd/particle_vbd_kernels.py): tri_ke
  and tri_ka are Lame's constants mu and lambda of an isotropic sheet in N/m; an edge has edge_ke/2 times its length and
  the square of its angle, so that edge_ke (N) goes with the mesh;
- blender (docs.blender.org/api, bpy.types.ClothSettings; SIM_mass_spring.cc): springs of stiffness over the mean edge,
  diagonals for shear, 0.1 bending_stiffness times the edge for a hinge, as a force at the vertices of both faces, and a
  mass for each vertex: all of them go with the mesh, and none has a unit there.

A hinge that bends as the sheet has the bending stiffness times L^2/(A1 + A2): exact on equilateral triangles (Seung and
Nelson 1988, doi 10.1103/PhysRevA.38.1005).
"""

import numpy as np

HINGE = 1.28e-5  # of bend, m4/s2
EQUILATERAL = 2 / np.sqrt(3)  # L^2/(A1 + A2) of two such triangles
LOST = {
    "ppf": "the slopes at rest alone, and the geometric mean of warp and weft in tension and bending; no Poisson's "
    "ratio of the cloth (poiss-rat is used up for the shear), no curves, unloading, friction or softening",
    "newton": "an isotropic sheet: the geometric mean of warp and weft in tension and bending, the mean Poisson's "
    "ratio, and a shear that follows from both; no curves, unloading, friction or softening",
    "blender": "springs along edges and diagonals: the geometric mean of warp and weft, no Poisson's ratio, no curves, "
    "unloading, friction or softening; a mesh of squares along the yarns is taken for granted",
}


def numbers(n: dict[str, float], format: str, edge: float) -> dict[str, object]:
    """The numbers of `ppf`, `newton` or `blender` from those of `exporting.linear`; edge of the mesh in m."""
    tension, B = (
        float(np.sqrt(n[f"{key}_warp_{unit}"] * n[f"{key}_weft_{unit}"]))
        for key, unit in (("tension", "N_per_m"), ("bending", "N_m"))
    )
    shear, mass = n["shear_N_per_m"], n["areal_mass_kg_per_m2"]
    if format == "ppf":
        part = shear / tension  # lambda/mu = 2 nu/(1 - 2 nu)
        nu = part / (2 * (1 + part))
        young = 2 * (1 + nu) * tension / mass
        return {
            "model": "baraff-witkin",
            "density": mass,
            "young-mod": young,
            "poiss-rat": nu,
            "bend": B / HINGE / mass,
        }
    if format == "newton":
        nu = float(np.sqrt(n["nu12"] * n["nu21"]))
        mu, lame = tension / (2 * (1 + nu)), tension * nu / (1 - nu**2)
        size = {"edge_m": edge, "shear_over_that_of_the_cloth": mu / shear}
        return {"density": mass, "tri_ke": mu, "tri_ka": lame, "edge_ke": EQUILATERAL * B / edge} | size
    springs = {"tension_stiffness": tension * edge, "compression_stiffness": tension * edge}
    springs |= {"shear_stiffness": shear * edge, "bending_stiffness": 20 * B / edge**2}
    return {"bending_model": "ANGULAR", "mass": mass * edge**2} | springs | {"edge_m": edge}
