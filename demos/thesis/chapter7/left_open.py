"""What the thesis left open, each answered with a number; and Table 7.4, which is one of these questions."""

import numpy as np

from fabric_fenicsx import plots

from . import page
from .sections import NAMES, SAID, above, block, worst

OPEN = "What the thesis left open"
DRAPE = "drape continuous"


@block("7.2.1 Axial tests in warp and weft", "How large may Poisson's ratios be? Table 7.4")
def table_7_4(r):
    found = r.fabrics("ratios", ("duck", "muslin"))
    figure, axes = plots.panels(len(found), 1, width=3.8, height=3.0)
    rows, words = [], []
    for one, (name, answer) in zip(axes, found.items(), strict=True):
        values = r.settings(f"ratios {name}")["values"]
        for way in "warp", "weft":
            for law, style in ("continuous", "-"), ("printed", ":"):
                excess = [
                    answer[f"{nu:g} {way} {law}"]["above_fit_percent"]
                    if answer[f"{nu:g} {way} {law}"]["complete_up"] else np.nan
                    for nu in values
                ]  # fmt: skip
                color = plots.style(name)["color"] if way == "warp" else "0.35"
                one.plot(values, excess, style, marker=".", color=color, label=f"{way}, {law}")
        one.axvline(SAID["table_7_4"][name]["nu12"], color="k", lw=0.8, ls="--", label="Table 7.4")
        plots.label(one, name, "nu12 = nu21 (-)", "above the fit at full displacement (%)")
        bound = SAID["table_7_4"][name]["nu12"]
        stopped = [key for key, test in answer.items() if not test["complete_up"]]
        at = {way: answer[f"{bound:g} {way} continuous"]["above_fit_percent"] for way in ("warp", "weft")}
        high = {way: answer[f"{values[-1]:g} {way} continuous"]["above_fit_percent"] for way in ("warp", "weft")}
        misses = [page.percent(value) for value in (*at.values(), *high.values())]
        ends = f"{len(stopped)} of {len(answer)} tests stop on the way up"
        rows.append((name, f"{bound:g}, {bound:g}", *misses[:2], f"{values[-1]:g}", *misses[2:], ends))
        words.append(
            f"for {name} it is {page.percent(at['warp'])} and {page.percent(at['weft'])} (warp, weft) at the bound and "
            f"{page.percent(high['warp'])} and {page.percent(high['weft'])} at {values[-1]:g}"
        )
    plots.legend(figure, 5)
    return (
        page.settings(
            "27 bilinear elements, ends clamped, nu12 = nu21 of the values shown, continuous and printed law."
        )
        + page.drawn(figure, "What equal ratios cost. The thesis's parametric study has no figure.")
        + page.table(
            "Table 7.4, row by row, with the miss of the fit at the printed bound and at the largest value tried",
            (
                "fabric",
                "bound, printed",
                "warp there",
                "weft there",
                "largest tried",
                "warp there",
                "weft there",
                "ends",
            ),
            rows,
        )
        + page.p(
            f"There is no sharp bound here: the over-estimate grows with the ratios, and {'; '.join(words)}.",
            "The bound of 0.40 is then a choice of how much to accept, and, for the thesis's own solution, of where "
            "it converged.".replace("0.40", f"{SAID['table_7_4']['duck']['nu12']:.2f}"),
        )
    )


@block(OPEN, "Does shear hysteresis run in dynamics?")
def hysteresis(r):
    found = r.fabrics(DRAPE)
    end = max(answer["history"]["time_s"][-1] for answer in found.values())
    done = [name for name, answer in found.items() if not answer["stopped"] and answer["history"]["time_s"][-1] >= end]
    off = r.get("drape continuous blend no shear hysteresis")
    rows = [
        (name, "yes" if name in done else f"no, it stops at {answer['stopped_at_s']:.3f} s",
         f"{answer['imbalance_percent']:.2f} %", f"{answer['iterations_a_step']:.1f}",
         f"{sum(answer['history']['step_cuts']):.0f}", f"{answer['history']['centre_z_m'][-1]:.3f}")
        for name, answer in found.items()
    ]  # fmt: skip
    pokes = {name: r.get(f"poke continuous {name}") for name in NAMES}
    pokes = {name: answer for name, answer in pokes.items() if answer}
    through = [name for name, answer in pokes.items() if not answer["stopped"]]
    halted = [f"{name} at {answer['stopped_at_s']:.2f} s" for name, answer in pokes.items() if answer["stopped"]]
    answer = "Yes" if len(done) == len(found) else f"For {len(done)} of {len(found)} fabrics"
    worst_ = max(found[name]["imbalance_percent"] for name in done) if done else float("nan")
    return page.table(
        "The drape with the whole law and measured ratios",
        ("fabric", f"runs to {end:g} s", "largest imbalance", "Newton a step", "cuts", "centre, m"),
        rows,
    ) + page.p(
        f"{answer}.",
        f"With shear hysteresis on and measured ratios the drape runs to {end:g} s for {page.joined(done)}, and at "
        f"most {worst_:.2f} % of the external work is not accounted for." if done else None,
        f"Without it blend's centre ends at {off['history']['centre_z_m'][-1]:.3f} m in place of "
        f"{found['blend']['history']['centre_z_m'][-1]:.3f} m, and the imbalance is {off['imbalance_percent']:.2f} %."
        if off and "blend" in found else None,
        f"The poke goes out and back for {page.joined(through) or 'none'}." if pokes else None,
        f"It stops for {page.joined(halted)}." if halted else None,
    )  # fmt: skip


