"""Controller reduction: the loop of the smaller controller, seen by others, keeps its norm."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.plants import assert_verified, resonators, weighed, yaw_plant


@pytest.fixture(scope="module")
def design():
    P = yaw_plant("stroke_anti")
    return P, bc.h_infinity(P, 1, 1)


def test_the_lowest_order_within_the_tolerance(design):
    P, full = design
    small = bc.reduce_controller(P, full.controller, max_degradation=0.05)
    assert small.order < full.controller.nstates / 2
    assert small.controller.nstates == small.order
    assert_verified(P, small.controller, small.gamma, small.norm_bounds.peak_omega)
    assert small.gamma <= 1.0501 * full.gamma
    assert_allclose(small.gamma_full, full.gamma, rtol=1e-5)
    assert small.controller.input_labels == ["stroke_anti"]
    assert small.closed_loop.input_labels == full.closed_loop.input_labels
    with pytest.raises(bc.exceptions.SynthesisError, match=f"order {small.order - 1}"):
        bc.reduce_controller(P, full.controller, order=small.order - 1)


@examples(60)
@given(seeds, st.sampled_from([0.0, 0.02]), st.integers(1, 5), st.sampled_from([0.0, 1e-14, 1e-9]))
def test_the_controller_itself_always_will_do(seed, dt, n, tolerance):
    """Whatever balancing costs: of random stable plants under small random controllers, also badly scaled ones."""
    rng = np.random.default_rng(seed)
    A, K = (rng.standard_normal((m, m)) for m in (3, n))
    A, K = (M - (np.linalg.eigvals(M).real.max() + rng.uniform(0.01, 1.0)) * np.eye(len(M)) for M in (A, K))
    if dt:
        A, K = (M / (1.1 * np.abs(np.linalg.eigvals(M)).max()) for M in (A, K))
    P = control.ss(A, rng.standard_normal((3, 3)), rng.standard_normal((3, 3)), np.diag([0.1, 0.2, 0.0]), dt)
    scale = 10.0 ** rng.uniform(-4.0, 4.0, n)
    K = K * scale[:, None] / scale
    controller = control.ss(
        K, 0.02 * rng.standard_normal((n, 1)) * scale[:, None], 0.02 * rng.standard_normal((1, n)) / scale, 0.0, dt
    )
    for order in (None, n):
        found = bc.reduce_controller(P, controller, order=order, max_degradation=tolerance)
        assert found.order <= n
        assert found.norm_bounds.upper_bound <= found.gamma_full * (1.0 + 1e-5 + tolerance)
        assert (np.diff(found.singular_values) <= 0.0).all()


def test_poles_too_fast_are_replaced_by_their_gain():
    P = weighed(resonators(3, 0.01, 3))
    K = bc.h_infinity(P, 1, 1).controller
    chain = control.series(K, control.ss([[-1e6]], [[1e3]], [[1e3]], [[0.0]]))
    small = bc.reduce_controller(P, chain, order=K.nstates, fastest_pole=1e5)
    assert small.fastest_pole <= 1e5
    assert_allclose(small.gamma, small.gamma_full, rtol=1e-2)


@pytest.mark.parametrize("order", [1, 2])
def test_states_that_do_nothing_within_the_loop_go_first(order):
    P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    K = control.ss(np.diag([-1.0, -2.0]), [[1.0], [0.0]], [[-0.1, 1.0]], 0.0)
    found = bc.reduce_controller(P, K, order=order)
    assert found.order == 1
    assert_allclose(found.gamma, found.gamma_full, rtol=1e-9)
