"""Beam discretisations: patch tests, mass, convergence towards the exact beam, stepped beams."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
    SpringDamper,
    fixed,
    planar,
    revolute,
)
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from tests.references import ROOTS, natural_frequencies
from tests.strategies import random_stepped_beam, seeds

TWO = (BeamSegment(0.7, 1.3, 2.0, 1e-3), BeamSegment(1.1, 0.8, 0.9, 1e-3))
MASSES = ("hermite", "linear", "lumped")


def beam(mesh, sections=(BeamSegment(1.0, 1.0, 1.0),), joint=fixed(), at=()):  # noqa: B008
    """Return a beam from x = 0 on, pushed at its end and at the places ``at``; deflections there are read, then slopes."""
    part = Beam("beam", GROUND.at(0.0), joint, (0.0, 0.0), tuple(sections), mesh)
    places = [*at, part.length]
    forces = tuple(Force(f"p{i}", part.at(x)) for i, x in enumerate(places))
    outputs = [Output(f"{d}{i}", part.at(x), d) for d in ("y", "theta") for i, x in enumerate(places)]
    return Assembly((part,), (), forces, tuple(outputs))


def mass_matrix(part, mesh):
    """Return the mass matrix of a beam over its own coordinates."""
    rows, density = mesh.inertia, np.array([section.mass_per_length for section in part.segments])
    N = np.asarray(rows.matrix(0, len(mesh.names)))
    return N.T @ np.diag(rows.weights(density[mesh.section])) @ N


@pytest.mark.parametrize("elements", [1, 3, 7])
@pytest.mark.parametrize("order", [3, 4, 7, 12])
def test_a_cantilever_bends_statically_as_it_should(elements, order):
    """Under an end load: ``L^3/3EI`` at the end, ``x^2 (3 L - x)/6EI`` before; cubics and their slopes are exact."""
    places = [0.25, 0.6]
    Y = beam(FiniteElements(elements, order), at=places).assemble().frequency_response([0.0]).frdata[:, -1, 0]
    x = np.array([*places, 1.0])
    assert np.allclose(Y, [*(x**2 * (3 - x) / 6), *(x * (2 - x) / 2)], rtol=1e-11)


@given(seeds, st.sampled_from(MASSES), st.integers(2, 9))
def test_every_discretisation_keeps_the_mass(seed, mass, elements):
    """And its first moment; its second only where mass is consistent with rotation."""
    sections = [BeamSegment(*np.random.default_rng(seed).uniform(0.5, 2.0, 3)) for _ in range(2)]
    part = beam(DiscreteElements(elements, mass), sections, planar("y", "theta")).bodies[0]
    mesh = part.discretization.mesh(part, [])
    M, ends = mass_matrix(part, mesh), np.cumsum([section.length for section in sections])
    shift, turn = np.zeros(len(M)), np.zeros(len(M))
    shift[::2], turn[::2], turn[1::2] = 1.0, mesh.nodes, 1.0
    masses = np.array([section.length * section.mass_per_length for section in sections])
    middles = ends - np.array([section.length for section in sections]) / 2
    assert shift @ M @ shift == pytest.approx(masses.sum(), rel=1e-13)
    assert shift @ M @ turn == pytest.approx(masses @ middles, rel=1e-13)
    inertia = masses @ (middles**2 + np.array([s.length**2 for s in sections]) / 12)
    if mass == "lumped":
        assert turn @ M @ turn > inertia
    else:
        assert turn @ M @ turn == pytest.approx(inertia, rel=1e-13)


def error(mesh, mode=0):
    expected = ROOTS["clamped-free"][mode] ** 2
    return natural_frequencies(beam(mesh).assemble())[mode] / expected - 1


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_cubic_elements_converge_order_4(mode):
    errors = [error(FiniteElements(n), mode) for n in (4, 8, 16)]
    assert all(e > 0 for e in errors)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("mass", ["linear", "lumped"])
def test_lumping_converges_with_the_second_power(mass):
    errors = [error(DiscreteElements(n, mass)) for n in (16, 32)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_hermite_elements_match_finite_elements():
    nodes = (0.0, 0.3, 1.0)
    a, b = beam(DiscreteElements(nodes), at=[0.3]).assemble(), beam(FiniteElements(nodes), at=[0.3]).assemble()
    assert np.array_equal(a.M, b.M)
    assert np.array_equal(a.K, b.K)


def test_raising_the_order_converges_faster_than_any_power():
    """Of one element, for the first mode, until rounding: each order gains more than the one before."""
    errors = np.array([error(FiniteElements(1, order)) for order in (3, 5, 7, 9)])
    assert (errors > 0).all()
    assert (np.diff(np.log(errors)) < -4).all()
    assert errors[-1] < 1e-9


@given(seeds)
def test_finite_elements_converge_to_the_exact_stepped_beam(seed):
    """Cubic elements from above, high order to ten digits."""
    exact = undamped_frequencies(random_stepped_beam(seed).to_exact(), 3)
    rough, fine = (elastic(random_stepped_beam(seed, order).assemble(), 3) for order in (3, 18))
    assert (rough > exact * (1 - 1e-9)).all()
    assert fine == pytest.approx(exact, rel=1e-9)


def elastic(model, count):
    """Return the lowest natural frequencies that are not rigid-body ones."""
    omega = natural_frequencies(model)
    return omega[omega > 1e-5][:count]


def test_a_rigid_knob_gives_a_point_mass_its_inertia():
    part = beam(DiscreteElements(4, "lumped")).bodies[0]
    knob = RigidBody("knob", part.at(1.0), fixed(), 0.1, 0.2)
    model = Assembly((part, knob), (), (Force("t", part.at(1.0), "theta"),), (Output("y", part.at(1.0)),)).assemble()
    assert model.frequency_response([0.0]).frdata[0, 0, 0] == pytest.approx(0.5, rel=1e-12)


@given(seeds)
def test_moved_and_turned_machine_has_same_frequencies(seed):
    """A beam of two sections carries another one, whose end a spring and a cut joint connect to the ground."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.5, 3.0, 2)
    carried, load_at, relative = rng.uniform(0.1, 1.0), rng.uniform(0.0, 1.0), rng.uniform(-1.5, 1.5)

    def machine(start, angle):
        stepped, base = (BeamSegment(0.3 * a, 2.0, 500.0, 1e-4), BeamSegment(0.7 * a, 1.0, 300.0)), GROUND.at(*start)
        mast = Beam("mast", base, fixed(), base, stepped, FiniteElements(4), angle)
        joint, uniform = mast.at(carried * a), (BeamSegment(b, 1.5, 200.0),)
        arm = Beam("arm", joint, revolute(), joint, uniform, FiniteElements(4), angle + relative)
        middle, tip = ((p, GROUND.at_point(p.x, p.y)) for p in (arm.at(0.5 * b), arm.end))
        loads = RigidBody("knob", mast.at(load_at * a), fixed(), 1.0), RigidBody("load", arm.end, fixed(), 3.0, 0.2)
        spring = SpringDamper(*middle, angle + 1.0, 50.0, 1.0)
        return Assembly((mast, arm, *loads), (spring,), cut_joints=(CutJoint(*tip, (angle + 0.7,)),))

    at_origin, moved = machine((0.0, 0.0), 0.0), machine(rng.uniform(-100.0, 100.0, 2).tolist(), rng.uniform(-3.0, 3.0))
    expected = at_origin.assemble().eigenfrequencies_hz(5)
    np.testing.assert_allclose(moved.assemble().eigenfrequencies_hz(5), expected, rtol=1e-10)


def test_beam_points_are_distances_from_start():
    arm = Beam("arm", GROUND.at(8.0, 1.0), fixed(), (8.0, 1.0), TWO, FiniteElements(4), np.pi / 6)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    for point, distance in ((arm.start, 0.0), (arm.at(0.3), 0.3), (arm.at(1.8 + 1e-12), 1.8), (arm.end, 1.8)):
        assert (point.x, point.y) == pytest.approx((8.0 + distance * c, 1.0 + distance * s), abs=1e-14)
        assert arm.station(point.x, point.y) == pytest.approx(distance, abs=1e-14)
        assert point == arm.at_point(point.x, point.y)
    upright = replace(arm, parent=arm.end, start=arm.end, angle=np.pi / 2)
    assert (upright.start.x, upright.start.y, upright.start.body) == (arm.end.x, arm.end.y, upright)
    assert "start=(9.55885, 1.9)" in " ".join(repr(upright).split())

    for body in (GROUND, RigidBody("rod", GROUND.at_point(1.0), fixed())):
        assert body.at(0.5, 2.0) == body.at_point(0.5, 2.0)
