"""Describing function and stepped sine: limits, scaling, each other, and true singular values."""

from dataclasses import replace
from functools import partial

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.lti.frequency import singular_values
from boomctl.simulation import CoulombFriction, describing_function, simulate_loop, sine_sigma, swept_sine
from tests.profiles import examples
from tests.simulation.cases import mass_on_spring

_OMEGA = 2.0 * np.pi * np.array([0.8, 1.3, 2.0, 2.8, 3.3, 3.9, 4.4])
_JOLT = bc.split_symmetric(bc.spray_boom(elements=8))[0]
_METHODS = (describing_function, partial(swept_sine, steps=100, tolerance=1e-3))


def _linear(outputs=("tip_sym",), inputs=("actuator_sym",)):
    return np.asarray(_JOLT.frequency_response(_OMEGA, inputs=list(inputs), outputs=list(outputs)).frdata)


def _stuck():
    H = _linear(("tip_sym", "cradle_slip"), ("actuator_sym", "cradle"))
    return H[0, 0] - H[0, 1] * H[1, 0] / H[1, 1]


@pytest.mark.parametrize("method", _METHODS)
def test_little_friction_leaves_the_linear_response(method):
    found = method(_JOLT, CoulombFriction(1e-7), _OMEGA, "actuator_sym", 5e-3, "tip_sym")
    np.testing.assert_allclose(found.response[0], _linear()[0, 0], rtol=2e-3)
    assert not found.stuck.any()


@pytest.mark.parametrize("method", _METHODS)
def test_much_friction_leaves_a_cradle_that_sticks(method):
    found = method(_JOLT, CoulombFriction(1e4), _OMEGA, "actuator_sym", 5e-3, "tip_sym")
    np.testing.assert_allclose(found.response[0], _stuck(), rtol=2e-3)
    assert found.stuck.all()
    assert not found.slip.any()


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.03, 40.0])
def test_only_the_ratio_of_friction_and_excitation_matters(scale):
    for method in _METHODS:
        plain, scaled = (
            method(_JOLT, CoulombFriction(8.0 * k), _OMEGA[1::3], "actuator_sym", 5e-3 * k, "tip_sym")
            for k in (1.0, scale)
        )
        np.testing.assert_allclose(scaled.response, plain.response, rtol=1e-3)


@given(force=st.floats(1.0, 40.0), freq_hz=st.floats(0.5, 6.0))
@examples(40)
def test_the_harmonic_balance_closes(force, freq_hz):
    """Slip and friction of the describing function solve the linear model with the equivalent viscous damper."""
    omega = np.array([2.0 * np.pi * freq_hz])
    found = describing_function(_JOLT, CoulombFriction(force), omega, "actuator_sym", 5e-3, ("tip_sym", "cradle_slip"))
    if found.stuck[0]:
        np.testing.assert_allclose(found.response[1], 0.0, atol=1e-9)
        return
    damping = 4.0 * force / (np.pi * omega[0] * found.slip[0])
    p = bc.BoomParameters()
    damped = bc.split_symmetric(bc.spray_boom(replace(p, cradle_damping=p.cradle_damping + damping), elements=8))[0]
    true = np.asarray(
        damped.frequency_response(omega, inputs=["actuator_sym"], outputs=["tip_sym", "cradle_slip"]).frdata
    )
    np.testing.assert_allclose(found.response, true[:, 0], rtol=1e-7)
    np.testing.assert_allclose(5e-3 * np.abs(true[1, 0]), found.slip, rtol=1e-7)


@pytest.mark.parametrize("force", [3.0, pytest.param(8.0, marks=pytest.mark.slow)])
def test_sines_in_time_agree_with_the_harmonic_balance_where_the_cradle_slides(force):
    balance, swept = (
        method(_JOLT, CoulombFriction(force), _OMEGA[2:], "actuator_sym", 5e-3, "tip_sym") for method in _METHODS
    )
    np.testing.assert_allclose(swept.gain, balance.gain, rtol=0.04)
    np.testing.assert_allclose(swept.slip, balance.slip, rtol=0.06)


