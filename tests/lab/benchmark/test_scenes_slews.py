"""Scenes of slews: their references agree with ours and with the linear part, and what is judged is what is meant."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.peers.opti import Effort, Failed, opti_programme
from boomctl.lab.benchmark.references.slews import Referee
from boomctl.lab.benchmark.scenes.slews import certified, fastest, least_effort
from boomctl.rotating_beam import AssumedModesBeam, HubBeamParameters
from boomctl.slew import optimal_slew
from boomctl.slew.torque import ramped

EFFORT = Effort(AssumedModesBeam(HubBeamParameters(), "sfoam", 1), np.pi / 2, 200.0, 3.2, 100)


def test_the_replay_finds_the_end_that_ours_reaches():
    slew = optimal_slew(EFFORT.beam, EFFORT.angle, EFFORT.torque_limit, "effort", EFFORT.duration, intervals=40)
    referee = Referee(EFFORT)
    assert referee.miss(slew.history) < 1e-6
    further = replace(slew.history, left=1.01 * slew.history.left, right=1.01 * slew.history.right)
    assert referee.miss(further) > 1e-2
    with pytest.raises(ValueError, match="held"):
        referee.miss(ramped(np.linspace(0.0, 1.0, 3), np.array([0.0, 1.0, 0.0])))


@pytest.mark.slow
def test_the_least_effort_is_that_of_ours_extrapolated():
    ours = [
        optimal_slew(EFFORT.beam, EFFORT.angle, 200.0, "effort", EFFORT.duration, intervals=n).cost for n in (100, 200)
    ]
    least = Referee(EFFORT).least_effort()
    assert least < ours[1] < ours[0]
    assert least == pytest.approx(ours[1] - (ours[0] - ours[1]) / 3.0, rel=1e-6)


@pytest.mark.slow
def test_the_least_time_is_ours():
    least = Referee(EFFORT).least_time()
    assert optimal_slew(EFFORT.beam, EFFORT.angle, 200.0, tolerance=1e-8).duration == pytest.approx(least, rel=1e-9)


def test_too_little_torque_is_said_to_fail():
    with pytest.raises(Failed):
        Referee(replace(EFFORT, duration=2.0)).least_effort()  # the least time is 2.9 s


def test_a_programme_starts_again_from_a_neighbour():
    programme = opti_programme(EFFORT, mapped=True)
    near = programme.solve(0.99 * EFFORT.angle)
    again = programme.torque(programme.solve(EFFORT.angle, near))
    anew = programme.torque(programme.solve(EFFORT.angle))
    assert again.left == pytest.approx(anew.left, abs=1e-4 * EFFORT.torque_limit)


@pytest.mark.slow
@pytest.mark.parametrize("maker", [least_effort, partial(fastest, "slew-time")], ids=["least_effort", "fastest"])
def test_everybody_answers_and_finer_is_better(maker):
    scene = maker("quick")
    found = {}
    for setting in scene.settings:
        cold = scene.error(setting.cold(0.0))
        found.setdefault(setting.competitor, []).append(cold)
        if setting.hot is not None:
            assert scene.error(setting.hot(setting.prepare())) == pytest.approx(cold, rel=1e-2)
    for name, errors in found.items():
        assert np.isfinite(errors).all()
        assert errors == sorted(errors, reverse=True), name


@pytest.mark.slow
def test_the_references_of_three_modes_are_ours():
    effort = replace(EFFORT, beam=AssumedModesBeam(HubBeamParameters(), "sfoam", 3), duration=3.0, intervals=400)
    referee = Referee(effort)
    ours = [optimal_slew(effort.beam, effort.angle, 200.0, "effort", 3.0, intervals=n).cost for n in (200, 400)]
    assert referee.least_effort() == pytest.approx(ours[1] - (ours[0] - ours[1]) / 3.0, rel=5e-7)
    least = Referee(
        replace(effort, intervals=100)
    ).least_time()  # ends with exact switches from whatever mesh it begins on
    assert optimal_slew(effort.beam, effort.angle, 200.0).duration == pytest.approx(least, rel=1e-9)


@pytest.mark.slow
def test_certificates_of_least_time_hold_against_exact_durations():
    found = measured(certified("quick"), 1e-3, lambda text: None)
    assert len(found.kept) == 8
    assert all(kept.held for kept in found.kept), found.kept
