"""The open-loop response: against extended precision, python-control, and its own error estimate."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.lab.benchmark.peers.boom_loop import extended_maps
from boomctl.lti.hold import linear_hold_response
from boomctl.simulation import forced_response, simulate_loop
from tests.profiles import examples
from tests.simulation.cases import random_plant
from tests.strategies import seeds

_TIME = np.linspace(0.0, 6.0, 3001)
_PLATFORM = {
    "actuator_left": 0.01 * np.sin(4.0 * _TIME) + 0.002 * np.sin(31.0 * _TIME),
    "actuator_right": 0.01 * np.sin(2.5 * _TIME + 0.4) - 0.01 * np.sin(0.4),
}
_TIPS = ("tip_left", "tip_right")


def _stepped(system, U, h):
    """Step a system in its own coordinates, in extended precision."""
    Phi, held, ramp = extended_maps(system.A, system.B, h)
    x, y = np.zeros(system.nstates, dtype=np.longdouble), []
    for k in range(U.shape[1]):
        y.append((system.C @ x + system.D @ U[:, k]).astype(float))
        if k < U.shape[1] - 1:
            x = Phi @ x + held @ U[:, k] + ramp @ (U[:, k + 1] - U[:, k])
    return np.array(y).T


@given(seed=seeds, n=st.integers(1, 8), points=st.sampled_from([2, 3, 127, 128, 129, 400]))
@examples(25)
def test_a_system_responds_as_it_does_step_by_step(seed, n, points):
    rng = np.random.default_rng(seed)
    plant = random_plant(rng, n)
    U, time = rng.standard_normal((3, points)), 0.03 * np.arange(points)
    found = forced_response(plant, dict(zip(plant.input_labels, U, strict=True)), time)
    theirs = _stepped(plant, U, 0.03)
    for name, values in zip(plant.output_labels, theirs, strict=True):
        np.testing.assert_allclose(found[name], values, atol=1e-9 * max(1.0, np.abs(theirs).max()))


def test_rigid_bodies_are_no_exception():
    plant = ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs=["f"], outputs=["x"])
    found = forced_response(plant, {"f": _TIME}, _TIME)
    np.testing.assert_allclose(found["x"], _TIME**3 / 6.0, atol=1e-10)


@pytest.mark.parametrize("elements", [6, 20])
def test_a_boom_responds_as_it_does_step_by_step(elements):
    model = bc.spray_boom(elements=elements)
    found = forced_response(model, _PLATFORM, _TIME, _TIPS, accuracy=1e-12)
    system = model.to_statespace(list(_PLATFORM), list(_TIPS))
    theirs = _stepped(system, np.array(list(_PLATFORM.values())), float(_TIME[1]))
    for name, values in zip(_TIPS, theirs, strict=True):
        np.testing.assert_allclose(found[name], values, atol=1e-8 * np.abs(theirs).max())


@pytest.mark.parametrize("accuracy", [*(pytest.param(each, marks=pytest.mark.slow) for each in (1e-3, 1e-5)), 1e-7])
def test_fewer_modes_keep_the_accuracy_asked_for(accuracy):
    model = bc.spray_boom(elements=60)
    whole = forced_response(model, _PLATFORM, _TIME, accuracy=1e-14)
    found = forced_response(model, _PLATFORM, _TIME, accuracy=accuracy)
    assert found.modes < whole.modes
    assert found.error_estimate <= 2.0 * accuracy
    assert found.modes < model.n
    for name, values in whole.outputs.items():
        assert np.abs(found[name] - values).max() <= 2.0 * accuracy * np.abs(values).max()


@pytest.mark.parametrize("excitation", ["velocity", "acceleration"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
def test_imposed_velocities_and_accelerations_keep_the_accuracy_asked_for(excitation, accuracy):
    model = bc.spray_boom(elements=24, excitation=excitation)
    rng = np.random.default_rng(0)
    time = 0.004 * np.arange(800)
    signals = {"actuator_left": 0.01 * rng.standard_normal(800).cumsum(), "suspension_right": rng.standard_normal(800)}
    found = forced_response(model, signals, time, accuracy=accuracy)
    rows = np.array([signals.get(name, np.zeros(800)) for name in model.inputs])
    exact = dict(zip(model.outputs, linear_hold_response(model.to_statespace(), rows, 0.004), strict=True))
    for name, values in exact.items():
        error = np.abs(found[name] - values).max() / np.abs(values).max()
        assert error <= 4.0 * found.error_estimate + 1e-8
        assert error <= 2.0 * accuracy
    assert found.modes < model.n


def test_a_loop_of_many_modes_follows_an_imposed_acceleration():
    model = bc.spray_boom(elements=24, excitation="acceleration")
    time = 0.004 * np.arange(500)
    signals = {"actuator_left": np.sin(3.0 * time)}
    loop = simulate_loop(model, None, signals, time, sample_time=0.004)
    found = forced_response(model, signals, time, accuracy=1e-9)
    for name, values in found.outputs.items():
        np.testing.assert_allclose(loop[name], values, atol=1e-6 * np.abs(values).max())


def test_one_actuator_alone_and_superposition():
    model = bc.spray_boom(elements=20)
    both = forced_response(model, _PLATFORM, _TIME, "tip_left")
    alone = [
        forced_response(model, {name: values}, _TIME, "tip_left")["tip_left"] for name, values in _PLATFORM.items()
    ]
    np.testing.assert_allclose(both["tip_left"], sum(alone), atol=1e-6 * np.abs(both["tip_left"]).max())
    assert tuple(both.outputs) == ("tip_left",)
    assert both.response.input_labels == list(_PLATFORM)


def test_it_is_the_open_loop_of_the_sampled_one():
    model = bc.spray_boom(elements=6)
    loop = simulate_loop(model, None, _PLATFORM, _TIME, sample_time=float(_TIME[1]))
    found = forced_response(model, _PLATFORM, _TIME)
    for name, values in loop.outputs.items():
        np.testing.assert_allclose(found[name], values, atol=1e-9)


def test_an_unsymmetric_mesh_has_no_halves():
    model = bc.spray_boom(elements=[-6.0, -3.5, -1.0, 0.5, 3.0, 6.0])
    found = forced_response(model, _PLATFORM, _TIME, _TIPS)
    loop = simulate_loop(model, None, _PLATFORM, _TIME, sample_time=float(_TIME[1]))
    for name in _TIPS:
        np.testing.assert_allclose(found[name], loop[name], atol=1e-9)


@pytest.mark.parametrize(
    ("signals", "options", "message"),
    [
        ({}, {}, "not empty"),
        (np.zeros(3001), {}, "expected a mapping"),
        ({"actuator": _TIME}, {}, "did you mean"),
        ({"actuator_left": _TIME[:-1]}, {}, "has shape"),
        ({"actuator_left": np.full(3001, np.nan)}, {}, "has a gap"),
        ({"actuator_left": _TIME}, {"outputs": "tip"}, "unknown output 'tip'"),
        ({"actuator_left": _TIME}, {"accuracy": 0.0}, "accuracy"),
        ({"actuator_left": _TIME}, {"timepts": _TIME**2}, "equal steps"),
    ],
)
def test_bad_input(signals, options, message):
    arguments = {"timepts": _TIME} | options
    with pytest.raises((TypeError, ValueError), match=message):
        forced_response(bc.spray_boom(elements=6), signals, **arguments)