@block(OPEN, "Do duck and muslin run with their measured ratios?")
def measured(r):
    words = []
    for name, cycles in r.fabrics("cycles", ("duck", "muslin")).items():
        tests = {key: test for key, test in cycles.items() if key.endswith("measured continuous")}
        complete = sum(not test["stopped"] for test in tests.values())
        refined, drape = r.get(f"refined {name}"), r.get(f"{DRAPE} {name}")
        both = [
            f"{page.percent(above(tests[f'{way} measured continuous'], name, way))}"
            + (f" ({page.percent(above(refined[f'{way} measured continuous'], name, way))} refined)" if refined else "")
            + f" along the {way}"
            for way in ("warp", "weft")
        ]
        low = [page.percent(worst(cycles[f"{way} lowered continuous"], name, way)) for way in ("warp", "weft")]
        words.append(
            f"{name}: {complete} of {len(tests)} cycles complete, {page.joined(both)}; with lowered ratios "
            f"{page.joined(low)}" + (f"; the drape {'runs' if not drape['stopped'] else 'stops'}" if drape else "")
        )
    return page.p(
        f"{'. '.join(word[0].upper() + word[1:] for word in words)}. The stress above the fit is the answer of the law "
        "to clamps, which refinement does not take away."
    )


@block(OPEN, "How much energy can the law make on closed loops?")
def energy(r):
    found = r.fabrics("loops")
    asked = r.settings(f"loops {next(iter(found))}")
    rows, most, least = [], (0.0, ""), []
    for name, answer in found.items():
        for kind, loop in answer.items():
            if not isinstance(loop, dict):
                continue
            ratios, coupling = kind.split()
            E = [f"{a:.3f} ... {b:.3f}" for a, b in (loop["E11"], loop["E22"])]
            shape = "rectangle" if loop["rectangle"] else "ellipse"
            rows.append((
                name, f"{coupling}, {ratios} ratios", f"{loop['created_kJ_per_m3']:.3g}",
                f"{loop['stored_kJ_per_m3']:.3g}", f"{loop['share']:.2f}",
                f"{answer['warp_test_kJ_per_m3']:.3g}", f"{shape}, E11 {E[0]}, E22 {E[1]}",
                f"{100 * loop['gap']:.1f} %, {loop['rounds']}",
            ))  # fmt: skip
            if kind == "measured measured":
                most = max(most, (loop["share"], name))
            if coupling == "reciprocal":
                least.append(f"{loop['share']:.2f} ({name})")
    scenes = {name: done for name in r.done if name.startswith(("drape", "poke cont")) and (done := r.get(name))}
    bills = [
        (name, f"{answer['law_gives_back_percent']:.3f} %", page.percent(answer["dissipated_least_percent"], 3),
         f"{answer['history']['dissipated_J'][-1]:.4g} J of {answer['external_work_most_J']:.4g} J")
        for name, answer in scenes.items()
    ]  # fmt: skip
    falls = {name: answer["law_gives_back_percent"] for name, answer in scenes.items()}
    fall, where = max(((fall, name) for name, fall in falls.items()), default=(None, ""))
    low = [f"{falls[f'{name} lowered ratios']:.2f} ({name})" for name in falls if f"{name} lowered ratios" in falls]
    return (
        page.settings(
            "a search over ellipses and rectangles in E11 and E22, from the contraction of the tests to their ends: "
            f"{asked['trials']} random ones, the best bred through {asked['generations']} generations, and gone round "
            "several times. Shear is a curve by itself, and only dissipates. Made: work given back in the last round, "
            "and what is stored more after it. Stored: what the law can give back at the peak of the loop, yarn by "
            "yarn."
        )
        + page.table(
            "The worst loop found; warp test: the work of first loading to its end; gap: by how much the stress has "
            "not come back after the last round",
            ("fabric", "coupling", "made, kJ/m3", "stored", "ratio", "warp test", "loop", "gap, rounds"),
            rows,
        )
        + page.table(
            "And in the scenes? What the law has dissipated in all: its largest fall and its least value, in percent "
            "of the largest external work, and where it ends",
            ("scene", "largest fall", "least", "dissipated"),
            bills,
        )
        + page.p(
            f"Round its worst loop {most[1]} makes {most[0]:.3g} times what it stores at the peak, and the loop closes "
            "in stress and state. The measured coupling has no potential; while one yarn is on its stiff way back and "
            "the other is not, its two off-diagonal moduli differ by far more than Poisson's ratios do.",
            f"With the reciprocal coupling the worst ratio found is {page.joined(least)}; there stress creeps from "
            "round to round, and a ratio below zero is a loss." if least else None,
            "In the scenes " + (
                "it does not show" if fall <= 1.0 else "it shows"
            ) + f": what the law has dissipated falls back by at most {fall:.3f} % of the external work ({where})."
            if fall is not None else None,
            f"With lowered ratios it falls by {page.joined(low)} %. Energy that the law makes is in the balance, "
            "which closes: a small imbalance does not tell of it, the table does." if low else None,
        )
    )  # fmt: skip


