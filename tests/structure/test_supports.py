"""A beam on three supports that move differently: statics in closed form, dynamics by Lagrange multipliers."""

import numpy as np
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
