"""Norms, singular values and modes of discrete systems: closed forms, dense grids, SLICOT, sums in many digits."""

import control
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.analysis import compare_sigma, h2_norm, hinf_norm, mode_table, sigma
from boomctl.analysis.norm import IN_MODES, NO_CROSSING, PROVED
from tests.profiles import examples
from tests.references import gains


def random_system(seed, lightest=6.0, scaled=4.0):
    """Return a stable discrete system, lightly damped and badly scaled more often than not."""
    rng = np.random.default_rng(seed)
    n, m, p = int(rng.integers(1, 9)), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    A = rng.standard_normal((n, n))
    A *= (1.0 - 10.0 ** rng.uniform(-lightest, -0.1)) / np.abs(np.linalg.eigvals(A)).max()
    scale = 10.0 ** rng.uniform(-scaled, scaled, n)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    D = rng.standard_normal((p, m)) * (seed % 2)
    return control.ss(A * scale[:, None] / scale, B * scale[:, None], C / scale, D, float(10.0 ** rng.uniform(-4, 1)))


@examples(300)
@given(st.integers(0, 100_000))
def test_the_norm_lies_above_a_dense_grid_and_is_attained(seed):
    system = random_system(seed)
    found = hinf_norm(system)
    assert found.certified
    assert found.method in (IN_MODES, NO_CROSSING, PROVED)
    poles = np.linalg.eigvals(system.A)
    at = np.abs(np.angle(poles)) / system.dt
    wide = np.abs(np.log(np.abs(poles))) / system.dt
    near = (at[:, None] + wide[:, None] * np.linspace(-3.0, 3.0, 61)).ravel()
    omega = np.concatenate(
        [np.linspace(0.0, np.pi / system.dt, 1001), near[(near >= 0.0) & (near <= np.pi / system.dt)]]
    )
    values = gains(system, omega)
    assert values.max() <= found.upper_bound * (1.0 + 1e-9)
    assert gains(system, np.array([found.peak_omega]))[0] == pytest.approx(found.lower_bound, rel=2e-5)
    assert values.max() >= found.lower_bound * 0.98


def test_poles_whose_image_rounding_hides_have_a_norm():
    """All poles are ``z = -1/2``, but coupled so strongly that ``A + 1`` has no inverse in floats."""
    n = 16
    A = 16.0 * np.triu(np.fromfunction(lambda i, k: -((-1.0) ** (i + k)), (n, n)), 1) - 0.5 * np.eye(n)
    found = hinf_norm(control.ss(A, np.eye(n)[:, -1:], np.eye(n)[:1], 0.0, 0.1))
    with mp.workdps(60):
        at_the_end = abs(mp.lu_solve(mp.matrix((-np.eye(n) - A).tolist()), mp.matrix(np.eye(n)[-1].tolist()))[0])
    assert found.certified
    assert found.lower_bound == pytest.approx(float(at_the_end), rel=1e-9)


@pytest.mark.parametrize("states", [3, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 4))])
def test_norm_at_nyquist_frequency_of_defective_system(states):
    for seed in range(40):
        rng = np.random.default_rng(seed)
        turned = np.linalg.qr(rng.standard_normal((states, states)))[0]
        B, C = rng.standard_normal((states, 1)), rng.standard_normal((1, states))
        apart = 10.0 ** rng.uniform(-8.0, -2.0)
        chain = np.diag(apart * np.arange(states) - 0.5) + np.eye(states, k=1)
        system = control.ss(turned @ chain @ turned.T, B, C, 0.0, 1.0)
        found = hinf_norm(system)
        assert found.certified
        assert found.lower_bound <= gains(system, np.array([found.peak_omega]))[0] * (1.0 + 1e-12)


ON_CIRCLE = control.ss([[1.0]], [[1.0]], [[1.0]], 0.0, 0.1)
STATIC = control.ss([], [], [], [[3.0, 4.0]], 0.1)


def delays(through):
    """Return five samples of delay beside a direct way."""
    return control.ss(np.eye(5, k=1), np.eye(5)[:, 4:], np.eye(5)[:1], through, 0.1)


