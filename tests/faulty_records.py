"""Records as laboratories have them, made from good ones: each must give the fabric (1 %) or a refusal, never another.

`trial(seed)` makes one; `python tests/faulty_records.py --count 500` counts what becomes of many and names the wrong.
"""

import argparse
import tempfile
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fabric_fenicsx import fabrics
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.identify import identification, listing
from fabric_fenicsx.identify.synthetic import synthetic

HEAD = {"time": ("Time", "s"), "displacement": ("Extension", "mm"), "force": ("Load", "N")}
GROUPS = ("", "", "", ",", ".", " ", "\u00a0", "\u202f", "'")
RIGHT = 0.01


@dataclass
class Written:
    """What is put into a file: columns (n,) of numbers, of words, and how they are written."""

    columns: dict
    heads: dict
    rng: np.random.Generator
    words: dict = field(default_factory=dict)  # name -> list of n cells, written before or after the numbers
    before: list = field(default_factory=list)
    after: list = field(default_factory=list)
    between: dict = field(default_factory=dict)  # row -> lines before it
    cells: dict = field(default_factory=dict)  # (row, name) -> what is written in place of the number
    decimals: dict = field(default_factory=dict)
    mark: str = ";"
    decimal: str = "."
    group: str = ""
    encoding: str = "utf-8"
    style: str = "{} ({})"
    said: list = field(default_factory=list)

    @property
    def n(self):
        return len(next(iter(self.columns.values())))

    def rows(self, keep):
        """The same with some rows only, in that order."""
        place = {int(old): new for new, old in enumerate(keep)}
        self.columns = {k: v[keep] for k, v in self.columns.items()}
        self.words = {k: [v[i] for i in keep] for k, v in self.words.items()}
        self.cells = {(place[i], k): v for (i, k), v in self.cells.items() if i in place}
        self.between = {place[i]: v for i, v in self.between.items() if i in place}

    def number(self, name, value):
        text = f"{value:.{self.decimals.get(name, 4)}f}"
        whole, _, part = text.partition(".")
        sign, whole = ("-", whole[1:]) if whole[0] == "-" else ("", whole)
        if self.group:
            whole = f"{int(whole):,}".replace(",", self.group)
        return sign + whole + (self.decimal + part if part else "")

    def row(self, i):
        return [
            *(cells[i] for cells in self.words.values()),
            *(self.cells.get((i, k), self.number(k, v[i])) for k, v in self.columns.items()),
        ]

    def line(self, cells):
        if self.mark == " ":
            return "".join(f"{cell:>22s}" for cell in cells)
        return self.mark.join(f'"{cell}"' if self.mark in cell else cell for cell in cells)

    def text(self):
        head = self.line([*self.words, *(self.style.format(*self.heads[k]) for k in self.columns)])
        lines = [*self.before, head]
        for i in range(self.n):
            lines += [head if one is None else one for one in self.between.get(i, [])]
            lines.append(self.line(self.row(i)))
        return "\n".join([*lines, *self.after, ""])


# --- what laboratories do to a record of force


def numbers(w):
    """Any country's marks; forces in mN and displacements in um have thousands."""
    w.decimal = str(w.rng.choice([".", ","]))
    w.group = str(w.rng.choice(GROUPS))
    if w.group == w.decimal:
        w.group = {",": ".", ".": ","}[w.decimal]
    if w.mark == " " and w.group in (" ", "\u00a0", "\u202f"):
        w.group = ""
    for name, unit, factor in ("force", "mN", 1e3), ("displacement", "um", 1e3):
        if w.rng.random() < 0.6 and w.heads[name][1] in ("N", "mm"):
            w.heads[name] = (w.heads[name][0], unit)
            w.columns[name] = w.columns[name] * factor
            w.decimals[name] = int(w.rng.choice([0, 1, 2, 3]))
    if w.mark == "," and (w.decimal == "," or w.group == ",") and w.rng.random() < 0.5:
        w.mark = ";"


def words(w):
    """Columns of text that nobody needs, before the numbers."""
    top = int(w.columns["displacement"].argmax())
    for name, cells in {
        "Event": ["loading" if i <= top else "unloading" for i in range(w.n)],
        "Specimen": ["W1"] * w.n,
        "Date": ["2024-05-06"] * w.n,
        "Datum": ["06.05.2024"] * w.n,
        "image": [f"IMG_{i:03d}.jpg" for i in range(w.n)],
        "Remark": [""] * (w.n - 1) + ["ok"],
        "Counter": [str(i) for i in range(w.n)],
    }.items():
        if w.rng.random() < 0.3:
            w.words[name] = cells
    if w.mark == " ":
        w.words.pop("Remark", None)


