"""The mesh-free driver: paths, turned axes, material stability, and a check that finds broken laws."""

import numpy as np
import pytest

from fabric_fenicsx.errors import InputError, StepFailed
from fabric_fenicsx.laws import (
    HasCalibration,
    HasPotential,
    HasRecoverable,
    HasStiffest,
    HasStiffness,
    Law,
    stability,
)
from fabric_fenicsx.laws.driver import check, mixed, run, uniaxial
from fabric_fenicsx.laws.svk import StVenantKirchhoff

NONSYMMETRIC = np.array([[5.0, 2.0, 0.3], [0.4, 3.0, -0.2], [0.1, 0.6, 1.0]]) * 1e6
ORTHOTROPIC = StVenantKirchhoff.orthotropic(50e6, 9e6, 0.3, 2e6)
rng = np.random.default_rng(7)


class Diagonal:
    """S_k = f_k(E_k) without history: a law whose every answer can be written down. Stiff in 22 and 12."""

    initial_state = np.empty(0)
    symmetric = True
    stiff = 1e9

    def curve(self, e):
        """Stress and modulus of the warp, in Pa."""
        return 1e6 * e, np.full_like(e, 1e6)

    def respond(self, strain, state, out=None):
        stress, tangent = (
            self.stiff * strain,
            np.tile(np.diag([0, self.stiff, self.stiff]), (len(strain), 1, 1)),
        )
        stress[:, 0], tangent[:, 0, 0] = self.curve(strain[:, 0])
        stress[~np.isfinite(strain).all(axis=1)] = np.nan
        answer = stress, tangent, state.copy()
        if out is None:
            return answer
        for a, b in zip(out, answer, strict=True):
            a[...] = b
        return out


class Softening(Diagonal):
    """S11 = A E (1 - E/(2 e0)): its modulus is A at zero strain and zero at e0."""

    A, e0 = 1e7, 0.2

    def curve(self, e):
        return self.A * e * (1 - e / (2 * self.e0)), self.A * (1 - e / self.e0)


class Kinked(Diagonal):
    """Slack until E11 = 0.1, then a thousand times stiffer."""

    def curve(self, e):
        return 1e6 * e + 1e9 * np.maximum(e - 0.1, 0), 1e6 + 1e9 * (e > 0.1)


class Ratchet(Diagonal):
    """Answers NaN to increments of E11 above 0.06; its state is E11, so that small steps get anywhere."""

    initial_state = np.zeros(1)

    def respond(self, strain, state, out=None):
        stress, tangent, _ = super().respond(strain, state)
        stress[np.abs(strain[:, 0] - state[:, 0]) > 0.06] = np.nan
        return stress, tangent, strain[:, :1].copy()


# ---------------------------------------------------------------- turned axes


def tensor(packed, shear=1.0):
    return np.array([[packed[0], packed[2] / shear], [packed[2] / shear, packed[1]]])


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, -1.2, 4.0])
def test_turning_is_the_tensor_rule(angle):
    """E' = R E R^T and S' = R S R^T with the rows of R the turned axes; C' by R on all four indices."""
    R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    strain, stress, C = rng.normal(size=3), rng.normal(size=3), rng.normal(size=(3, 3))
    E, S = stability.rotate_strain(strain, angle), stability.rotate_stress(stress, angle)
    np.testing.assert_allclose(tensor(E, 2), R @ tensor(strain, 2) @ R.T, atol=1e-14)
    np.testing.assert_allclose(tensor(S), R @ tensor(stress) @ R.T, atol=1e-14)

    place = ((0, 0), (1, 1), (0, 1))
    full = np.zeros((2, 2, 2, 2))
    for a, (i, j) in enumerate(place):
        for b, (k, m) in enumerate(place):
            full[i, j, k, m] = full[j, i, k, m] = full[i, j, m, k] = full[j, i, m, k] = C[a, b]
    turned = np.einsum("ai,bj,ck,dm,ijkm->abcd", R, R, R, R, full)
    expected = [[turned[i, j, k, m] for k, m in place] for i, j in place]
    np.testing.assert_allclose(stability.rotate_tangent(C, angle), expected, atol=1e-14)
    # and the three agree: stress of turned strain = turned stress
    np.testing.assert_allclose(
        stability.rotate_tangent(C, angle) @ E, stability.rotate_stress(C @ strain, angle), atol=1e-13
    )


