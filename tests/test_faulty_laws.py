"""Sixty laws with one fault each: every one is named in a sentence before it is used."""

import numpy as np
import pytest
from mpi4py import MPI
from motions import SQUARE

from fabric_fenicsx import fabrics, sheet
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.laws import checks
from fabric_fenicsx.laws.printed import Printed
from fabric_fenicsx.laws.svk import StVenantKirchhoff
from fabric_fenicsx.laws.woven import Woven
from fabric_fenicsx.surfaces import meshing

COMM = MPI.COMM_WORLD
K = np.array([50e6, 30e6, 0.5e6])


class Good:
    """Linear, with two state variables: the largest strain along the warp, and how often it grew."""

    symmetric = True
    initial_state = np.zeros(2)

    def answer(self, strain, state):
        """Stress, tangent and new state."""
        C = np.zeros((len(strain), 3, 3))
        C[:, range(3), range(3)] = K
        new = state.copy()
        new[:, 0] = np.maximum(state[:, 0], strain[:, 0])
        return strain * K, C, new

    def respond(self, strain, state, out=None):
        """As of `Law`."""
        answer = self.answer(strain, state)
        if out is None:
            return answer
        for array, values in zip(out, answer, strict=True):
            array[:] = values
        return out


def member(**members):
    """The good law with other members."""
    return type("Faulty", (Good,), members)()


def lacking(name):
    """The good law without a member."""
    hidden = property(lambda self: (_ for _ in ()).throw(AttributeError(name)))
    return type("Faulty", (Good,), {name: hidden})()


def answering(change):
    """The good law whose answer is changed by `change(strain, state, S, C, new)`, which returns three arrays."""

    def answer(self, strain, state):
        return change(strain, state, *Good.answer(self, strain, state))

    return member(answer=answer)


def responding(respond):
    """The good law with another `respond`."""
    return member(respond=respond)


def returning(change):
    """The good law that returns something else, having written into `out` what it should."""

    def respond(self, strain, state, out=None):
        return change(Good.respond(self, strain, state, out))

    return responding(respond)


def put(array, where, value):
    """A copy with another value somewhere."""
    array = array.copy()
    array[where] = value
    return array


def ignore_out(self, strain, state, out=None):
    return self.answer(strain, state)


def only(kept):
    """Writes only some of the three arrays."""

    def respond(self, strain, state, out=None):
        answer = self.answer(strain, state)
        if out is None:
            return answer
        for k in kept:
            out[k][:] = answer[k]
        return out

    return responding(respond)


def refuses_out(self, strain, state):
    return self.answer(strain, state)


def needs_out(self, strain, state, out):
    return Good.respond(self, strain, state, out)


def changes(which, how):
    """Changes what it is given, after it has used it."""

    def respond(self, strain, state, out=None):
        answer = Good.respond(self, strain, state, out)
        how((strain, state)[which])
        return answer

    return responding(respond)


def zero(array):
    array[:] = 0.0


def grow(array):
    array += 1.0


def raising(error, when=lambda strain: True):
    def respond(self, strain, state, out=None):
        if when(strain):
            raise error
        return Good.respond(self, strain, state, out)

    return responding(respond)


def remembering():
    """Keeps its own history."""

    def answer(self, strain, state):
        self.calls = getattr(self, "calls", 0) + 1
        S, C, new = Good.answer(self, strain, state)
        return S * (1 + 1e-3 * self.calls), C, new

    return member(answer=answer)


def own_buffers():
    """Returns the same arrays at every call."""

    def respond(self, strain, state, out=None):
        answer = self.answer(strain, state)
        if out is None:
            kept = self.__dict__.setdefault(len(strain), answer)
            for array, values in zip(kept, answer, strict=True):
                array[:] = values
            return kept
        return Good.respond(self, strain, state, out)

    return responding(respond)