def clocks(w):
    """Times of day, without meaning, restarting, missing, partly unreadable; or lines shuffled."""
    kind = w.rng.choice(["day", "senseless", "restart", "none", "some", "shuffled", "wild"])
    time = w.columns["time"]
    if kind == "day":
        for i, t in enumerate(time):
            w.cells[i, "time"] = f"{int(t // 3600):02d}:{int(t // 60) % 60:02d}:{t % 60:05.2f}"
    elif kind == "senseless":
        w.cells |= {(i, "time"): f"T+{i}" for i in range(w.n)}
    elif kind == "restart":
        top = int(w.rng.choice([w.columns["displacement"].argmax() + 1, w.n // 3]))
        w.columns["time"] = np.concatenate([time[:top], time[top:] - time[min(top, w.n - 1)]])
    elif kind == "none":
        del w.columns["time"]
        w.cells = {key: v for key, v in w.cells.items() if key[1] != "time"}
    elif kind == "some":
        w.cells |= {(int(i), "time"): "?" for i in w.rng.choice(w.n - 2, 2) + 1}
    elif kind == "shuffled" and not w.between:
        w.rows(w.rng.permutation(w.n))
    elif kind == "wild":
        w.columns["time"] = np.where(np.arange(w.n) == w.rng.integers(w.n), 99999.0, time)
    w.said.append(str(kind))


def slack(w):
    """The crosshead moves before the strip is taut, over a load cell that may have an offset."""
    way, force = w.rng.uniform(0.02, 0.4) * w.columns["displacement"].max(), w.columns["force"]
    offset = float(w.rng.choice([0.0, 0.0, 0.01, -0.01])) * force.max()
    m = int(w.rng.integers(10, 60))
    d = np.linspace(0, way, m, endpoint=False)
    idle = offset + w.noise * force.max() * w.rng.standard_normal(m)
    step = np.diff(w.columns["time"]).mean()
    w.columns = {
        "time": np.concatenate([np.arange(m) * step, w.columns["time"] + m * step]),
        "displacement": np.concatenate([d, w.columns["displacement"] + way]),
        "force": np.concatenate([idle, force + offset]),
    }
    w.said.append(f"{way:.2f} mm, offset {offset:.2g} N")


def offset(w):
    """The load cell is off, by up to a third."""
    w.columns["force"] = (
        w.columns["force"] + w.rng.choice([-1, 1]) * w.rng.uniform(0.01, 0.33) * w.columns["force"].max()
    )


def preload(w):
    """The machine begins at a pre-load, and calls the displacement there zero, or not."""
    first = int(np.argmax(w.columns["force"] > w.rng.uniform(0.02, 0.08) * w.columns["force"].max()))
    w.rows(np.arange(first, w.n))
    if w.rng.random() < 0.5:
        w.columns["displacement"] = w.columns["displacement"] - w.columns["displacement"][0]
        w.said.append("zeroed")


def spikes(w):
    """Single wild readings."""
    for _ in range(int(w.rng.integers(1, 4))):
        i, name = int(w.rng.integers(w.n)), str(w.rng.choice(["force", "force", "displacement"]))
        old = w.columns[name][i]
        new = float(
            w.rng.choice([99999.0, 50 * old, 0.0, -old, -1.0, 1.5 * old, 9.9e30, old + 0.3 * w.columns[name].max()])
        )
        w.columns[name] = w.columns[name].copy()
        w.columns[name][i] = new
        w.said.append(f"{name}[{i}] = {new:.3g}")


def heads(w):
    """The head again, on every page or where the way turns."""
    every = int(w.rng.integers(15, 60))
    turn = [int(w.columns["displacement"].argmax()) + 1]
    for i in turn if w.rng.random() < 0.3 else range(every, w.n, every):
        w.between.setdefault(i, []).append(None)


def remarks(w):
    """Words before, between and after the readings."""
    w.before = [
        line for line in ("Machine 7", "", "Load cell: 5 kN", "Operator;Jones", "# raw") if w.rng.random() < 0.5
    ]
    closing = "End of test", "", "Max. load;185.1;N", "Mean;8.0;66.2", "Mean,3.1,44", "SD  1.2  3.3", "*** stopped ***"
    w.after = [line for line in closing if w.rng.random() < 0.4]
    if w.rng.random() < 0.3:
        w.between.setdefault(int(w.rng.integers(1, w.n)), []).append("-- way back --")


def spaces(w):
    """Columns of spaces."""
    w.mark = " "
    w.words.pop("Remark", None)
    if w.group in (" ", "\u00a0", "\u202f"):
        w.group = ""


def encodings(w):
    """Bytes other than UTF-8, with words that show it."""
    w.encoding = str(w.rng.choice(["utf-8-sig", "utf-16", "utf-16-le", "cp932", "latin-1", "utf-32"]))
    if w.encoding == "cp932":
        w.heads |= {"force": ("荷重", w.heads["force"][1]), "displacement": ("変位", w.heads["displacement"][1])}
        w.before = ["試験日 2024/05/06", *w.before]
    elif w.encoding == "latin-1":
        w.before = ["Prüfgerät µ²", *w.before]


def first(w):
    """The first reading, or a part of it, is missing."""
    kind = int(w.rng.integers(3))
    if kind == 0:
        w.rows(np.arange(1, w.n))
    else:
        w.cells[0, "force" if kind == 1 else "displacement"] = (
            str(w.rng.choice(["", "NaN", "---"])) if w.mark != " " else "---"
        )
    w.said.append(str(kind))


def signs(w):
    """Compression positive, and a displacement that begins anywhere."""
    if w.rng.random() < 0.5:
        w.columns["force"] = -w.columns["force"]
    else:
        w.columns["displacement"] = w.rng.choice([-1, 1]) * (w.columns["displacement"] + w.rng.uniform(20, 90))


def specimens(w):
    """The same test again below it, by a head, a column, the clock, or nothing."""
    kind = str(w.rng.choice(["head", "column", "clock", "nothing"]))
    n = w.n
    other = np.setdiff1d(np.arange(n), w.rng.choice(np.arange(1, n), n // 10, replace=False))
    w.columns = {k: np.concatenate([v, v[other]]) for k, v in w.columns.items()}
    w.words = {k: v + [v[i] for i in other] for k, v in w.words.items()}
    w.cells |= {(n + j, k): w.cells[i, k] for j, i in enumerate(other) for k in HEAD if (i, k) in w.cells}
    if kind == "head":
        w.between.setdefault(n, []).insert(0, None)
    elif kind == "column":
        w.words = {"Specimen": ["A 1"] * n + ["A 2"] * len(other)} | {
            k: v for k, v in w.words.items() if k != "Specimen"
        }
    elif kind == "nothing" and "time" in w.columns and w.rng.random() < 0.5:
        del w.columns["time"]
        w.cells = {key: v for key, v in w.cells.items() if key[1] != "time"}
    w.said.append(kind)


SHAPE = (slack, offset, preload, first, signs, spikes)  # one of those that change the curve at most, in this order
FORM = (clocks, words, specimens, heads, remarks, encodings, numbers, spaces)


# --- dots


def dots(columns, rng):
    """Faults of a tracker in columns of coordinates; what was done."""
    names = sorted({k.rsplit("_", 2)[0] for k in columns if k.endswith("_x_mm")})
    kind = str(
        rng.choice(["swap", "lost", "wild", "rest", "photograph", "swap for good", "lost for good", "swap at rest"])
    )
    n = len(next(iter(columns.values())))
    a, b = (names[i] for i in rng.choice(len(names), 2, replace=False))
    i = int(rng.integers(1, n))
    rows = slice(i, None) if "good" in kind else slice(0, 5) if "at rest" in kind else slice(i, i + 1)
    for axis in "xy":
        p, q = columns[f"{a}_{axis}_mm"], columns[f"{b}_{axis}_mm"]
        if "swap" in kind:
            p[rows], q[rows] = q[rows].copy(), p[rows].copy()
        elif "lost" in kind:
            p[rows] = 0.0
        elif kind == "rest":
            for name in names:
                columns[f"{name}_{axis}_mm"][:5] = np.nan
        elif kind == "photograph":
            for name in names:
                columns[f"{name}_{axis}_mm"][i] *= 1.2
    if kind == "wild":
        columns[f"{a}_x_mm"][i] = float(rng.choice([-1000.0, 99999.0, 3.0 * columns[f"{a}_x_mm"][i] + 5]))
    return f"{kind} {a} {b} in row {i}"


# --- a trial


@dataclass(frozen=True)
class Good:
    """Records of a fabric without faults: columns by file, the list of tests, and the fabric found by them."""

    name: str
    folder: Path
    tests: listing.Tests


def good(folder, name="blend"):
    """Records of a known fabric, without noise."""
    path = synthetic.write(fabrics.load(name), Path(folder), specimens=1, noise=0.0)
    return Good(name, Path(folder), listing.read(path))


def columns_of(path):
    head = next(line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    values = np.genfromtxt(path, delimiter=",", skip_header=2)
    return dict(zip(head.split(","), values.T.copy(), strict=True))


def found(tests, kind, path):
    """What a file alone tells: (curve and unloading) or (ratio,); raises InputError where it is refused."""
    warp = {"warp": tests.records["warp"]} if kind == "weft_dots" else {}  # dots alone are no tests
    answer = identification.identify(replace(tests, records={**warp, kind: [path]}))
    if answer.doubts:
        raise InputError("doubts: " + "; ".join(answer.doubts))
    return answer


def miss(kind, before, after):
    """By which part of itself what a file tells has changed."""
    if kind.endswith("dots"):
        one, other = before.poisson["nu21"].value, after.poisson["nu21"].value
        return abs(other - one) / max(abs(one), 0.1)
    curve, other = before.curves["weft"], after.curves["weft"]
    E = np.linspace(0, min(curve.loading.limit, other.loading.limit), 101)
    wrong = np.abs(other.loading.stress(E) - curve.loading.stress(E)).max() / curve.loading.stress(E).max()
    there, here = before.unloading("weft"), after.unloading("weft")
    return max(float(wrong), abs(here / there - 1), abs(other.loading.limit / curve.loading.limit - 1))


def trial(made, seed, folder):
    """(verdict, what was done, the refusal or the miss): verdict is right, refused or WRONG."""
    rng = np.random.default_rng(seed)
    kind = "weft_dots" if rng.random() < 0.25 else "weft"
    columns = columns_of(made.tests.records[kind][0])
    path, plain = Path(folder) / f"faulty_{seed}.csv", Path(folder) / f"plain_{seed}.csv"
    if kind == "weft":
        n = len(columns["time_s"])
        step = max(1, n // int(rng.integers(80, 300)))
        top = int(columns["displacement_mm"].argmax())
        keep = np.unique(
            np.concatenate([[0], np.arange(top % step, n, step), np.arange(top, n, max(1, (n - top) // 20))])
        )
        w = Written({k.split("_")[0]: v[keep] for k, v in columns.items()}, dict(HEAD), rng)
        w.noise = float(rng.choice([0.0, 0.0, 0.002]))
        w.columns["displacement"] = w.columns["displacement"] - w.columns["displacement"][0]
        peak = w.columns["force"].max()
        w.columns["force"] = w.columns["force"] + w.noise * peak * rng.standard_normal(w.n)
        plain.write_text(w.text(), encoding="utf-8")
        w.mark = str(rng.choice([",", ";", "\t"]))
        w.style = str(rng.choice(["{} ({})", "{} [{}]"]))
        did = [SHAPE[i] for i in sorted(rng.choice(len(SHAPE), int(rng.integers(0, 2)), replace=False))]
        did += [FORM[i] for i in sorted(rng.choice(len(FORM), int(rng.integers(0 if did else 1, 4)), replace=False))]
        for change in did:
            change(w)
        path.write_bytes(w.text().encode(w.encoding, errors="replace"))
        told = ", ".join(change.__name__ for change in did) + f" {w.said} mark {w.mark!r} noise {w.noise}"
    else:
        shift, before = rng.uniform(-60, 60, 2), columns
        for k in columns:
            if k.endswith(("_x_mm", "_y_mm")):
                columns[k] = columns[k] + shift[0 if "_x_" in k else 1]
        few = set(
            rng.choice([k.rsplit("_", 2)[0] for k in columns if "_x_" in k], int(rng.integers(6, 16)), replace=False)
        )
        columns = {k: v for k, v in before.items() if k.rsplit("_", 2)[0] in few or k.startswith("displacement")}
        rows = [",".join(columns)] + [",".join(f"{v:.4f}" for v in row) for row in zip(*columns.values(), strict=True)]
        plain.write_text("\n".join(rows), encoding="utf-8")
        told = dots(columns, rng)
        cells = [["" if np.isnan(v) else f"{v:.4f}" for v in row] for row in zip(*columns.values(), strict=True)]
        path.write_text("\n".join([",".join(columns), *map(",".join, cells)]), encoding="utf-8")
    try:
        before = found(made.tests, kind, plain)
    except InputError as error:  # three dots in line
        return "right", told, f"nothing to compare with: {error}"
    try:
        after = found(made.tests, kind, path)
    except InputError as error:
        return "refused", told, str(error)
    wrong = miss(kind, before, after)
    return "right" if wrong < RIGHT else "WRONG", told, f"{100 * wrong:.2f} % {after.notes}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--verbose", action="store_true", help="show every one")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made = {name: good(Path(folder) / name, name) for name in ("blend", "denim")}
        count = Counter()
        for seed in range(args.first, args.first + args.count):
            one = made["blend" if seed % 2 else "denim"]
            verdict, told, said = trial(one, seed, one.folder)
            count[verdict] += 1
            if args.verbose or verdict == "WRONG":
                print(f"{seed} {one.name} {verdict}: {told}\n    {said}", flush=True)
    print(f"{args.count} records: " + ", ".join(f"{n} {verdict}" for verdict, n in sorted(count.items())))
    return 1 if count["WRONG"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
