"""What cannot be done is said, in words, before or after trying; bad input names parameter and expectation."""

import re
from functools import cache

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import boomctl as bc
from boomctl.slew import compare_slews, input_shaper, rest_to_rest_torque
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


def single(C=((1.0, 0.0),), A=((0.0, 1.0), (0.0, 0.0)), D=0.0, dt=0):
    """A system of other matrices than a slew takes."""
    return bc.optimal_slew(control.ss(A, np.eye(len(A))[:, [1]], C, D, dt), 1.0, 1.0)


@cache
def tracked(**options):
    return beam(torque_limit=140.0).track(sample_time=0.02, **options)


REFUSED = [
    (lambda: turned(duration=1.0), "duration = 1 s: too short for a change of angle by 1; "),
    (lambda: turned(duration=3.0, speed_limit=0.1), "at speed_limit = 0.1, which takes at least 10 s"),
    (
        lambda: turned(rigid(1.0), 2.0, 5.0, duration=1.0, speed_limit=1.0, final_speed=0.5),
        "^duration = 1 s: too short for a change of angle by 2 at speed_limit = 1, which takes at least 2 s$",
    ),
    (
        lambda: turned(rigid(1.0), None, 5.0, duration=1.0, speed_limit=1.0, final_state=[2.0, 0.5]),
        "^duration = 1 s: too short",
    ),
    # no margin for a beam's bending: the bound is exact
    (
        lambda: beam(objective="effort", duration=3.2, speed_limit=0.3),
        r"^duration = 3\.2 s: too short for 1 rad at speed_limit = 0\.3 rad/s, which takes at least 3\.333334 s$",
    ),
    (lambda: turned(angle=None, duration=3.0, final_speed=2.0, speed_limit=1.0), "final_speed"),
    (lambda: turned(duration=4.0, torque_rate_limit=50.0), "torque_rate_limit = 50, or needs"),
    (lambda: turned(), "duration"),
    (lambda: turned(LOADED, torque_limit=1e6, objective="time"), r"torque_limit = 1e\+06 N m: bends"),
    (
        lambda: masses(initial_state=[0.0, 0.0, 2.0, 2.0], speed_limit=1.0),
        "speed_limit = 1: the initial_state has 2 at",
    ),
    (lambda: masses(duration=2.0), "duration"),
    (lambda: masses(angle=0.0), "end state already"),
    (lambda: masses(None, "effort", 2.0), "end state already"),
    (lambda: masses(tip_limit=1.0), "tip_displacement"),
    (lambda: masses(tip_masses=(0.1,)), "tip_masses"),
    (lambda: masses(initial_state=[0.0]), "initial_state"),
    (lambda: masses(final_state=[2.0, 2.0, 0.0, 0.0]), r"angle = 1\.0: expected None or 2, as the final_state has it"),
    (lambda: masses(angle_deg=60.0), "angle, angle_deg: expected one of them, got both"),
    (lambda: bc.optimal_slew(two_masses(), torque_limit=1.0), "angle: expected an angle"),
    (lambda: bc.optimal_slew(two_masses(), 1.0), "torque_limit: expected the largest torque"),
    (lambda: beam(progress=1), "progress = 1: expected a function"),
    (lambda: single(dt=0.1), "continuous"),
    (lambda: single(D=1.0), "C B = 0"),
    (lambda: single(A=[[0, 1, 0], [0, 0, 0], [0, 0, -1]], C=[[1, 0, 0]]), "does not move the mode"),
    (lambda: single(A=[[0.0, 1.0], [-1.0, 0.0]]), "rest at any angle"),
    # no torque is needed
    (
        lambda: turned(rigid(1.0), None, 1.0, duration=2.0, initial_state=[0.0, 1.0], final_state=[2.0, 1.0]),
        "by itself",
    ),
    (lambda: beam(initial_state=np.zeros(4)), "initial_state: expected None for a hub-beam"),
    # shaped torques and comparisons
    (lambda: input_shaper("ZV", bc.hub_beam(modes=1), 0.01), "expected none for a hub-beam"),
    (lambda: rest_to_rest_torque("bang-bang", input_shaper("ZV", 1.0), 0.0, 1.0, 1.0), "angle"),
    (lambda: input_shaper("EI", 1.0, level=2.0), r"level = 2\.0"),
    (lambda: compare_slews(bc.hub_beam(modes=1), None, 200.0, final_speed=0.0), "final_speed"),
    (lambda: compare_slews(bc.hub_beam(modes=1), 1.0, 9.0, {"a": 5}), "optimal"),
    # feedback along a slew
    (lambda: tracked(torque_limit=100.0), "torque_limit = 100: expected at least 140 N m"),
    (
        lambda: tracked(measurements=("hub_angle",)),
        "noise: expected a standard deviation above zero for each measurement",
    ),
    (lambda: tracked(noise=1.0), "noise: expected None without measurements"),
    (lambda: tracked(measurements=("tip_displacement",), noise=1e-3), "measurements: they do not show all"),
    (lambda: masses().track(), "expected one of a hub-beam"),
    (lambda: tracked().monte_carlo(4, tip_mass=(0.2, 0.1)), "expected the lower end first"),
    (lambda: tracked().monte_carlo(4, stiffness=1.5), "stiffness = 1.5: expected a half-width"),
    (lambda: tracked().monte_carlo(4, friction=[1.0, 2.0, 3.0]), "friction has shape"),
    (lambda: tracked().monte_carlo(4, settling_time=99.0), "settling_time = 99"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_combination_that_is_impossible_refused(call, words):
    with pytest.raises((TypeError, ValueError, bc.exceptions.SlewError), match=words):
        call()


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
    said = re.search(rf"{name} = {value:g} .*? is (?:exceeded most at|met from) t = (\S+) s", message)
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
    assert f"beyond a tenth of the length after {far.small_deformation_until:.4g} s" in repr(far)
    assert np.isinf(near.small_deformation_until)
    assert "tenth" not in repr(near)
