"""Displacement inputs that cannot be: refused in a line that names them."""

import numpy as np
import pytest

from boomctl.structure import SecondOrderModel, prescribe_displacement

FORCES = {
    "left": [1.0, 0.0, 0.0, 0.0],
    "right": [0.0, 1.0, 0.0, 0.0],
    "sum": [1.0, 1.0, 0.0, 0.0],
    "mixed": [1.0, 1.0, 1.0, 0.0],
    "other": [3.0, -2.0, -2.0, 0.0],
    "nothing": [0.0, 0.0, 0.0, 0.0],
    "third": [0.0, 0.0, 1.0, 0.0],
    "fourth": [0.0, 0.0, 0.0, 1.0],
}
MODEL = SecondOrderModel(np.eye(4), 0.1 * np.eye(4), np.diag([1.0, 2.0, 3.0, 4.0]), FORCES, {"y": [1, 1, 1, 1]})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"inputs": "lfet"}, "unknown input 'lfet'; did you mean 'left'"),
        ({"inputs": "left", "hold": "rihgt"}, "did you mean 'right'"),
        ({"inputs": "nothing"}, "'nothing' moves no coordinate"),
        ({"inputs": ["left", "right", "sum"]}, "'left', 'right', 'sum': more displacements"),
        ({"inputs": ["left", "mixed", "other"]}, "displacement of '.*' depends on that of '.*', '.*'"),
        ({"inputs": ["left"], "hold": ["mixed", "other"]}, "depends on that of"),
        ({"inputs": ["left", "left"]}, "input 'left' is asked for twice"),
        ({"inputs": ["left"], "hold": ["left"]}, "'left' is prescribed twice"),
        ({"inputs": ["left", "right", "third", "fourth"]}, "4 displacements .* 4 coordinates"),
        ({"inputs": "left", "motion": "jerk"}, "unknown motion 'jerk'.*displacement, velocity, acceleration"),
        ({"inputs": "left", "motion": "velocty"}, "did you mean 'velocity'"),
    ],
)
def test_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        prescribe_displacement(MODEL, **arguments)


@pytest.mark.parametrize("second", [{"inputs": "left"}, {"inputs": "right"}, {"hold": "right"}])
def test_nothing_more_is_prescribed_once_something_moves(second):
    """Its displacement would depend on that of the point that moves already."""
    driven = prescribe_displacement(MODEL, "left")
    with pytest.raises(ValueError, match=r"\['left'\] impose motion already: prescribe all displacements in one call"):
        prescribe_displacement(driven, **second)


def test_nearly_dependent_columns_are_refused():
    """To ten digits the same column: no choice of coordinates could carry it."""
    almost = SecondOrderModel(np.eye(3), np.eye(3), np.eye(3), {"a": [1.0, 1.0, 0.0], "b": [1.0, 1.0 + 1e-11, 0.0]}, {})
    with pytest.raises(ValueError, match=r"'.' depends on that of '.'"):
        prescribe_displacement(almost, ["a", "b"])


def test_what_is_not_there_is_listed():
    with pytest.raises(ValueError, match="there are: left, right, sum, mixed, other, nothing, third, fourth"):
        prescribe_displacement(MODEL, "x")
