"""Parts, meshes and signals that do not fit together are refused in words that say what to do."""

import re

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
    CutJoint,
    DiscreteElements,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    SpringDamper,
    circular_section,
    fixed,
    i_section,
    planar,
    prescribe_displacement,
    rectangular_section,
    revolute,
    split_symmetric,
)
from boomctl.structure.beams.eigenvalues import damped_eigenvalues
from boomctl.structure.response.modes import undamped_modes
from tests import handed_out as one
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


REFUSED = [
    # machines
    (lambda: Assembly((BODY, BODY)), "two of the assembly's body names are 'body'"),
    (lambda: Assembly((OTHER, BODY)), r"body 'other' refers to body 'body'; expected one listed before: \['ground'\]"),
    (lambda: Assembly((BODY,), (), (Force("f", BODY.at(0)), Force("f", BODY.at(1)))), "force names are 'f'"),
    (lambda: Assembly((BODY,), (SpringDamper(BODY.at(0), OTHER.at(0), "y"),)), "refers to body 'other'"),
    (
        lambda: Assembly((RigidBody("b", GROUND.at(0.0), fixed(), 1.0),)).assemble(),
        "no coordinate|cannot move|no freedom",
    ),
    (
        lambda: Assembly((MASSLESS,), (), (Force("f", MASSLESS.at(1.0)),)).assemble(),
        "'body.theta', which has no inertia",
    ),
    (lambda: Assembly((BODY, RigidBody("hand", BODY.at(0.0), revolute()))).assemble(), r"hand\.theta"),
    (lambda: CutJoint(CRANK.at(1.0), GROUND.at(1.1)), r"its points must coincide at rest, got a distance of 0\.1 m"),
    (lambda: chained(*2 * (CutJoint(CRANK.at(1.0), GROUND.at(1.0), ("y",)),)), "cut joint between crank and ground"),
    # meshes
    (lambda: meshed(FiniteElements((0.0, 0.5))), r"stations of beam 'beam' run from 0 to 0\.5 m; expected 0 to 2 m"),
    (lambda: meshed(FiniteElements((0.0, 0.6, 0.4, 2.0))), "expected at least two, ascending"),
    (lambda: meshed(FiniteElements((0.0, 0.3, 0.1 + 0.2, 2.0))), r"is 5\.6e-17 m long; .*, or one node for both"),
    (lambda: meshed(DiscreteElements((0.0, 0.5, 2.0))), r"station 0\.3 m, which is not a mass allocation point"),
    (lambda: meshed(DiscreteElements(1)), "elements = 1: beam 'beam' has 2 intervals between attachments"),
    (lambda: meshed(DiscreteElements(4, "lumped"), "theta"), r"'beam\.phi4', which has no inertia: give it some"),
    (lambda: FiniteElements(4, 21), "order = 21: expected a whole number of at most 20"),
    (lambda: bc.spray_boom(elements=100_000), r"at most 1000 coordinates, got \d+. Use a few elements of high order"),
    (lambda: SecondOrderModel(*3 * (np.eye(1001),)), "must have at most 1000 coordinates, got"),
    # parts
    (lambda: Force("f", BODY.at(0.0), 90.0), r"direction = 90\.0: expected radians, at most one turn"),
    (lambda: beam(angle=45), "angle of beam 'beam' = 45: expected radians"),
    (lambda: SpringDamper(BODY.at(0.0), BODY.at(1.0), "y"), "both ends are on 'body'; expected two bodies"),
    (lambda: CutJoint(BODY.at(0.0), BODY.at(0.0)), "cut joint: both ends are on 'body'"),
    (
        lambda: Output("y", BODY.at(0.0), derivative=3),
        "derivative of output 'y' = 3: expected a whole number of at most 2",
    ),
    (lambda: beam(segments=()), "beam 'beam': expected at least one segment"),
    (lambda: beam(parent=GROUND.at(1.0, 0.1)), r"0\.1 m off an axis of 2 m"),
    (lambda: beam().at(-0.001), r"`s` must be from 0 to 2 m, the length of beam .beam., got -0\.001\. Use `at_point"),
    (lambda: rectangular_section(0.02, 0.06, 0.01), r"wall = 0\.01: expected less than half the width"),
    (lambda: rectangular_section(0.06, 0.02, (0.001, 0.02)), "less than half the depth"),
    (lambda: circular_section(0.06, 0.03), "less than half the diameter"),
    (lambda: i_section(0.1, 0.2, 0.15, 0.01), r"web = 0\.15: expected at most the width"),
    # displacement inputs
    (lambda: moved("left", "right", "sum"), "'left', 'right', 'sum': more displacements"),
    (lambda: moved("left", "mixed", "other"), "displacement of '.*' depends on that of '.*', '.*'"),
    (lambda: moved("left", hold=["left"]), "'left' is prescribed twice"),
    (lambda: moved("left", "right", "third", "fourth"), "4 displacements .* 4 coordinates"),
    (lambda: prescribe_displacement(moved("left"), hold="right"), r"\['left'\] impose motion already: prescribe all"),
    (lambda: driven_acceleration("displacement"), "output 'read' needs a derivative of input 'p': impose its acceler"),
    (lambda: read_exactly(derivative=2), "the exact beam offers displacement outputs only"),
    (lambda: read_exactly(bandwidth_hz=2.0), "the exact beam offers outputs without a bandwidth only"),
    # responses and modes
    (lambda: bc.spray_boom(excitation="velocity").frequency_response([0.0, 1.0]), "not finite"),
    (lambda: MODEL.eigenfrequencies_hz(5), "count = 5: the model has only 4 damped eigenfrequencies"),
    (lambda: modes_of(np.diag([1.0, -1.0]), np.eye(2)), "M|mass"),
    (lambda: modes_of(np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]])), "symmetric K"),
    (lambda: split_symmetric(bc.spray_boom(elements=[-6, -2, 1, 6])), "not symmetric about x = 0"),
    (lambda: split_symmetric(bc.spray_boom().select("actuator_left")), "actuator_left|pairs of mirror images"),
    # matrices and names
    (lambda: SecondOrderModel(np.eye(2), np.eye(3), np.eye(2)), r"C has shape \(3, 3\); expected that of M, \(2, 2\)"),
    (lambda: SecondOrderModel(np.ones((2, 3)), ONE, ONE), r"M has shape \(2, 3\); expected a square matrix"),
    (lambda: SecondOrderModel(ONE, ONE, ONE, outputs={"y": [1.0, 2.0]}), "output 'y' has 2 entries; expected 1"),
    (
        lambda: SecondOrderModel(ONE, ONE, ONE, {"f.x": [1.0]}),
        "name of a force input = 'f.x': expected a name .* no dot",
    ),
    (lambda: SecondOrderModel(*3 * (np.eye(2),), coordinates=["a", "a"]), "coordinates: expected 2 different names"),
    (lambda: MODEL.select(inputs="rigth"), r"unknown input 'rigth'; did you mean 'right'\? \(there are: left, right"),
    (lambda: MODEL.select(inputs=["left", "left"]), "input 'left' is given twice"),
    (
        lambda: bc.sigma(one.boom(), "tip_left"),
        "omega = 'tip_left': expected frequencies; signals are named by inputs=",
    ),
    (lambda: bc.step(one.boom(), "tip_left"), r"timepts = 'tip_left': expected time points \[s\]; signals are named"),
    (lambda: bc.nyquist(one.boom(), "tip_left"), "controller = 'tip_left': expected a controller; signals are named"),
    (lambda: bc.hub_beam(modes=1).eigenfrequencies_hz(np.array([0.0, 1.0])), r"\.campbell\(speeds\) takes many"),
    # other kinds, and what makes the right one
    (lambda: one.boom() * one.boom(), r"its \.to_statespace\(\) is"),
    (lambda: one.boom().A, r"no attribute 'A'; its \.to_statespace\(\) has"),
    (lambda: bc.sigma(one.machine()), r"got Assembly; its \.assemble\(\) is one"),
    (lambda: bc.sigma(one.family()), r"got AffineFamily; its \.at\(\.\.\.\) is one"),
    (lambda: bc.hinf_norm(bc.reduce(one.mass(), order=2)), r"got ReductionResult; its \.system is one"),
    (
        lambda: bc.discretize(one.mass(), 0.01),
        r"got SecondOrderModel. Sample a structure by its \.to_statespace\(dt=0\.01\)",
    ),
    (lambda: bc.write_controller(one.machine(), "law.json"), r"got Assembly; its \.assemble\(\)\.to_statespace\(\) is"),
    (lambda: bc.sigma(np.eye(2)), r"got ndarray; .* or control\.ss\(A, B, C, D\) makes one"),
    (lambda: split_symmetric(one.machine()), r"got Assembly; .*\.assemble\(\) of an Assembly"),
    (lambda: Force("push", one.machine().bodies[0]), r"got RigidBody; \.at\(s\) of a beam"),
    (lambda: RigidBody("bar", GROUND.at(0), revolute), r"expected Joint, got function; revolute\(\)"),
    (lambda: bc.robust_stability(one.boom(), one.suspension()), r"got SecondOrderModel; boom_family\(\)"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=[re.sub(r"\W+", " ", words)[:40] for _, words in REFUSED])
def test_what_does_not_fit_is_refused(call, words):
    with pytest.raises((TypeError, ValueError, AttributeError), match=words):
        call()


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
