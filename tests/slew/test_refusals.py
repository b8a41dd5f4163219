"""What cannot be done is said, in words, before or after trying; bad input names parameter and expectation."""

import re
from functools import cache

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import boomctl as bc
from tests.refusals import assert_refused, refusals
from tests.slew.systems import rigid, two_masses

pytestmark = pytest.mark.early

LOADED = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), modes=2)


def turned(system=None, angle=1.0, torque_limit=100.0, objective="effort", duration=None, **more):
    """A slew of a rigid body, or another plant."""
    return bc.optimal_slew(rigid(241.0) if system is None else system, angle, torque_limit, objective, duration, **more)


def masses(angle=1.0, objective="time", duration=None, **more):
    return bc.optimal_slew(two_masses(), angle, 1.0, objective, duration, **more)


def beam(modes=1, **more):
    h = bc.hub_beam(modes=modes)
    return turned(h, **{"torque_limit": 200.0, "objective": "time"} | more)


def single(C=((1.0, 0.0),), A=((0.0, 1.0), (0.0, 0.0)), D=0.0, dt=0, final_state=None):
    """A system of other matrices than a slew takes."""
    system = control.ss(A, np.eye(len(A))[:, [1]], C, D, dt)
    return bc.optimal_slew(system, None if final_state else 1.0, 1.0, final_state=final_state)


@cache
def tracked(**options):
    return beam(torque_limit=140.0).track(sample_time=0.02, **options)


REFUSED = r"""
turned(duration=1.0) -> SlewError: duration = 1 s: too short for a change of angle by 1;
turned(duration=3.0, speed_limit=0.1) -> SlewError: at speed_limit = 0.1, which takes at least 10 s
turned(rigid(1.0), 2.0, 5.0, duration=1.0, speed_limit=1.0, final_speed=0.5)
    -> SlewError: ^duration = 1 s: too short for a change of angle by 2 at speed_limit = 1, which takes at least 2 s$
turned(rigid(1.0), None, 5.0, duration=1.0, speed_limit=1.0, final_state=[2.0, 0.5]) -> SlewError: ^duration = 1 s: too short
# no margin for a beam's bending: the bound is exact
beam(objective="effort", duration=3.2, speed_limit=0.3)
    -> SlewError: ^duration = 3\.2 s: too short for 1 rad at speed_limit = 0\.3 rad/s, which takes at least 3\.333334 s$
turned(angle=None, duration=3.0, final_speed=2.0, speed_limit=1.0) -> SlewError: final_speed
turned(duration=4.0, torque_rate_limit=50.0) -> SlewError: torque_rate_limit = 50, or needs
turned() -> duration
turned(LOADED, torque_limit=1e6, objective="time") -> SlewError: torque_limit = 1e\+06 N m: bends
masses(initial_state=[0.0, 0.0, 2.0, 2.0], speed_limit=1.0) -> SlewError: speed_limit = 1: the initial_state has 2 at
masses(duration=2.0) -> duration
masses(angle=0.0) -> end state already
masses(None, "effort", 2.0) -> end state already
masses(tip_limit=1.0) -> tip_displacement
masses(tip_masses=(0.1,)) -> tip_masses
masses(initial_state=[0.0]) -> initial_state
masses(final_state=[2.0, 2.0, 0.0, 0.0]) -> angle = 1\.0: expected None or 2, as the final_state has it
masses(angle_deg=60.0) -> angle, angle_deg: expected one of them, got both
bc.optimal_slew(two_masses(), torque_limit=1.0) -> angle: the plant is at its end state already; expected another angle
bc.optimal_slew(two_masses(), 1.0) -> torque_limit: expected the largest torque
beam(progress=1) -> progress = 1: expected a function
single(dt=0.1) -> continuous
single(D=1.0) -> C B = 0
single(A=[[0, 1, 0], [0, 0, 0], [0, 0, -1]], C=[[1, 0, 0]]) -> does not move the mode
single(A=[[0.0, 1.0], [-1.0, 0.0]]) -> rest at any angle
# no torque is needed
turned(rigid(1.0), None, 1.0, duration=2.0, initial_state=[0.0, 1.0], final_state=[2.0, 1.0]) -> by itself
beam(initial_state=np.zeros(4)) -> initial_state: expected None for a hub-beam
# shaped torques and comparisons
input_shaper("ZV", bc.hub_beam(modes=1), 0.01) -> expected none for a hub-beam
rest_to_rest_torque("bang-bang", input_shaper("ZV", 1.0), 0.0, 1.0, 1.0) -> angle
input_shaper("EI", 1.0, level=2.0) -> level = 2\.0
compare_slews(bc.hub_beam(modes=1), None, 200.0, final_speed=0.0) -> final_speed
compare_slews(bc.hub_beam(modes=1), 1.0, 9.0, {"a": 5}) -> optimal
TorqueProfile([0, 2, 1], [1, 1], [1, 1]) -> edges = \[0\.0, 2\.0, 1\.0\]: expected at least two ascending times
TorqueProfile([1, 2], [1], [1]) -> edges = \[1\.0, 2\.0\]: .* from 0 on
TorqueProfile([0, 1], [1], [1, 2]) -> end_values: expected 1 torques, one an interval, got 2
# feedback along a slew
tracked(torque_limit=100.0) -> torque_limit = 100: expected at least 140 N m
tracked(measurements=("hub_angle",)) -> noise: expected a standard deviation above zero for each measurement
tracked(noise=1.0) -> noise: expected None without measurements
tracked(measurements=("tip_displacement",), noise=1e-3) -> measurements: they do not show all
masses().track() -> expected one of a hub-beam
tracked().monte_carlo(4, tip_mass=(0.2, 0.1)) -> expected the lower end first
tracked().monte_carlo(4, stiffness=1.5) -> stiffness = 1.5: expected a half-width
tracked().monte_carlo(4, friction=[1.0, 2.0, 3.0]) -> friction has shape
tracked().monte_carlo(4, settling_time=99.0) -> settling_time = 99
# a tolerance that the torque planned without axial modes does not meet
bc.optimal_slew(bc.hub_beam(tip_mass=0.3, model="foam", modes=2), 1.0, 300.0, "effort", 3.0, rtol=1e-9)
    -> SlewError: ^the replay ends .*e-06 off the end state; .* A larger rtol may do
switching_function(one.slew()) -> bang-bang
"""