@block(OPEN, "How wrong is the modulus of the increment's end?")
def increments(r):
    points, strips = r.fabrics("steps"), {name: r.get(f"increments {name}") for name in NAMES}
    strips = {name: answer for name, answer in strips.items() if answer}
    figure, (one, two) = plots.panels(2, 1, width=3.8, height=3.2)
    rows, orders, exact = [], [], 0.0
    counts = points[next(iter(points))]["warp"]["steps"]
    for name, answer in points.items():
        for way in "warp", "weft":
            error = answer[way]["error_percent"]
            one.loglog(
                counts, error, plots.YARNS[way], marker=".", color=plots.style(name)["color"], label=f"{name}, {way}"
            )
            rows.append((f"{name}, {way}, a point", *[page.percent(e, 2) for e in error]))
            orders.append(np.log2(error[0] / error[1]))
            exact = max(exact, *np.abs(answer[way]["continuous_error_percent"]))
    cut = []
    for name, answer in strips.items():
        for key, test in answer.items():
            error = [np.nan if e is None else e for e in test["error_percent"]]
            if key.endswith("clamped"):
                way = key.split()[0]
                two.loglog(test["steps"], np.abs(error), plots.YARNS[way], marker=".", color=plots.style(name)["color"],
                           label=f"{name}, {way}")  # fmt: skip
                rows.append((f"{name}, {key}", *[page.percent(e, 2) for e in error]))
            cut += [f"{name} {key}"] * bool(np.isnan(error).all())
    for axes, title in (one, "material point, uniaxial stress"), (two, "27 elements between clamps"):
        plots.label(axes, title, "increments up to the full load (-)", "error of the peak stress (%)")
        axes.set_xticks(counts, [str(n) for n in counts])
        axes.minorticks_off()
    plots.legend(figure, 4)
    first = [answer[way]["error_percent"][0] for answer in points.values() for way in ("warp", "weft")]
    last = [answer[way]["error_percent"][-1] for answer in points.values() for way in ("warp", "weft")]
    return (
        page.settings("the law as printed, against the continuous law (at a point: against the fitted curve).")
        + page.drawn(figure, "Error of the printed law against the number of increments.")
        + page.table("Error of the peak stress; none: the law stops", ("test", *[f"{n} steps" for n in counts]), rows)
        + page.p(
            f"At a point the stress is too high by {min(first):.1f} to {max(first):.1f} % with {counts[0]} increments "
            f"and by {min(last):.2f} to {max(last):.2f} % with {counts[-1]}; the order is {min(orders):.2f} to "
            f"{max(orders):.2f}. The continuous law is off by {exact:.0e} % with any number.",
            f"On the strip no count of increments gets the printed law through {page.joined(cut)}." if cut else None,
        )
    )
