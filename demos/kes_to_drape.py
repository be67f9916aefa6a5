"""From a KES sheet to a drape coefficient: two commands.

A laboratory hands over the sixteen numbers of a KES-F sheet; a designer asks how the cloth will drape. The first
command makes a fabric of the sheet, the second hangs a disc of it over a smaller disc, as Cusick's test does.

The checked numbers: B and 2HB of the sheet come back when a strip of the fabric goes through KES's bending cycle, and
Cusick's scene balances its energies to 1 % and has come to rest.
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
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics
from fabric_fenicsx.app import command
from fabric_fenicsx.identify import loops
from fabric_fenicsx.identify.bending import KES_2HB, KES_B

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
command.check(bool(good), f"drape coefficient {DC:.1f} %, and B and 2HB come back", args.out)
