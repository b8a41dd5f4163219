"""LQG controllers: closed forms, optimality, separation, names, recovery of the regulator's loop."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.lti.system import of
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis.test_lqr import random_system, random_weight, variance

SUSPENSIONS = ("suspension_left", "suspension_right")
STROKES = ("stroke_left", "stroke_right")
TRACKS = {"actuator_left": 1e-3, "actuator_right": 1e-3}
TIPS = {"tip_left": 1.0, "tip_right": 1.0}


def generalized(system, Q, R, W, V):
    """The plant whose H2 norm squared is the LQG cost, written out with Cholesky factors."""
    n, m, p = system.nstates, system.ninputs, system.noutputs
    q, r, w, v = linalg.cholesky(Q), linalg.cholesky(R), linalg.cholesky(W).T, linalg.cholesky(V).T
    B = np.hstack([w, np.zeros((n, p)), system.B])
    C = np.vstack([q, np.zeros((m, n)), system.C])
    D = np.zeros((n + m + p, n + p + m))
    D[n : n + m, n + p :], D[n + m :, n : n + p], D[n + m :, n + p :] = r, v, system.D
    return control.ss(system.A, B, C, D)


def problem(seed, dt=0.0):
    system = random_system(seed, dt=dt)
    return system, random_weight(seed, 5), random_weight(seed + 1, 2), random_weight(seed + 2, 5), np.diag([0.5, 2.0])


@given(st.floats(1e-2, 1e2), st.floats(1e-2, 1e2), st.floats(1e-2, 1e2), st.floats(1e-2, 1e2))
def test_an_integrator_in_closed_form(q, r, w, v):
    tank = control.ss([[0.0]], [[1.0]], [[1.0]], 0, inputs="flow", outputs="level")
    design = bc.lqg(tank, q, r, w, v)
    x, y, f = np.sqrt(q * r), np.sqrt(w * v), np.sqrt(q / r)
    assert design.cost == pytest.approx(x * w + r * f**2 * y, rel=1e-8)
    assert pytest.approx(-f - np.sqrt(w / v)) == design.controller.A
    assert design.controller(0.0) == pytest.approx(-f * np.sqrt(w / v) / (f + np.sqrt(w / v)))


@pytest.mark.parametrize("dt", [0.0, 0.1])
@given(seed=seeds)
@examples(60)
def test_lqg_cost_is_variance_of_loop_and_no_gain_costs_less(dt, seed):
    """Poles are those of regulator and filter; in continuous time H2 synthesis reaches the same cost."""
    system, Q, R, W, V = problem(seed, dt)
    design, rng = bc.lqg(system, Q, R, W, V), np.random.default_rng(seed)
    K, costs = design.controller, []
    for size in (0.0, 1e-2, 1e-2, 1e-2):
        gain = K.C + size * np.abs(K.C).max() * rng.standard_normal(K.C.shape)
        loop = np.block([[system.A, system.B @ gain], [K.B @ system.C, K.A + K.B @ system.D @ gain]])
        P = variance(loop, linalg.block_diag(W, K.B @ V @ K.B.T), dt)
        costs.append(np.inf if P is None else np.trace(Q @ P[:5, :5]) + np.trace(R @ gain @ P[5:, 5:] @ gain.T))
        if size == 0.0:
            regulator, estimator = system.A - system.B @ design.regulator_gain, system.A - design.filter_gain @ system.C
            poles = np.linalg.eigvals(linalg.block_diag(regulator, estimator))
            assert np.poly(np.linalg.eigvals(loop)) == pytest.approx(np.poly(poles), rel=1e-6, abs=1e-6)
    assert design.cost == pytest.approx(costs[0], rel=1e-6)
    assert min(costs[1:]) >= design.cost * (1.0 - 1e-9)
    assert dt == K.dt
    if not dt:
        assert design.certificate.norm_bounds.certified
        assert design.certificate.lower_bound**2 == pytest.approx(design.cost, rel=1e-6)
        assert bc.h2(generalized(system, Q, R, W, V), 2, 2).norm ** 2 == pytest.approx(design.cost, rel=1e-6)


@given(seeds)
@examples(40)
def test_lqg_with_feedthrough(seed):
    rng = np.random.default_rng(seed)
    system, Q, R, W, V = problem(seed)
    fed = control.ss(system.A, system.B, system.C, rng.standard_normal((2, 2)))
    plain, design = bc.lqg(system, Q, R, W, V), bc.lqg(fed, Q, R, W, V)
    assert design.cost == pytest.approx(plain.cost, rel=1e-6)


def test_the_closed_loop_is_the_plant_joined_with_the_controller():
    model = bc.spray_boom(elements=6, accelerometer_bandwidth_hz=50.0)
    measured = (*STROKES, "tip_left_acceleration", "tip_right_acceleration")
    design = bc.lqg(model, None, 1e-7, TRACKS, 1e-6, measured, SUSPENSIONS, output_weight=TIPS)
    whole = control.interconnect(
        [model.to_statespace(), design.controller],
        inputs=["actuator_left", "actuator_right", "cradle"],
        outputs=list(model.output_labels),
    )
    # states balanced: python-control's own evaluation keeps only six digits of a controller with gains of 1e5
    omega = np.array([0.5, 1.54, 17.5])
    expected = of(design.closed_loop).balanced().response(omega)
    assert of(whole).balanced().response(omega) == pytest.approx(expected, rel=1e-6, abs=1e-8)


def test_recovery_comes_nearer_with_every_step():
    jolt = bc.split_symmetric(bc.spray_boom(elements=6))[0]
    given = jolt, None, 1e-5, {"actuator_sym": 1e-3}, 1e-8, "stroke_sym", "suspension_sym"
    options = {"noise_intensities": [1.0, 1e3, 1e6, 1e9, 1e12], "omega_range": (0.3, 30.0)}
    found = bc.synthesis.loop_transfer_recovery(*given, **options, output_weight={"tip_sym": 1.0})
    assert len(found.zeros) == 0
    assert (np.diff(found.recovery_errors) < 0.0).all()
    assert found.recovery_errors[-1] < 0.04
    # a place from a force: the poles of the filter go out with the fourth root of the noise, and the error falls with it
    assert found.recovery_errors[-1] / found.recovery_errors[-2] == pytest.approx(1e3**-0.25, rel=0.3)
    plant, omega = jolt.to_statespace(), np.geomspace(0.3, 30.0, 2000)
    force, stroke = plant.B[:, [1]], plant.C[[1]]

    def through(A, B, C):
        return (C @ np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, B + 0j)).ravel()

    for design, error in zip(found.designs, found.recovery_errors, strict=True):
        K, target = design.controller, through(plant.A, force, design.regulator_gain)
        recovered = through(K.A, K.B, K.C) * through(plant.A, force, stroke)
        # the controller acts by ``u = K y``, the regulator by ``u = -F x``: the loops have opposite signs
        gap = np.abs(recovered / target + 1.0).max()
        assert gap * (1.0 - 1e-6) <= error <= 1.001 * gap  # the peak between the frequencies, too


def test_recovery_error_of_two_controls_by_its_definition():
    """Computed conjugate zeros of the regulator's loop differ by rounding, close to the peak."""
    A = np.array([[-1.0, 2.0, 0.0, 0.0], [-4.0, 0.9, -1.0, 1.0], [-1.0, -1.0, 0.0, 2.0], [1.0, 1.0, -24.0, 0.9]])
    B, C = (
        np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, -1.0]]),
        np.array([[0.0, 0.0, 2.0, 0.0], [0.0, 0.0, -2.0, 0.0]]),
    )
    options = {"noise_intensities": [1.0, 1e4], "omega_range": (0.05, 100.0)}
    found = bc.synthesis.loop_transfer_recovery(control.ss(A, B, C, 0.0), 1.0, 0.1, 0.1 * np.eye(4), 0.01, **options)
    s = 1j * np.geomspace(0.05, 100.0, 4000)
    states = control.ss(A, B, np.eye(4), 0.0)(s).transpose(2, 0, 1)
    for design, error in zip(found.designs, found.recovery_errors, strict=True):
        wanted, loop = design.regulator_gain @ states, -design.controller(s).transpose(2, 0, 1) @ C @ states
        gap = np.linalg.norm((loop - wanted) @ np.linalg.inv(wanted), 2, axis=(1, 2)).max()
        assert gap * (1.0 - 1e-8) <= error <= gap * (1.0 + 1e-4)


