"""Exact beams: textbook roots, the beam equation in fifty digits, and a count that misses no mode."""

import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.lab.benchmark.high_precision import exact_response
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Output,
    fixed,
    planar,
    revolute,
)
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from tests.references import ROOTS, natural_frequencies
from tests.strategies import random_stepped_beam, seeds

SUPPORTS = {
    "clamped-free": (fixed(), False),
    "free-free": (planar("y", "theta"), False),
    "pinned-free": (revolute(), False),
    "pinned-pinned": (revolute(), True),
}


def beam(supports, sections=(BeamSegment(1.0, 1.0, 1.0),), mesh=FiniteElements(1)):  # noqa: B008
    """Return a beam from x = 0 on, held as the key of ``SUPPORTS`` says, pushed and read at its end."""
    joint, pinned = SUPPORTS[supports]
    part = Beam("beam", GROUND.at(0.0), joint, (0.0, 0.0), tuple(sections), mesh)
    end = part.at(part.length)
    cuts = (CutJoint(end, GROUND.at(part.length), ("y",)),) if pinned else ()
    return Assembly((part,), (), (Force("f", end, "theta"),), (Output("y", end, "theta"),), cuts)


@pytest.mark.parametrize("supports", SUPPORTS)
def test_uniform_beams_have_the_roots_of_textbooks(supports):
    """Also free ones, whose roots are those of the clamped beam, where a segment's own stiffness is infinite."""
    found = np.sqrt(undamped_frequencies(beam(supports).to_exact(), 4))
    assert found == pytest.approx(ROOTS[supports], rel=4e-15)


@pytest.mark.parametrize(
    ("supports", "shift"), [("clamped-free", -0.5), ("free-free", 0.5), ("pinned-free", 0.25), ("pinned-pinned", 0.0)]
)
def test_the_hundredth_root_is_the_asymptotic_one(supports, shift):
    """``cos`` alone decides there: ``exp(-300)`` is nothing."""
    found = np.sqrt(undamped_frequencies(beam(supports).to_exact(), 100))
    assert np.diff(found)[10:] == pytest.approx(np.pi, rel=1e-11)
    assert found[-1] == pytest.approx((100 + shift) * np.pi, rel=1e-14)


@given(seeds)
def test_the_count_is_the_number_of_modes_of_a_stepped_beam(seed):
    """At random frequencies that keep off the modes of a fine mesh, which are good to ten digits up to there."""
    machine = random_stepped_beam(seed, order=18)
    modes = natural_frequencies(machine.assemble())
    omega = np.random.default_rng(seed).uniform(0.0, modes[10], 60)
    omega = omega[np.abs(omega[:, None] / np.maximum(modes, 1e-3) - 1).min(axis=1) > 1e-6]
    expected = (modes[None, :] < omega[:, None]).sum(axis=1)
    assert np.array_equal(machine.to_exact().count_below(omega), expected)


@pytest.mark.parametrize(
    ("inputs", "outputs", "rows", "columns"),
    [
        (None, None, slice(None), slice(None)),
        ("actuator_left", "tip_left", [0], [0]),
        (["actuator_right", "cradle"], "stroke_left", [2], [1, 4]),
    ],
)
def test_the_exact_boom_solves_the_beam_equation(inputs, outputs, rows, columns):
    """To fifty digits, from 1e-4 Hz to the hundredth mode; beside a resonance digits go as the frequency is rounded."""
    p = bc.BoomParameters()
    omega = 2 * np.pi * np.array([1e-4, 0.1, 0.4, 0.9325, 2.0, 3.5, 9.0, 60.0, 2400.0])
    truth = exact_response(p, omega)
    found = bc.exact_frequency_response(p, omega, inputs, outputs).frdata
    assert (np.abs(found - truth[rows][:, columns]) < 1e-12 * np.abs(truth[:, columns]).max(axis=0)).all()