@pytest.mark.slow
def test_a_stepped_sine_is_what_the_simulated_loop_ends_in():
    plant, law, omega = mass_on_spring(damping=0.5), CoulombFriction(0.6, input="f", output="x"), 14.0
    swept = swept_sine(plant, law, [omega], "f", 2.0, ("x",), steps=400)
    period, steps = 2.0 * np.pi / omega, 400
    time = np.arange(60 * steps + 1) * period / steps
    found = simulate_loop(
        plant, None, {"f": 2.0 * np.cos(omega * time)}, time, sample_time=period / steps, friction=law
    )["x"]
    last = found[-steps - 1 : -1]
    fundamental = 2.0 / steps * (last @ np.exp(-1j * omega * time[-steps - 1 : -1]))
    assert swept.response[0, 0] == pytest.approx(fundamental / 2.0, rel=2e-3)


def test_singular_values_from_two_patterns_are_those_of_the_response_without_friction():
    model = bc.spray_boom(elements=6)
    patterns = [{"actuator_left": 1.0, "actuator_right": 1.0}, {"actuator_left": 1.0, "actuator_right": -1.0}]
    tips = ("tip_left", "tip_right")
    true = singular_values(
        np.asarray(model.frequency_response(_OMEGA[2:5], inputs=list(patterns[0]), outputs=list(tips)).frdata)
    )
    for method in ("balance", "swept"):
        found = sine_sigma(model, CoulombFriction(1e-8), _OMEGA[2:5], patterns, 5e-3, tips, method)
        np.testing.assert_allclose(found, true, rtol=5e-3)
    with pytest.raises(ValueError, match="independent"):
        sine_sigma(model, CoulombFriction(1.0), _OMEGA, [patterns[0], patterns[0]], 5e-3, tips)


@pytest.mark.parametrize("method", _METHODS)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"omega": [0.0, 1.0]}, "above zero"),
        ({"amplitude": 0.0}, "amplitude"),
        ({"excitation": "actuator"}, "unknown excited input"),
        ({"excitation": {}}, "not all zero"),
        ({"outputs": "tip"}, "unknown output"),
        ({"friction": CoulombFriction(1.0, input="brake")}, "unknown input"),
        ({"friction": CoulombFriction(1.0, output="slip")}, "unknown output"),
        ({"plant": 3.0}, "plant.*: expected"),
    ],
)
def test_bad_input(method, change, message):
    arguments = {
        "plant": _JOLT,
        "friction": CoulombFriction(1.0),
        "omega": [1.0],
        "excitation": "actuator_sym",
        "amplitude": 1e-3,
    } | change
    with pytest.raises((TypeError, ValueError), match=message):
        method(**arguments)


@pytest.mark.parametrize("omega", [0.0079, 0.013, 0.1, 1.0, 1.9])
def test_what_never_slips_is_held_and_does_not_creep(omega):
    """However long the steps of a low frequency are for the plant, the slip of a cradle that holds is zero."""
    plant = ct.ss(
        [[0.0, 1.0], [-4.0, -0.4]],
        [[0.0, 0.0], [1.0, 1.0]],
        [[1.0, 0.0], [0.0, 1.0]],
        [[0.0, 0.0], [0.0, 0.5]],
        inputs=["cradle", "d"],
        outputs=["cradle_slip", "reading"],
    )
    found = swept_sine(plant, CoulombFriction(2.0), [omega], "d", 1.0)
    assert found.stuck.all()
    np.testing.assert_allclose(found.response, [[0.0], [0.5]], atol=1e-12)


def test_steps_too_long_for_the_contact_are_refused():
    plant = ct.ss(
        [[0, 1.0], [-4.0, -0.4]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs=["cradle"], outputs=["cradle_slip"]
    )
    for h in (4.0, 8.0):
        time = h * np.arange(101)
        with pytest.raises(ValueError, match="finer timepts"):
            simulate_loop(plant, None, {"cradle": time / 100.0}, time, sample_time=h, friction=CoulombFriction(10.0))
