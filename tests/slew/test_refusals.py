"""What cannot be done is said, in words, before or after trying; bad input names parameter and expectation."""

import control
import numpy as np
import pytest

import boomctl as bc
from tests.slew.systems import rigid, two_masses


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"duration": 1.0}, "duration = 1 s: too short for 1 rad"),
        ({"duration": 3.0, "speed_limit": 0.1}, "speed_limit = 0.1 rad/s"),
        ({"duration": 3.0, "final_speed": 2.0, "angle": None, "speed_limit": 1.0}, "final_speed"),
        ({"duration": 3.0, "final_speed": 20.0, "angle": None}, "too short for a change of 20 rad/s"),
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


def test_failure_names_the_limit_and_the_time():
    with pytest.raises(bc.SlewError, match=r"tip_limit|end state.*t = ") as caught:
        bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "effort", 2.4, tip_limit=0.05, intervals=40)
    assert "Ipopt" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"torque_limit": -1.0}, ValueError, "torque_limit"),
        ({"objective": "joy"}, ValueError, "objective"),
        ({"method": "magic"}, ValueError, "method"),
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
