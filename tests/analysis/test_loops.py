"""Closed loops by name: against algebra at each frequency, and against python-control."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis import closed_loop_response, feedback_loop
from boomctl.exceptions import FeedbackSignWarning
from tests.analysis.loop_cases import chain, velocity_feedback
from tests.profiles import examples


@given(st.integers(0, 1000))
@examples(20)
def test_the_loop_solves_its_equations_at_each_frequency(seed):
    rng = np.random.default_rng(seed)
    plant = control.rss(4, 3, 3)
    plant = control.ss(
        plant.A, plant.B, plant.C, rng.standard_normal((3, 3)), inputs=["a", "u", "b"], outputs=["y", "z", "x"]
    )
    K = control.rss(3, 1, 2)
    K = control.ss(K.A, K.B, K.C, 0.1 * rng.standard_normal((1, 2)), inputs=["x", "y"], outputs=["u"])
    loop = feedback_loop(plant, K, injection_points=["y", "u"])
    assert loop.input_labels == ["a", "b", "y_injected", "u_injected"]
    assert loop.output_labels == ["y", "z", "x", "u"]
    s = 0.7j
    response, G, C = loop(s), plant(s), K(s)
    for i in range(4):
        u = response[3, i]
        w = np.array([i == 0, u, i == 1], dtype=complex)
        assert G @ w == pytest.approx(response[:3, i], rel=1e-8, abs=1e-8)
        read = response[[2, 0], i] + np.array([0.0, i == 2])
        assert (C @ read)[0] + (i == 3) == pytest.approx(u, rel=1e-8, abs=1e-8)


def test_a_loop_of_responses_is_the_response_of_the_loop():
    model, K, omega = chain(3), velocity_feedback(0.4), np.geomspace(0.1, 20.0, 50)
    closed = feedback_loop(model, K)
    data = closed_loop_response(model.frequency_response, K, omega)
    assert data.input_labels == ["w"]
    assert data.output_labels == closed.output_labels == ["y0", "z", "y1", "u0", "u1"]
    assert data.frdata == pytest.approx(closed(1j * omega).reshape(5, 1, 50), rel=1e-8)
    assert closed_loop_response(model.frequency_response(omega), K).frdata == pytest.approx(data.frdata)


@pytest.mark.parametrize("sample_time", [None, 0.01])
def test_negated_controller_is_reported_with_advice(sample_time):
    mass = control.ss(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], 0.0, inputs=["force", "load"], outputs="place"
    )
    lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="place", outputs="force")
    good = lead if sample_time is None else bc.discretize(lead, sample_time)
    bad = control.ss(good.A, good.B, -good.C, -good.D, good.dt, inputs="place", outputs="force")
    advice = r"u = \+K y: pass -K"
    with pytest.raises(ValueError, match=advice):
        bc.margins(mass, bad)
    with pytest.warns(FeedbackSignWarning, match=advice):
        bc.feedback_loop(mass, bad)
    time = 0.01 * np.arange(50)
    with pytest.warns(FeedbackSignWarning, match=advice):
        bc.simulate_loop(mass, bad, time, {"load": np.ones(50)}, sample_time=0.01)
    assert "u = +K y: pass -K" in repr(bc.nyquist(mass, bad))
    with warnings.catch_warnings():
        warnings.simplefilter("error", FeedbackSignWarning)
        loop = bc.feedback_loop(mass, good)
        bc.simulate_loop(mass, good, time, {"load": np.ones(50)}, sample_time=0.01)
    assert (loop.poles().real < 0.0).all() if loop.isctime() else (np.abs(loop.poles()) < 1.0).all()
    assert "pass -K" not in repr(bc.nyquist(mass, good))


def test_unstable_loop_with_either_sign_has_no_sign_advice():
    plant = control.ss(np.diag([1.0, 2.0]), np.ones((2, 1)), np.ones((1, 2)), 0.0, inputs="u", outputs="y")
    K = control.ss([], [], [], 0.1, inputs="y", outputs="u")
    with pytest.raises(ValueError, match=r"it has no margins\.$"):
        bc.margins(plant, K)
    with warnings.catch_warnings():
        warnings.simplefilter("error", FeedbackSignWarning)
        bc.feedback_loop(plant, K, "u")


def test_worst_case_of_negated_controller_has_advice():
    signals = {"inputs": "stroke_anti", "outputs": "suspension_anti"}
    damper = control.ss([[-30.0]], [[30.0]], [[-3000.0]], [[3000.0]], **signals)
    worst = bc.worst_case(bc.boom.yaw_family(subsystem="yaw"), damper, "actuator_anti", "tip_anti")
    assert "u = +K y: pass -K" in worst.summary
