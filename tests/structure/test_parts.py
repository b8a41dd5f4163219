"""Parts of a machine: what each refuses, in a line that names parameter and value."""

from math import pi

import numpy as np
import pytest

from boomctl.structure import (
    GROUND,
    Beam,
    BeamSection,
    CutJoint,
    DiscreteElements,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SpringDamper,
    fixed,
    free,
    prismatic,
    revolute,
)
from boomctl.structure.kinematics import Frame, Row

SECTION = BeamSection(2.0, 1.0, 1.0)
BODY = RigidBody("body", GROUND.at(0.0), free("y"), 1.0)
BEAM = Beam("beam", GROUND.at(1.0), revolute(), (0.0, 0.0), (SECTION,), FiniteElements(2))


def beam(**changes):
    """Return ``BEAM`` with other fields."""
    fields = {"parent": GROUND.at(1.0), "joint": revolute(), "start": (0.0, 0.0), "sections": (SECTION,)}
    return Beam("beam", **{**fields, "discretization": FiniteElements(2), **changes})


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda x: RigidBody("b", GROUND.at(0.0), fixed(), mass=x), "mass of 'b' = "),
        (lambda x: RigidBody("b", GROUND.at(0.0), fixed(), inertia=x), "inertia of 'b' = "),
        (lambda x: BeamSection(1.0, 1.0, 1.0, damping=x), "damping of a beam section = "),
        (lambda x: SpringDamper(BODY.at(0.0), GROUND.at(0.0), "y", stiffness=x), "stiffness of a spring = "),
        (lambda x: SpringDamper(BODY.at(0.0), GROUND.at(0.0), "y", damping=x), "damping of a damper = "),
    ],
)
def test_what_may_be_zero_may_not_be_less(build, message):
    assert build(0.0) is not None
    for wrong, expected in (
        (-1.0, "-1.0: expected zero or a number greater"),
        (np.nan, "nan: expected a finite number"),
    ):
        with pytest.raises(ValueError, match=message + expected):
            build(wrong)
    with pytest.raises(TypeError, match=message + "'1': expected a real number, got str"):
        build("1")


@pytest.mark.parametrize("field", ["length", "mass_per_length", "bending_stiffness"])
@pytest.mark.parametrize("wrong", [0.0, -1.0])
def test_a_beam_section_has_length_mass_and_stiffness(field, wrong):
    values = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0, field: wrong}
    with pytest.raises(ValueError, match=rf"{field}.* = {wrong}: expected a number greater than zero"):
        BeamSection(**values)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "build",
    [
        lambda x: GROUND.at(x),
        lambda x: BODY.at(0.0, x),
        lambda x: BEAM.at(x),
        lambda x: prismatic(x),
        lambda x: beam(angle=x),
        lambda x: beam(start=(x, 0.0)),
        lambda x: RigidBody("b", GROUND.at(0.0), fixed(), centre=(0.0, x)),
        lambda x: Force("f", BODY.at(0.0), x),
        lambda x: Output("y", BODY.at(0.0), x),
        lambda x: SpringDamper(BODY.at(0.0), GROUND.at(0.0), x),
        lambda x: Output("y", BODY.at(0.0), bandwidth_hz=x),
    ],
)
def test_places_and_directions_are_finite(build, wrong):
    with pytest.raises(ValueError, match=r"= -?(nan|inf): expected a finite number"):
        build(wrong)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Force("f", BODY.at(0.0), 90.0), r"direction = 90\.0: expected radians, at most one turn"),
        (lambda: beam(angle=45), "angle of beam 'beam' = 45: expected radians"),
        (lambda: prismatic(180.0), r"angle = 180\.0: expected radians"),
        (lambda: free("z"), r"unknown freedom 'z' \(there are: x, y, theta\)"),
        (lambda: free("teta"), "did you mean 'theta'"),
        (lambda: Force("f", BODY.at(0.0), "thetta"), "unknown direction 'thetta'; did you mean 'theta'"),
        (lambda: Output("y", BODY.at(0.0), "up"), r"unknown direction 'up' \(there are: x, y, theta\)"),
        (lambda: SpringDamper(BODY.at(0.0), GROUND.at(0.0), "z"), "unknown direction 'z'"),
        (lambda: CutJoint(BODY.at(0.0), GROUND.at(0.0), ("z",)), "unknown direction 'z'"),
        (lambda: SpringDamper(BODY.at(0.0), BODY.at(1.0), "y"), "both ends are on 'body'; expected two bodies"),
        (lambda: Force("f", BODY.at(0.0), reaction=BODY.at(1.0)), "force 'f': both ends are on 'body'"),
        (lambda: CutJoint(BODY.at(0.0), BODY.at(0.0)), "cut joint: both ends are on 'body'"),
        (lambda: Output("y", BODY.at(0.0), derivative=3), "derivative of output 'y' = 3: expected 0, 1 or 2"),
        (lambda: Output("y", BODY.at(0.0), bandwidth_hz=0.0), "bandwidth_hz of output 'y' = 0.0: expected a number gr"),
        (lambda: beam(sections=()), "beam 'beam': expected at least one section"),
        (lambda: beam(parent=GROUND.at(2.1)), r"point \(2\.1, 0\) is not on beam 'beam': it lies 2\.1 m along"),
        (lambda: beam(parent=GROUND.at(1.0, 0.1)), r"0\.1 m beside an axis of 2 m"),
        (lambda: BEAM.at(-0.001), r"`s` must be from 0 to 2 m, the length of beam .beam., got -0\.001\. Use `at_point"),
        (lambda: BEAM.at(2.5), r"`s` must be from 0 to 2 m, .* got 2\.5\."),
        (lambda: DiscreteElements(4, "consistent"), "unknown mass allocation 'consistent'.*hermite, linear, lumped"),
        (lambda: FiniteElements(4, 2), "order = 2: expected a whole number not below 3"),
        (lambda: FiniteElements(4, 21), "order = 21: expected 3 to 20"),
        (lambda: FiniteElements(0), "elements = 0: expected a whole number not below 1"),
        (lambda: DiscreteElements(-2), "elements = -2: expected a whole number not below 1"),
    ],
)
def test_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()


@pytest.mark.parametrize("wrong", ["1", None, True])
def test_a_place_is_a_number(wrong):
    with pytest.raises(TypeError, match=f"x = {wrong!r}: expected a real number"):
        GROUND.at(wrong)


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