NAN, INF = np.nan, np.inf
FAULTS = {
    "no initial_state": (lacking("initial_state"), "initial_state must be"),
    "state of two dimensions": (member(initial_state=np.zeros((2, 2))), "initial_state must be"),
    "state a list": (member(initial_state=[0.0, 0.0]), "initial_state must be"),
    "state None": (member(initial_state=None), "initial_state must be"),
    "state of single precision": (member(initial_state=np.zeros(2, dtype="f4")), "initial_state must be"),
    "state of integers": (member(initial_state=np.zeros(2, dtype=int)), "initial_state must be"),
    "state a number": (member(initial_state=np.array(0.0)), "initial_state must be"),
    "state NaN": (member(initial_state=np.array([0.0, NAN])), "initial_state must be"),
    "state infinite": (member(initial_state=np.array([INF, 0.0])), "initial_state must be"),
    "no symmetric": (lacking("symmetric"), "symmetric must be"),
    "symmetric a word": (member(symmetric="yes"), "symmetric must be"),
    "symmetric None": (member(symmetric=None), "symmetric must be"),
    "no respond": (lacking("respond"), "respond must be"),
    "respond an array": (member(respond=np.zeros(3)), "respond must be"),
    "out ignored": (responding(ignore_out), "the stress is another one|not written into out"),
    "out without stress": (only((1, 2)), "the stress"),
    "out without tangent": (only((0, 2)), "the tangent"),
    "out without state": (only((0, 1)), "the new state"),
    "out unknown": (responding(refuses_out), "respond raises TypeError"),
    "out needed": (responding(needs_out), "respond raises TypeError"),
    "out written twice over": (returning(lambda a: (2 * a[0], a[1], a[2])), "the stress"),
    "returns nothing": (returning(lambda a: None), "must return a tuple"),
    "returns a list": (returning(list), "must return a tuple"),
    "returns two": (returning(lambda a: a[:2]), "must return a tuple"),
    "returns four": (returning(lambda a: (*a, a[0])), "must return a tuple"),
    "stress short": (returning(lambda a: (a[0][:, :2], a[1], a[2])), "the stress must be an array"),
    "stress flat": (returning(lambda a: (a[0].ravel(), a[1], a[2])), "the stress must be an array"),
    "stress of one point": (returning(lambda a: (a[0][:1], a[1], a[2])), "the stress must be an array|depends"),
    "stress a list": (returning(lambda a: (a[0].tolist(), a[1], a[2])), "the stress must be an array"),
    "stress of single precision": (returning(lambda a: (a[0].astype("f4"), a[1], a[2])), "the stress must be an array"),
    "stress complex": (returning(lambda a: (a[0] + 0j, a[1], a[2])), "the stress must be an array"),
    "stress words": (returning(lambda a: (a[0].astype(str), a[1], a[2])), "the stress must be an array"),
    "tangent of one point": (returning(lambda a: (a[0], a[1][0], a[2])), "the tangent must be an array"),
    "tangent flat": (returning(lambda a: (a[0], a[1].reshape(-1, 9), a[2])), "the tangent must be an array"),
    "tangent a diagonal": (returning(lambda a: (a[0], a[0], a[2])), "the tangent must be an array"),
    "state short": (returning(lambda a: (a[0], a[1], a[2][:, :1])), "the new state must be an array"),
    "state left out": (returning(lambda a: (a[0], a[1], None)), "the new state must be an array"),
    "stress NaN": (answering(lambda E, s, S, C, n: (S * NAN, C, n)), "the stress is not finite"),
    "stress NaN at rest": (answering(lambda E, s, S, C, n: (S + 0 * (S / S), C, n)), "the stress is not finite"),
    "stress infinite": (answering(lambda E, s, S, C, n: (put(S, (0, 0), INF), C, n)), "the stress is not finite"),
    "tangent NaN": (answering(lambda E, s, S, C, n: (S, C * NAN, n)), "the tangent is not finite"),
    "tangent infinite at rest": (
        answering(lambda E, s, S, C, n: (S, C / np.where(E[:, :1, None] == 0, 0, 1), n)),
        "the tangent is not finite",
    ),
    "state NaN in the answer": (answering(lambda E, s, S, C, n: (S, C, n * NAN)), "the new state is not finite"),
    "state infinite in the answer": (
        answering(lambda E, s, S, C, n: (S, C, put(n, (0, 1), INF))),
        "the new state is not finite",
    ),
    "strain zeroed": (changes(0, zero), "changes the strain"),
    "strain grown": (changes(0, grow), "changes the strain"),
    "state set": (changes(1, grow), "changes the state"),
    "state moved in place": (
        responding(lambda self, E, s, out=None: Good.respond(self, E, np.maximum(s, 1, out=s), out)),
        "changes the state",
    ),
    "raises": (raising(ValueError("no good")), r"respond raises ValueError\('no good'\)"),
    "raises at rest": (
        raising(ZeroDivisionError("at rest"), lambda E: (E == 0).all(axis=1).any()),
        "respond raises ZeroDivisionError",
    ),
    "raises an InputError": (raising(InputError("says no")), "respond raises InputError"),
    "history of its own": (remembering(), "differs when the same is asked again"),
    "noise": (
        answering(lambda E, s, S, C, n: (S + np.random.default_rng().uniform(0, 1, S.shape), C, n)),
        "differs when the same",
    ),
    "buffers of its own": (own_buffers(), "is changed by a later call"),
    "mean of the batch": (answering(lambda E, s, S, C, n: (S - S.mean(0), C, n)), "depends on the other points"),
    "largest of the batch": (answering(lambda E, s, S, C, n: (S, C, n + n.max())), "depends on the other points"),
    "tangent zero": (answering(lambda E, s, S, C, n: (S, 0 * C, n)), "not the derivative"),
    "tangent of the other sign": (answering(lambda E, s, S, C, n: (S, -C, n)), "not the derivative"),
    "tangent in the wrong unit": (answering(lambda E, s, S, C, n: (S, C / 1e6, n)), "not the derivative"),
    "tangent of tensor shear": (
        answering(lambda E, s, S, C, n: (S, C * np.array([1, 1, 2])[None, None], n)),
        "not the derivative",
    ),
    "tangent in another order": (answering(lambda E, s, S, C, n: (S, C[:, ::-1, ::-1], n)), "not the derivative"),
    "tangent not symmetric": (
        answering(lambda E, s, S, C, n: (S + E[:, ::-1] * [1e6, 0, 0], put(C, (slice(None), 0, 2), 1e6), n)),
        "symmetric is True",
    ),
}


