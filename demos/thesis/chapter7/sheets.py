"""Section 7.3 of the report: sheets stretched both ways, and in motion."""

import biaxial
import moving
import numpy as np
import poke as poke_demo

from fabric_fenicsx import fabrics, plots

from . import page
from .sections import SAID, block, looks

SIDE_CM = 100 * biaxial.SIDE
STRETCH = "7.3.1 Biaxial strain"
DRAPE, POKE = "7.3.2 Draping fabric from four corners", "7.3.3 Poking fabric"


@block(STRETCH, "Equibiaxial strain of blend and denim")
def stretch(r):
    found = r.fabrics("stretch", ("blend", "denim"))
    asked = r.settings(f"stretch {next(iter(found))}")
    figure, axes = plots.panels(len(found), 1, width=3.8, height=3.2)
    rows = []
    for one, (name, answer) in zip(axes, found.items(), strict=True):
        given, factor = fabrics.load(name), 1 / (1 - np.prod(fabrics.load(name).poisson["measured"]))
        for yarn, column, k in (("warp", "axial", 1), ("weft", "transverse", 0)):
            for law, test in answer.items():
                history, peak = test["history"], test["peak"]
                E, S = (np.insert(history[key], 0, 0.0) for key in ("axial_strain", f"{column}_stress_MPa"))
                style = {"color": plots.style(name)["color"], "ls": plots.YARNS[yarn]}
                if law == "printed":
                    style = looks(name)["printed"]
                one.plot(E, S, label="law as printed" if law == "printed" else f"{yarn}, 1:1 strain", **style)
                if len(E) > peak:
                    fit = getattr(given, yarn).stress(E[peak]) / 1e6
                    expected = factor * (1 + given.poisson["measured"][k])
                    numbers = (
                        f"{E[peak]:.4f}",
                        f"{S[peak]:.3f}",
                        f"{fit:.3f}",
                        f"{S[peak] / fit:.2f}",
                        f"{expected:.2f}",
                    )
                    rows.append((name, yarn, law, *numbers, "stopped later" if test["stopped"] else "complete"))
            smooth = np.linspace(0, E.max(), 60)
            one.plot(smooth, getattr(given, yarn).stress(smooth) / 1e6, label="uniaxial, Table 7.1", **plots.FITTED)
        plots.label(one, name, "strain E11 = E22 (-)", "stress S (MPa)")
    plots.legend(figure, 4)
    ratios = [f"{row[6]} ({row[0]}, {row[1]})" for row in rows if row[2] == "continuous"]
    return (
        page.settings(
            f"sheets of {SIDE_CM:g} cm x {SIDE_CM:g} cm, both sides made longer by {asked['displacement_mm'] / 10:g} "
            f"cm, and back until no force is left; {asked['steps']} steps up. The displacement is read as the whole "
            "extension of a side."
        )
        + page.drawn(figure, "1:1 biaxial strain.", *[{"blend": "7-29", "denim": "7-30"}[name] for name in found])
        + page.table(
            "Stress at the largest strain, and how many times that of uniaxial stress; expected: (1 + nu)/(1 - nu12 "
            "nu21)",
            ("fabric", "yarn", "law", "strain", "S, MPa", "uniaxial, MPa", "times", "expected", "cycle"),
            rows,
        )
        + page.p(
            f"At the same strain the stress is {page.joined(ratios)} times the uniaxial one: the thesis's “tremendous "
            "effect”, which it does not put into numbers. The continuous law gives exactly the factor that (6.11) "
            "asks for; the printed one is above it by the error of its increments."
        )
    )


def sheet(asked, answer):
    """The sheet of a scene in motion and the steps of its time, in words."""
    side, cells, step = moving.SIDE, asked["cells"], 1e3 * answer["history"]["time_s"][0]
    return f"{side:g} m x {side:g} m, {cells} x {cells} mitc4 shell elements, implicit, nominal step {step:g} ms"


def energies(answer):
    """Where the work of a run went, as one cell, and its bill."""
    history = answer["history"]
    return (
        f"{history['time_s'][-1]:.3f} s" + (" (stopped)" if answer["stopped"] else ""),
        f"{answer['imbalance_percent']:.2f} %",
        f"{answer['iterations_a_step']:.1f}",
        f"{sum(history['step_cuts']):.0f}",
    )


