"""What a person has corrected: a CSV file that is read in every run and never written over.

photograph,mark,x_px,y_px
img_007.png,m12,412.5,230     # the mark is here, pixels from the upper left corner; it is followed from here on
img_009.png,m12,,             # nothing to be seen of it here
,m03,,                        # not a mark at all
img_001.png,new,640,200       # another mark: a new name, in the first photograph
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import files
from ..errors import InputError
from ..laws import Array

HEAD = "photograph,mark,x_px,y_px"
EMPTY = f"""# Corrections by hand; this file is kept. A line each, such as
# img_007.png,m12,412.5,230   the mark is here (pixels from the upper left corner of the photograph)
# img_009.png,m12,,           it is not to be seen here
# ,m03,,                      it is not a mark at all
# img_001.png,new,640,200     one more mark, under a new name, in the first photograph
{HEAD}
"""


@dataclass
class Corrections:
    """Places by hand (pixels, infinite: not to be seen) by photograph and mark, and what is no mark."""

    file: str = "corrections.csv"
    places: dict[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    never: set[str] = field(default_factory=set)

    def apply(self, photographs: Sequence[str], names: list[str], x0: Array) -> tuple[list[str], Array, Array]:
        """Names of the marks, their places (n, 2) in the first photograph, and those by hand (m, n, 2), else NaN."""
        kept = [k for k, name in enumerate(names) if name not in self.never]
        unknown = self.never - set(names)
        if unknown:
            raise InputError(f"{self.file}: {min(unknown)!r} is none of the marks; take its name from the sheet.")
        x0, names = x0[kept], [names[k] for k in kept]
        new = {mark: xy for (photo, mark), xy in self.places.items() if mark not in names and photo == photographs[0]}
        names, x0 = [*names, *new], np.concatenate([x0, np.array(list(new.values())).reshape(-1, 2)])
        hand = np.full((len(photographs), len(names), 2), np.nan)
        for (photo, mark), xy in self.places.items():
            if photo not in photographs:
                raise InputError(f"{self.file}: {photo!r} is none of the photographs; write its name as it is.")
            if mark not in names:
                raise InputError(
                    f"{self.file}: {mark!r} is none of the marks; take its name from the sheet, or give a new mark a "
                    f"place in the first photograph, {photographs[0]}."
                )
            hand[photographs.index(photo), names.index(mark)] = xy
        return names, x0, hand


def read(path: Path) -> Corrections:
    """The corrections of a file, none if it is not there; raises InputError for what cannot be read."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        return Corrections(path.name)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); save it as CSV in UTF-8.") from error
    out = Corrections(path.name)
    for number, line in enumerate(lines, 1):
        line = line.split("#")[0].strip()
        if not line or line.replace(" ", "") == HEAD:
            continue
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=";" if ";" in line else ","))]
        where = f"{path.name}: line {number}"
        if len(cells) != 4 or not cells[1]:
            raise InputError(f"{where} is not of the form {HEAD}; write img_007.png,m12,412.5,230, say.")
        photo, mark, x, y = cells
        if not x and not y:
            if photo:
                out.places[photo, mark] = (np.inf, np.inf)
            else:
                out.never.add(mark)
            continue
        try:
            place = (float(x), float(y))
        except ValueError:
            raise InputError(f"{where} has the place {x!r}, {y!r}; give two numbers, or none.") from None
        if not photo or not np.isfinite(place).all():
            raise InputError(f"{where} has a place, but no photograph, or one that is not finite; give both.")
        out.places[photo, mark] = place
    return out


def begin(path: Path) -> None:
    """An empty file to write corrections into, if there is none."""
    if not path.exists():
        files.replace(path, EMPTY)
