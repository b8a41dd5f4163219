"""Scheduled controllers in a sampled loop: brute force, python-control, and the constant controller as a special case."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples
from tests.simulation.cases import conditioning_gain, random_controller, random_plant
from tests.simulation.test_beam_loop import SCENES, run_both

_TS = 0.02
_SPEEDS = (0.0, 0.03, 0.5)


def _law(k):
    """Return one of a row of controllers with all matrices that a controller has."""
    A, B = [[0.6 - 0.1 * k]], [[0.4, 0.02 * k]]
    C, D = [[-60.0 - 5.0 * k]], [[-80.0 + 10.0 * k, -240.0 - 20.0 * k]]
    return ct.ss(A, B, C, D, _TS, inputs=["hub_angle", "hub_speed"], outputs=["torque"])


def _scheduled():
    return bc.gain_schedule([_law(k) for k in range(len(_SPEEDS))], _SPEEDS)


def _interpolated(measured):
    """Return the matrices at a measured speed, by NumPy's interpolation of each entry."""
    laws = [_law(k) for k in range(len(_SPEEDS))]
    gains = [conditioning_gain(*(np.asarray(each) for each in (K.A, K.B, K.C, K.D))) for K in laws]
    stacks = [np.array([np.asarray(getattr(K, name)) for K in laws]) for name in "ABCD"] + [np.array(gains)]
    found = [
        np.array([[np.interp(measured[1], _SPEEDS, X[:, i, j]) for j in range(X.shape[2])] for i in range(X.shape[1])])
        for X in stacks
    ]
    return found[0], found[1], found[2][0], found[3][0], found[4][:, 0]


@pytest.mark.parametrize("scene", ["everything", pytest.param("limits", marks=pytest.mark.slow)])
def test_the_loop_is_what_brute_force_finds(scene):
    beam, time = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), model="sfoam", modes=2), np.linspace(0.0, 0.5, 51)
    run, states, given = run_both(beam, SCENES[scene], time, _scheduled(), _interpolated)
    assert 0.03 < np.abs(states[:, beam.equations.size]).max() < 0.5  # more than one stretch of the schedule is passed
    np.testing.assert_allclose(run.states, states, rtol=0.0, atol=1e-9 * np.abs(states).max())
    late = int(np.ceil(SCENES[scene]["delay"] / _TS - 1e-9))
    acting = run.controls["torque"][:: round(_TS / 0.01)]
    wanted = np.concatenate([np.zeros(late), given])[: len(acting)]
    np.testing.assert_allclose(acting, wanted, atol=1e-7 * np.abs(given).max())


@examples(40)
@given(st.integers(0, 10_000), st.floats(0.0, 0.03), st.sampled_from([None, 0.3]))
def test_equal_controllers_are_one(seed, delay, limit):
    rng = np.random.default_rng(seed)
    plant = random_plant(rng)
    law = random_controller(rng, _TS, gain=0.1)
    scheduled = bc.gain_schedule([law, law, law], [-1.0, 0.1, 2.0], plant.output_labels[1])
    time = np.linspace(0.0, 2.0, 101)
    given = {"sample_time": _TS, "delay": delay, "control_limit": limit}
    w = {plant.input_labels[-1]: rng.normal(size=101)}
    one, other = (bc.simulate_loop(plant, K, time, w, **given) for K in (law, scheduled))
    for name, row in one.outputs.items():
        np.testing.assert_allclose(other[name], row, atol=1e-9 * np.abs(row).max())


