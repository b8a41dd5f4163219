"""Generalized plants: each channel against the product that it stands for, every name in its place."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import boomctl as bc
from tests.profiles import examples
from tests.synthesis.plants import yaw_plant

OMEGA = (0.3, 2.0, 11.0)


@pytest.fixture(scope="module")
def yaw():
    return bc.split_symmetric(bc.spray_boom(bc.BoomParameters()))[1]


WEIGHTS = (  # of disturbance, performance, effort and noise
    bc.synthesis.band_pass(0.05, 1.0, 20.0),
    bc.shelf(10.0, 1.0, 3.0),
    bc.shelf(1e-4, 1e-2, 60.0, order=2),
    bc.synthesis.high_pass(0.01, 5.0),
)


def weighed_yaw(plant, track, tip, effort, noise):
    weights = {"disturbances": {"actuator_anti": track}, "noise": {"stroke_anti": noise}}
    weights |= {"performance": {"tip_anti": tip}, "effort": {"suspension_anti": effort}}
    return yaw_plant("stroke_anti", plant=plant, **weights)


def test_names_and_states(yaw):
    P = weighed_yaw(yaw, *WEIGHTS)
    assert P.input_labels == ["w_actuator_anti", "n_stroke_anti", "suspension_anti"]
    assert P.output_labels == ["z_tip_anti", "z_suspension_anti", "stroke_anti"]
    assert P.nstates == 2 * yaw.ncoordinates + sum(weight.nstates for weight in WEIGHTS)
    assert "w_actuator_anti[1]" in P.state_labels
    assert "mode1.x1" in P.state_labels
    assert bc.synthesis.select_channels(P, "suspension_anti", "stroke_anti").output_labels == ["stroke_anti"]


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("omega", OMEGA)
def test_channels_are_products(yaw, dt, omega):
    """Of a sampled plant with weights that are sampled by the trapezoidal rule."""
    plant = bc.analysis.sample_plant(yaw, dt, "suspension_anti", delay=0.04) if dt else yaw.to_statespace()
    at = np.exp(1j * omega * dt) if dt else 1j * omega
    s = 2.0 / dt * (at - 1.0) / (at + 1.0) if dt else at
    track, tip, effort, noise = (weight(s) for weight in WEIGHTS)
    G = plant(at)  # rows: tip, stroke; columns: actuator, suspension
    expected = np.array(
        [[tip * G[0, 0] * track, 0.0, tip * G[0, 1]], [0.0, 0.0, effort], [G[1, 0] * track, noise, G[1, 1]]]
    )
    for weights in (WEIGHTS, [control.sample_system(weight, dt, "tustin") for weight in WEIGHTS] if dt else WEIGHTS):
        P = weighed_yaw(plant, *weights)
        assert P.dt == dt
        assert_allclose(P(at), expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
    part = bc.synthesis.select_channels(plant, "suspension_anti", "stroke_anti")
    assert bc.mixed_sensitivity(part, W1=bc.shelf(10.0, 0.5, 1.0), W2=0.1).dt == part.dt == dt


@examples(20)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 6), k=st.integers(0, 3), omega=st.floats(0.1, 30.0))
def test_lft_is_the_fractional_transformation(seed, n, k, omega):
    rng = np.random.default_rng(seed)
    P = control.ss(*(rng.normal(size=shape) for shape in ((n, n), (n, 4), (5, n), (5, 4))))
    K = control.ss(*(rng.normal(size=shape) for shape in ((k, k), (k, 2), (1, k), (1, 2))))
    p, c = P(1j * omega), np.atleast_2d(K(1j * omega))
    expected = p[:3, :3] + p[:3, 3:] @ np.linalg.solve(np.eye(1) - c @ p[3:, 3:], c @ p[3:, :3])
    loop = bc.lft(P, K)
    assert loop.input_labels == P.input_labels[:3]
    assert loop.output_labels == P.output_labels[:3]
    assert_allclose(loop(1j * omega), expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())


def test_lft_finds_signals_by_name():
    P = control.rss(3, 4, 3, strictly_proper=True)
    P = control.ss(P.A, P.B, P.C, P.D, inputs=["w", "u", "v"], outputs=["z", "a", "b", "c"])
    K = control.ss([], [], [], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], inputs=["c", "a", "b"], outputs=["v", "u"])
    straight = control.ss([], [], [], [[5.0, 6.0, 4.0], [2.0, 3.0, 1.0]], inputs=["a", "b", "c"], outputs=["u", "v"])
    assert_allclose(bc.lft(P, K)(1j), bc.lft(P, straight)(1j))


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_do_not_make_a_loop_ill_posed(unit):
    """The controls of very different units, the measurements likewise: the loop is the same."""
    D22, gains = np.array([[0.5, 0.7], [-0.3, 0.4]]), np.array([[0.2, 0.5], [-0.5, 0.3]])
    controls, measurements = np.array([1.0, unit]), np.array([unit, 1.0])
    B, C = np.concatenate([[1.0], controls]), np.concatenate([[1.0], measurements])
    D = np.zeros((3, 3))
    D[1:, 1:] = measurements[:, None] * D22 * controls
    P = control.ss([[-1.0]], B[None, :], C[:, None], D)
    loop = bc.lft(P, control.ss([], [], [], gains / np.outer(controls, measurements)))
    expected = -1.0 + np.ones(2) @ np.linalg.solve(np.eye(2) - gains @ D22, gains @ np.ones(2))
    assert_allclose(loop.A, expected, rtol=1e-9)


def test_mixed_sensitivity_stacks_the_weighted_functions():
    G = control.ss([[-1.0, 0.3], [0.0, -2.0]], np.eye(2), np.eye(2), 0.0, inputs=["u1", "u2"], outputs=["y1", "y2"])
    W1, W3 = bc.shelf(50.0, 0.5, 1.0), bc.synthesis.high_pass(2.0, 20.0)
    P = bc.mixed_sensitivity(G, W1, 0.1, W3)
    assert P.output_labels[:2] == ["z_error_y1", "z_error_y2"]
    assert P.output_labels[-2:] == ["error_y1", "error_y2"]
    assert P.input_labels == ["r_y1", "r_y2", "u1", "u2"]
    assert P.nstates == 2 + 2 * W1.nstates + 2 * W3.nstates
    design, s = bc.h_infinity(P, 2, 2), 0.7j
    g, k = G(s), design.controller(s)
    S = np.linalg.inv(np.eye(2) + g @ k)
    expected = np.vstack([W1(s) * S, 0.1 * k @ S, W3(s) * g @ k @ S])
    assert_allclose(design.closed_loop(s), expected, rtol=1e-6, atol=1e-8)


def test_names_tell_measurements_and_controls():
    P = yaw_plant("stroke_anti")
    told = bc.h_infinity(P)
    assert told.gamma == bc.h_infinity(P, nmeas=1, ncon=1).gamma
    assert bc.synthesis.h2(P).optimal_norm == bc.synthesis.h2(P, 1, 1).optimal_norm
    tuned = bc.tune(P, structure=bc.tunable.gain(), n_starts=1)
    assert tuned.gamma == bc.tune(P, 1, 1, bc.tunable.gain(), n_starts=1).gamma
    lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    assert bc.h_infinity(bc.mixed_sensitivity(lag, W1=bc.shelf(100.0, 0.5, corner=1.0), W2=0.1)).gamma < 0.93
