"""A four-bar linkage with a flexible coupler, closed in three ways, and its rigid limit."""

from math import atan2, hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigvalsh

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SpringDamper,
    planar,
    revolute,
)

A, D = (0.0, 0.0), (4.0, 0.5)
SPRING, DAMPER = 30.0, 0.7


def linkage(B, C, stiffness, mesh=FiniteElements(4)):  # noqa: B008
    """Return crank AB, rocker DC and a coupler BC, closed by a cut joint."""
    length, angle = hypot(C[0] - B[0], C[1] - B[1]), atan2(C[1] - B[1], C[0] - B[0])
    crank = RigidBody("crank", GROUND.at(*A), revolute(), 2.0, 0.5, (B[0] / 2, B[1] / 2))
    rocker = RigidBody("rocker", GROUND.at(*D), revolute(), 3.0, 0.8, ((C[0] + D[0]) / 2, (C[1] + D[1]) / 2))
    section = BeamSegment(length, 0.9, stiffness, 1e-3)
    coupler = Beam("coupler", crank.at(*B), revolute(), B, (section,), mesh, angle)
    return Assembly(
        bodies=(crank, rocker, coupler),
        springs=(SpringDamper(crank.at(*A), GROUND.at(*A), "theta", SPRING, DAMPER),),
        forces=(Force("crank", crank.at(*B), "theta"),),
        outputs=(
            Output("crank", crank.at(*A), "theta"),
            Output("rocker", rocker.at(*D), "theta"),
            Output("middle", coupler.at(length / 2), "y"),
        ),
        cut_joints=(CutJoint(coupler.end, rocker.at(*C)),),
    )


shapes = st.tuples(
    st.tuples(st.floats(-0.8, 0.8), st.floats(1.0, 2.0)), st.tuples(st.floats(3.0, 5.0), st.floats(1.5, 3.0))
)


def rigid_frequency(B, C):
    """Return the undamped natural frequency of the rigid linkage [rad/s] from the speeds of its three links."""
    B, C = np.array(B), np.array(C)
    turned = [np.array([-v[1], v[0]]) for v in (B - A, C - B, C - D)]
    coupler, rocker = np.linalg.solve(np.column_stack([turned[1], -turned[2]]), -turned[0])
    length = np.linalg.norm(C - B)
    mass = 0.9 * length
    middle = turned[0] + coupler * turned[1] / 2
    inertia = 0.5 + 2.0 * (B @ B) / 4 + rocker**2 * (0.8 + 3.0 * ((C - D) @ (C - D)) / 4)
    inertia += mass * (middle @ middle) + coupler**2 * mass * length**2 / 12
    return np.sqrt(SPRING / inertia)


@given(shapes)
def test_a_stiff_coupler_leaves_the_rigid_linkages_one_frequency(shape):
    """The coupler's compliance lowers it by its share, one over the stiffness; K's condition of 1e8 rounds at 2e-8."""
    expected = rigid_frequency(*shape)
    change = []
    for stiffness in (1e5, 1e6):
        model = linkage(*shape, stiffness).assemble()
        lowest = eigvalsh(model.M, model.K)[-1] ** -0.5  # upside down, which keeps the lowest accurate
        change.append(1 - lowest / expected)
    assert abs(change[1]) < 1e-3
    assert change[0] == pytest.approx(10 * change[1], rel=0.05, abs=2e-8)


@pytest.mark.parametrize("place", [0.3, 0.1 + 0.2])
def test_a_cut_joint_at_a_hinge_is_no_lock(place):
    """Places that are one but for rounding are one: the joint holds nothing there that the hinge does not hold already."""
    arm = RigidBody("arm", GROUND.at(0.3), planar("x", "theta"), 1.0, 0.1, (0.8, 0.0))
    swing = Force("swing", arm.at(1.0), "y")
    with pytest.raises(ValueError, match="is fully constrained"):
        Assembly((arm,), (), (swing,), cut_joints=(CutJoint(arm.at(place), GROUND.at(place), ("y",)),)).assemble()


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_a_short_lever_is_a_lever(gap):
    arm = RigidBody("arm", GROUND.at(0.3), revolute(), 1.0, 0.1)
    spring = SpringDamper(arm.at(0.3 + gap), GROUND.at(0.3 + gap), "y", 1.0)
    model = Assembly((arm,), (spring,), (Force("swing", arm.at(1.3), "y"),)).assemble()
    assert model.K[0, 0] == pytest.approx(gap**2, rel=1e-6)


def test_a_locked_chain_answers_nothing_at_rest_too():
    bar = RigidBody("bar", GROUND.at(0.0), revolute(), 1.0, 1.0)
    ports = (Force("f", bar.at(1.0)),), (Output("y", bar.at(1.0)),)
    model = Assembly((bar,), (), *ports, (CutJoint(bar.at(1.0), GROUND.at(1.0), ("y",)),)).assemble()
    assert model.ncoordinates == 0
    assert (model.frequency_response([0.0, 1.0]).frdata == 0.0).all()