def test_a_regulator_reads_the_states_of_a_hub_beam():
    """By their names: at each sample the torque is minus the gain times the state."""
    beam, time = bc.hub_beam(model="sfoam", modes=2), np.linspace(0.0, 2.0, 201)
    design = bc.lqr(beam.linearize(0.0), {"hub_angle": 10.0, "hub_speed": 1e3, "transverse_1": 1e4}, 0.1)
    wanted, push = {"hub_speed": 0.5 * time, "hub_angle": 0.25 * time**2}, {"tip_force": np.cos(3.0 * time)}
    run = bc.simulate_loop(beam, design.controller, time, push, sample_time=0.01, reference=wanted)
    assert {"transverse_1", "transverse_2_rate"} <= set(run.outputs)
    off = run.states.copy()
    off[:, 0] -= wanted["hub_angle"]
    off[:, beam.equations.size] -= wanted["hub_speed"]
    np.testing.assert_allclose(run.controls["torque"], -off @ design.gain[0], rtol=1e-9, atol=1e-9)
    for k, name in enumerate(beam.state_labels):
        np.testing.assert_allclose(run[name] if name in run.outputs else run.states[:, k], run.states[:, k], atol=1e-12)


def test_the_same_in_python_control():
    beam = bc.hub_beam(model="sfoam", modes=1)
    plant, time = beam.linearize(0.0), np.linspace(0.0, 1.0, 51)
    speed = 0.8 * time
    run = bc.simulate_loop(plant, _scheduled(), time, None, sample_time=_TS, reference={"hub_speed": speed})
    discrete = ct.sample_system(plant, _TS)
    for each in ("input_labels", "output_labels", "state_labels"):
        setattr(discrete, each, getattr(plant, each))
    discrete.name = "beam"
    whole = ct.interconnect(
        [discrete, _scheduled().to_nlsys("hub_speed")], inplist="hub_speed_reference", outlist=list(plant.output_labels)
    )
    found = ct.input_output_response(whole, time, speed)
    np.testing.assert_allclose(found.outputs[0], run["hub_angle"], atol=1e-9 * abs(run["hub_angle"]).max())
    np.testing.assert_allclose(found.outputs[1], run["hub_speed"], atol=1e-9 * abs(run["hub_speed"]).max())


def test_frozen_controllers_stand_on_straight_lines():
    scheduled, (low, middle, high) = _scheduled(), (_law(k) for k in range(3))
    for value, wanted in ((-1.0, low.C), (0.03, middle.C), (0.265, 0.5 * (middle.C + high.C)), (9.0, high.C)):
        np.testing.assert_allclose(scheduled.at(value).C, wanted, rtol=1e-14)
    unread = bc.gain_schedule(
        [ct.ss([], [], [], [[k]], inputs="tip", outputs="torque") for k in (1.0, 2.0)], [0.0, 1.0]
    )
    assert unread.input_labels == ("tip", "hub_speed")
    np.testing.assert_array_equal(unread.at(0.25).D, [[1.25, 0.0]])


_NAMES = ["hub_angle", "hub_speed"], ["torque"]
_LAW = ct.ss([[0.6]], [[0.4, 0.02]], [[-60.0]], [[-80.0, -240.0]], _TS, inputs=_NAMES[0], outputs=_NAMES[1])


@pytest.mark.parametrize("kind", ["hub-beam", "linear"])
def test_each_sample_has_its_own_matrices_and_the_last_stay(kind):
    """A controller that goes on with other matrices is one that is started anew where the first ended."""
    beam, time = bc.hub_beam(modes=2), np.arange(0.0, 1.0, _TS)
    plant, scale = beam if kind == "hub-beam" else beam.linearize(), np.array([1.0, 0.5, 2.0, 0.0, 1.5])
    A, B, C, D = (np.repeat(np.asarray(each)[None], 5, axis=0) for each in (_LAW.A, _LAW.B, _LAW.C, _LAW.D))
    C, D = C * scale[:, None, None], D * scale[:, None, None]
    varying = bc.simulation.TimeVaryingController(A, B, C, D, *_NAMES, dt=_TS)
    start = np.linspace(0.1, 0.2, 6)
    run = bc.simulate_loop(plant, varying, time, None, sample_time=_TS, initial_state=start)
    state = np.zeros(1)
    for k in range(8):
        read = np.array([run["hub_angle"][k], run["hub_speed"][k]])
        asked = scale[min(k, 4)] * (_LAW.C @ state + _LAW.D @ read)
        assert run.commanded["torque"][k] == pytest.approx(float(asked[0]), rel=1e-9)
        state = _LAW.A @ state + _LAW.B @ read
