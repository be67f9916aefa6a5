"""Forces per width beside stress: numbers, second axes, tables, files."""

import numpy as np
import pytest
from click.testing import CliRunner

from fabric_fenicsx import fabrics
from fabric_fenicsx.app.cli import app
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabrics import per_width
from fabric_fenicsx.identify import fabric_file, identification, listing
from fabric_fenicsx.identify.report import page as report
from fabric_fenicsx.identify.synthetic import synthetic

BLEND = fabrics.load("blend")


@pytest.mark.parametrize(("unit", "width"), [("N/m", 1.0), ("N/cm", 0.01), ("N/5cm", 0.05)])
def test_a_force_per_width_is_stress_times_thickness_times_width(unit, width):
    assert per_width.factor(unit, 0.4e-3) == pytest.approx(0.4e-3 * width)
    line = per_width.describe(BLEND, unit)[0]
    force = float(BLEND.warp.stress(BLEND.warp.limit)) * BLEND.thickness * width
    assert f"stress {force:.4g} {unit} at the end" in line
    with pytest.raises(InputError, match="'N/mm' is no force per width; give one of N/m, N/cm, N/5cm"):
        per_width.factor("N/mm", 1e-3)


def right_axes(figure):
    return [child for axes in figure.axes for child in axes.child_axes]


def test_plots_have_a_second_axis_or_another_unit(tmp_path):
    figure = BLEND.plot(tmp_path / "one.png", per_width="N/cm")
    assert len(right_axes(figure)) == 3 and not right_axes(BLEND.plot())
    for axes, right in zip(figure.axes, right_axes(figure), strict=False):
        assert np.allclose(right.get_ylim(), np.array(axes.get_ylim()) * 1e6 * BLEND.thickness * 0.01)
        assert right.get_ylabel() == "per width (N/cm)"
    fabrics.compare([BLEND, fabrics.load("duck")], tmp_path / "two.svg", per_width="N/m")
    assert (tmp_path / "two.svg").stat().st_size > 1000


def test_files_and_the_report_say_both(tmp_path):
    found = identification.identify(listing.read(synthetic.write(BLEND, tmp_path, 1, noise=0.0)))
    path, fabric = fabric_file.write(found, tmp_path, per_width="N/5cm")
    last = path.read_text(encoding="utf-8").splitlines()[-3:]
    assert last == [f"# {line}" for line in per_width.describe(fabric, "N/5cm")]
    assert fabrics.load(path) == fabric and "MPa" in path.read_text(encoding="utf-8")
    figure = report.draw(found, per_width="N/m")
    table = next(text.get_text() for axes in figure.axes for text in axes.texts if "dots:" in text.get_text())
    assert len(right_axes(figure)) == 3 and table.count("per width, N/m: coefficients") == 3


def test_the_command_says_both():
    shown = CliRunner().invoke(app, ["fabrics", "show", "duck", "--per-width", "N/cm"])
    assert shown.exit_code == 0 and "warp per width: modulus at rest 55.8 N/cm" in shown.output
    assert CliRunner().invoke(app, ["fabrics", "show", "duck", "--per-width"]).output.count(" N/m") == 9
    assert "per width" not in CliRunner().invoke(app, ["fabrics", "show", "duck"]).output
