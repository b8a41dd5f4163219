"""Response to sines with friction: limits, scaling, the equivalent viscous damper, and both methods against each other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.lab.papers.anthonis_ramon.friction import describing_function, stepped_sine
from boomctl.simulation import CoulombFriction
from tests.profiles import examples

_OMEGA = 2.0 * np.pi * np.array([2.0, 2.8, 3.9, 4.4])
_JOLT = bc.split_symmetric(bc.spray_boom(elements=8))[0]
_METHODS = (describing_function, pytest.param(stepped_sine, marks=pytest.mark.slow))


def respond(method, force, amplitude=5e-3, omega=_OMEGA, plant=_JOLT):
    return method(plant, CoulombFriction(force), omega, "actuator_sym", amplitude, "tip_sym")


def linear(omega=_OMEGA, plant=_JOLT):
    return np.asarray(plant.frequency_response(omega, ["actuator_sym", "cradle"], ["tip_sym", "cradle_slip"]).frdata)


@pytest.mark.parametrize("method", _METHODS)
def test_sine_response_without_friction_is_linear(method):
    np.testing.assert_allclose(respond(method, 1e-7).response, linear()[0, 0], rtol=2e-3)


@pytest.mark.parametrize("method", _METHODS)
def test_sine_response_large_friction_is_stuck_cradle(method):
    found, H = respond(method, 1e4), linear()
    np.testing.assert_allclose(found.response, H[0, 0] - H[0, 1] * H[1, 0] / H[1, 1], rtol=2e-3)
    np.testing.assert_allclose(found.slip, 0.0, atol=2e-6)  # m; a simulated contact is at rest at the ends of steps


@pytest.mark.parametrize("method", _METHODS)
def test_sine_response_scales_with_force(method):
    scaled, plain = (respond(method, 8.0 * k, 5e-3 * k) for k in (0.03, 1.0))
    np.testing.assert_allclose(scaled.response, plain.response, rtol=1e-3)


@given(force=st.floats(1.0, 40.0), freq_hz=st.floats(0.5, 6.0))
@examples(40)
def test_describing_function_is_the_equivalent_viscous_damper(force, freq_hz):
    omega = np.array([2.0 * np.pi * freq_hz])
    found = respond(describing_function, force, omega=omega)
    amplitude = abs(found.slip[0])
    if amplitude < 1e-9:
        assert np.abs(found.force[0]) <= 4.0 * force / np.pi * (1.0 + 1e-9)  # it sticks
        return
    damping = 4.0 * force / (np.pi * omega[0] * amplitude)
    p = bc.BoomParameters()
    damped = bc.split_symmetric(bc.spray_boom(replace(p, cradle_damping=p.cradle_damping + damping), elements=8))[0]
    true = linear(omega, damped)[:, 0]
    np.testing.assert_allclose(found.response, true[0], rtol=1e-7)
    np.testing.assert_allclose(found.slip, 5e-3 * true[1], rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("force", [3.0, 8.0])
def test_stepped_sine_agrees_with_the_describing_function(force):
    balance, stepped = (respond(method, force) for method in (describing_function, stepped_sine))
    np.testing.assert_allclose(stepped.gain, balance.gain, rtol=0.04)
    np.testing.assert_allclose(np.abs(stepped.slip), np.abs(balance.slip), rtol=0.06)