def test_recovery_incomplete_with_rhp_zero():
    system = control.ss([[0, 1], [-1, -0.2]], [[0], [1]], [[1.0, -0.5]], 0, inputs="u", outputs="y")  # zero at 2
    found = bc.synthesis.loop_transfer_recovery(
        system, np.diag([10.0, 1.0]), 1.0, 1.0, 1.0, noise_intensities=[1.0, 1e4, 1e8], omega_range=(0.1, 10.0)
    )
    assert found.zeros == pytest.approx([2.0])
    assert found.recovery_errors[-1] > 0.1


def test_a_loop_in_which_each_mode_stands_twice_has_its_norm():
    """Regulator and filter of a collocated chain are each other's dual: every pole is double, in a chain of two."""
    n = 30
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    w, V = np.linalg.eigh(K)
    w, B = np.sqrt(w), np.vstack([np.zeros((n, 1)), V[-1:].T])
    chain = control.ss(np.block([[np.zeros((n, n)), np.diag(w)], [-np.diag(w), -0.02 * np.diag(w)]]), B, B.T, 0.0)
    design = bc.lqg(chain, B @ B.T, 1.0, B @ B.T, 1.0)
    assert design.cost == pytest.approx(design.certificate.lower_bound**2, rel=1e-9)
    assert design.certificate.norm_bounds.verified
    assert "verified" in repr(design)


def test_noise_inputs_that_would_be_driven_too_are_warned_of():
    plant = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], 0.0, inputs=["push", "gust"], outputs="place")
    arguments = plant, None, 1.0, {"gust": 1.0}, 1.0
    with pytest.warns(UserWarning, match="drives all inputs, also those with process noise, gust"):
        both = bc.lqg(*arguments, output_weight={"place": 1.0})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = bc.lqg(*arguments, output_weight={"place": 1.0}, controls="push")
    assert both.controller.noutputs == 2
    assert one.controller.noutputs == 1
