"""From a KES sheet to a drape coefficient: two commands.

A laboratory hands over the sixteen numbers of a KES-F sheet; a designer asks how the cloth will drape. The first
command makes a fabric of the sheet, the second hangs a disc of it over a smaller disc, as Cusick's test does.

The sheet may also be given as the curves that the instrument draws.

The checked numbers: curves of the sheet make the fabric of its numbers to 1 %, B and 2HB of the sheet come back when a
strip of the fabric goes through KES's bending cycle, and Cusick's scene balances its energies to 1 % and has come to
rest.
"""

# %% [markdown]
# ## The sheet
# In `demos/records/kes_sheet.toml`, in the units of the sheet; `fabric-fenicsx identify --keys` tells every key, and
# that a sheet of FAST may stand in its place. What KES measures, and what it does not:
#
# | KES-F | numbers | become |
# | --- | --- | --- |
# | tension to 500 gf/cm | EM, LT or WT, RT | curves of warp and weft, and the slope of unloading |
# | shear to 8 degrees | G, 2HG, 2HG5 | the shear curve, and its slope of unloading |
# | bending to 2.5 1/cm | B, 2HB | rigidity and friction of warp and weft |
# | not measured | contraction across | `[assumed]`, and said so in every output |
# | not measured | bending in bias | the twist is assumed from warp and weft |
#
# In bending, the moment of a yarn direction is elastic but for friction of a total of half the width of the loop,
#
# $$ M(K) = B\,K \pm \tfrac12\,\text{2HB}. $$
#
# **Do not add them.** A bending length of a cantilever (ASTM D1388, FAST-2) is of a first loading, and holds friction
# already; B of KES is the slope between 0.5 and 1.5 1/cm, where friction has been overcome, and holds none. So a fabric
# takes B with 2HB, or bending lengths without it, never a bending length and 2HB on top. What a bending length holds
# of friction cannot be told from one length; KES tells neither how B softens as the curvature grows, nor creep, nor
# bending while the cloth is stretched. A bias strip that hangs freely twists, and reads the compliances, one between
# long grips the stiffnesses: the list of tests says which, in `bias_strip`.

# %%

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics, plots
from fabric_fenicsx.app import command
from fabric_fenicsx.identify.bending import loops
from fabric_fenicsx.identify.bending.found import KES_2HB, KES_B

DEMOS = Path(__file__).resolve().parent
args = command.script(__doc__.split("\n")[0], "out/kes_to_drape", cell=10.0, end=1.0)


def run(*words):
    """Do a command as it is typed; what it prints."""
    command.say("$", *(str(word).replace(f"{DEMOS.parent}/", "") for word in words))
    program = [Path(sys.executable).with_name(words[0])] if words[0] == "fabric-fenicsx" else [sys.executable]
    answer = subprocess.run([*program, *map(str, words[1:])], stdout=subprocess.PIPE, text=True, check=True)
    command.say(answer.stdout)
    return answer.stdout


# %% [markdown]
# ## The first command
# It writes the fabric, and a report of every curve over its data.

# %%
run("fabric-fenicsx", "identify", DEMOS / "records" / "kes_sheet.toml", "--out", args.out)

# %% [markdown]
# ## The same sheet as curves
# A laboratory may hand over what the instrument drew in place of what it printed: tension to 500 gf/cm and back, shear
# to 8 degrees on both sides, bending to 2.5 1/cm on both sides, a file for each specimen. `tension`, `shear` and
# `bending` of a direction then name files, and the numbers that these tell are left out. Which column is which is told
# by its unit, whatever the language. No real curves stand here: these are drawn from the numbers above, with the
# resolution and 0.5 % of noise.

# %%
sides = tomllib.loads((DEMOS / "records" / "kes_sheet.toml").read_text())["kes"]
rng, folder = np.random.default_rng(1), args.out / "curves"
folder.mkdir(exist_ok=True)
shown = plots.panels(3, width=3.2, height=3.0)


def there_and_back(way, one):
    """Tension: a line and a power up, which give LT, and a line down that gives RT."""
    x, power = np.linspace(0, 1, 250), 2 if one["LT"] > 0.7 else 3
    line = (one["LT"] / 2 - 1 / (power + 1)) / (1 / 2 - 1 / (power + 1))
    slack = one["EM"] * (1 - one["LT"] * one["RT"] / 100)
    down = 500 * np.clip((one["EM"] * x[::-1] - slack) / (one["EM"] - slack), 0, None)
    return one["EM"] * np.append(x, x[-2::-1]), np.append(500 * (line * x + (1 - line) * x**power), down[1:])


def sheared(way, one):
    """A line with a width that grows from 0.5 to 5 degrees."""
    a = np.linspace(0, 8, 161)
    up = one["G"] * a + one["2HG"] / 2
    half = (
        np.append(a, a[-2::-1]),
        np.append(up, (up - one["2HG"] - (one["2HG5"] - one["2HG"]) * (a - 0.5) / 4.5)[-2::-1]),
    )
    return tuple(np.append(value, -value[1:]) for value in half)