@refusals(REFUSED)
def test_combination_that_is_impossible_refused(call, words):
    assert_refused(call, words, globals())


def test_rigid_bound_is_sharp():
    least = 2.0 * np.sqrt(241.0 / 100.0)
    with pytest.raises(bc.exceptions.SlewError, match="needs"):
        bc.optimal_slew(rigid(241.0), 1.0, 100.0, "effort", 0.999 * least)
    assert bc.optimal_slew(rigid(241.0), 1.0, 100.0, "effort", 1.01 * least, intervals=100).terminal_error < 1e-6


@pytest.mark.parametrize(
    ("name", "value", "duration"),
    [
        ("torque_limit", 200.0, 2.4),
        ("torque_rate_limit", 400.0, 2.9),
        pytest.param("speed_limit", 0.4, 2.8, marks=pytest.mark.slow),
        pytest.param("tip_limit", 0.05, 2.8, marks=pytest.mark.slow),
        pytest.param("moment_limit", 5.0, 2.8, marks=pytest.mark.slow),
    ],
)
def test_failure_names_the_limit_and_the_time(name, value, duration):
    ask = {"torque_limit": 300.0, "intervals": 40, "duration": duration} | {name: value}
    with pytest.raises(bc.exceptions.SlewError, match=f"no slew of {duration:g} s was found: ") as caught:
        bc.optimal_slew(bc.hub_beam(modes=1), 1.0, objective="effort", **ask)
    message = str(caught.value)
    said = re.search(rf"{name} = {value:g} .*? is (?:exceeded most at|active from) t = (\S+) s", message)
    assert said, message
    assert 0.0 <= float(said[1]) <= duration
    assert "Ipopt" not in message
    assert "\n" not in message


def test_units_are_those_of_the_plant_or_none():
    """Meters and newtons are called by their own names, without a unit; a hub-beam's linear model has its units."""
    A, B, C = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]]
    crane = control.ss(A, B, C, 0.0, inputs="force", outputs="place")
    slew = bc.optimal_slew(crane, 2.0, 1.0)
    said = repr(slew) + repr(slew.torque_profile) + str(list(slew.__figures__()))
    assert not re.search(r"\brad\b|N m|torque|angle", said)
    assert "place by 2 in" in said
    assert "force up to 1\n" in said
    assert [each.get_ylabel() for each in slew.plot(Figure().subplots(3, 1))] == ["force", "place", "rate of place"]
    assert slew.torque_profile.plot(Figure().subplots()).get_ylabel() == "torque"
    with pytest.raises(
        bc.exceptions.SlewError, match="too short for a change of place by 2; a rigid body of inertia 1 takes"
    ):
        bc.optimal_slew(crane, 2.0, 1.0, "effort", 1.0)
    turned = control.ss(A, B, C, 0.0, inputs="torque", outputs="hub_angle")
    slew = bc.optimal_slew(turned, 2.0, 1.0)
    assert "2 rad in" in repr(slew)


def test_a_tip_beyond_a_tenth_of_the_length_is_said():
    """As the replay in the same model says; of a gentler slew there is nothing to say."""
    beam = bc.hub_beam(modes=1)
    far, near = (bc.optimal_slew(beam, 1.0, 200.0, "effort", T, intervals=20) for T in (3.0, 6.0))
    again = beam.simulate(far)
    assert far.small_deformation_until == pytest.approx(again.small_deformation_until, abs=1e-3)
    assert f"small-deformation model invalid after {far.small_deformation_until:.4g} s" in repr(far)
    assert np.isinf(near.small_deformation_until)
    assert "invalid" not in repr(near)
