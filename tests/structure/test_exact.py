"""Exact beams: textbook roots, the beam equation in many digits, segments of any length, and stated rounding."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.exact import exact_boom
from boomctl.boom.model import ACTUATORS, boom_assembly
from boomctl.exceptions import AccuracyWarning
from boomctl.lab.benchmark.high_precision import exact_response
from boomctl.lti.rounding import ALIKE
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    CutJoint,
    FiniteElements,
    Force,
    Output,
    SpringDamper,
    fixed,
    planar,
    revolute,
)
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.displacement_input import prescribe_displacement
from tests.fifty_digits import damped_eigenvalues
from tests.profiles import examples
from tests.references import ROOTS
from tests.strategies import seeds

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


DIGITS = 160  # of the reference: the hundredth mode's exponentials take some hundred


def error(found, truth):
    """Return how far a response is off, of the largest output to each input at each frequency."""
    return (np.abs(found - truth).max(axis=0) / np.abs(truth).max(axis=0)).max()


@pytest.mark.parametrize("distance", [1e-5, 1e-3, 6.0])
@pytest.mark.parametrize("change", [{}, {"spring_stiffness": 0.0}, {"stiffness_damping": 0.0, "hinge_damping": 0.0}])
def test_exact_boom_at_any_spring_distance(distance, change):
    """From 1e-4 Hz to the hundredth mode, and says nothing of rounding."""
    p = bc.BoomParameters(spring_distance=distance, **change)
    omega = 2 * np.pi * np.array([1e-4, 0.3, 9.1, 2400.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error", AccuracyWarning)
        found = bc.exact_frequency_response(p, omega).frdata
    assert error(found, exact_response(p, omega, DIGITS)) < ALIKE


@pytest.mark.slow
@given(st.floats(-5.0, 1.07), st.floats(-4.0, 3.5), st.sampled_from([0.0, 1e-6, 1e-4]), st.floats(0.0, 4.0))
def test_no_response_is_further_off_than_is_promised_or_said(distance, frequency, damping, softness):
    """Random booms and frequencies, springs from usual to 1e-4 of that."""
    p = bc.BoomParameters(
        spring_distance=10.0**distance, stiffness_damping=damping, spring_stiffness=1100.0 * 10.0**-softness
    )
    omega = np.array([10.0**frequency])
    truth = exact_response(p, omega, DIGITS)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", AccuracyWarning)
        found = bc.exact_frequency_response(p, omega).frdata
    assert said or error(found, truth) < ALIKE


@pytest.mark.parametrize("away", [1e-8, 1e-11])
def test_rounding_that_may_show_is_said_with_its_size(away):
    """Beside an undamped resonance: a frequency of sixteen digits does not tell how far away it is."""
    p = bc.BoomParameters(stiffness_damping=0.0, hinge_damping=0.0, cradle_damping=0.0)
    omega = np.array([undamped_frequencies(exact_boom(p), 4)[3] * (1.0 + away)])
    with pytest.warns(AccuracyWarning, match=r"rad/s may change it by") as said:
        found = bc.exact_frequency_response(p, omega).frdata
    limit = float(str(said[0].message).split("change it by ")[1].split(" (")[0])
    off = error(found, exact_response(p, omega, DIGITS))
    assert off < 1.05 * limit  # said to one digit
    assert limit < 1e6 * max(off, 1e-16)


@pytest.mark.parametrize("distance", [1e-5, *(pytest.param(d, marks=pytest.mark.slow) for d in (1e-3, 6.0, 11.9))])
def test_eigenfrequencies_of_the_boom_at_any_spring_distance(distance):
    p = bc.BoomParameters(spring_distance=distance)
    still = bc.BoomParameters(spring_distance=distance, stiffness_damping=0.0, hinge_damping=0.0, cradle_damping=0.0)
    found = bc.exact_eigenfrequencies_hz(p, 6, damped=False)
    truth = damped_eigenvalues(still, 2j * np.pi * found * (1.0 + 1e-9), 50).imag / (2.0 * np.pi)
    assert found == pytest.approx(truth, rel=1e-10)
    damped = bc.exact_eigenfrequencies_hz(p, 6)
    half, spring = p.length / 2, p.spring_distance / 2
    outer = np.linspace(-half, -spring, 5)
    mesh = FiniteElements(tuple(np.concatenate([outer, [0.0], -outer[::-1]]) + half), 12)
    elements = prescribe_displacement(boom_assembly(p, mesh).assemble(), ACTUATORS)
    poles = elements.structure.strain_form.poles()
    near = poles[np.argmin(np.abs(poles.imag[:, None] / (2 * np.pi) - damped[None, :]), axis=0)]
    exact = damped_eigenvalues(p, near, 50)
    assert damped == pytest.approx(np.sort(exact.imag) / (2.0 * np.pi), rel=1e-10)


def cantilever(lengths, soft=1.0):
    """Return a clamped beam in sections, with a spring to ground at its end, pushed and read there."""
    sections = tuple(BeamSegment(float(length), 2.5, 4000.0, 1e-5) for length in lengths)
    part = Beam("beam", GROUND.at(0.0), fixed(), (0.0, 0.0), sections, FiniteElements(len(sections)))
    end = part.end
    spring = SpringDamper(end, GROUND.at(part.length), "y", soft, 1e-3)
    return Assembly((part,), (spring,), (Force("f", end, "y"),), (Output("y", end, "y"),))


@given(seeds)
@examples(40)
def test_a_beam_with_a_short_section_is_the_beam_without(seed):
    """Short ones of 1e-6 to all of the beam, up to three; frequencies from far below the first mode to the thirtieth."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    short = 10.0 ** rng.uniform(-6.0, 0.0, count)
    rest = rng.dirichlet(np.ones(count + 1)) * 12.0
    lengths = np.concatenate([np.stack([rest[:-1], short], axis=1).ravel(), rest[-1:]])
    omega, soft = 10.0 ** rng.uniform(-3.0, 4.0, 6), 10.0 ** rng.uniform(-4.0, 3.0)
    whole, parts = cantilever([lengths.sum()], soft).to_exact(), cantilever(lengths, soft).to_exact()
    assert error(parts.response(omega, ["f"], ["y"]), whole.response(omega, ["f"], ["y"])) < ALIKE
    assert undamped_frequencies(parts, 4) == pytest.approx(undamped_frequencies(whole, 4), rel=ALIKE)


