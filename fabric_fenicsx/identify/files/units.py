"""Units that stand in the columns of test records: from a header such as "Load (lbf)" to a factor to SI."""

import re

FORCE = {"N": 1.0, "kN": 1e3, "daN": 10.0, "mN": 1e-3, "cN": 1e-2, "gf": 9.80665e-3, "kgf": 9.80665, "kp": 9.80665}
FORCE |= {"lbf": 4.4482216152605, "ozf": 0.27801385095378}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "in": 0.0254, "inch": 0.0254}
TIME = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
STRESS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": 6894.757293168, "ksi": 6894757.293168}
STRESS |= {"N/m2": 1.0, "N/m^2": 1.0, "N/m²": 1.0, "N/mm2": 1e6, "N/mm^2": 1e6, "N/mm²": 1e6}
WIDTHS = LENGTH | {"5cm": 0.05, "50mm": 0.05, "2.5cm": 0.025, "25mm": 0.025, "2in": 0.0508}
PER_WIDTH = {f"{f}/{b}": force / width for f, force in FORCE.items() for b, width in WIDTHS.items()}
RATIO = {"1": 1.0, "-": 1.0, "%": 1e-2, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0}
ANGLE = {"deg": 0.017453292519943295, "°": 0.017453292519943295, "rad": 1.0}
PICTURE = {"px": 1.0, "pixel": 1.0}
CURVATURE = {"1/m": 1.0, "1/cm": 1e2, "1/mm": 1e3} | {
    f"{b}{p}": 1 / LENGTH[b] for b in ("m", "cm", "mm") for p in ("-1", "^-1")
}
RIGIDITY = {f"{f}{b}": FORCE[f] * LENGTH[b] for f in ("N", "mN", "cN", "gf") for b in ("m", "cm", "mm")}
RIGIDITY |= {"uNm": 1e-6, "µNm": 1e-6, "μNm": 1e-6, "uNm2/m": 1e-6, "µNm2/m": 1e-6, "Nm2/m": 1.0}
RIGIDITY |= {f"{f}cm2/cm": 1e-2 * FORCE[f] for f in ("N", "cN", "mN", "gf")}
MOMENT = {f"{f}{b}/{b}": FORCE[f] for f in ("N", "mN", "cN", "gf") for b in ("m", "cm", "mm")}

KINDS = {
    "force": FORCE,
    "force per width": PER_WIDTH,
    "stress": STRESS,
    "length": LENGTH,
    "ratio": RATIO,
    "time": TIME,
    "angle": ANGLE,
    "pixels": PICTURE,
    "curvature": CURVATURE,
    "bending rigidity": RIGIDITY,
    "moment per width": MOMENT,
}
"""Kind of a unit -> its units and their factors to SI (N, N/m, Pa, m, 1, s, rad, 1/m, N m, N)."""
SHOWN = {"force per width": ("N/m", "N/cm", "N/5cm", "daN/5cm", "kN/m", "gf/cm", "lbf/in")}
"""Kind -> units that stand for all of them in a sentence."""


ALIASES = {
    "n": "N",
    "kn": "kN",
    "lb": "lbf",
    "lbs": "lbf",
    "newton": "N",
    "newtons": "N",
    "mpa": "MPa",
    "kpa": "kPa",
    "pa": "Pa",
    "inches": "in",
}
ALIASES |= {"seconds": "s", "degrees": "deg", "degree": "deg", "radians": "rad", "percent": "%", "pixels": "px"}
CAPITALS = ("mm", "cm", "in", "lbf", "gf", "kgf", "psi", "ksi", "deg", "sec", "min", "s")
ALIASES |= {name: name for name in CAPITALS}


def factor(unit: str) -> tuple[str, float] | None:
    """Kind of a unit and its factor to SI, or None if it is not known.

    Capitals are taken for small letters only where that cannot change the meaning: MM is mm, but MN is no mN.
    """
    unit = re.sub(r"\s|[.·・⋅*](?!\d)", "", unit).replace("²", "2").replace("⁻¹", "-1").replace("^2", "2")
    above, mark, below = unit.partition("/")
    plain = f"{ALIASES.get(above.lower(), above)}{mark}{ALIASES.get(below.lower(), below)}"
    for name in (unit, plain):
        for kind, known in KINDS.items():
            if name in known:
                return kind, known[name]
    return None


def of_kind(unit: str, kind: str) -> float | None:
    """Factor to SI of a unit of one kind, or None: mN is a force, and a moment per width."""
    known = KINDS[kind]
    found = factor(unit)
    return known.get(unit) or (found[1] if found and found[0] == kind else None)


def split(header: str) -> tuple[str, str | None]:
    """Name, in lower case, and unit of a column: "Load (N)", "Load [N]", "Load / N", "Load, N" or "load_N";
    unit None if it has none."""
    text = header.strip().strip('"').strip()
    for pattern in (r"^(.*?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$", r"^(.*\S)\s+/\s+(\S+)$", r"^(.*\S)\s*,\s*(\S+)$"):
        match = re.match(pattern, text)
        if match:
            return _plain(match[1]), match[2]
    for at in (i for i, letter in enumerate(text) if letter in "_ "):
        unit = in_name(text[at:].replace(" ", "_"))
        if unit:
            return _plain(text[:at]), unit
    return _plain(text), None


def in_name(end: str) -> str:
    """The unit that ends a name: gf cm/cm of "_gf_cm_per_cm", 1/m of "_per_m"; '' if it is none."""
    unit = end.replace("_per_", "/").strip("_").replace("_", "")
    unit = f"1{unit}" if unit.startswith("/") else unit
    return unit if factor(unit) else ""


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name).strip().lower()
