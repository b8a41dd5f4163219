"""The hub-beam over hub speed and tip mass: the linear models at every point, proofs that hold at every point tried."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.box.loops import BoxLoops
from tests.profiles import examples
from tests.rotating_beam.strategies import parameters

_SPEED_HUB = {"inputs": ["hub_speed", "root_moment"], "outputs": "torque"}


def _beam(model="sfoam", modes=2, damping=0.01, tip_mass=0.0):
    return bc.hub_beam(bc.HubBeamParameters(damping_ratio=damping, tip_mass=tip_mass), model=model, modes=modes)


def _drive(count=3, last=4.0):
    gains = [ct.ss([[-3.0]], [[1.0, 0.0]], [[-20.0]], [[-30.0 - 10.0 * k, -0.3]], **_SPEED_HUB) for k in range(count)]
    return bc.gain_schedule(gains, np.linspace(0.0, last, count))


@pytest.mark.parametrize("damping", [0.0, pytest.param(0.02, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "model",
    ["tlam", "sfoam", *(pytest.param(name, marks=pytest.mark.slow) for name in ("sfoam-consistent", "foam", "cfoam"))],
)
def test_it_is_the_linear_model_at_every_point(model, damping):
    beam, high = _beam(model, damping=damping), 1.8 if model == "tlam" else 5.0
    sensor = bc.BeamSensor("gauge", "strain", 2.0, height=0.01)
    family = beam.family((0.0, high), (0.0, 0.2), sensors=[sensor])
    assert family.names == ("hub_speed", "tip_mass")
    assert family.nominal.output_labels[:5] == ("hub_angle", "hub_speed", "tip_displacement", "root_moment", "gauge")
    fast = beam._small_motion(high)
    sizes = [np.abs(each).max() for each in (fast.mass, fast.damping, fast.stiffness)]
    for speed, mass in ((0.0, 0.2), (0.37 * high, 0.05), (high, 0.13)):
        there = beam.with_tip_mass(mass)
        mine = family.at(family.normalize({"hub_speed": speed, "tip_mass": mass}))
        motion = there._small_motion(speed)
        pairs = ((mine.M, motion.mass), (mine.C, motion.damping), (mine.K, motion.stiffness))
        for (found, true), size in zip(pairs, sizes, strict=True):
            np.testing.assert_allclose(found, true, rtol=0.0, atol=1e-10 * size)
        omega, linear = np.array([0.3, 2.0, 9.0]), there.linearize(speed, sensors=[sensor])
        true = ct.ss(linear.A, linear.B, linear.C, linear.D)(1j * omega)[[0, 1, 2, 3, 5]]
        response = mine.frequency_response(omega).frdata[:5]
        size = np.abs(true).max(axis=2, keepdims=True)
        np.testing.assert_allclose(response / size, true / size, rtol=0.0, atol=1e-6 if model == "cfoam" else 1e-7)


def test_family_matches_linear_model():
    """Readings such as the root moment change with the beam, too."""
    family = _beam().family(hub_inertia=(180.0, 220.0), length=(7.98, 8.02))
    assert family.ranges["length"] == (7.98, 8.02)
    values = {"hub_inertia": 188.0, "length": 7.993}
    there = bc.HubBeamParameters(damping_ratio=0.01, **values)
    omega = np.array([0.3, 2.0, 9.0])
    mine = family.at(family.normalize(values)).frequency_response(omega).frdata
    linear = bc.hub_beam(there, model="sfoam", modes=2).linearize(sensors=())
    true = ct.ss(linear.A, linear.B, linear.C, linear.D)(1j * omega)
    np.testing.assert_allclose(mine[:4], true[:4], rtol=1e-8)
    assert family.nominal.output_labels == _beam().to_second_order().output_labels


def test_one_parameter_is_enough():
    assert _beam().family(hub_speed=(-2.0, 2.0)).names == ("hub_speed",)
    fixed = _beam().family(3.0, tip_mass=(0.0, 0.1))
    assert fixed.names == ("tip_mass",)
    np.testing.assert_allclose(fixed.at([-1.0]).K, _beam()._small_motion(3.0).stiffness, atol=1e-9)


@pytest.mark.slow
@examples(6)
@given(st.integers(0, 1000))
def test_scheduled_drive_proved_if_frozen_loops_stable(seed):
    """The loops that the proof covers are those of the linear beam and the controller as it is at that speed."""
    rng, drive = np.random.default_rng(seed), _drive()
    family = _beam().family((0.0, 5.0), (0.0, 0.1))
    found = bc.robust_stability(family, drive)
    assert found.proved
    loops = BoxLoops.of(family, drive)
    for _ in range(5):
        point = rng.uniform(-1.0, 1.0, 2)
        values = family.denormalize(point)
        plant = _beam(tip_mass=values["tip_mass"]).linearize(values["hub_speed"], sensors=())
        plant = ct.ss(plant, inputs=plant.input_labels, outputs=plant.output_labels)
        whole = bc.feedback_loop(plant, drive.at(values["hub_speed"]))
        poles = whole.poles()
        free = np.sort_complex(poles[np.abs(poles) > 1e-6])  # all but the hub angle, which nothing feels
        assert len(free) == len(poles) - 1
        np.testing.assert_allclose(np.sort_complex(loops.poles(point)), free, atol=1e-6 * np.abs(free).max())


def test_the_angle_is_left_out_only_where_nothing_reads_it():
    family = _beam().family((0.0, 4.0))
    speed = ct.ss([], [], [], [[-50.0]], inputs="hub_speed", outputs="torque")
    assert len(BoxLoops.of(family, speed).poles(np.zeros(1))) == 5
    assert bc.robust_stability(family, speed).proved
    both = ct.ss([], [], [], [[-20.0, -50.0]], inputs=["hub_angle", "hub_speed"], outputs="torque")
    assert len(BoxLoops.of(family, both).poles(np.zeros(1))) == 6
    assert not bc.robust_stability(
        replace(family, ignorable_coordinates=()), speed
    ).proved  # an integrator is not stable


@pytest.mark.slow
@examples(200)
@given(
    parameters(damped=True),
    st.sampled_from(["tlam", "sfoam", "sfoam-consistent"]),
    st.integers(1, 3),
    st.floats(0.5, 15.0),
    st.booleans(),
    st.sampled_from([-1.0, -0.3, 0.0, 0.7, 1.0]),
)
def test_family_hub_angle_is_ignorable(given, model, modes, fastest, backwards, delta):
    """No rounding of its motion shows in what does not read it: norms of loops that hold the speed are finite."""
    assume(given.damping_ratio > 1e-3 and given.hub_inertia > 0.3)
    beam = bc.hub_beam(given, model=model, modes=modes)
    fastest = min(0.8 * beam.divergence_speed(), fastest)
    family = beam.family((-fastest if backwards else 0.0, fastest))
    brake = ct.ss([], [], [], [[-5.0 * given.rigid_body_inertia]], inputs="hub_speed", outputs="torque")
    assert np.count_nonzero(family.at([delta]).to_statespace().poles() == 0.0) >= 1
    loop = bc.feedback_loop(family.at([delta]), brake)["tip_displacement", :]
    compliance = given.length**3 / (3.0 * given.youngs_modulus * given.second_moment)
    # a resonance with the least damping that is drawn is 500 times as high, and the beam may be softer as it turns
    assert bc.hinf_norm(loop).lower_bound < 2e3 * compliance


def test_an_unstable_stretch_of_a_schedule_is_found():
    drives = [ct.ss([], [], [], [[-gain]], inputs="hub_speed", outputs="torque") for gain in (50.0, -5.0, 50.0)]
    found = bc.robust_stability(_beam().family((0.0, 4.0)), bc.gain_schedule(drives, [0.0, 2.0, 4.0]))
    assert not found.proved
    assert found.destabilizing_values is not None
    assert 1.5 < found.destabilizing_values["hub_speed"] < 2.5


def test_margin_and_worst_case_of_a_scheduled_drive():
    family, drive = _beam().family((1.0, 3.0)), _drive()
    margin = bc.analysis.robust_stability_margin(family, drive, max_factor=1.5)
    assert margin.lower_bound == 1.5
    worst = bc.worst_case(family, drive, "tip_force", "tip_displacement")
    speed = worst.worst_values["hub_speed"]
    plant = _beam().linearize(speed, sensors=())
    loop = bc.feedback_loop(plant, drive.at(speed))
    true = bc.hinf_norm(
        ct.ss(loop, inputs=loop.input_labels, outputs=loop.output_labels)["tip_displacement", "tip_force"]
    )
    assert worst.worst_norm.lower_bound == pytest.approx(true.lower_bound, rel=1e-5)