@given(seeds)
@examples(40)
def test_a_free_beam_moves_as_a_rigid_one_at_low_frequency(seed):
    """``y = -F (1/m + x^2/J)/omega^2``, however stiff its segments; as a whole they strain nothing, to the last digit."""
    rng = np.random.default_rng(seed)
    lengths = 10.0 ** rng.uniform(-4.0, 0.5, 3)
    sections = tuple(BeamSegment(float(length), 2.5, 4e6) for length in lengths)
    part = Beam("beam", GROUND.at(0.0), planar("y", "theta"), (0.0, 0.0), sections, FiniteElements(3))
    end, total = part.end, lengths.sum()
    machine = Assembly((part,), (), (Force("f", end, "y"),), (Output("y", end, "y"),)).to_exact()
    omega = np.array([1e-5])
    expected = -4.0 / (2.5 * total * omega**2)
    assert machine.response(omega, ["f"], ["y"])[0, 0].real == pytest.approx(expected, rel=1e-11)
    assert machine.strains.at_rest.rigid == 2
    with pytest.raises(ValueError, match="the structure moves freely"):
        machine.response(np.zeros(1), ["f"], ["y"])


@pytest.mark.parametrize("distance", [1e-5, 1e-3, 1.318])
def test_exact_boom_static_response(distance):
    """A short segment is no reason to believe that it moves freely; without springs it does."""
    p = bc.BoomParameters(spring_distance=distance, hinge_damping=0.0)
    rest, slow = (bc.exact_frequency_response(p, w).frdata for w in ([0.0], [1e-12]))
    assert np.abs(rest - slow).max() < 1e-6 * np.abs(rest).max()
    with pytest.raises(ValueError, match="the structure moves freely"):
        bc.exact_frequency_response(bc.BoomParameters(spring_distance=distance, spring_stiffness=0.0), [0.0])
