"""Parts, meshes and signals that do not fit together are refused in words that say what to do."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.boom.exact import exact_boom
from boomctl.boom.model import ACTUATORS, boom_assembly
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    fixed,
    planar,
    prescribe_displacement,
    revolute,
)
from boomctl.structure.beams.eigenvalues import damped_eigenvalues
from boomctl.structure.response.modes import undamped_modes
from tests import handed_out as one
from tests.refusals import assert_refused, refusals
from tests.strategies import random_stepped_beam

ONE = np.eye(1)
SECTION = BeamSegment(2.0, 1.0, 1.0)
BODY = RigidBody("body", GROUND.at(0.0), planar("y"), 1.0)
OTHER = RigidBody("other", BODY.at(0.0), planar("y"), 1.0)
CRANK = RigidBody("crank", GROUND.at(0.0), revolute(), 1.0, 1.0)
MASSLESS = RigidBody("body", GROUND.at(0.0), revolute())
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


def beam(mesh=FiniteElements(2), **changes):  # noqa: B008
    fields = {"parent": GROUND.at(1.0), "joint": revolute(), "start": (0.0, 0.0), "segments": (SECTION,)}
    return Beam("beam", **{**fields, "discretization": mesh, **changes})


def meshed(mesh, direction="y"):
    """Return the model of a clamped beam of 2 m with forces at 0.3 m and its end."""
    part = beam(mesh, parent=GROUND.at(0.0), joint=fixed())
    return Assembly((part,), (), (Force("f", part.at(0.3)), Force("t", part.at(2.0), direction))).assemble()


def chained(*cuts):
    return Assembly((CRANK,), cut_joints=cuts).assemble()


def moved(*inputs, **options):
    return prescribe_displacement(MODEL, inputs, **options)


def driven_acceleration(motion):
    """Return the state space of a mass whose moved point's acceleration is read."""
    read = Output("read", BODY.at(0.0), derivative=2)
    model = Assembly((BODY, OTHER), (), (Force("p", BODY.at(0.0)), Force("f", OTHER.at(0.0))), (read,)).assemble()
    return prescribe_displacement(model, "p", motion=motion).to_statespace()


def read_exactly(**options):
    machine = random_stepped_beam(0)
    read = Output("y", machine.outputs[0].point, **options)
    return Assembly(machine.bodies, (), machine.forces, (read,)).to_exact().response(np.ones(1), ["tip"], ["y"])


def modes_of(M, K):
    return undamped_modes(SecondOrderModel(M, np.eye(2), K).structure)