@block(DRAPE, "A square sheet falls, held at its four corners")
def drape(r):
    found = {name: r.get(case) for name, case in {
        "blend, shear hysteresis off": "drape continuous blend no shear hysteresis",
        **{name: f"drape continuous {name}" for name in ("blend", "denim", "duck", "muslin")},
        "blend, printed, off": "drape printed blend no shear hysteresis", "blend, printed": "drape printed blend",
    }.items()}  # fmt: skip
    found = {name: answer for name, answer in found.items() if answer}
    blend = r["drape continuous blend"]
    asked = r.settings("drape continuous blend")
    figure, (one,) = plots.panels(1, 1, width=5.5, height=3.0)
    rows = []
    for name, answer in found.items():
        fabric, printed = name.split(",")[0], "printed" in name
        history = answer["history"]
        style = {"color": "0.4" if printed else plots.style(fabric)["color"], "ls": "--" if "off" in name else "-"}
        one.plot(history["time_s"], history["centre_z_m"], label=name, **style)
        left = 100 * history["kinetic_J"][-1] / max(answer["external_work_most_J"], 1e-300)
        rows.append((name, f"{history['centre_z_m'][-1]:.3f}", f"{left:.1f} %", *energies(answer)))
    plots.label(one, "", "time (s)", "height of the centre (m)")
    plots.legend(figure, 3)
    t, z = (np.array(blend["history"][key]) for key in ("time_s", "centre_z_m"))
    low, last = int([*np.flatnonzero(np.diff(z) > 0), len(z) - 1][0]), max(len(z) - 5, 1)
    left = 100 * blend["history"]["kinetic_J"][-1] / blend["external_work_most_J"]
    speed = np.abs(np.diff(z[last - 1 :]) / np.diff(t[last - 1 :])).max()
    return (
        page.settings(
            f"{sheet(asked, blend)}, pinned at its corner points, gravity. The thesis: blend, explicit, steps of "
            f"{SAID['dynamics']['step_us']} us, shear hysteresis off."
        )
        + page.snapshots(blend["pictures"], "Blend with the whole law, larger yarn strain.", "7-31")
        + page.drawn(figure, "Height of the centre. Grey: the law as printed, to where it stops.")
        + page.table(
            "The drape; imbalance: of the largest external work; Newton iterations a step taken",
            ("sheet", "centre at the end, m", "still kinetic", "to", "imbalance", "Newton", "cuts"),
            rows,
        )
        + page.p(
            f"The thesis's sheet comes to equilibrium within {SAID['dynamics']['rest_s']:g} s. Here blend falls to "
            f"{z[low]:.3f} m at {t[low]:.3f} s, springs back to {z[low:].max():.3f} m, and at {t[-1]:g} s its centre "
            f"is at {z[-1]:.3f} m and moved by up to {speed:.2f} m/s in the last steps; {left:.1f} % of the work of "
            "its weight is kinetic then. Nothing but its own hysteresis damps it here.",
            "A sheet pinned at points has no answer that refinement would converge to; heights compare at this mesh "
            "only.",
            *(f"{name}: {answer['stopped'].split(';')[0]}." for name, answer in found.items() if answer["stopped"]),
        )
    )


