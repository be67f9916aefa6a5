"""How far a step may go, and how what leads a term gets to its place: in as many parts as the terms ask for."""

from collections.abc import Callable, Sequence

from mpi4py import MPI

from ..laws import Array
from ..terms.term import Term

PARTS = 20
"""Of the way of what is led in one step, each of which ends in balance."""
HELD = "what leads the sheet is held back by it"


def unled(t: float) -> None:
    """Nothing changes with time (s): a `set_load` after which supports stay where they are."""


def limited(terms: Sequence[Term]) -> list[Term]:
    """Those that may shorten a step."""
    return [term for term in terms if type(term).longest_step is not Term.longest_step]


def free_part(terms: Sequence[Term], change: Array, comm: MPI.Comm) -> float:
    """The part of a change of q (local array) that these terms allow on all ranks, up to 1."""
    return float(comm.allreduce(min(term.longest_step(change) for term in terms), MPI.MIN))


def leads(terms: Sequence[Term]) -> bool:
    """Whether something leads any of these."""
    return any(type(term).follow is not Term.follow for term in terms)


def balanced(terms: Sequence[Term], start: Callable[[], None], balance: Callable[[], int]) -> int | None:
    """Lead the terms to their places, with a `balance` after each part of the way; its iterations, None if held.

    start: puts the sheet where the first balance begins, which may not be where terms were last evaluated.
    """
    iterations = 0
    if leads(terms):
        start()
    for _ in range(PARTS):
        there = all([term.follow() for term in terms])
        iterations += balance()
        if there:
            return iterations
    return None
