"""A section of the report of its own: the thesis's law, as printed and continuous, beside the one with a potential."""

from fabric_fenicsx import fabrics, plots

from . import page
from .sections import NAMES, Missing, above, block, ending, full, trace, trace_fit
from .sheets import energies

LAWS = ("printed", "continuous", "potential")
THREE = "The thesis's law and one with a potential"
LOOKS = {"printed": {"ls": ":"}, "continuous": {"ls": "--"}, "potential": {"ls": "-"}}


@block(THREE, "At a point")
def points(r):
    rows, made = [], {law: [] for law in LAWS}
    for fabric, answer in r.fabrics("laws").items():
        for law in LAWS:
            own = answer[law]
            misses = [f"{page.percent(own[way]['misfit_percent'], 2)}" for way in ("warp", "weft")]
            ratios = [f"{own[way]['poisson']:.3f} ({own[way]['nu']:.3f})" for way in ("warp", "weft")]
            both = [f"{own['biaxial'][way]:.2f}" for way in ("warp", "weft")]
            rows.append((fabric, law, *misses, *ratios, *both, f"{own['loop']['share']:.2g}"))
            made[law].append(own["loop"]["share"])
    return page.table(
        "Uniaxial tests to their ends, equal strain along both yarns, closed loops of strain",
        ("fabric", "law", "warp", "weft", "nu12 (measured)", "nu21", "biaxial, warp", "weft", "made of the stored"),
        rows,
    ) + page.p(
        "Warp and weft: by how much the stress misses the fitted curve at the worst strain, in percent of its peak; "
        "biaxial: stress over that of the uniaxial test at the same strain, half of the smaller limit; made: the "
        "energy that the worst closed loop which a search finds gives back beyond what was put in, of what is stored "
        "at its peak.",
        "All three follow the measured curves and contract as measured. In the thesis's law the stress along one yarn "
        "is its own curve times a factor of the strain across, so that the work to a strain depends on the way to it, "
        f"and a loop can give back up to {max(made['continuous']):.2g} times what is stored; the other's stress is the "
        "gradient of a potential along every stretch of loading, and of another along every unloading, so that what a "
        f"loop gives back beyond its work is round-off, {max(made['potential']):.1g}. The price is a choice: how stiff "
        "the cloth is across a pulled yarn is no measured curve but one number a family (transverse, of the fabric's "
        "file).",
    )  # fmt: skip


@block(THREE, "Strips between clamps")
def clamped(r):
    found, rows = r.fabrics("clamped"), []
    figure, axes = plots.panels(2 * len(found), len(found), width=3.6, height=2.6)
    panels = iter(axes)
    for fabric, answer in found.items():
        given = fabrics.load(fabric)
        for way, nu in zip(("warp", "weft"), given.poisson["measured"], strict=True):
            one, tests = next(panels), {law: answer[f"{way} {law}"] for law in LAWS}
            trace_fit(one, fabric, way, max(max(test["history"]["axial_strain"]) for test in tests.values()))
            for law, test in tests.items():
                trace(one, test, law, color=plots.style(fabric)["color"], **LOOKS[law])
                history, top = test["history"], test["top"]
                narrower = -top["transverse_strain"] / top["axial_strain"] / nu - 1
                rows.append(
                    (
                        f"{fabric}, {way}", law, page.percent(above(test, fabric, way)) if full(test) else "-",
                        page.percent(100 * narrower) if full(test) else "-",
                        f"{sum(history['newton_iterations']):.0f}", f"{sum(history['step_cuts']):.0f}", ending(test),
                    )
                )  # fmt: skip
            plots.label(one, f"{fabric}, {way}", "axial strain (-)", "axial stress S (MPa)", ylim=(0, None))
    plots.legend(figure, 4)
    asked = r.settings(f"clamped {next(iter(found))}")
    return (
        page.settings(
            f"{asked['cells'][0]} x {asked['cells'][1]} quadratic cells, measured ratios, {asked['steps']} steps up."
        )
        + page.drawn(figure, "Whole cycles of clamped strips by the three laws, over the curve they were fitted to.")
        + page.table(
            "At the full displacement: force over the fitted curve, contraction of the middle third over the measured",
            ("test", "law", "force", "contraction", "Newton", "cuts", "end"),
            rows,
        )
        + page.p(
            "Near the clamps a strip cannot contract, and is strained along both yarns. There the thesis's law answers "
            "with the product of both curves' factors, and the strip reads far above the curve; the law with a "
            "potential stays near it, as the measured strips did, which were clamped as well."
        )
    )


@block(THREE, "Drape and poke")
def moving(r):
    rows, shown = [], False
    for scene, value in (("drape", "centre_z_m"), ("poke", None)):
        for fabric in NAMES:
            for law in LAWS:
                answer = r.done.get(f"{scene} {law} {fabric}") and r.get(f"{scene} {law} {fabric}")
                if not answer:
                    continue
                history, shown = answer["history"], True
                end = history[value][-1] if value else history["element_207_E11"][-1]
                to, imbalance, _, cuts = energies(answer)
                rows.append(
                    (
                        f"{scene}, {fabric}", law, f"{end:.3f} m" if value else f"E11 {end:.4f}",
                        to, f"{sum(history['newton_iterations']):.0f}", cuts,
                        page.percent(answer["law_gives_back_percent"], 3), imbalance,
                    )
                )  # fmt: skip
    if not shown:
        raise Missing("drape continuous blend")
    return page.table(
        "Scenes of 7.3.2 and 7.3.3; made: energy that the law gives back beyond its work, of the largest external work",
        ("scene", "law", "at the end", "to", "Newton", "cuts", "made", "imbalance"),
        rows,
    )
