"""Laws of every assembled machine: symmetry, definiteness, rigid motions, total mass and inertia, reciprocity."""

import warnings
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    Force,
    Output,
    Point,
    RigidBody,
    SpringDamper,
    planar,
)
from tests.strategies import random_machine, seeds

OMEGA = np.array([0.3, 1.7, 6.0])


def rigid_motion(machine, model, shift, turn):
    """Return the coordinates of a floating machine that moves by ``shift`` and turns by ``turn`` about the origin."""
    values = {}
    for body in machine.bodies:
        if body.name == "root":
            values["root.x"], values["root.y"] = shift[0] - turn * body.parent.y, shift[1] + turn * body.parent.x
            values["root.theta"] = turn
        if isinstance(body, Beam):
            c, s = np.cos(body.angle), np.sin(body.angle)
            for i, station in enumerate(body.discretization.elements):
                x, y = body.start.x + station * c, body.start.y + station * s
                values[f"{body.name}.w{i}"] = -s * (shift[0] - turn * y) + c * (shift[1] + turn * x)
                values[f"{body.name}.phi{i}"] = turn
    return np.array([values.get(name, 0.0) for name in model.coordinates])


def weight(machine):
    """Return mass, first moment ``(x, y)`` and moment of inertia about the origin, from the bodies as they rest."""
    parts = []
    for body in machine.bodies:
        if isinstance(body, RigidBody):
            parts.append((body.mass, *(body.center_of_mass or (body.parent.x, body.parent.y)), body.inertia))
            continue
        station = 0.0
        for section in body.segments:
            middle = station + section.length / 2
            mass = section.mass_per_length * section.length
            x, y = body.start.x + middle * np.cos(body.angle), body.start.y + middle * np.sin(body.angle)
            parts.append((mass, x, y, mass * section.length**2 / 12))
            station += section.length
    m, x, y, inertia = np.array(parts).T
    return m.sum(), (m @ x, m @ y), (inertia + m * (x**2 + y**2)).sum()


@given(seeds)
def test_matrices_are_symmetric_and_definite_or_semidefinite(seed):
    """Rounding may leave a zero eigenvalue on the wrong side by as many units in the last place as there are sums."""
    model = random_machine(seed).assemble()
    for X in (model.M, model.C, model.K):
        assert np.abs(X - X.T).max() <= 2 * np.finfo(float).eps * np.abs(X).max()
    assert np.linalg.eigvalsh(model.M).min() > 0.0
    for X in (model.K, model.C):
        values = np.linalg.eigvalsh(X)
        assert values.min() >= -len(X) * np.finfo(float).eps * values.max()


@given(seeds)
def test_rigid_motions_strain_nothing_and_have_mass_and_inertia(seed):
    """``V^T M V`` of two shifts and a turn about the origin is the rigid body's mass matrix."""
    machine = random_machine(seed, grounded=False)
    model = machine.assemble()
    V = np.column_stack([rigid_motion(machine, model, *motion) for motion in (((1, 0), 0), ((0, 1), 0), ((0, 0), 1))])
    for X in (model.K, model.C):
        assert (np.abs(X @ V).max(axis=0) < 1e-13 * np.maximum((np.abs(X) @ np.abs(V)).max(axis=0), 1.0)).all()
    mass, (mx, my), inertia = weight(machine)
    expected = np.array([[mass, 0.0, -my], [0.0, mass, mx], [-my, mx, inertia]])
    terms = np.abs(V).T @ np.abs(model.M) @ np.abs(V)
    assert np.abs(V.T @ model.M @ V - expected).max() < 1e-13 * terms.max()


def rounding(model):
    """Return what rounding leaves of a response: some units in the last place times the condition of D."""
    D = [model.K + 1j * w * model.C - w * w * model.M for w in OMEGA]
    return 1e-15 * np.linalg.cond(D).max()


@given(seeds)
def test_collocated_responses_are_reciprocal_and_dissipate(seed):
    """The power that forces put in is never negative: ``-Im Y`` is positive semidefinite at every frequency."""
    model = random_machine(seed).assemble()
    Y = np.moveaxis(model.frequency_response(OMEGA).frdata, 2, 0)
    slack = rounding(model) * np.abs(Y).max()
    assert np.abs(Y - Y.swapaxes(1, 2)).max() < slack
    lost = (Y - Y.conj().swapaxes(1, 2)) / -2j
    assert np.linalg.eigvalsh(lost).min() > -slack


@given(seeds)
def test_the_exact_machine_is_the_limit_of_high_order_elements(seed):
    """Order 20, with nodes wherever something is attached, as the deflection is smooth between those alone."""
    machine = random_machine(seed, at_nodes=True)
    names = tuple(force.name for force in machine.forces)
    exact = machine.to_exact().response(OMEGA, names, names)
    fine = refined(machine, 20).assemble().frequency_response(OMEGA).frdata
    assert np.abs(fine - exact).max() < 1e-9 * np.abs(exact).max()


def refined(machine, order):
    """Return the machine with beam elements of another order; every point moves on to the new bodies."""
    bodies = {GROUND.name: GROUND}

    def copied(part, **changes):
        named = {f.name: getattr(part, f.name) for f in fields(part)}
        points = {k: replace(v, body=bodies[v.body.name]) for k, v in named.items() if isinstance(v, Point)}
        return replace(part, **points, **changes)

    for body in machine.bodies:
        mesh = {"discretization": replace(body.discretization, order=order)} if isinstance(body, Beam) else {}
        bodies[body.name] = copied(body, **mesh)
    links, forces, outputs = (tuple(map(copied, x)) for x in (machine.springs, machine.forces, machine.outputs))
    return Assembly(tuple(bodies.values())[1:], links, forces, outputs)


def test_what_acts_along_what_joints_hold_is_warned_of():
    body = RigidBody("body", GROUND.at(0.0), planar("x"), 2.0)
    parts = {
        "springs": tuple(SpringDamper(body.at(0.0), GROUND.at(0.0), line, 5.0) for line in ("x", "y")),
        "forces": (Force("lift", body.at(0.0), "y"), Force("push", body.at(0.0), 0.0)),
        "outputs": (Output("rise", body.at(0.0)), Output("place", body.at(0.0), "x", derivative=2)),
    }
    idle = "the link of 'body' and 'ground' along 'y', force 'lift' along 'y', output 'rise' along 'y': the joints"
    machine = Assembly((body,), **parts)
    for made in (machine.assemble, machine.assemble, machine.to_exact):  # also where the mechanism is known already
        with pytest.warns(UserWarning, match=idle) as said:
            made()
        assert said[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Assembly((body,), parts["springs"][:1], parts["forces"][1:], parts["outputs"][1:]).assemble()