@pytest.mark.parametrize("angle", np.radians([0, 15, 45, 60, 90]))
def test_off_axis_modulus(angle):
    """1/E(phi) = c^4/E1 + (1/G - 2 nu12/E1) s^2 c^2 + s^4/E2, exact as S is linear in E."""
    c, s = np.cos(angle), np.sin(angle)
    expected = 1 / (c**4 / 50e6 + (1 / 2e6 - 2 * 0.3 / 50e6) * s**2 * c**2 + s**4 / 9e6)
    result = uniaxial(ORTHOTROPIC, [1e-4, 2e-4], angle=angle)
    np.testing.assert_allclose(result.stress[:, 0] / result.strain[:, 0], expected, rtol=1e-9)
    assert np.abs(result.stress[:, 1:]).max() < 1e-9 * expected * 1e-4 + 1e-12 * 55e6


def test_weft_is_warp_seen_from_axes_turned_by_a_right_angle():
    warp = uniaxial(ORTHOTROPIC, [0.1], direction=0, angle=np.pi / 2)
    weft = uniaxial(ORTHOTROPIC, [0.1], direction=1)
    np.testing.assert_allclose(warp.stress[0, 0], weft.stress[0, 1], rtol=1e-12)


# ---------------------------------------------------------------- paths


def test_run_gives_stress_work_and_second_order_work():
    """Linear law: work = E . C E / 2 on any straight path; second-order work = smallest eigenvalue of C."""
    path = np.linspace(0, 1, 6)[1:, None] * np.array([0.1, -0.05, 0.2])
    for angle in (0.0, 0.7):
        result = run(ORTHOTROPIC, path, angle)
        C = stability.rotate_tangent(ORTHOTROPIC.stiffness, angle)
        np.testing.assert_allclose(result.stress, path @ C.T, rtol=1e-12)
        np.testing.assert_allclose(result.tangent, np.tile(C, (5, 1, 1)), atol=1e-7)
        np.testing.assert_allclose(result.work, np.einsum("ni,ij,nj->n", path, C, path) / 2, rtol=1e-12)
        np.testing.assert_allclose(result.second_order_work, np.linalg.eigvalsh(C)[0], rtol=1e-12)
        assert (result.strain == path).all() and result.state.shape == (5, 0)


def test_run_commits_after_every_step():
    path = np.array([[0.05, 0, 0], [0.1, 0, 0], [0.15, 0, 0], [0.0, 0, 0]])
    np.testing.assert_array_equal(run(Ratchet(), path[:3]).state, path[:3, :1])
    with pytest.raises(StepFailed, match=r"step 4 of 4 .* residuals \(nan\)"):
        run(Ratchet(), path)


def test_a_law_that_is_not_plane():
    result = run(StVenantKirchhoff([[2e6]]), [[0.1], [0.2]])
    np.testing.assert_allclose(result.stress, [[2e5], [4e5]])
    assert result.stability is None and result.localisation is None and np.isnan(result.acoustic).all()
    assert check(StVenantKirchhoff([[2e6]]), [[0.1], [0.2]]).judged == 1


@pytest.mark.parametrize("prescribed", [("strain", "stress", "stress"), ("stress", "stress", "strain")])
def test_mixed_is_exact_for_a_nonsymmetric_law(prescribed):
    """Against the linear equations solved by hand; a transposed tangent would miss in the first iteration."""
    law = StVenantKirchhoff(NONSYMMETRIC)
    free = np.array([p == "stress" for p in prescribed])
    targets = np.where(free, 1e5 * rng.normal(size=(4, 3)), 0.1 * rng.normal(size=(4, 3)))
    result = mixed(law, targets, prescribed, max_iterations=1)
    C, given = NONSYMMETRIC, ~free
    for strain, stress, target in zip(result.strain, result.stress, targets, strict=True):
        expected = target.copy()
        rest = target[free] - C[np.ix_(free, given)] @ target[given]
        expected[free] = np.linalg.solve(C[np.ix_(free, free)], rest)
        np.testing.assert_allclose(strain, expected, atol=1e-12)
        np.testing.assert_allclose(stress, C @ expected, atol=1e-5)


def test_all_stresses_given():
    stress = np.array([[1e5, -2e5, 3e4]])
    result = mixed(StVenantKirchhoff(NONSYMMETRIC), stress, ["stress"] * 3)
    np.testing.assert_allclose(result.strain[0], np.linalg.solve(NONSYMMETRIC, stress[0]), rtol=1e-10)


