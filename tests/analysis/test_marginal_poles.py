"""Modes at the imaginary axis: what the digits given tell is told, and what they do not tell is not certified."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.analysis.claim import Claim
from boomctl.analysis.sum_over_modes import Bounded, bounds
from boomctl.exceptions import CertificateError
from boomctl.lti.frequency import singular_values
from boomctl.lti.rounding import CANCELLED
from boomctl.lti.system import Lti, of
from tests.exact import Exact
from tests.profiles import examples

REST = 0.7  # gain of a lag that stands beside the modes


def beside(A, B, C, D=0.0):
    """Return a system beside a lag of gain REST, first input to first output."""
    n = len(A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[n, n] = A, -1.0
    return control.ss(whole, [*B, [1.0]], [[*C, REST]], D)


def turned(system, seed):
    Q = np.linalg.qr(np.random.default_rng(seed).standard_normal(system.A.shape))[0]
    return control.ss(Q @ system.A @ Q.T, Q @ system.B, system.C @ Q.T, system.D)


def block(damping, omega=1.0):
    return np.array([[-damping * omega, omega], [-omega, -damping * omega]])


ON_AXIS = pytest.mark.parametrize(
    "A", [[[0.0]], block(0.0), [[0.0, 1.0], [0.0, 0.0]]], ids=["integrator", "undamped", "rigid"]
)


@given(visible=st.floats(-14.0, 3.0))
@examples(30)
@ON_AXIS
def test_norm_infinite_with_weak_mode_on_axis(A, visible):
    n = len(A)
    system = beside(np.array(A), np.eye(n)[:, -1:] * 10.0**visible, np.eye(n)[0])
    assert bc.hinf_norm(system).lower_bound == np.inf
    assert bc.h2_norm(system).value == np.inf
    assert bc.sigma(system).peak == np.inf


@pytest.mark.parametrize("hidden", ["from the input", "from the output"])
@ON_AXIS
def test_a_mode_on_the_axis_that_does_not_show_does_not_count(A, hidden):
    n = len(A)
    B, C = np.ones((n, 1)), np.ones(n)
    system = beside(np.array(A), 0.0 * B if "input" in hidden else B, C if "input" in hidden else 0.0 * C)
    norm, energy = bc.hinf_norm(system), bc.h2_norm(system)
    assert norm.certified
    assert norm.lower_bound == pytest.approx(REST, rel=1e-6)
    assert energy.certified
    assert energy.value == pytest.approx(REST / np.sqrt(2.0), rel=1e-9)


@ON_AXIS
def test_claimed_stability_of_mode_on_the_axis_is_refuted(A):
    n = len(A)
    claim = Claim("loop", of(beside(np.array(A), np.eye(n)[:, -1:], np.eye(n)[0])), stable=True)
    with pytest.raises(CertificateError, match=f"{n} on the stability boundary"):
        bc.prove(SimpleNamespace(__claims__=lambda: iter([claim])))


@given(damping=st.floats(-13.0, -3.0), omega=st.floats(-3.0, 3.0))
@examples(40)
def test_light_damping_has_a_norm_and_its_sign_is_told(damping, omega):
    zeta, w = 10.0**damping, 10.0**omega
    for sign in (1.0, -1.0):
        system = beside(block(sign * zeta, w), [[0.0], [1.0]], [1.0, 0.0])
        norm, energy = bc.hinf_norm(system), bc.h2_norm(system)
        if zeta >= 1e-11 or sign < 0.0:
            assert norm.certified
            assert energy.certified
        assert (norm.lower_bound < np.inf) == (energy.value < np.inf) == (sign > 0.0)
        assert np.isfinite(bc.sigma(system, [w]).peak) == (sign > 0.0)
        if sign > 0.0:
            peak = 1.0 / (2.0 * zeta * w)
            assert norm.lower_bound <= peak * (1.0 + zeta) + 2.0
            assert norm.upper_bound >= peak - 2.0
            assert energy.value > 0.0


@pytest.mark.parametrize("spread", [1e3, 1e8, 1e13])
def test_a_slow_pole_beside_a_fast_one_keeps_its_side(spread):
    assert bc.hinf_norm(control.ss(np.diag([1.0, -spread]), [[1.0], [1.0]], [[1.0, 1.0]], 0.0)).lower_bound == np.inf
    stable = bc.hinf_norm(control.ss(np.diag([-1.0, -spread]), [[1.0], [1.0]], [[1.0, 1.0]], 0.0))
    assert stable.certified
    assert stable.lower_bound == pytest.approx(1.0 + 1.0 / spread, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
@ON_AXIS
def test_what_only_rounding_decides_is_not_certified_finite(A, seed):
    """Turned, the mode lies on the axis to the last digit but not exactly, on one side or the other."""
    n = len(A)
    system = turned(beside(np.array(A), np.eye(n)[:, -1:], np.eye(n)[0]), seed)
    for norm in (bc.hinf_norm(system), bc.h2_norm(system)):
        assert norm.upper_bound == np.inf
        assert norm.value > 0.0
    hidden = turned(beside(np.array(A), np.zeros((n, 1)), np.eye(n)[0]), seed)
    norm = bc.hinf_norm(hidden)
    assert norm.lower_bound == np.inf or norm.upper_bound == np.inf or not norm.certified


@given(seed=st.integers(0, 10**6), dt=st.sampled_from([0.0, 0.1]))
@examples(100)
def test_sum_over_modes_bounds_gain_and_rounding(seed, dt):
    rng = np.random.default_rng(seed)
    n, m, p = int(rng.integers(1, 13)), *rng.integers(1, 4, 2)
    poles = -(10.0 ** rng.uniform(-3.0, 0.0, n)) + 1j * 10.0 ** rng.uniform(-1.0, 1.0, n) * rng.integers(0, 2, n)
    parts = [[[z.real, z.imag], [-z.imag, z.real]] if z.imag else [[z.real]] for z in poles]
    A = linalg.expm(linalg.block_diag(*parts) * dt) if dt else linalg.block_diag(*parts)
    T = rng.standard_normal((len(A), len(A))) + 2.0 * np.eye(len(A))
    B, C, D = rng.standard_normal((len(A), m)), rng.standard_normal((p, len(A))), rng.standard_normal((p, m))
    system = Lti(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), D, dt=dt)
    bounded = bounds(system)
    rates = system.rates
    omega = np.abs(rates.imag[:, None] + rates.real[:, None] * np.linspace(-3.0, 3.0, 25)).ravel()
    G = system.response(omega, quiet=True)
    assert singular_values(G)[0].max() <= bounded.norm
    # a thousand last places: what rounding of the response itself leaves does not count beside them
    off = 1e3 * CANCELLED
    moved = [M * (1.0 + off * rng.choice([-1.0, 1.0], M.shape)) for M in (system.A, system.B, system.C, system.D)]
    change = singular_values(Lti(*moved, dt=dt).response(omega, quiet=True) - G)[0].max()
    assert change <= 1.1e3 * bounded.error or bounded.error * 1e3 > 0.1 * bounded.norm


@pytest.mark.parametrize(("inputs", "outputs"), [(0, 1), (1, 0), (0, 0)])
def test_what_nothing_acts_on_or_reads_has_no_gain(inputs, outputs):
    A, B, C = np.array([[-1.0, 1.0], [0.0, -2.0]]), np.ones((2, inputs)), np.ones((outputs, 2))
    assert bounds(Lti(A, B, C, np.zeros((outputs, inputs)))) == Bounded(0.0, 0.0)


@given(seed=st.integers(0, 10**6), discrete=st.booleans())
@examples(200)
def test_discs_around_poles_detect_unstable_pole(seed, discrete):
    """Exact arithmetic says of the numbers as they are stored whether a pole lies beyond the boundary."""
    rng = np.random.default_rng(seed)
    side, omega = rng.choice([-1.0, 0.0, 1.0], 3, p=[0.7, 0.1, 0.2]), 10.0 ** rng.uniform(-1.0, 1.0, 3)
    A = linalg.block_diag(*(block(-s * 10.0 ** rng.uniform(-18.0, -1.0), w) for s, w in zip(side, omega, strict=True)))
    T = rng.standard_normal((6, 6)) * 10.0 ** rng.uniform(-1.0, 1.0, 6)
    A = T @ (linalg.expm(0.1 * A) if discrete else A) @ np.linalg.inv(T)
    system = Lti(A, rng.standard_normal((6, 1)), rng.standard_normal((1, 6)), np.zeros((1, 1)), dt=0.1 * discrete)
    poles = [complex(pole) for pole in Exact.of(control.ss(A, system.B, system.C, 0.0)).poles_in_rad()]
    growth = max(abs(pole) - 1.0 if discrete else pole.real for pole in poles)
    told = bounds(system).unstable
    assert growth > 0.0 or not told
    assert told or growth < 1e-9


def test_norm_of_many_states_with_mode_on_axis():
    """Above the states that exact arithmetic takes: only the slowest was looked at, and the norm said to be 0."""
    modes = linalg.block_diag(block(0.0), block(0.0, 3.0), np.diag(-np.arange(1.0, 41.0)))
    C = np.ones((1, 44))
    C[0, :2] = 0.0
    system = control.ss(modes, np.ones((44, 1)), C, 0.0)
    assert bc.hinf_norm(system).lower_bound == bc.h2_norm(system).value == np.inf
    assert bc.hinf_norm(system).peak_omega == pytest.approx(3.0)
