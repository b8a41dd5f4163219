"""What cannot be done is said, in words, before or after trying; bad input names parameter and expectation."""

import re

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import boomctl as bc
from tests.slew.systems import rigid, two_masses

pytestmark = pytest.mark.early


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"duration": 1.0}, "duration = 1 s: too short for a change of angle by 1; "),
        ({"duration": 3.0, "speed_limit": 0.1}, "speed_limit = 0.1, which takes"),
        ({"duration": 3.0, "final_speed": 2.0, "angle": None, "speed_limit": 1.0}, "final_speed"),
        ({"duration": 4.0, "torque_rate_limit": 50.0}, "torque_rate_limit = 50, or needs"),
        ({"duration": 3.0, "final_speed": 20.0, "angle": None}, "too short for a change of 20; "),
    ],
)
def test_infeasible_asks_are_refused(change, words):
    ask = {"angle": 1.0, "torque_limit": 100.0, "objective": "effort"} | change
    with pytest.raises(bc.SlewError, match=words):
        bc.optimal_slew(rigid(241.0), **ask)


def test_rigid_bound_is_sharp():
    least = 2.0 * np.sqrt(241.0 / 100.0)
    with pytest.raises(bc.SlewError, match="needs"):
        bc.optimal_slew(rigid(241.0), 1.0, 100.0, "effort", 0.999 * least)
    assert bc.optimal_slew(rigid(241.0), 1.0, 100.0, "effort", 1.01 * least, intervals=100).end_error < 1e-6


@pytest.mark.parametrize(
    ("name", "value", "duration"),
    [
        ("torque_limit", 200.0, 2.4),
        ("torque_rate_limit", 400.0, 2.9),
        ("speed_limit", 0.4, 2.8),
        ("tip_limit", 0.05, 2.8),
        ("moment_limit", 5.0, 2.8),
    ],
)
def test_failure_names_the_limit_and_the_time(name, value, duration):
    ask = {"torque_limit": 300.0, "intervals": 40, "duration": duration} | {name: value}
    with pytest.raises(bc.SlewError, match=f"no slew of {duration:g} s was found: ") as caught:
        bc.optimal_slew(bc.hub_beam(modes=1), 1.0, objective="effort", **ask)
    message = str(caught.value)
    said = re.search(rf"{name} = {value:g} .*? is (?:exceeded most at|met from) t = (\S+) s", message)
    assert said, message
    assert 0.0 <= float(said[1]) <= duration
    assert "Ipopt" not in message
    assert "\n" not in message


def test_states_beyond_a_limit_are_refused():
    system = control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0)
    with pytest.raises(bc.SlewError, match="speed_limit = 1: the initial_state has 2 at t = 0"):
        bc.optimal_slew(system, 1.0, 1.0, initial_state=[0.0, 2.0], speed_limit=1.0)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"torque_limit": -1.0}, ValueError, "torque_limit"),
        ({"objective": "joy"}, ValueError, "objective"),
        ({"objective": "effort"}, ValueError, "duration"),
        ({"duration": 2.0}, ValueError, "duration"),
        ({"angle": float("nan")}, ValueError, "angle"),
        ({"angle": "far"}, TypeError, "angle"),
        ({"angle": 0.0}, ValueError, "end state already"),
        ({"tip_limit": 1.0}, ValueError, "tip_displacement"),
        ({"tip_masses": (0.1,)}, ValueError, "tip_masses"),
        ({"initial_state": [0.0]}, ValueError, "initial_state"),
        ({"intervals": 1}, ValueError, "intervals"),
    ],
)
def test_bad_input(change, error, words):
    ask = {"angle": 1.0, "torque_limit": 1.0} | change
    with pytest.raises(error, match=words):
        bc.optimal_slew(two_masses(), **ask)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0, 0.1), "continuous"),
        (control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 1), "C B = 0"),
        (control.ss([[0, 1, 0], [0, 0, 0], [0, 0, -1]], [[0], [1], [0]], [[1, 0, 0]], 0), "does not move the mode"),
        (control.ss([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], 0), "rest at any angle"),
    ],
)
def test_unsuitable_systems(system, words):
    with pytest.raises(ValueError, match=words):
        bc.optimal_slew(system, 1.0, 1.0)


def test_something_else_altogether():
    with pytest.raises(TypeError, match="expected a hub-beam"):
        bc.optimal_slew(42, 1.0, 1.0)


