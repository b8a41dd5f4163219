"""Points of a machine: they move with their bodies, by rows that add and cancel."""

from math import pi

import numpy as np
import pytest

from boomctl.structure.kinematics import Frame, Row


def test_a_point_moves_with_its_body():
    """Turning by a small angle moves a point across its lever arm; lengths stay."""
    frame = Frame(1.0, 2.0, Row({"x": 1.0}), Row({"y": 1.0}), Row({"turn": 1.0}))
    point = frame.moved_to(4.0, 6.0)
    assert point.x.terms == {"x": 1.0, "turn": -4.0}
    assert point.y.terms == {"y": 1.0, "turn": 3.0}
    assert point.along(0.0) == point.x
    assert point.along(pi / 2) == point.y
    assert point.along(np.arctan2(4.0, 3.0)).terms.get("turn", 0.0) == pytest.approx(0.0, abs=1e-15)


def test_rows_add_and_cancel():
    a, b = Row({"a": 1.0}), Row({"b": 1.0})
    assert (a.scaled(2.0, 2.0) + b - a).terms == {"a": 1.0, "b": 1.0}
    assert (a - a).terms == {}
    assert a.scaled(0.0, 1.0).terms == {}