REFUSED = r"""
# machines
Assembly((BODY, BODY)) -> two of the assembly's body names are 'body'
Assembly((OTHER, BODY)) -> body 'other' refers to body 'body'; expected one listed before: \['ground'\]
Assembly((BODY,), (), (Force("f", BODY.at(0)), Force("f", BODY.at(1)))) -> force names are 'f'
Assembly((BODY,), (SpringDamper(BODY.at(0), OTHER.at(0), "y"),)) -> refers to body 'other'
Assembly((RigidBody("b", GROUND.at(0.0), fixed(), 1.0),)).assemble() -> no coordinate|cannot move|no freedom
Assembly((MASSLESS,), (), (Force("f", MASSLESS.at(1.0)),)).assemble() -> 'body.theta', which has no inertia
Assembly((BODY, RigidBody("hand", BODY.at(0.0), revolute()))).assemble() -> hand\.theta
CutJoint(CRANK.at(1.0), GROUND.at(1.1)) -> its points must coincide at rest, got a distance of 0\.1 m
chained(*2 * (CutJoint(CRANK.at(1.0), GROUND.at(1.0), ("y",)),)) -> cut joint between crank and ground
# meshes
meshed(FiniteElements((0.0, 0.5))) -> stations of beam 'beam' run from 0 to 0\.5 m; expected 0 to 2 m
meshed(FiniteElements((0.0, 0.6, 0.4, 2.0))) -> expected at least two, ascending
meshed(FiniteElements((0.0, 0.3, 0.1 + 0.2, 2.0))) -> is 5\.6e-17 m long; .*, or one node for both
meshed(DiscreteElements((0.0, 0.5, 2.0))) -> station 0\.3 m, which is not a mass allocation point
meshed(DiscreteElements(1)) -> elements = 1: beam 'beam' has 2 intervals between attachments
meshed(DiscreteElements(4, "lumped"), "theta") -> 'beam\.phi4', which has no inertia: give it some
FiniteElements(4, 21) -> order = 21: expected a whole number of at most 20
bc.spray_boom(elements=100_000) -> at most 1000 coordinates, got \d+. Use a few elements of high order
SecondOrderModel(*3 * (np.eye(1001),)) -> must have at most 1000 coordinates, got
# parts
Force("f", BODY.at(0.0), 90.0) -> direction = 90\.0: expected radians, at most one turn
beam(angle=45) -> angle of beam 'beam' = 45: expected radians
beam(FiniteElements(1), parent=GROUND.at(0.0), joint=fixed()).at(1, 0.5) -> `s` must be one number.*at_point
SpringDamper(BODY.at(0.0), BODY.at(1.0), "y") -> both ends are on 'body'; expected two bodies
CutJoint(BODY.at(0.0), BODY.at(0.0)) -> cut joint: both ends are on 'body'
Output("y", BODY.at(0.0), derivative=3) -> derivative of output 'y' = 3: expected a whole number of at most 2
beam(segments=()) -> beam 'beam': expected at least one segment
beam(parent=GROUND.at(1.0, 0.1)) -> 0\.1 m off an axis of 2 m
beam().at(-0.001) -> `s` must be from 0 to 2 m, the length of beam .beam., got -0\.001\. Use `at_point
rectangular_section(0.02, 0.06, 0.01) -> wall = 0\.01: expected less than half the width
rectangular_section(0.06, 0.02, (0.001, 0.02)) -> less than half the depth
circular_section(0.06, 0.03) -> less than half the diameter
i_section(0.1, 0.2, 0.15, 0.01) -> web = 0\.15: expected at most the width
# displacement inputs
moved("left", "right", "sum") -> 'left', 'right', 'sum': more displacements
moved("left", "mixed", "other") -> displacement of '.*' depends on that of '.*', '.*'
moved("left", hold=["left"]) -> 'left' is prescribed twice
moved("left", "right", "third", "fourth") -> 4 displacements .* 4 coordinates
prescribe_displacement(moved("left"), hold="right") -> \['left'\] impose motion already: prescribe all
driven_acceleration("displacement") -> output 'read' needs a derivative of input 'p': impose its acceler
read_exactly(derivative=2) -> the exact beam offers displacement outputs only
read_exactly(bandwidth_hz=2.0) -> the exact beam offers outputs without a bandwidth only
# responses and modes
bc.spray_boom(excitation="velocity").frequency_response([0.0, 1.0]) -> not finite
MODEL.eigenfrequencies_hz(5) -> count = 5: the model has only 4 damped eigenfrequencies
modes_of(np.diag([1.0, -1.0]), np.eye(2)) -> M|mass
modes_of(np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]])) -> symmetric K
split_symmetric(bc.spray_boom(elements=[-6, -2, 1, 6])) -> not symmetric about x = 0
split_symmetric(bc.spray_boom().select("actuator_left")) -> actuator_left|pairs of mirror images
# matrices and names
SecondOrderModel(np.eye(2), np.eye(3), np.eye(2)) -> C has shape \(3, 3\); expected that of M, \(2, 2\)
SecondOrderModel(np.ones((2, 3)), ONE, ONE) -> M has shape \(2, 3\); expected a square matrix
SecondOrderModel(ONE, ONE, ONE, outputs={"y": [1.0, 2.0]}) -> output 'y' has 2 entries; expected 1
SecondOrderModel(ONE, ONE, ONE, {"f.x": [1.0]}) -> name of a force input = 'f.x': expected a name .* no dot
SecondOrderModel(*3 * (np.eye(2),), coordinates=["a", "a"]) -> coordinates: expected 2 different names
MODEL.select(inputs="rigth") -> unknown input 'rigth'; did you mean 'right'\? \(there are: left, right
MODEL.select(inputs=["left", "left"]) -> input 'left' is given twice
bc.sigma(one.boom(), "tip_left") -> omega = 'tip_left': expected frequencies; signals are named by inputs=
bc.step(one.boom(), "tip_left") -> timepts = 'tip_left': expected time points \[s\]; signals are named
bc.nyquist(one.boom(), "tip_left") -> controller = 'tip_left': expected a controller; signals are named
bc.hub_beam(modes=1).eigenfrequencies_hz(np.array([0.0, 1.0])) -> \.campbell\(speeds\) takes many
one.boom()["tip_lef", "cradle"] -> did you mean 'tip_left'
one.boom()["tip_left"] -> expected model\[outputs, inputs\]
one.boom().to_statespace(dt=-1.0) -> dt = -1\.0: expected
bc.spray_boom(excitation="force").ports.L[0].fill(1.0) -> read-only
# other kinds, and what makes the right one
one.boom() * one.boom() -> its \.to_statespace\(\) is
one.boom().A -> AttributeError: no attribute 'A'; its \.to_statespace\(\) has
bc.sigma(one.machine()) -> got Assembly; its \.assemble\(\) is one
bc.sigma(one.family()) -> got AffineFamily; its \.at\(\.\.\.\) is one
bc.hinf_norm(bc.reduce(one.mass(), order=2)) -> got ReductionResult; its \.system is one
bc.discretize(one.mass(), 0.01) -> got SecondOrderModel. Sample a structure by its \.to_statespace\(dt=0\.01\)
bc.write_controller(one.machine(), "law.json") -> got Assembly; its \.assemble\(\)\.to_statespace\(\) is
bc.sigma(np.eye(2)) -> got ndarray; .* or control\.ss\(A, B, C, D\) makes one
split_symmetric(one.machine()) -> got Assembly; .*\.assemble\(\) of an Assembly
Force("push", one.machine().bodies[0]) -> got RigidBody; \.at\(s\) of a beam
RigidBody("bar", GROUND.at(0), revolute) -> expected Joint, got function; revolute\(\)
bc.robust_stability(one.boom(), one.suspension()) -> got SecondOrderModel; boom_family\(\)
"""


