"""The bound of all orders: no controller is below it, and where synthesis takes the plant too, it is that of synthesis."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.progress import Deadline
from boomctl.synthesis.plants.partition import partition
from boomctl.tuning.full_order import full_order_bound
from tests.profiles import examples

ROUNDING = 1e-6  # relative: norms are certified to as much


def bound(P, nmeas, ncon):
    """Return the bound and what stands in for what; zero and the reason where there is none."""
    try:
        return full_order_bound(partition(P, nmeas, ncon), Deadline(20.0))
    except bc.exceptions.SynthesisError as error:
        return 0.0, str(error)


def plant(rng, n, nw, nmeas, noise=0.0, ncon=1, weight=1.0):
    """Return a random plant: all states and the control in ``z``, and noise on the measurements or none."""
    A = rng.normal(size=(n, n)) - 0.5 * np.eye(n)
    B = np.hstack([rng.normal(size=(n, nw)), np.zeros((n, nmeas)), rng.normal(size=(n, ncon))])
    C = np.vstack([np.eye(n), np.zeros((ncon, n)), rng.normal(size=(nmeas, n))])
    D = np.zeros((len(C), B.shape[1]))
    D[n : n + ncon, nw + nmeas :] = weight * np.eye(ncon)
    D[n + ncon :, nw : nw + nmeas] = noise * np.eye(nmeas)
    if not noise:
        kept = [*range(nw), *range(nw + nmeas, B.shape[1])]
        B, D = B[:, kept], D[:, kept]
    return control.ss(A, B, C, D)


def test_where_synthesis_takes_the_plant_it_is_that_of_synthesis():
    P = plant(np.random.default_rng(1), 3, 2, 1, noise=0.3)
    found, design = bound(P, 1, 1), bc.h_infinity(P, 1, 1)
    assert found[1] == ""
    assert found[0] == pytest.approx(design.certificate.lower_bound, rel=0.01)
    assert found[0] <= design.gamma


@pytest.mark.parametrize(("nw", "nmeas", "told"), [(3, 1, "rates"), (2, 2, "rates"), (1, 2, "the disturbances")])
def test_noise_free_measurements_are_limit(nw, nmeas, told):
    """Less noise is no harm, so that designs with little of it come down to the bound without; their own is above it."""
    rng = [np.random.default_rng(5) for _ in range(2)]
    exact = bound(plant(rng[0], 3, nw, nmeas), nmeas, 1)
    noisy = bc.h_infinity(plant(rng[1], 3, nw, nmeas, noise=1e-5), nmeas, 1)
    assert told in exact[1]
    assert exact[0] <= noisy.gamma
    assert exact[0] == pytest.approx(noisy.certificate.lower_bound, rel=0.02)


def test_weight_free_control_is_dual():
    P = plant(np.random.default_rng(3), 3, 2, 1, noise=0.3, weight=0.0)
    found = bound(P, 1, 1)
    dual = bound(control.ss(P.A.T, P.C.T, P.B.T, P.D.T), 1, 1)
    assert "controls" in found[1]
    assert "measurements" in dual[1]
    assert found[0] == pytest.approx(dual[0], rel=1e-3)


def test_a_zero_on_the_axis_is_seen_from_its_right():
    """The first state is a double integrator's position that nobody weighs: with enough patience it costs nothing."""
    A, B1, B2 = [[0.0, 1.0], [0.0, -1.0]], [[0.0, 0.0], [1.0, 0.0]], [[0.0], [1.0]]
    C, D = [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]]
    P = control.ss(A, np.hstack([B1, B2]), C, D)
    with pytest.raises(bc.exceptions.SynthesisError):
        bc.h_infinity(P, 1, 1)
    found = bound(P, 1, 1)
    assert "axis" in found[1]
    gains = (control.ss([], [], [], [[-gain]]) for gain in np.geomspace(1e-3, 1.0, 13))
    least = min(bc.hinf_norm(bc.lft(P, K)).upper_bound for K in gains)
    assert 0.3 < found[0] <= least * (1.0 + ROUNDING)


def test_what_no_one_can_stabilize_has_no_bound_and_a_reason():
    P = control.ss([[1.0]], [[1.0, 0.0]], [[1.0], [0.0], [1.0]], [[0, 0], [0, 1], [0.1, 0]])
    found = bound(P, 1, 1)
    assert found[0] == 0.0
    assert found[1]


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 3), st.integers(1, 2), st.sampled_from([0.0, 0.2]))
def test_no_stabilizing_controller_is_below_it(seed, n, nw, nmeas, noise):
    rng = np.random.default_rng(seed)
    P = plant(rng, n, nw, nmeas, noise)
    found = bound(P, nmeas, 1)
    for _ in range(20):
        order = int(rng.integers(0, 3))
        parts = (rng.normal(size=shape) for shape in [(order, order), (order, nmeas), (1, order), (1, nmeas)])
        loop = bc.lft(P, control.ss(*parts))
        if loop.poles().real.max(initial=-1.0) < 0.0:
            assert bc.hinf_norm(loop).upper_bound >= found[0] * (1.0 - ROUNDING)
