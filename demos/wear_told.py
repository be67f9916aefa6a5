"""What bending a limb took, from the tables of `bending_limb.py`: lines, a table, a plot, and whether all is well."""

import numpy as np

from fabric_fenicsx import plots
from fabric_fenicsx.app import command
from fabric_fenicsx.garments import measures

SAME = 0.05
"""By what part a moment may differ on half the cells."""


def moments(table, about):
    """At an angle on the way up, and its mean within degrees about it: N m; NaN where it was not bent so far."""
    at, within = about
    up = slice(int(table.column("angle_deg").argmax()) + 1)
    angle, moment, work = (table.column(column)[up] for column in ("angle_deg", "moment_Nm", "work_J"))
    ends = np.interp([at - within, at + within], angle, work, right=np.nan)
    return float(np.interp(at, angle, moment, right=np.nan)), float(np.diff(ends)[0] / np.radians(2 * within))


def same(coarse, fine, about):
    """Whether two tables tell the same moments; says so."""
    change = [a / b - 1 for a, b in zip(moments(coarse, about), moments(fine, about), strict=True)]
    command.say(f"on cells twice as large the moment at {about[0]:g} degrees is {100 * change[0]:+.1f} % off, "
                f"and its mean within {about[1]:g} degrees of them {100 * change[1]:+.1f} %")  # fmt: skip
    return max(map(abs, change)) <= SAME


def _off(table):
    """How far the work of the moment is off that of all forces at most, over the largest of that."""
    work = table.column("work_J")
    paid = measures.work(table.column("angle_deg"), table.column("moment_Nm")) + table.column("onset_J")
    return np.abs(paid - work).max() / np.abs(work).max()


def good(table):
    """Whether nothing passes, moments do the work of all forces, and none is made, nor lost by what is elastic."""
    released, most = table.column("released_J"), np.abs(table.column("work_J")).max()
    good = not table.column("crossed").any() and released.min() >= -0.01 * most
    if not (table.column("dissipated_J").any() or table.column("friction_J").any()):
        good &= np.abs(released - table.column("snapped_J")).max() <= 0.01 * most
    return bool(good and _off(table) <= 0.01)


def say(name, table, joint):
    """What is told of one fabric and fit, in a line."""
    angle, last = table.column("angle_deg"), table.rows[-1]
    count, cuts, seconds = (table.column(column).sum() for column in ("newton_iterations", "step_cuts", "cpu_s"))
    way = f"{joint} to {angle.max():.0f} degrees" + " and back" * int(angle[-1] < angle.max())
    command.say(
        f"{name}: {way} in {len(angle) - 1} steps, {count:g} iterations, {cuts:g} cuts, {seconds:.0f} s of processor; "
        "moment over the angle off the work of all forces by "
        f"{100 * _off(table):.2f} %; slip {1e3 * last['slip_mean_m']:.1f} mm on average, the skin stretches by "
        f"{100 * table.column('strain_skin').max():.0f} %"
    )


COLUMNS = {
    "at {:g}": "mN m", "about {:g}": "mN m", "at most": "mN m", "where": "degrees", "work up": "mJ", "in all": "mJ",
    "law": "mJ", "friction": "mJ", "snaps": "mJ", "rest": "mJ", "pressure": "kPa", "strain": "%",
}  # fmt: skip


def rows(tables, about):
    """A row for each fabric and fit: moments, work up to the largest angle, and where that of all steps went."""
    command.say(" " * 26 + "".join(f"{column.format(about[0]):>10}" for column in COLUMNS))
    command.say(" " * 26 + "".join(f"{unit:>10}" for unit in COLUMNS.values()))
    for name, table in tables.items():
        angle, moment, work = (table.column(column) for column in ("angle_deg", "moment_Nm", "work_J"))
        k, last = int(angle.argmax()), table.rows[-1]
        told = [1e3 * each for each in moments(table, about)]
        lost = [1e3 * last[f"{key}_J"] for key in ("dissipated", "friction", "snapped")]
        lost.append(1e3 * (last["released_J"] - last["snapped_J"]))
        peak, strain = (table.column(column).max() for column in ("pressure_peak_Pa", "strain_cloth"))
        row = [*told, 1e3 * moment.max(), angle[moment.argmax()], 1e3 * work[k], 1e3 * work[-1], *lost]
        command.say(f"{name:26}" + "".join(f"{x:10.4g}" for x in [*row, 1e-3 * peak, 100 * strain]))


def plot(path, tables, joint):
    """Moment and peak pressure over the angle."""
    figure, (left, right) = plots.panels(2, width=5.0, height=3.8)
    for name, table in tables.items():
        angle = table.column("angle_deg")
        left.plot(angle, 1e3 * table.column("moment_Nm"), lw=1.2, label=name)
        right.plot(angle, 1e-3 * table.column("pressure_peak_Pa"), lw=1.2)
    plots.label(left, "", f"{joint} (degrees)", "moment against the bend (mN m)")
    plots.label(right, "", f"{joint} (degrees)", "peak pressure (kPa)")
    plots.legend(figure)
    plots.save(figure, path)
