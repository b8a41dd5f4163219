"""Where the switching times of linear plants come from changes nothing of them."""

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