def test_poles_on_the_circle_count_if_they_show():
    assert hinf_norm(ON_CIRCLE).lower_bound == h2_norm(ON_CIRCLE).value == np.inf
    at_the_end = hinf_norm(control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, 0.1))
    assert (at_the_end.lower_bound, at_the_end.method) == (np.inf, "a pole on the unit circle")
    assert at_the_end.peak_omega == pytest.approx(np.pi / 0.1)
    assert hinf_norm(control.ss([[-1.1]], [[1.0]], [[1.0]], 0.0, 0.1)).method == "an unstable pole"
    hidden = control.ss(np.diag([0.5, -1.0]), [[1.0], [0.0]], [[1.0, 1.0]], 0.0, 0.1)
    assert hinf_norm(hidden).lower_bound == pytest.approx(2.0)
    assert hinf_norm(hidden).certified
    assert h2_norm(hidden).value == pytest.approx(np.sqrt(1.0 / 0.75))


def test_norms_of_static_gains_and_delays_are_closed_forms():
    assert hinf_norm(STATIC).lower_bound == pytest.approx(5.0)
    assert h2_norm(STATIC).value == pytest.approx(5.0)
    assert h2_norm(control.ss([[0.5]], [[0.0]], [[1.0]], [[2.0]], 0.1)).value == pytest.approx(2.0)
    assert hinf_norm(delays(0.0)).lower_bound == pytest.approx(1.0)
    assert h2_norm(delays(2.0)).value == pytest.approx(5**0.5)


@examples(60)
@given(st.integers(0, 100_000))
def test_singular_values_end_at_half_the_sampling_rate(seed):
    system = random_system(seed, lightest=3.0)
    s = sigma(system)
    assert s.omega[-1] <= np.pi / system.dt
    assert s.sigma[0].max() <= s.certificate.upper_bound * (1.0 + 1e-9)
    if s.peak_omega >= s.omega[0]:
        assert s.sigma[0].max() >= s.peak * (1.0 - 1e-6)
    assert np.allclose(s.sigma[0], gains(system, s.omega), rtol=1e-6)
    assert s.stable


def test_comparison_of_continuous_and_sampled_system():
    slow = control.ss([[0.0, 1.0], [-4.0, -0.04]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    both = compare_sigma({"continuous": slow, "sampled": control.sample_system(slow, 0.2)})
    assert (both["continuous"].omega == both["sampled"].omega).all()
    assert "continuous: u[0] -> y[0], peak " in repr(both)
    assert both["sampled"].omega[-1] <= np.pi / 0.2
    assert both["sampled"].peak == pytest.approx(both["continuous"].peak, rel=0.1)


def test_modes_are_those_that_were_sampled():
    poles = [(-0.02 + 3.0j), (-0.5 + 7.0j)]
    A = linalg.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] for p in poles))
    slow = control.ss(A, np.ones((4, 1)), np.ones((1, 4)), 0.0, inputs="u", outputs="y")
    table, sampled = mode_table(slow), mode_table(control.sample_system(slow, 0.1))
    for row, other in zip(table.rows, sampled.rows, strict=True):
        assert other.pole == pytest.approx(row.pole)
        assert other.z == pytest.approx(np.exp(0.1 * row.pole))
        assert (row.z, row.damping_ratio) == (None, pytest.approx(other.damping_ratio))
    assert "z" in sampled.to_string().splitlines()[1].split()
    assert "<th>z</th>" in sampled._repr_html_()


def test_a_pole_at_zero_and_one_that_changes_sign_have_rates():
    table = mode_table(control.ss(np.diag([0.0, -0.5]), np.ones((2, 1)), np.ones((1, 2)), 0.0, 0.1))
    negative, dead = table.rows
    assert negative.pole == pytest.approx(np.log(0.5) / 0.1 + 1j * np.pi / 0.1)
    assert (dead.pole.real, dead.damping_ratio, dead.z) == (-np.inf, 1.0, 0.0)
    assert dead.modal_peaks == pytest.approx(np.ones((1, 1)))
