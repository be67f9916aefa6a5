"""Sections 7.1 and 7.4 of the report: what is put into the law, Kilby's modulus, the linear law."""

import numpy as np

from fabric_fenicsx import plots

from . import page
from .sections import SAID, above, block, fitted

ORDER = ("blend", "duck", "muslin", "denim")  # of the thesis's tables and figures
ROUNDING = 0.25  # MPa: a quarter of the 1 MPa to which Table 7.3 is rounded, as half of its constant is G12
SECTION = "7.1 Material parameters"


def polynomial(coefficients):
    """A modulus in words: 8 + 826 E."""
    terms = []
    for power, c in enumerate(coefficients):
        unit = "" if power == 0 else " E" if power == 1 else f" E^{power}"
        sign = ("-" if c < 0 else "+") if terms else ("-" if c < 0 else "")
        terms.append(f"{sign}{' ' if terms else ''}{abs(c):.5g}{unit}")
    return " ".join(terms)


def miss(found, printed):
    """Largest relative difference of coefficients, in percent."""
    return 100 * max(abs(a / b - 1) for a, b in zip(found, printed, strict=True))


@block(SECTION, "Curves along the yarns; Table 7.1")
def tension(r):
    found = r.fabrics("material", ORDER)
    figure, axes = plots.panels(len(found), 1, width=2.6, height=2.6)
    rows, worst = [], 0.0
    for one, (name, answer) in zip(axes, found.items(), strict=True):
        printed = SAID["table_7_1"][name]
        for way in "warp", "weft":
            curve, n = answer[way], len(answer[way]["fitted_MPa"])
            one.plot(
                curve["strain"], curve["stress_MPa"], plots.YARNS[way], color=plots.style(name)["color"], label=way
            )
            one.plot(curve["strain"][:n], curve["fitted_MPa"], label="fitted curve, Table 7.1", **plots.FITTED)
            difference = max(
                miss(curve["loading_MPa"], printed[way]), miss([curve["unloading_MPa"]], [printed[f"{way}_unloading"]])
            )
            worst = max(worst, difference)
            rows.append((
                name, way, polynomial(printed[way]), polynomial(curve["loading_MPa"]),
                f"{printed[f'{way}_unloading']:g}", f"{curve['unloading_MPa']:.5g}", f"{difference:.1g} %",
            ))  # fmt: skip
        plots.label(one, name, "strain (-)", "stress S (MPa)", ylim=(0, None))
    plots.legend(figure, 3)
    numbers = [f"7-{1 + ORDER.index(name)}" for name in found]
    steps = r.settings(f"material {next(iter(found))}")["steps"]
    return (
        page.settings(
            f"one material point under uniaxial stress, continuous law, {steps} steps up and {steps} down. The loading "
            "modulus is found again by a polynomial fitted to the stress and differentiated; the unloading modulus is "
            "the steepest slope on the way down."
        )
        + page.drawn(figure, "Loading and unloading along warp and weft, as the law answers.", *numbers)
        + page.table(
            "Table 7.1, row by row: moduli in MPa as printed, and as found in the law's answer",
            ("fabric", "yarn", "loading, printed", "loading, found", "unloading, printed", "found", "difference"),
            rows,
        )
        + page.p(
            f"Every row of Table 7.1 that is shown is reproduced: the largest difference is {worst:.1g} %.",
            "The thesis's table prints the warp modulus of denim as a function of E22; it is read as one of E11.",
        )
    )


