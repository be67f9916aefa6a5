"""Parts of an `.inp` file, and all of their instances as one: which node, element or set a word means."""

from dataclasses import dataclass, field

import numpy as np

from ..errors import InputError
from .abaqus_lines import Line
from .checking import Array


@dataclass
class Part:
    """Nodes, elements and sets that are numbered together: of a part, of an instance, or of a flat file."""

    name: str = ""
    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[int, tuple[str, tuple[str, ...], Line]] = field(default_factory=dict)
    """Number -> type, words that name the nodes, and where."""
    sets: dict[tuple[str, str], list[tuple[str, list[str], Line]]] = field(default_factory=dict)
    """"N" or "E" and name in capitals -> of which instance, and members: words of numbers or of other sets."""
    of: "Part | None" = None
    moves: list[tuple[float, ...]] = field(default_factory=list)

    def move(self, x: Array) -> Array:
        """Points, (points, 3), of the part as its instance has them: shifted, and then turned about an axis."""
        for move in self.moves:
            if len(move) == 3:
                x = x + np.array(move)
            else:
                a, b, angle = np.array(move[:3]), np.array(move[3:6]), np.radians(move[6])
                w, y = (b - a) / np.linalg.norm(b - a), x - a
                x = a + np.cos(angle) * y + np.sin(angle) * np.cross(w, y) + (1 - np.cos(angle)) * np.outer(y @ w, w)
        return x


class Whole:
    """Places of all nodes and elements of a file in one array each, by instance and number."""

    def __init__(self, flat: Part, instances: dict[str, Part]) -> None:
        self.parts: dict[str, list[Part]] = {"": [flat]}
        self.parts |= {name: [part.of, part] for name, part in instances.items() if part.of is not None}
        self.node: dict[tuple[str, int], int] = {}
        self.element: dict[tuple[str, int], tuple[str, tuple[str, ...], Line]] = {}
        points = [np.zeros((0, 3))]
        for name, both in self.parts.items():
            for part in both:
                first = len(self.node)
                self.node |= {(name, number): first + k for k, number in enumerate(part.nodes)}
                if len(self.node) != first + len(part.nodes):
                    raise InputError(f"The instance {part.name!r} and its part have nodes of the same numbers.")
                points.append(both[-1].move(np.array(list(part.nodes.values()), dtype=float).reshape(-1, 3)))
                self.element |= {(name, number): element for number, element in part.elements.items()}
        self.points = np.concatenate(points)

    def nodes(self, name: str, words: tuple[str, ...], line: Line) -> list[int]:
        """Places of the nodes that an element of an instance names."""
        found = []
        for word in words:
            instance, _, number = word.rpartition(".")
            try:
                found.append(self.node[instance.upper() or name, int(number)])
            except (KeyError, ValueError):
                line.refuse(f"there is no node {word!r}")
        return found

    def members(self, kind: str, owner: str, name: str, line: Line, before: tuple = ()) -> list[tuple[str, int]]:
        """Instance and number of all that is in a set."""
        if (kind, owner, name) in before:
            line.refuse(f"the set {name!r} is in itself")
        at = (*before, (kind, owner, name))
        entries = [entry for part in self.parts.get(owner, []) for entry in part.sets.get((kind, name), [])]
        if not entries:
            line.refuse(f"there is no {'node' if kind == 'N' else 'element'} set {name!r} before it or after it")
        found: list[tuple[str, int]] = []
        known = self.node if kind == "N" else self.element
        for instance, words, where in entries:
            for word in words:
                if word.startswith("E:"):
                    for own, number in self.members("E", instance or owner, word[2:].upper(), where, at):
                        _, names, _ = self.element[own, number]
                        found += [self._of(own, text) for text in names]
                    continue
                prefix, _, last = (
                    word.rpartition(".") if word.upper() not in self._named(kind, owner) else ("", "", word)
                )
                own = prefix.upper() or instance or owner
                if own not in self.parts:
                    where.refuse(f"{word!r} is of no instance")
                if not last.isdigit():
                    here = own if prefix or last.upper() in self._named(kind, own) else owner
                    found += self.members(kind, here, last.upper(), where, at)
                elif (own, int(last)) in known:
                    found.append((own, int(last)))
                else:
                    where.refuse(f"there is no {'node' if kind == 'N' else 'element'} {word!r}")
        return found

    def _of(self, owner: str, word: str) -> tuple[str, int]:
        instance, _, number = word.rpartition(".")
        return instance.upper() or owner, int(number)

    def _named(self, kind: str, owner: str) -> set[str]:
        return {name for part in self.parts.get(owner, []) for k, name in part.sets if k == kind}