@block(POKE, "The middle of a clamped sheet, pushed out and back")
def poke(r):
    wanted = {
        "blend, St. Venant-Kirchhoff": "poke svk blend", "blend": "poke continuous blend",
        "blend, shear hysteresis off": "poke continuous blend no shear hysteresis",
        **{name: f"poke continuous {name}" for name in ("denim", "duck", "muslin")},
        **{f"{name}, lowered ratios": f"poke continuous {name} lowered ratios" for name in ("duck", "muslin")},
    }  # fmt: skip
    found = {name: answer for name, answer in ((name, r.get(case)) for name, case in wanted.items()) if answer}
    svk, law = r["poke svk blend"], r["poke continuous blend"]
    asked = r.settings("poke svk blend")
    given, rows, words = fabrics.load("blend"), [], []
    figure, axes = plots.panels(2, 1, width=3.8, height=3.1)
    for one, (element, k, yarn) in zip(axes, ((207, 1, "warp"), (271, 2, "weft")), strict=True):
        peak = 0.0
        for name, answer, style in (
            ("fabric law", law, {"color": plots.style("blend")["color"], "marker": ".", "ms": 3}),
            ("St. Venant-Kirchhoff", svk, {"color": "0.5", "marker": ".", "ms": 3}),
        ):
            E, S = (
                np.array(answer["history"][f"element_{element}_{c}{k}{k}{unit}"])
                for c, unit in (("E", ""), ("S", "_MPa"))
            )
            one.plot(E, S, label=name, **style)
            peak = max(peak, E.max())
            words.append((element, name, S.max(), E[S.argmax()], E[-1], E.max()))
        strain = np.linspace(0, peak, 80)
        one.plot(strain, getattr(given, yarn).stress(strain) / 1e6, label="uniaxial, Table 7.1", **plots.FITTED)
        plots.label(one, f"element {element}", f"{yarn} strain E{k}{k} (-)", f"{yarn} stress S{k}{k} (MPa)")
    plots.legend(figure)
    for name, answer in found.items():
        history = answer["history"]
        strain = history["element_207_E11"]
        rows.append((name, f"{max(strain):.4f}", f"{strain[-1]:.4f}", *energies(answer)))
    told = [
        f"element {element}, {name}: at most {S:.2f} MPa at a strain of {at:.3f}; {end:.4f} of {most:.4f} stays at the "
        "end"
        for element, name, S, at, end, most in words
    ]
    return (
        page.settings(
            f"{sheet(asked, law)}, rim clamped, the middle 4 x 4 elements out by {poke_demo.HEIGHT:g} m and back in "
            f"{poke_demo.TIME:g} s along 1 - cos. The thesis does not tell how the middle moved; it took explicit "
            f"steps of {SAID['dynamics']['step_us']} us and no shear hysteresis. A run is given up after "
            f"{asked['most']} Newton iterations."
        )
        + page.drawn(
            _grid(), "Numbers of the elements, down the columns; blue: moved; red: elements 207 and 271.", "7-32"
        )
        + page.snapshots(svk["pictures"], "St. Venant-Kirchhoff: the sheet comes back.", "7-33")
        + page.snapshots(
            law["pictures"], "Fabric law, shear hysteresis on: the sheet stays stretched and wrinkles.", "7-34"
        )
        + page.drawn(figure, "Stress and strain along the yarn.", "7-35", "7-36")
        + page.table(
            "The poke; imbalance: of the largest external work",
            ("sheet", "207: largest E11", "at the end", "to", "imbalance", "Newton", "cuts"),
            rows,
        )
        + page.p(
            f"In numbers: {'; '.join(told)}.",
            "As in the thesis the fabric's stress is higher and not linear, the elastic sheet recovers and the fabric "
            "does not. The points of its way down show the steep unloading, of which the thesis has one point each.",
            *(
                f"{name}: {answer['stopped'].split(';')[0].rstrip('.')}."
                for name, answer in found.items()
                if answer["stopped"]
            ),
        )
    )


def _grid():
    """The element numbers of Figure 7-32."""
    figure, (axes,) = plots.panels(1, 1, width=4.2, height=4.2)
    axes.grid(False)
    colors = np.ones((20, 20, 3))
    colors[8:12, 8:12] = (0.75, 0.85, 1.0)
    for number in (207, 271):
        colors[(number - 1) % 20, (number - 1) // 20] = (1.0, 0.7, 0.7)
    axes.imshow(colors)
    for number in range(1, 401):
        axes.text((number - 1) // 20, (number - 1) % 20, number, size=3.6, ha="center", va="center")
    axes.set(xticks=np.arange(-0.5, 20), yticks=np.arange(-0.5, 20), xticklabels=[], yticklabels=[])
    axes.tick_params(length=0)
    axes.grid(color="0.6", lw=0.4)
    axes.set_xlabel("weft (y)", size=8)
    axes.set_ylabel("warp (x)", size=8)
    return figure