@block(SECTION, "Shear; Table 7.3")
def shear(r):
    found = r.fabrics("material", ORDER)
    figure, axes = plots.panels(len(found), 1, width=2.6, height=2.6)
    rows, worst = [], 0.0
    for one, (name, answer) in zip(axes, found.items(), strict=True):
        printed, curve = SAID["table_7_3"][name], answer["shear"]
        n = len(curve["fitted_MPa"])
        one.plot(curve["strain"], curve["stress_MPa"], color=plots.style(name)["color"], label="continuous law")
        one.plot(curve["strain"][:n], curve["fitted_MPa"], label="fitted curve, Table 7.3", **plots.FITTED)
        plots.label(one, name, "shear strain E12 (-)", "shear stress S12 (MPa)")
        difference = max(
            miss(curve["loading_MPa"], printed["loading"]), miss([curve["unloading_MPa"]], [printed["unloading"]])
        )
        worst = max(worst, difference)
        rows.append((
            name, polynomial(printed["loading"]), polynomial(curve["loading_MPa"]), f"{printed['unloading']:g}",
            f"{curve['unloading_MPa']:.5g}", f"{difference:.1g} %",
        ))  # fmt: skip
    plots.legend(figure, 2)
    return (
        page.settings("one material point in shear alone, continuous law, up to the end of the bias test and down.")
        + page.drawn(figure, "Shear loading and unloading.", *[f"7-{5 + ORDER.index(name)}" for name in found])
        + page.table(
            "Table 7.3, row by row: dS12/dE12 in MPa as printed, and as found in the law's answer",
            ("fabric", "loading, printed", "loading, found", "unloading, printed", "found", "difference"),
            rows,
        )
        + page.p(
            f"Every row is reproduced to {worst:.1g} %, with E12 read as the tensor component: the table is dS12/dE12, "
            "and the shear modulus G12 is half of it. Table 7.5 says which reading is meant."
        )
    )


@block(SECTION, "Poisson's ratios and densities; Table 7.2")
def poisson(r):
    rows, odd, worst = [], [], 0.0
    found = r.fabrics("material", ORDER)
    for name, answer in found.items():
        printed, measured = SAID["table_7_2"][name], SAID["table_3_3"][name]
        nu = answer["warp"]["poisson"], answer["weft"]["poisson"]
        worst = max(worst, miss(nu, (printed["nu12"], printed["nu21"])))
        weighed = measured["mass"] / measured["thickness"]
        used = answer["density_kg_per_m3"]
        if used != printed["density"]:
            odd.append(
                f"{name} is given {printed['density']:g} kg/m3 in Table 7.2 and {measured['density']:g} in Table 3.3; "
                f"its mass of {measured['mass']:g} g/m2 over {measured['thickness']:g} mm is {weighed:.0f}, and "
                f"{used:g} is used"
            )
        rows.append((
            name, f"{printed['nu12']:g}, {printed['nu21']:g}", f"{nu[0]:.4g}, {nu[1]:.4g}", f"{printed['density']:g}",
            f"{measured['density']:g}", f"{weighed:.0f}", f"{used:g}",
        ))  # fmt: skip
    return page.table(
        "Table 7.2, row by row; the ratios are found from the contraction of a point under uniaxial stress",
        ("fabric", "nu12, nu21 printed", "found", "density printed", "in Table 3.3", "mass / thickness", "used"),
        rows,
    ) + page.p(
        f"The ratios are reproduced to {worst:.1g} %.",
        f"The densities are, but for a swap: {'; '.join(odd)}." if odd else "So are the densities.",
    )


def kilby(E1, E2, E45, nu12, nu21, as_printed=False):
    """G12 by (3.4), and as the thesis prints (3.4) and (7.3), with the ratios the other way."""
    a, b = (nu21, nu12) if as_printed else (nu12, nu21)
    return 1 / (4 / E45 - 1 / E1 - 1 / E2 + a / E1 + b / E2)


