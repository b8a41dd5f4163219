"""A beam on three supports that move differently: statics in closed form, dynamics by Lagrange multipliers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSection,
    FiniteElements,
    Force,
    Output,
    free,
    prescribe_displacement,
)
from tests.references import kkt_response

EI, MASS = 3.0, 1.7
NAMES = ("left", "middle", "right")


def machine(a, b, overhang=0.5, damping=0.0, mesh=FiniteElements):
    """Return a floating beam with forces at x = 0, a, a + b; it goes on by ``overhang``, where its end is read."""
    marks = (0.0, a, a + b, a + b + overhang)
    section = BeamSection(marks[-1], MASS, EI, damping)
    beam = Beam("beam", GROUND.at(0.0), free("y", "theta"), (0.0, 0.0), (section,), mesh(marks))
    forces = tuple(Force(name, beam.at(x)) for name, x in zip(NAMES, marks, strict=False))
    return Assembly((beam,), (), forces, (Output("end", beam.at(marks[-1])), Output("slope", beam.at(0.0), "theta")))


lengths = st.floats(0.3, 3.0)


@given(lengths, lengths)
def test_at_rest_the_supports_push_as_a_continuous_beam_says(a, b):
    """Lifting the middle by one takes 3 EI (a + b)/(a^2 b^2); the outer supports balance force and moment."""
    driven = prescribe_displacement(machine(a, b).assemble(), NAMES, reactions=True)
    found = driven.frequency_response([0.0], outputs=[f"{name}_force" for name in NAMES]).frdata[:, :, 0]
    settle = np.array([-b / (a + b), 1.0, -a / (a + b)])
    expected = 3 * EI * (a + b) / (a * b) ** 2 * np.outer(settle, settle)
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


@given(lengths, lengths)
def test_at_rest_the_overhang_follows_the_end_slope(a, b):
    """The right support's slope: the chord's, less (2 a + b)/(2 a b) for a middle lifted by one above the chord."""
    end = prescribe_displacement(machine(a, b).assemble(), NAMES).frequency_response([0.0], outputs="end").frdata
    chord, lift = np.array([-1.0, 0.0, 1.0]) / (a + b), np.array([-b / (a + b), 1.0, -a / (a + b)])
    expected = np.array([0.0, 0.0, 1.0]) + 0.5 * (chord - lift * (2 * a + b) / (2 * a * b))
    assert np.abs(end[0, :, 0] - expected).max() < 1e-12 * np.abs(expected).max()


@given(lengths, lengths, st.floats(0.1, 5.0))
def test_moving_supports_obey_the_multipliers(a, b, omega):
    model = machine(a, b, damping=0.05, mesh=lambda marks: FiniteElements(marks, 6)).assemble()
    driven = prescribe_displacement(model, NAMES, reactions=True)
    ports = model.ports
    Y, F = kkt_response((model.M, model.C, model.K), ports.B[0], ports.L[0], [0, 1, 2], [], [omega])
    found = driven.frequency_response([omega]).frdata
    slack = 1e-14 * np.linalg.cond(driven.M) * np.linalg.cond(model.K + model.M)
    assert np.abs(found[:2] - Y).max() < slack * np.abs(Y).max()
    assert np.abs(found[2:] - F).max() < slack * np.abs(F).max()


@pytest.mark.parametrize("held", [("left",), ("left", "right")])
def test_a_support_that_stands_still_can_be_held(held):
    model = machine(1.0, 1.5).assemble()
    moving = [name for name in NAMES if name not in held]
    omega = [0.0, 1.0, 2.0]
    some = prescribe_displacement(model, moving, hold=held).frequency_response(omega).frdata
    every = prescribe_displacement(model, NAMES).frequency_response(omega, inputs=moving).frdata
    assert np.abs(some - every).max() < 1e-12 * np.abs(every).max()


@given(lengths, lengths)
def test_supports_moving_as_a_rigid_line_bend_nothing(a, b):
    """At rest every straight line of supports is free of force, and the end lies on it."""
    driven = prescribe_displacement(machine(a, b).assemble(), NAMES, reactions=True)
    Y = driven.frequency_response([0.0]).frdata[:, :, 0].real
    for line in (np.ones(3), np.array([0.0, a, a + b])):
        assert abs(Y[0] @ line - (1.0 if line[0] else a + b + 0.5)) < 1e-11 * (a + b + 1)
        assert np.abs(Y[2:] @ line).max() < 1e-12 * np.abs(Y[2:]).max() * (a + b)