@pytest.mark.parametrize("steps", [1, 2, 7])
def test_a_kink_is_passed_by_stress(steps):
    """Into the stiff branch and back: E = S/1 MPa up to 0.1, then 0.1 + (S - 0.1 MPa)/1001 MPa."""
    targets = np.zeros((2 * steps, 3))
    targets[:, 0] = 1e6 * np.r_[np.arange(1, steps + 1) / steps, np.arange(steps - 1, -1, -1) / steps]
    result = mixed(Kinked(), targets, ["stress"] * 3)
    S = targets[:, 0]
    np.testing.assert_allclose(result.strain[:, 0], np.where(S > 1e5, 0.1 + (S - 1e5) / 1001e6, S / 1e6), atol=1e-9)


def test_a_step_that_fails_is_halved_and_grows_again():
    result = uniaxial(Ratchet(), [0.5, 0.1])
    np.testing.assert_allclose(result.stress[:, 0], [5e5, 1e5], rtol=1e-9)
    np.testing.assert_allclose(result.state[:, 0], [0.5, 0.1])


def test_a_stress_out_of_reach_names_step_target_and_residuals():
    """Softening carries A e0/2 = 1 MPa at most."""
    targets = np.array([[0.9e6, 0, 0], [1.1e6, 0, 0]])
    with pytest.raises(StepFailed) as error:
        mixed(Softening(), targets, ["stress"] * 3, max_halvings=6)
    message = str(error.value)
    assert "step 2 of 2" in message and "target (1.1e+06, 0, 0)" in message and "residuals (" in message
    done = float(message.split("stopped ")[1].split()[0])
    assert 0.5 - 1 / 64 <= done <= 0.5  # 1 MPa is half way


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: run(ORTHOTROPIC, [0.1, 0.2, 0.3]), "of shape"),
        (lambda: run(ORTHOTROPIC, np.empty((0, 3))), "of shape"),
        (lambda: run(ORTHOTROPIC, [[np.nan, 0, 0]]), "finite"),
        (lambda: run(ORTHOTROPIC, [[0.1, 0, 0]], angle=np.inf), "angle"),
        (lambda: run(StVenantKirchhoff([[1.0]]), [[0.1]], angle=0.1), "angle"),
        (lambda: mixed(ORTHOTROPIC, [[0.1, 0, 0]], ("strain", "stress")), "each of the 3 components"),
        (lambda: mixed(ORTHOTROPIC, [[0.1, 0, 0]], ("strain", "stress", "load")), "each of the 3 components"),
        (lambda: uniaxial(ORTHOTROPIC, [[0.1]]), "axial strains"),
        (lambda: uniaxial(ORTHOTROPIC, [0.1], direction=2), "direction"),
    ],
)
def test_bad_paths_are_one_sentence(call, sentence):
    with pytest.raises(InputError, match=sentence):
        call()