@pytest.mark.parametrize("objective", ["effort", "jerk", "torque-rate"])
@pytest.mark.parametrize("angle", [0.0, None])
def test_a_slew_to_nowhere_is_refused_whatever_is_best(objective, angle):
    with pytest.raises(ValueError, match="end state already"):
        bc.optimal_slew(two_masses(), angle, 1.0, objective, 2.0)


def test_a_slew_that_needs_no_torque_is_refused():
    with pytest.raises(ValueError, match="by itself"):
        bc.optimal_slew(rigid(1.0), None, 1.0, "effort", 2.0, initial_state=[0.0, 1.0], final_state=[2.0, 1.0])
    h = bc.hub_beam(modes=1)
    with pytest.raises(ValueError, match="by itself"):
        bc.optimal_slew(h, 2.0, 100.0, "effort", 2.0, initial_state=h.steady_state(1.0), final_speed=1.0)


def test_an_angle_beside_another_final_state_is_refused():
    with pytest.raises(ValueError, match=r"angle = 1\.0: expected None or 2, as the final_state has it"):
        bc.optimal_slew(two_masses(), 1.0, 1.0, final_state=[2.0, 2.0, 0.0, 0.0])


@pytest.mark.parametrize("masses", [None, 0.1, "0.1"])
def test_payloads_are_given_as_numbers(masses):
    with pytest.raises(TypeError, match=r"tip_masses = .*: expected a sequence of masses in kg"):
        bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 100.0, tip_masses=masses)


def test_a_torque_that_breaks_the_beam_is_refused_in_words():
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), modes=2)
    with pytest.raises(bc.SlewError, match=r"torque_limit = 1e\+06 N m: bends"):
        bc.optimal_slew(h, 1.0, 1e6)


def test_units_are_those_of_the_plant_or_none():
    """Metres and newtons are called by their own names, without a unit; a hub-beam's linear model has its units."""
    A, B, C = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]]
    crane = control.ss(A, B, C, 0.0, inputs="force", outputs="place")
    slew = bc.optimal_slew(crane, 2.0, 1.0)
    said = repr(slew) + repr(slew.history) + str(list(slew.__figures__()))
    assert not re.search(r"\brad\b|N m|torque|angle", said)
    assert "place by 2 in" in said
    assert "force up to 1\n" in said
    assert [each.get_ylabel() for each in slew.plot(Figure().subplots(3, 1))] == ["force", "place", "rate of place"]
    assert slew.history.plot(Figure().subplots()).get_ylabel() == "torque"
    with pytest.raises(bc.SlewError, match="too short for a change of place by 2; a rigid body of inertia 1 takes"):
        bc.optimal_slew(crane, 2.0, 1.0, "effort", 1.0)
    turned = control.ss(A, B, C, 0.0, inputs="torque", outputs="hub_angle")
    slew = bc.optimal_slew(turned, 2.0, 1.0)
    assert "2 rad in" in repr(slew)
    assert slew.plot(Figure().subplots(3, 1))[0].get_ylabel() == "torque [N m]"


def test_a_tip_beyond_a_tenth_of_the_length_is_said():
    """As the replay in the same model says; of a gentler slew there is nothing to say."""
    beam = bc.hub_beam(modes=1)
    far, near = (bc.optimal_slew(beam, 1.0, 200.0, "effort", T, intervals=20) for T in (3.0, 6.0))
    again = beam.simulate(far)
    assert far.small_deformation_until == pytest.approx(again.small_deformation_until, abs=1e-3)
    assert f"beyond a tenth of the length after {far.small_deformation_until:.4g} s" in repr(far)
    assert far.plot(Figure().subplots(5, 1))[3].texts[0].get_text().startswith("beyond a tenth")
    assert np.isinf(near.small_deformation_until)
    assert "tenth" not in repr(near)
    assert not near.plot(Figure().subplots(5, 1))[3].texts


def test_a_slew_is_solved_again_in_degrees():
    slew = bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "effort", 4.0, intervals=20)
    assert bc.slew.resolve(slew, angle_deg=60.0).hub_angle[-1] == pytest.approx(np.pi / 3.0, abs=1e-6)
    with pytest.raises(ValueError, match="angle, angle_deg: expected one of them"):
        bc.slew.resolve(slew, angle=1.0, angle_deg=60.0)
    with pytest.warns(UserWarning, match="60 rad: 9.55 turns"), pytest.raises(bc.SlewError):
        bc.slew.resolve(slew, angle=60.0)
