"""Reduced systems: laws that hold for every method, and refusals."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.structure import SecondOrderModel
from tests.hard_systems import modes
from tests.references import state_space_response
from tests.refusals import assert_refused, refusals
from tests.strategies import seeds

METHODS = ("balanced", "singular-perturbation", "hankel", "modal")
GRID = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 600)])


def stable_system(seed, most=12, inputs=2, outputs=3):
    """Return a random stable system of oscillators (damping 1e-4 to 0.5) and lags, mixed by a random congruence."""
    rng = np.random.default_rng(seed)
    n = 2 * int(rng.integers(3, most // 2 + 1))
    A = modes(rng, n // 2 - 1, 2, damping=(-4.0, -0.3))
    T = np.linalg.qr(rng.standard_normal((n, n)))[0] * rng.uniform(0.5, 2.0, n)
    B, C = rng.standard_normal((n, inputs)), rng.standard_normal((outputs, n))
    D = rng.standard_normal((outputs, inputs))
    names = {"inputs": [f"force{i}" for i in range(inputs)], "outputs": [f"place{i}" for i in range(outputs)]}
    return control.ss(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), D, **names)


def response(system, omega=GRID):
    """Return the response from the matrices by numpy: outputs, inputs, frequencies."""
    if isinstance(system, SecondOrderModel):
        system = system.to_statespace()
    return state_space_response(system, omega)


def gap(full, reduced, omega=GRID):
    """Return the largest singular values of the difference by numpy."""
    return np.linalg.norm(response(full, omega) - response(reduced, omega), 2, axis=(0, 1))


def test_methods_exact_at_dc_or_infinity():
    full = stable_system(3)
    at_rest = full.C @ np.linalg.solve(-full.A, full.B) + full.D
    for method in ("singular-perturbation", "modal"):
        small = bc.reduce(full, order=4, method=method).system
        assert small.C @ np.linalg.solve(-small.A, small.B) + small.D == pytest.approx(at_rest, abs=1e-8)
    truncated = bc.reduce(full, order=4).system
    np.testing.assert_allclose(truncated.D, full.D)


@given(seeds, st.sampled_from(METHODS))
def test_unstable_and_rigid_parts_are_kept_exactly(seed, method):
    stable = stable_system(seed, inputs=1, outputs=1)
    rigid = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[2.0, 0.0]], 0.0)
    unstable = control.ss([[0.5]], [[1.0]], [[-1.0]], 0.0)
    full = stable + rigid + unstable
    red = bc.reduce(full, order=7, method=method)
    assert red.retained_order == 3
    assert red.order <= 7
    poles = red.system.poles()
    assert np.sort(np.abs(poles - 0.5))[0] < 1e-8
    assert np.sort(np.abs(poles))[:2].max() < 1e-5
    omega = np.geomspace(0.05, 1e3, 400)
    assert gap(full, red.system, omega).max() <= red.error_norm * (1 + 1e-5) + 1e-7
    slow = 1e-4  # the double integrator dominates
    assert response(red.system, np.array([slow])).ravel()[0] == pytest.approx(-2.0 / slow**2, rel=1e-5)
    with pytest.raises(ValueError, match="3 unstable, undamped or rigid-body states are kept"):
        bc.reduce(full, order=2, method=method)


@given(seeds, st.sampled_from(METHODS))
def test_units_and_the_order_of_states_and_signals_do_not_matter(seed, method):
    full = stable_system(seed)
    red = bc.reduce(full, order=4, method=method)
    rng = np.random.default_rng(seed)
    states, ins, outs = rng.permutation(full.nstates), rng.permutation(2), rng.permutation(3)
    units = 10.0 ** rng.uniform(-3, 3, full.nstates)
    A = (full.A * units[None, :] / units[:, None])[np.ix_(states, states)]
    B, C = (full.B / units[:, None])[np.ix_(states, ins)], (full.C * units)[np.ix_(outs, states)]
    other = bc.reduce(control.ss(A, 1e3 * B, C, 1e3 * full.D[np.ix_(outs, ins)]), order=4, method=method)
    assert other.error_norm == pytest.approx(1e3 * red.error_norm, rel=1e-4)
    expected = 1e3 * response(red.system)[np.ix_(outs, ins)]
    assert response(other.system) == pytest.approx(expected, abs=1e-4 * 1e3 * red.error_norm)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("elements", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_the_boom_keeps_its_response_and_its_names(method, elements):
    model = bc.spray_boom(elements=elements).select(ACTUATORS, TIPS)
    red = bc.reduce(model, order=10, method=method)
    assert tuple(red.system.input_labels) == ACTUATORS
    assert tuple(red.system.output_labels) == TIPS
    shown = gap(model, red.system, bc.sigma(model).omega[::4])
    assert shown.max() <= red.error_norm * (1 + 1e-4)
    assert shown.max() >= 0.9 * red.error_norm
    assert red.certificate.lower_bound <= red.error_bound


def test_hankel_error_is_smallest_in_hankel_norm_alone():
    """The Hankel norm of the error is never larger than that of balanced truncation, the H-infinity norm is sometimes."""
    larger = 0
    for seed in range(8):
        full = stable_system(seed, most=6)
        one, two = (bc.reduce(full, 2, method) for method in ("hankel", "balanced"))
        norms = [bc.reduce(full - red.system, 0).hankel_singular_values[0] for red in (one, two)]
        assert norms[0] <= norms[1] * (1.0 + 1e-6)
        assert norms[0] == pytest.approx(one.hankel_singular_values[2], rel=1e-5)
        larger += one.error_norm > two.error_norm * (1.0 + 1e-3)
    assert larger


def test_repr_with_omega_range_names_range_and_unit():
    full = control.ss(np.diag([-1.0, -30.0]), np.ones((2, 1)), [[1.0, 40.0]], 0.0, inputs="u", outputs="y")
    plain, ranged = (bc.reduce(full, 1, omega_range=limits) for limits in (None, (20.0, 62.5)))
    assert ranged.omega_range == (20.0, 62.5)
    assert "rad/s" not in repr(plain)
    bounds = f"error at most {ranged.error_norm:.6g} from 20 to 62.5 rad/s, verified; a priori bound {ranged.error_bound:.6g}"
    assert f"{bounds} at all frequencies" in repr(ranged)
    everywhere = gap(full, ranged.system, np.geomspace(1e-3, 1e4, 2000)).max()
    assert ranged.error_norm < 0.9 * everywhere < 0.9 * ranged.error_bound


def reduced(system=None, **options):
    return bc.reduce(stable_system(1) if system is None else system, **options)


REFUSED = r"""
reduced(order=13) -> has only
reduced() -> exactly one
reduced(order=2, max_error=0.1) -> exactly one
reduced(order=2, method="balancd") -> did you mean 'balanced'
reduced(order=2, omega_range=(3.0, 1.0)) -> ascending
reduced(order=2, omega_range=(1.0, 2.0, 3.0)) -> two nonnegative numbers
reduced(order=2, omega_range=(1.0, 2.0), method="hankel") -> ^`omega_range` must be None for method 'hankel'
reduced(order=2, method="second-order") -> SecondOrderModel
reduced(bc.spray_boom(elements=6), order=5, method="second-order") -> even number
reduced(control.ss(0.5, 1.0, 1.0, 0.0, 0.1), order=1, omega_range=(1.0, 100.0))
    -> ^`omega_range` must end at or below half the sampling rate
reduced(order=2, progress=True) -> progress = .*: expected a function of a Progress, or None
bc.progress_callback("yes").__enter__() -> listener = .*: expected a function
"""


@refusals(REFUSED)
def test_arguments_that_do_not_fit_are_refused_in_one_line(call, words):
    assert_refused(call, words, globals())


@pytest.mark.parametrize("method", METHODS)
def test_of_an_error_below_rounding_the_system_itself_comes_back(method):
    full = stable_system(2)
    found = bc.reduce(full, max_error=1e-16, method=method)
    assert found.order == full.nstates
    assert found.error_norm == found.error_bound == 0.0
    assert found.stages[-1] == "the system itself"
    assert np.array_equal(found.system.A, full.A)