def test_plot_writes_a_picture(tmp_path):
    result = uniaxial(Softening(), np.linspace(0.01, 0.2, 20))
    figure = result.plot(tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 5000
    line = figure.axes[0].lines[0]
    np.testing.assert_allclose(line.get_ydata(), result.stress[:, 0] / 1e6)


# ---------------------------------------------------------------- material stability


def test_isotropic_acoustic_tensor():
    """At zero strain Q has the eigenvalues C11 (along N) and G (across), whatever N."""
    law = StVenantKirchhoff.isotropic(1e6, 0.3)
    found = stability.acoustic(np.zeros((1, 3)), np.zeros((1, 3)), law.stiffness[None])
    C11, G = 1e6 / (1 - 0.09), 1e6 / 2.6
    np.testing.assert_allclose(found.eigenvalue, G, rtol=1e-12)
    np.testing.assert_allclose(found.determinant, C11 * G, rtol=1e-12)
    assert run(law, [[1e-9, 0, 0]]).localisation is None


def test_acoustic_tensor_is_the_derivative_of_the_first_piola_kirchhoff_stress():
    """A_iJkL = dP_iJ/dF_kL by central differences at F = R U, minimised over 200000 directions."""
    law = StVenantKirchhoff(NONSYMMETRIC)
    a = 0.8
    F = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ np.array([[1.3, 0.2], [0.2, 0.8]])

    def strain_of(F):
        E = (F.T @ F - np.eye(2)) / 2
        return np.array([E[0, 0], E[1, 1], 2 * E[0, 1]])

    A, h = np.empty((2, 2, 2, 2)), 1e-6
    for k in range(2):
        for m in range(2):
            dF = np.zeros((2, 2))
            dF[k, m] = h
            P = [G @ tensor(NONSYMMETRIC @ strain_of(G)) for G in (F + dF, F - dF)]
            A[:, :, k, m] = (P[0] - P[1]) / (2 * h)
    angle = np.linspace(0, np.pi, 200_000)
    N = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    Q = np.einsum("iJkL,nJ,nL->nik", A, N, N)
    smallest, determinants = np.linalg.eigvalsh((Q + Q.swapaxes(1, 2)) / 2)[:, 0], np.linalg.det(Q)

    strain = strain_of(F)[None]
    found = stability.acoustic(strain, law.respond(strain, np.empty((1, 0)))[0], NONSYMMETRIC[None])
    np.testing.assert_allclose(found.eigenvalue, smallest.min(), rtol=1e-8)
    np.testing.assert_allclose(found.determinant, determinants.min(), rtol=1e-8)
    # the direction is a reference one: the rotation does not turn it
    assert abs(np.tan(found.determinant_angle[0] - angle[determinants.argmin()])) < 1e-4


def test_loss_of_ellipticity_at_a_known_strain():
    """Uniaxial strain of the softening law: Q11(e1) = S11 + (1 + 2 E) C11 vanishes first, at the root of

    E (1 - E/(2 e0)) + (1 + 2 E)(1 - E/e0) = 1 + (3 - 1/e0) E - (5/(2 e0)) E^2.
    """
    e0 = Softening.e0
    b = 3 - 1 / e0
    root = (b + np.sqrt(b**2 + 10 / e0)) / (5 / e0)
    path = np.zeros((5, 3))
    path[:, 0] = root * np.array([0.3, 0.9, 1 - 1e-9, 1 + 1e-9, 1.1])
    result = run(Softening(), path)
    assert result.localisation is not None
    step, angle = result.localisation
    assert step == 3 and abs(angle) < 1e-6
    assert (result.acoustic[:3] > 0).all() and (result.acoustic[3:] < 0).all()
    # Hill's condition without geometry fails earlier, where the modulus is zero: at e0 = 0.2 < 0.214
    assert result.second_order_work[1] > 0 > result.second_order_work[2]
    # seen from turned axes, the band is turned back
    turned = run(Softening(), stability.rotate_strain(path, 0.3), angle=0.3)
    assert turned.localisation is not None and turned.localisation[0] == 3
    assert abs(turned.stability.determinant_angle[4] + 0.3) < 1e-6


def test_impossible_strain_has_no_acoustic_tensor():
    assert np.isnan(run(ORTHOTROPIC, [[-0.6, 0, 0]]).acoustic).all()


# ---------------------------------------------------------------- check


def test_check_passes_good_laws_and_reports():
    for law in (ORTHOTROPIC, StVenantKirchhoff(NONSYMMETRIC), Softening(), Kinked()):
        report = check(law)
        assert report.tangent_error < 1e-6 and report.symmetric is law.symmetric
        assert report.points == 256 and "promises kept at 256 points" in str(report)
    assert check(StVenantKirchhoff(NONSYMMETRIC)).asymmetry == pytest.approx(1.6 / 5)


def test_check_does_not_judge_a_kink():
    on_it = check(Kinked(), [[0.1, 0, 0], [0.2, 0, 0]])
    assert on_it.judged == pytest.approx(1 - 1 / 18) and on_it.tangent_error < 1e-6


class Broken(StVenantKirchhoff):
    """A good nonsymmetric law, to be broken in one point each."""

    def __init__(self):
        super().__init__(NONSYMMETRIC)
        self.initial_state = np.zeros(1)
        self.calls = 0


class Transposed(Broken):
    def respond(self, strain, state, out=None):
        stress, tangent, new_state = super().respond(strain, state, out)
        tangent[...] = tangent.swapaxes(1, 2).copy()
        return stress, tangent, new_state


class Counting(Broken):
    def respond(self, strain, state, out=None):
        self.calls += 1
        stress, tangent, new_state = super().respond(strain, state, out)
        stress += self.calls
        return stress, tangent, new_state


class StateInPlace(Broken):
    def respond(self, strain, state, out=None):
        state += np.abs(strain[:, :1])
        return super().respond(strain, state, out)


class StrainInPlace(Broken):
    def respond(self, strain, state, out=None):
        strain[:, 2] /= 2
        return super().respond(strain, state, out)


class Remembering(Broken):
    """Keeps its history to itself."""

    peak = 0.0

    def respond(self, strain, state, out=None):
        self.peak = max(self.peak, np.nanmax(strain[0]))
        stress, tangent, new_state = super().respond(strain, state, out)
        stress *= 1 + self.peak
        return stress, tangent, new_state


class OneBuffer(Broken):
    """Answers with the same array every time."""

    def respond(self, strain, state, out=None):
        self.buffers = getattr(self, "buffers", {})
        n = len(strain)
        own = self.buffers.setdefault(n, (np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 1))))
        return super().respond(strain, state, out or own)


