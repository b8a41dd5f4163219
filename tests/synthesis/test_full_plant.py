"""Designs on a reduced plant: what is said of the full one is true, and said where it matters."""

import copy
import pickle
import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import linalg

import boomctl as bc
from boomctl.exceptions import ReductionError
from boomctl.lti.system import of
from boomctl.synthesis.plants import full_plant
from tests.profiles import examples

SCALES = {"actuator_anti": 0.03, "suspension_anti": 150.0, "tip_anti": 0.2, "stroke_anti": 0.05}
SCALES["tip_acceleration_anti"] = 1.0
SISO = {"performance": {"y[0]": 1.0}, "effort": {"u[1]": 0.3}, "noise": {"y[1]": 0.3}}
SISO |= {"disturbances": {"u[0]": 1.0}, "measurements": "y[1]", "controls": "u[1]"}


@pytest.fixture(scope="module")
def full():
    _, yaw = bc.split_symmetric(bc.spray_boom(elements=12, accelerometer_bandwidth_hz=20.0))
    return bc.scale_signals(yaw, SCALES)


def generalized(plant):
    return bc.generalized_plant(
        plant,
        disturbances={"actuator_anti": bc.low_pass(1.0, 2.0), "suspension_anti": 0.05},
        performance={"tip_anti": 1.0, "stroke_anti": 2.0},
        effort={"suspension_anti": bc.shelf(2.0, 7200.0, 39.0, order=2)},
        noise={"stroke_anti": 0.02, "tip_acceleration_anti": 1.5},
        measurements=["stroke_anti", "tip_acceleration_anti"],
        controls=["suspension_anti"],
    )


def slowest_on(full, K):
    """Return the largest real part of the poles of ``u = K y``, by python-control alone."""
    G = bc.synthesis.select_channels(full, K.output_labels, K.input_labels)
    return control.feedback(G, K, sign=1).poles().real.max()


def design(P, nmeas=2):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = bc.h_infinity(P, nmeas, 1)
    return found, [str(one.message) for one in said if issubclass(one.category, bc.exceptions.ReductionWarning)]


@pytest.mark.filterwarnings("ignore::boomctl.exceptions.ReductionWarning")
@pytest.mark.parametrize(("order", "stable", "worse"), [(2, False, True), (4, True, True), (16, True, False)])
def test_design_on_reduction_says_what_becomes_of_the_full_loop(full, order, stable, worse):
    """It is certified there, and warned of where it is unstable or worse."""
    found, said = design(generalized(bc.reduce(full, order=order)))
    proof, slowest = found.certificate.full_plant, slowest_on(full, found.scaled_controller)
    assert proof.stable is stable
    assert (slowest < 0.0) == stable
    assert_allclose(proof.spectral_abscissa, slowest, rtol=1e-6)
    if stable:
        loop = generalized(full).lft(found.scaled_controller)
        assert_allclose(proof.norm_bounds.lower_bound, control.norm(loop, "inf"), rtol=1e-3)
        assert "; its norm " in proof.summary
    assert (proof.norm_bounds.lower_bound > 1.1 * found.gamma) == worse
    assert len(said) == worse
    assert not worse or (f"{proof.norm_bounds.upper_bound:.6g}" if stable else "UNSTABLE") in said[0]
    for text in (repr(found), repr(found.certificate)):
        assert stable == ("UNSTABLE" not in text)


