"""Where the switching times of linear plants come from changes nothing of them."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.slew.least_time import switching
from boomctl.slew.problem import Limits, slew_problem


def problem(modes, tip_mass=0.1, angle=np.pi / 2, limit=200.0):
    beam = bc.hub_beam(bc.HubBeamParameters(tip_mass=tip_mass), model="sfoam", modes=modes).linearize()
    return slew_problem(beam, angle, Limits(limit), "time", None)


@pytest.mark.parametrize("modes", [1, 2, 3])
@pytest.mark.parametrize(
    ("tip_mass", "angle", "limit"), [(0.1, np.pi / 2, 200.0), (2.0, 0.3, 50.0), (0.0, -2.0, 400.0)]
)
def test_least_squares_and_linear_program_agree(modes, tip_mass, angle, limit, monkeypatch):
    asked = problem(modes, tip_mass, angle, limit)
    found = switching.least_time(asked)
    monkeypatch.setattr(switching, "_reweighted", lambda *_: None)
    expected = switching.least_time(asked)
    assert found.duration == pytest.approx(expected.duration, rel=1e-13)
    assert found.switches == pytest.approx(expected.switches, abs=1e-10 * expected.duration)


def test_too_few_switches_are_not_taken_for_converged():
    """Solved in least squares, Newton's steps end there too, but the end state is missed."""
    asked = problem(3, 0.0, -2.0, 400.0)
    right = switching.least_time(asked)
    fewer = switching.replace(right, switches=np.delete(right.switches, [3, 4]))
    assert switching._newton(asked, switching._fitted(asked, fewer)) is None


@pytest.mark.parametrize("turn", [-0.5, -0.2, -0.05, -0.01, -1e-3, 3e-4, 1e-3, 0.1, 3.0])
def test_minimum_time_between_moving_states_matches_closed_form(turn):
    """A unit inertia at speed 1 swings back through -turn and ends at speed 1, or speeds up and slows down again.

    Braking to -v and returning takes 2 (1 + v) and turns by 1 - v^2; the other way takes 2 (v - 1) and turns by v^2 - 1.
    """
    body = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    slew = bc.optimal_slew(body, None, 1.0, initial_state=[0.0, 1.0], final_state=[turn, 1.0])
    expected = 2.0 + 2.0 * np.sqrt(1.0 - turn) if turn < 0.0 else 2.0 * (np.sqrt(1.0 + turn) - 1.0)
    assert slew.duration == pytest.approx(expected, rel=1e-9)
