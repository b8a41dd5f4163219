"""Sampled controllers: closed forms, names, the responses they keep, rates that are too low."""

import control
import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.test_lqr import random_system


@given(seeds, st.floats(1e-4, 1e-1))
def test_tustin_response_on_warped_axis(seed, sample_time):
    controller = random_system(seed, unstable=False)
    digital = bc.discretize(controller, sample_time)
    for w in (0.1, 1.0, 3.0):
        warped = 2.0 / sample_time * np.tan(0.5 * w * sample_time)
        assert digital(np.exp(1j * w * sample_time)) == pytest.approx(controller(1j * warped), rel=1e-6)


@pytest.mark.parametrize("method", ["tustin", "zoh"])
@given(seed=seeds)
@examples(60)
def test_discretize_integrators_matches_arb(method, seed):
    """Integrators and lags from a transfer function, states in units from 1e-6 to 1e6: the pulse response."""
    rng = np.random.default_rng(seed)
    den = np.r_[1.0, np.zeros(rng.integers(2, 5))]
    for rate in 10.0 ** rng.uniform(-1, 2, rng.integers(0, 3)):
        den = np.polymul(den, [1.0, rate])
    plain = control.ss(control.tf(rng.standard_normal(2), den))
    scale, ctx.prec = 10.0 ** rng.uniform(-6, 6, plain.nstates), 600
    K = control.ss(plain.A * scale[:, None] / scale, plain.B * scale[:, None], plain.C / scale, 0.0)
    h, n = 0.5 / max(1.0, np.abs(K.poles()).max()), K.nstates
    X, B, C = (arb_mat([[arb(x) for x in row] for row in np.asarray(M).tolist()]) for M in (K.A, K.B, K.C))
    X, unit = X * arb(h), arb_mat([[int(i == j) for j in range(n)] for i in range(n)])
    if method == "tustin":
        inverse = (unit - X * arb(0.5)).inv()
        A, B, C = inverse * (unit + X * arb(0.5)), inverse * B * arb(h), C * inverse
    else:
        big = arb_mat([[*(X[i, j] for j in range(n)), B[i, 0] * arb(h)] for i in range(n)] + [[0] * (n + 1)]).exp()
        A, B = arb_mat([[big[i, j] for j in range(n)] for i in range(n)]), arb_mat([[big[i, n]] for i in range(n)])
    digital, exact, values = bc.discretize(K, h, method), [], []
    x = digital.B[:, 0]
    for _ in range(60):
        values.append(float(digital.C[0] @ x))
        exact.append(float((C * B)[0, 0].mid()))
        x, B = digital.A @ x, A * B
    np.testing.assert_allclose(values, exact, atol=1e-11 * np.abs(exact).max())


@pytest.mark.parametrize("method", ["tustin", "zoh"])
def test_names_and_stability_survive(method):
    gain = control.ss([], [], [], [[1.0, -2.0]], inputs=["a", "b"], outputs="u")
    for controller in (random_system(5, unstable=False), gain):
        digital = bc.discretize(controller, 0.01, method)
        for kind in ("input_labels", "output_labels", "state_labels"):
            assert getattr(digital, kind) == getattr(controller, kind)
        assert digital.dt == 0.01
        assert np.abs(digital.poles()).max(initial=0.0) < 1.0
    assert pytest.approx(gain.D) == digital.D


def test_a_frequency_may_be_kept_exactly():
    controller = random_system(6, unstable=False)
    digital = bc.discretize(controller, 0.05, prewarp_omega=6.0)
    assert digital(np.exp(1j * 6.0 * 0.05)) == pytest.approx(controller(6.0j), rel=1e-9)
    assert np.abs(digital(np.exp(1j * 3.0 * 0.05)) - controller(3.0j)).max() > 1e-6


def test_a_rate_too_low_for_a_pole_names_both():
    fast = control.ss([[-3.0, 0.0], [0.0, -2000.0]], [[1], [1]], [[1, 1]], 0)
    words = (
        r"`sample_time` must be at most 0.000785\S* s \(.* pole at -2000\S* rad/s\), got 0.001 s.*fastest_pole=1571\)"
    )
    with pytest.raises(ValueError, match=words):
        bc.discretize(fast, 1e-3)
    assert bc.discretize(control.ss([[-1570.0]], [[1.0]], [[1.0]], 0), 1e-3).nstates == 1
    assert bc.discretize(fast, 1e-3, samples_per_period=2.0).nstates == 2
    assert bc.discretize(fast, 1.0 / 1274.0).nstates == 2


def test_tustin_pole_at_infinity_raises():
    unstable = control.ss([[20.0]], [[1.0]], [[1.0]], 0.0)
    with pytest.raises(ValueError, match="`sample_time` must not put the controller's unstable pole"):
        bc.discretize(unstable, 0.1, samples_per_period=2.0)
    assert bc.discretize(unstable, 0.1, "zoh", samples_per_period=2.0).nstates == 1