class NoOut(Broken):
    def respond(self, strain, state, out=None):
        return super().respond(strain, state)


class WrongShape(Broken):
    def respond(self, strain, state, out=None):
        stress, tangent, new_state = super().respond(strain, state)
        return stress, tangent.reshape(len(strain), 9), new_state


class Single(Broken):
    def respond(self, strain, state, out=None):
        return tuple(a.astype(np.float32) for a in super().respond(strain, state))


class Pair(Broken):
    def respond(self, strain, state, out=None):
        return super().respond(strain, state)[:2]


class Raising(Broken):
    def respond(self, strain, state, out=None):
        if not np.isfinite(strain).all():
            raise FloatingPointError("bad strain")
        return super().respond(strain, state, out)


class Swallowing(Broken):
    def respond(self, strain, state, out=None):
        return super().respond(np.nan_to_num(strain, posinf=0.0), state, out)


class Spreading(Broken):
    def respond(self, strain, state, out=None):
        stress, tangent, new_state = super().respond(strain, state, out)
        if np.isnan(stress).any():
            stress[:] = np.nan
        return stress, tangent, new_state


class Averaging(Broken):
    def respond(self, strain, state, out=None):
        return super().respond(strain - strain.mean(axis=0), state, out)


class Overflowing(Diagonal):
    def curve(self, e):
        with np.errstate(over="ignore"):
            return np.exp(200 * e) - 1, 200 * np.exp(200 * e)


class Liar(Broken):
    def __init__(self):
        super().__init__()
        self.symmetric = True


class Jumping(Diagonal):
    """A stress of random sign: nothing to differentiate."""

    def curve(self, e):
        return 1e6 * np.sign(np.sin(1e12 * e)), np.ones_like(e)


class NoState(Broken):
    def __init__(self):
        super().__init__()
        self.initial_state = [0.0]


class Undecided(Broken):
    def __init__(self):
        super().__init__()
        self.symmetric = "no"


@pytest.mark.parametrize(
    ("law", "sentence"),
    [
        (Transposed, "the tangent is not the derivative of the stress, at strain"),
        (Counting, "the stress differs when the same is asked again"),
        (Remembering, "the stress .*, at strain"),
        (StateInPlace, "respond changes the state it is given"),
        (StrainInPlace, "respond changes the strain it is given"),
        (OneBuffer, "the (stress|tangent) .*(later call|asked again)"),
        (NoOut, "the stress is not written into out"),
        (WrongShape, r"the tangent must be an array of float64 \(64, 3, 3\) but is float64 \(64, 9\)"),
        (Single, "the stress must be an array of float64 .* but is float32"),
        (Pair, "must return a tuple"),
        (Raising, r"respond raises FloatingPointError\('bad strain'\), at strain \(nan, "),
        (Swallowing, r"the stress is not NaN, at strain \(nan, "),
        (Spreading, "the stress is spoilt by a neighbour that is not finite"),
        (Averaging, "the stress depends on the other points"),
        (Overflowing, "the stress is not finite"),
        (Liar, "symmetric is True but the tangent is not so"),
        (NoState, "initial_state must be"),
        (Undecided, "symmetric must be"),
    ],
)
def test_check_finds_the_broken_promise(law, sentence):
    with pytest.raises(InputError, match=sentence) as error:
        check(law())
    assert "\n" not in str(error.value) and str(error.value).endswith(".")