def bent(way, one):
    """The law's own loop."""
    K = np.concatenate([np.linspace(0, 250, 101), np.linspace(250, -250, 201)[1:], np.linspace(-250, 0, 101)[1:]])
    curve = fabrics.BendingCurve(KES_B * one["B"], 0.0, KES_2HB * one["2HB"])
    return K / 100, loops.moments(K, curve, curve, fabrics.bending.FRICTION_PER_M, True) / KES_2HB


DRAWN = {
    "tension": (there_and_back, "Dehnung (%);Kraft (gf/cm)", "strain (%)", "force (gf/cm)"),
    "shear": (sheared, "せん断角 (deg);荷重 (gf/cm)", "shear angle (deg)", "force (gf/cm)"),
    "bending": (bent, "curvature (1/cm);moment (gf cm/cm)", "curvature (1/cm)", "moment (gf cm/cm)"),
}
for way, one in sides.items():
    for axes, (test, (draw, head, *axis)) in zip(shown[1], DRAWN.items(), strict=True):
        x, y = draw(way, one)
        y = y + 0.005 * np.abs(y).max() * rng.standard_normal(len(y)) * (test != "tension")
        np.savetxt(folder / f"{way}_{test}.csv", np.column_stack([x, y]), "%.5g", ";", header=head, comments="",
                   encoding="utf-8")  # fmt: skip
        axes.plot(x, y, lw=0.8, label=way)
        plots.label(axes, test, *axis)
plots.legend(shown[0], 2)
plots.save(shown[0], args.out / "curves.png")

kinds = ", ".join(f'{test} = ["{{way}}_{test}.csv"]' for test in DRAWN)
text = (DEMOS / "records" / "kes_sheet.toml").read_text()
for way in sides:
    text = re.sub(rf"(?m)^{way} = .*$", f"{way} = {{{{ {kinds} }}}}".format(way=way), text)
(folder / "kes_curves.toml").write_text(text)
command.say(text[text.index("[kes]") : text.index("[assumed]")])
run("fabric-fenicsx", "identify", folder / "kes_curves.toml", "--out", folder)

# %% [markdown]
# ![the curves of the sheet](curves.png)
#
# The fabric is that of the numbers, but for the noise:

# %%
of_numbers, of_curves = (fabrics.load(str(path / "fabric.toml")) for path in (args.out, folder))
apart = {
    name: float(getattr(of_curves, name).stress(E).max() / getattr(of_numbers, name).stress(E).max() - 1)
    for name in ("warp", "weft", "shear")
    for E in [np.linspace(0, getattr(of_numbers, name).limit, 51)]
}
apart |= {f"B of {way}": getattr(of_curves.bending, way).B / getattr(of_numbers.bending, way).B - 1 for way in sides}
for name, part in apart.items():
    command.say(f"{name}: {100 * part:+.2f} % from that of the numbers")
same = max(map(abs, apart.values())) < 0.01

# %% [markdown]
# ## The second command
# A disc of 300 mm between discs of 180 mm is lowered in 0.6 s. Cells of 10 mm resolve the folds of this cloth; which
# folds it gets is not unique, here as in the laboratory, so take several seeds for a mean: `--seeds 5`.

# %%
said = run(
    "python", DEMOS / "cusick.py", "--fabric", args.out / "fabric.toml", "--out", args.out / "cusick",
    "--cell", args.cell, "--end", args.end,
)  # fmt: skip
DC = float(re.search(r"drape coefficient ([\d.]+) %", said)[1])

# %% [markdown]
# ![its outline from above](cusick/outline.png)
#
# ![the draped disc](cusick/seed0/deformed.png)
#
# ## Is it the cloth of the sheet?
# A strip of the fabric is bent as KES does, to 2.5 1/cm and back: B is the slope of the loop's mean, 2HB its width.

# %%
fabric, sheet = fabrics.load(str(args.out / "fabric.toml")), {"warp": (0.10, 0.05), "weft": (0.08, 0.04)}
reach, good = np.linspace(-250, 250, 201), True
K = np.concatenate([reach[100:], reach[-2::-1], reach[1:]])
for way, (B, width) in sheet.items():
    curve = getattr(fabric.bending, way)
    read = loops.read_loop(K, loops.moments(K, curve, curve, fabric.bending.friction_per_m, True))
    again = read[0] / KES_B, read[1] / KES_2HB
    command.say(f"{way}: B {again[0]:.4f} gf cm2/cm, 2HB {again[1]:.4f} gf cm/cm; the sheet has {B:g} and {width:g}")
    good &= abs(again[0] / B - 1) < 0.005 and abs(again[1] / width - 1) < 0.005

# %%
command.check(
    bool(good and same), f"drape coefficient {DC:.1f} %, and B, 2HB and the fabric of the curves come back", args.out
)