@refusals(REFUSED)
def test_what_does_not_fit_is_refused(call, words):
    assert_refused(call, words, globals())


def test_damped_eigenvalues_of_coarse_start_are_refused():
    """Twelve cubic elements know five modes to a thousandth, and not the sixth."""
    p = bc.BoomParameters()
    start = boom_assembly(p, FiniteElements(12)).assemble()
    five = np.sort(damped_eigenvalues(exact_boom(p), start, ACTUATORS, 5).imag) / (2.0 * np.pi)
    assert five == pytest.approx(bc.exact_eigenfrequencies_hz(p, 5), rel=1e-12)
    with pytest.raises(ArithmeticError, match="left its start: refine the starting discretization"):
        damped_eigenvalues(exact_boom(p), start, ACTUATORS, 6)


@pytest.mark.parametrize("lost", [lambda K: -K, lambda K: control.ss(K.A, K.B, K.C, K.D)])
def test_controller_without_names_says_how_it_gets_them_back(lost):
    K = lost(one.suspension())
    with pytest.raises(ValueError, match=r"no names but u\[0\], y\[0\]: python-control loses .* K\.update_names\("):
        bc.margins(one.yaw(), K)
    K.update_names(inputs=["stroke_anti"], outputs=["suspension_anti"])
    assert bc.margins(one.yaw(), K).loops