@block("7.4 Discussion", "Kilby's shear modulus; Table 7.5")
def table_7_5(r):
    rows, near, off = [], [], []
    for name, answer in r.fabrics("material", ORDER).items():
        printed, E = SAID["table_7_5"][name], answer["initial_MPa"]
        nu = answer["poisson"]["measured"]
        strip = r.get(f"cycles {name}")
        ours, wrong = (kilby(E["warp"], E["weft"], E["bias"], *nu, as_printed=told) for told in (False, True))
        test = strip and strip["bias measured continuous"]
        # of the first step of the strip
        secant = test and test["history"]["axial_stress_MPa"][0] / test["history"]["axial_strain"][0]
        # what the bias test's initial modulus must have been for Kilby's equation to give the printed number
        meant = 4 / (1 / printed["kilby"] + (1 - nu[0]) / E["warp"] + (1 - nu[1]) / E["weft"])
        again = 100 * abs(printed["kilby"] / printed["present"] - 1)
        rows.append((
            name, f"{printed['kilby']:g}", f"{printed['present']:g}", f"{printed['difference']:g} %", f"{again:.1f} %",
            f"{E['shear']:.3g}", f"{ours:.3g}", f"{wrong:.3g}", f"{meant:.3g}", f"{E['bias']:.3g}",
            f"{secant:.3g}" if secant else "-",
        ))  # fmt: skip
        (near if abs(E["shear"] - printed["present"]) <= ROUNDING else off).append(
            f"{name} ({E['shear']:.3g} against {printed['present']:g} MPa)"
        )
    return page.table(
        "Table 7.5, row by row, MPa. Printed: G12 by Kilby, G12 by the bias tests, their difference (and as the two "
        "printed numbers give it). Here: initial G12 of the law; Kilby's equation with the law's own initial moduli, "
        "and with its ratios as printed in (7.3); the initial modulus in bias that the thesis's Kilby modulus stands "
        "for, the law's, and that of the first step of the strip",
        ("fabric", "Kilby", "present", "differ", "again", "G12 here", "Kilby here", "(7.3) as printed", "E45 meant",
         "E45 here", "strip"),
        rows,
    ) + page.p(
        "The modulus that the law takes at zero strain is half of the constant of Table 7.3, which is rounded to 1 "
        f"MPa, so that it can differ from Table 7.5 by {ROUNDING:g} MPa. Within that it is right for "
        f"{page.joined(near)}."
        if near else None,
        f"It is not for {page.joined(off)}: the two tables of the thesis do not agree there." if off else None,
        "Kilby's equation turns the law's initial modulus in bias into the law's own shear modulus, since it is exact "
        "for a linear sheet; with its two ratios exchanged, as printed, it is off where they differ much. The "
        "thesis's Kilby column rests on the initial modulus of its bias tests, which it does not print; the column "
        "“E45 meant” is what that must have been.",
    )  # fmt: skip


@block("7.4 Discussion", "The linear law beside the measured one")
def linear(r):
    answer, cycles = r["material blend"], r["cycles blend"]
    figure, axes = plots.panels(2, 1, width=3.8, height=3.0)
    rows = []
    for one, way in zip(axes, ("warp", "weft"), strict=True):
        curve, n = answer[way], len(answer[way]["fitted_MPa"])
        strain, fit, linear_ = (
            np.array(curve["strain"][:n]),
            np.array(curve["fitted_MPa"]),
            np.array(curve["linear_MPa"]),
        )
        history = cycles[f"{way} measured continuous"]["history"]
        one.plot(
            history["axial_strain"],
            history["axial_stress_MPa"],
            color=plots.style("blend")["color"],
            label="27 elements",
        )
        one.plot(strain, linear_, color="0.5", label="St. Venant-Kirchhoff, initial moduli")
        one.plot(strain, fit, label="fitted curve, Table 7.1", **plots.FITTED)
        plots.label(one, f"blend, {way}", "strain (-)", "stress S (MPa)", ylim=(0, None))
        for k, at in enumerate(SAID["linear"]["strains"]):
            model = above(cycles[f"{way} measured continuous"], "blend", way, at)
            svk = 100 * (at * linear_[-1] / strain[-1] / fitted("blend", way, at) - 1)
            said = SAID["linear"][way]
            rows.append((way, f"{100 * at:g} %", f"{said['model'][k]:g} %", f"{said['svk'][k]:g} %",
                         page.percent(model), page.percent(svk)))  # fmt: skip
    plots.legend(figure, 3)
    return (
        page.drawn(figure, "Blend along warp and weft: the law, the linear law of its initial moduli, the fit.", "7-37")
        + page.table(
            "Miss at three strains: the thesis's against its experiment, this code's against the fitted curve",
            ("yarn", "strain", "thesis, model", "thesis, SVK", "27 elements here", "SVK here"),
            rows,
        )
        + page.p(
            "The thesis's percentages for the linear law do not fall on one curve with those for its own model, nor "
            "on Table 7.1: against the fitted quadratic a line through its initial modulus must lose more and more "
            "with the strain, as the last column does. They are quoted and not pursued."
        )
    )