def test_there_are_sixty():
    assert len(FAULTS) >= 60
    checks.glance(Good())


@np.errstate(all="ignore")
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_in_a_sentence(name):
    law, reason = FAULTS[name]
    with pytest.raises(InputError, match=reason) as said:
        checks.glance(law)
    assert "\n" not in str(said.value) and str(said.value).endswith(".")


@pytest.mark.parametrize("fabric", fabrics.names())
def test_no_law_of_the_package_is_refused(fabric):
    fabric = fabrics.load(fabric)
    for law in (Woven(fabric), Printed(fabric), StVenantKirchhoff.isotropic(1e6, 0.3)):
        checks.glance(law)
        checks.check(law)


@pytest.mark.parallel
@np.errstate(all="ignore")
@pytest.mark.parametrize("kinematics", ["shell", "membrane"])
def test_a_sheet_looks_at_its_law_on_every_rank(kinematics):
    """A fault on one rank is every rank's; f11: arrays that are returned and not written into `out` are no zeros."""
    domain = meshing.read(SQUARE, COMM, side=1.0, n=2)
    sheet.Sheet(domain, Good(), 1e-3, (1e6, 1e6), kinematics=kinematics)
    for law in (responding(ignore_out), FAULTS["stress NaN at rest"][0]):
        with pytest.raises(InputError, match=r"The law (Faulty|Good) cannot be used: the stress.*\.$"):
            sheet.Sheet(domain, law if COMM.rank == COMM.size - 1 else Good(), 1e-3, (1e6, 1e6), kinematics=kinematics)
