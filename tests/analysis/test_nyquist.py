"""Stability by winding: the same verdict and count as eigenvalues."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis import feedback_loop, nyquist_stability
from boomctl.boom import BoomParameters, exact_frequency_response, spray_boom
from tests.analysis.loop_cases import SIGNALS, chain, velocity_feedback
from tests.profiles import examples


@pytest.mark.parametrize("unstable", [0, 1])
@given(st.integers(0, 1000))
@examples(30)
def test_unstable_poles_are_those_that_eigenvalues_show(unstable, seed):
    """With stable controllers, and with one that is unstable."""
    rng = np.random.default_rng(seed)
    plant, K = chain(seed), velocity_feedback(rng.uniform(-1.0, 1.0), rng.uniform(2.0, 30.0))
    if unstable:
        plant, (B, C) = chain(seed, damping=0.2), rng.standard_normal((2, 2, 2))
        K = control.ss(np.diag([0.5, -3.0]), B, C, 0.0, **SIGNALS)
    poles = feedback_loop(plant, K).poles()
    if np.abs(poles.real).min() < 1e-6:
        return
    found = nyquist_stability(plant.frequency_response, K, plant.to_statespace().poles())
    assert (found.unstable_controller_poles, found.unstable_poles) == (unstable, int((poles.real > 0.0).sum()))
    assert found.stable == bool(poles.real.max() < 0.0)
    assert found.min_return_difference > 0.0


@pytest.mark.parametrize("gain", [-20000.0, -200.0, -1.0, 200.0, 30000.0])
def test_the_exact_boom_agrees_with_a_fine_mesh(gain):
    strokes, forces = ["stroke_left", "stroke_right"], ["suspension_left", "suspension_right"]
    eye = np.eye(2)
    K = control.ss(-30.0 * eye, eye, 30.0 * gain * eye, 0.0 * eye, inputs=strokes, outputs=forces)
    mesh = spray_boom(discretization="high-order", elements=4)
    poles = mesh.to_statespace().poles()
    poles = poles[np.abs(poles) < 600.0]
    p = BoomParameters()
    found = nyquist_stability(lambda w: exact_frequency_response(p, w, forces, strokes), K, poles)
    assert found.unstable_poles == int((feedback_loop(mesh, K).poles().real > 0.0).sum())