def test_inaccurate_reduction_warns_before_design(full):
    with pytest.warns(bc.exceptions.ReductionWarning, match="from controls to measurements") as said:
        generalized(bc.reduce(full, order=2))
    assert said[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        generalized(bc.reduce(full, order=12))


def test_generalized_plant_of_reduction(full):
    small = bc.reduce(full, order=16)
    P, plain = generalized(small), generalized(small.system)
    for letter in "ABCD":
        np.testing.assert_array_equal(getattr(P, letter), getattr(plain, letter))
    assert P.input_labels == plain.input_labels
    assert full_plant.origin_of(plain) is None
    for other in (P, pickle.loads(pickle.dumps(P)), copy.deepcopy(P)):
        origin = full_plant.origin_of(other)
        assert origin.reduction.error_norm == small.error_norm
        np.testing.assert_array_equal(origin.around(of(full)).A, generalized(full).A)


def test_reduced_plants_of_other_kinds_know_the_full_one(full):
    """A reduction of a generalized plant, and the mixed sensitivity of a reduction."""
    lag = control.ss(control.tf([400.0], np.polymul([1.0, 1.0], [1.0, 0.8, 400.0])), inputs="u", outputs="y")
    weights = {"W1": bc.low_pass(4.0, 0.5), "W2": 0.1}
    whole, other = generalized(full), bc.mixed_sensitivity(lag, **weights)
    for P, around, plant, nmeas in (
        (bc.reduce(whole, order=20), whole, whole, 2),
        (bc.mixed_sensitivity(bc.reduce(lag, order=1), **weights), other, lag, 1),
    ):
        found, said = design(P, nmeas)
        proof = found.certificate.full_plant
        assert proof.stable == bool(around.lft(found.scaled_controller).poles().real.max() < 0.0)
        assert f"the full plant of {plant.nstates} states" in proof.summary
        assert bool(said) == (not proof.stable or proof.norm_bounds.upper_bound > 1.1 * found.gamma)
    assert said


@pytest.mark.slow
def test_large_full_plant_uses_small_gain(monkeypatch, full):
    monkeypatch.setattr(full_plant, "_MAX_POLES", 0)
    found, said = design(generalized(bc.reduce(full, order=12)))
    told = found.certificate.full_plant
    assert told.stable is None
    assert told.small_gain >= 1.0
    assert "not proved" in said[0]
    near, said = design(generalized(bc.reduce(full, max_error=1e-4)))
    assert near.certificate.full_plant.stable
    assert (found.success, near.success) == (False, True)
    assert near.certificate.full_plant.small_gain < 1.0
    assert not said


@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.integers(1, 5), st.booleans())
@examples(60)
def test_what_is_said_of_the_full_plant_is_true(seed, states, kept, banded):
    """Random plants, unstable ones among them: neither way of telling ever contradicts the poles of the full loop."""
    rng = np.random.default_rng(seed)
    spread = np.exp(rng.uniform(-2.0, 3.0, size=states))
    A = linalg.block_diag(*(-spread * rng.uniform(0.02, 1.0))) + np.triu(rng.normal(size=(states, states)), 1)
    A[0, 0] *= rng.choice([-1.0, 1.0])
    sizes = rng.uniform(0.05, 1.0, size=states)
    plant = control.ss(A, rng.normal(size=(states, 2)) * sizes[:, None], rng.normal(size=(2, states)), 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        order = min(max(kept, int((A.diagonal() > 0.0).sum())), states)
        try:
            small = bc.reduce(plant, order=order, omega_range=(0.0, 30.0) if banded else None)
        except (ReductionError, ValueError):  # refused: a band that the plant does not show itself in
            return
        P = bc.generalized_plant(small, **SISO)
        try:
            found = bc.h_infinity(P, 1, 1)
        except bc.exceptions.SynthesisError:
            return
    told = found.certificate.full_plant
    slowest = slowest_on(plant, found.scaled_controller)
    if told.stable is not None:
        assert told.stable == (slowest < 0.0)
    if told.small_gain < 1.0:
        assert slowest < 0.0
    if told.norm_bounds.certified:
        whole = bc.lft(full_plant_of(P), found.scaled_controller)
        assert_allclose(bc.hinf_norm(whole).lower_bound, told.norm_bounds.lower_bound, rtol=1e-4)


def cost_on(plant, K, weights, noise):
    """Return the expected ``y^T W y + u^T R u`` at rest of ``u[1] = K y[1]``, by a Lyapunov equation."""
    W, R, intensity, V, q = *weights, *noise
    A, B, C, D, n = plant.A, plant.B[:, 1:], plant.C, plant.D[:, 1:], plant.nstates
    loop = np.block([[A, B @ K.C], [K.B @ C[1:], K.A + K.B @ D[1:] @ K.C]])
    roots = np.sqrt([intensity, V, q])
    states, measured = np.hstack([plant.B[:, :1], np.zeros((n, 1)), B]), np.array([[plant.D[1, 0], 1.0, D[1, 0]]])
    entering = np.vstack([states, K.B @ measured]) * roots
    poles = np.linalg.eigvals(loop)
    if (poles.real.max() if plant.dt == 0.0 else np.abs(poles).max() - 1.0) >= 0.0:
        return np.inf
    solve = linalg.solve_continuous_lyapunov if plant.dt == 0.0 else linalg.solve_discrete_lyapunov
    covariance = solve(loop, entering @ entering.T * (-1.0 if plant.dt == 0.0 else 1.0))
    y, u = np.hstack([C, D @ K.C]), np.hstack([np.zeros((1, n)), K.C])
    return float(np.trace(W * y @ covariance @ y.T) + R * (u @ covariance @ u.T)[0, 0])


@pytest.mark.parametrize("sampled", [False, True])
@given(seed=st.integers(0, 2**32 - 1))
@examples(120)
def test_cost_and_h2_norm_on_full_plant_equal_lyapunov(sampled, seed):
    rng = np.random.default_rng(seed)
    states, kept = int(rng.integers(3, 9)), int(rng.integers(1, 6))
    rates, frequencies = np.exp(rng.uniform(-1.0, 1.5, states)), rng.uniform(0.5, 8.0, states // 2)
    A = np.diag(-rates)
    for i, omega in enumerate(frequencies):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[-0.1 * omega, omega], [-omega, -0.1 * omega]]
    B, C = rng.normal(size=(states, 2)), rng.normal(size=(2, states)) * rng.uniform(0.02, 1.0, states)
    D = 0.1 * rng.normal(size=(2, 2)) * [[0.0, 1.0], [1.0, 1.0]]
    plant = control.ss(A, B, C, D)
    plant = control.sample_system(plant, 0.1) if sampled else plant
    weights, noise = np.exp(rng.normal(size=2)), np.exp(rng.normal(size=3)) * [1.0, 1.0, float(not sampled)]
    (W, R), (intensity, V, q) = weights, noise
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        small = bc.reduce(plant, order=min(kept, states - 1))
        found = bc.lqg(small, None, R, {"u[0]": intensity}, V, "y[1]", "u[1]", output_weight=W, ltr_intensity=q)
        best = bc.h2(bc.generalized_plant(small, **SISO))
    assert cost_on(small.system, found.controller, weights, noise) == pytest.approx(found.cost, rel=1e-7)
    told, true = found.certificate.full_plant, cost_on(plant, found.controller, weights, noise)
    assert told.stable == np.isfinite(true)
    assert told.norm_bounds.kind == "h2"
    assert told.norm_bounds.value**2 == pytest.approx(true, rel=1e-7)
    assert not told.stable or f"a cost of {told.norm_bounds.value**2:.6g}" in told.summary

    told, whole = best.certificate.full_plant, bc.generalized_plant(plant, **SISO).lft(best.controller)
    assert told.stable == bool((np.abs(whole.poles()).max() if sampled else np.exp(whole.poles().real.max())) < 1.0)
    if told.stable:
        solve = linalg.solve_discrete_lyapunov if sampled else linalg.solve_continuous_lyapunov
        covariance = solve(whole.A, whole.B @ whole.B.T * (1.0 if sampled else -1.0))
        true = np.trace(whole.C @ covariance @ whole.C.T) + sampled * np.square(whole.D).sum()
        assert told.norm_bounds.value**2 == pytest.approx(true, rel=1e-7)


def test_cost_of_reduced_states_is_undefined_on_full_plant(full):
    small = bc.reduce(full, order=18)
    given = (1e-2, {"actuator_anti": 1.0}, 1e-2, "stroke_anti", "suspension_anti")
    states = bc.lqg(small, 1e-9, *given, output_weight={"tip_anti": 1.0}).certificate.full_plant
    assert states.stable
    assert states.norm_bounds.upper_bound == np.inf
    assert "cost there is not defined" in states.summary
    outputs = bc.lqg(small, None, *given, output_weight={"tip_anti": 1.0})
    assert outputs.certificate.full_plant.norm_bounds.value**2 == pytest.approx(outputs.cost, rel=0.1)
    assert "a cost of" in repr(outputs)


def full_plant_of(P):
    """Return the generalized plant around the full one."""
    origin = full_plant.origin_of(P)
    return origin.around(of(origin.reduction.full_system)).statespace("full")