class Offering(Diagonal):
    """S_k = k_k E_k with all that a law may offer besides, to be broken in one member each."""

    stiff = 1e6
    stiffness = 1e6 * np.eye(3)

    @property
    def stiffest(self):
        return StVenantKirchhoff(1e6 * np.eye(3))

    def potential(self, strain, state):
        return 0.5e6 * (strain**2).sum(axis=1)

    recoverable = potential

    def beyond_calibration(self, strain):
        return "far" if np.abs(strain).max() > 0.2 else None


def test_check_looks_at_what_a_law_offers_besides():
    law = Offering()
    offers = (HasStiffness, HasStiffest, HasRecoverable, HasPotential, HasCalibration)
    assert all(isinstance(law, offer) and not isinstance(Diagonal(), offer) for offer in offers)
    report = check(law)
    assert report.potential_error < 1e-11 and "error of the potential" in str(report)
    assert check(Diagonal()).potential_error is None


def scaled(factor):
    """A potential that is so many times the right one."""
    return lambda self, strain, state: factor * Offering.potential(self, strain, state)


def writing(self, strain, state):
    strain[:] = 0.0
    return np.zeros(len(strain))


class Restarting(Offering):
    """A potential that jumps when history moves: the state counts the steps."""

    initial_state = np.zeros(1)

    def respond(self, strain, state, out=None):
        stress, tangent, _ = super().respond(strain, state)
        answer = stress, tangent, state + 1.0
        for a, b in zip(out or (), answer, strict=bool(out)):
            a[...] = b
        return out or answer

    def potential(self, strain, state):
        return Offering.potential(self, strain, state) + state[:, 0]

    def recoverable(self, strain, state):
        return self.potential(strain, state)


def softly(self, strain, state, stress, new):
    stress[:], new[:] = 0.9e6 * strain, state
    return 0.0


BROKEN = {
    "advance": ({"advance": softly}, "the stress is another one without a tangent"),
    "stiffness": ({"stiffness": 1.1e6 * np.eye(3)}, "the tangent is not the stiffness"),
    "its shape": ({"stiffness": 1e6 * np.eye(2)}, r"stiffness must be an array \(3, 3\)"),
    "stiffest": ({"stiffest": StVenantKirchhoff(0.9e6 * np.eye(3))}, "the tangent is stiffer than the stiffest"),
    "calibration": ({"beyond_calibration": lambda self, strain: True}, "neither None nor a sentence"),
    "at rest": ({"beyond_calibration": lambda self, strain: "far"}, "beyond_calibration is not None"),
    "negative": ({"recoverable": lambda self, strain, state: -np.ones(len(strain))}, "recoverable is negative"),
    "writing": ({"recoverable": writing}, "recoverable changes what it is given"),
    "list": ({"recoverable": lambda self, strain, state: [0.0]}, "recoverable must return an array"),
    "not finite": ({"recoverable": lambda self, strain, state: strain[:, 0] / 0}, "recoverable is not finite"),
    "gradient": ({"potential": scaled(1 + 1e-7), "recoverable": scaled(1 + 1e-7)}, "not the gradient of the potential"),
    "another": ({"recoverable": scaled(0.9)}, "after the strain is not what is recoverable"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_check_finds_what_is_wrong_with_it(fault):
    members, sentence = BROKEN[fault]
    with pytest.raises(InputError, match=sentence) as error:
        check(type("Wrong", (Offering,), members)())
    assert "\n" not in str(error.value) and str(error.value).endswith(".")


def test_check_finds_energy_out_of_nothing():
    with pytest.raises(InputError, match="a step makes energy"):
        check(Restarting())


def test_a_law_without_any_smooth_point_is_refused():
    with pytest.raises(InputError, match="no tangent can be judged"):
        check(_Everywhere())


class _Everywhere(Jumping):
    """Jumps in all three components."""

    def respond(self, strain, state, out=None):
        answer = super().respond(strain, state, out)
        with np.errstate(invalid="ignore"):
            answer[0][:] = 1e6 * np.sign(np.sin(1e12 * strain.sum(axis=1, keepdims=True)))
        return answer


def test_the_toy_laws_are_laws():
    laws: list[Law] = [Diagonal(), Softening(), Kinked(), ORTHOTROPIC]
    assert all(check(law).judged > 0.9 for law in laws)
