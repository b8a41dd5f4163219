"""Random machines, trees and closed chains, held and moved, are what an exact solution with multipliers says."""

import re
import warnings
from dataclasses import replace
from math import cos, sin

import numpy as np
import pytest
from hypothesis import given

from boomctl.exceptions import AccuracyWarning
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    Force,
    RigidBody,
    planar,
    prescribe_displacement,
)
from tests.exact_machine import drawn, response
from tests.profiles import examples
from tests.references import state_space_response
from tests.strategies import seeds

REFUSED = re.compile(r"is fully constrained|depends on|more displacements|nothing moves|no coordinates")
OMEGA = np.array([0.1, 1.3, 7.0, 40.0])


def off(found, true, sizes):
    """Return the largest error of a response, of each output to each input over all frequencies.

    Where all of it is zero, it is compared with the largest of the output and of the input; where nothing moves, with one.
    """
    size = np.maximum(np.abs(true), sizes).max(axis=2, keepdims=True)
    largest = size.max(initial=0.0) or 1.0
    beside = size.max(axis=1, keepdims=True, initial=0.0) * size.max(axis=0, keepdims=True, initial=0.0) / largest
    size = np.where(size > 0.0, size, np.where(beside > 0.0, beside, largest))
    return float((np.abs(found - true) / size).max(initial=0.0))


@given(seeds)
@examples(400)
def test_a_machine_is_what_its_multipliers_say(seed):
    """What can be prescribed is, and what cannot be is refused; springs that nothing strains and forces that push nothing."""
    machine, description, moved, held = drawn(seed)
    expected = response(machine, moved, held, OMEGA)

    names = ([f"f{i}" for i in group] for group in (moved, held))
    try:
        model = prescribe_displacement(description.assemble(), *names, reactions=True)
    except ValueError as said:
        assert expected is None, said  # noqa: PT017
        assert REFUSED.search(str(said))  # noqa: PT017
        return
    if expected is None:
        assert model.ncoordinates == 0
        return
    left, true, sizes = expected
    assert model.ncoordinates == left
    outputs = [f"y{i}" for i in range(len(machine.outputs))]
    assert off(model.frequency_response(OMEGA).frdata, true, sizes) < 1e-7
    many = np.concatenate([OMEGA, np.linspace(2.0, 3.0, 2000 // left)])
    assert off(model.frequency_response(many).frdata[:, :, : len(OMEGA)], true, sizes) < 1e-7
    bends = any(isinstance(body, Beam) for body in description.bodies)  # over coordinates, fast bending takes digits
    for states in (None, *(["coordinates"] * (not bends))) if model.input_labels else ():
        with warnings.catch_warnings():
            warnings.simplefilter("error", AccuracyWarning)
            try:
                system = model.to_statespace(outputs=outputs, states=states)
            except AccuracyWarning as said:
                assert "rounding of the state space" in str(said)  # noqa: PT017
                continue
        count = len(outputs)
        assert off(state_space_response(system, OMEGA), true[:count], sizes[:count]) < 1e-6


@given(seeds)
@examples(200)
def test_acceleration_outputs_proper_or_raises(seed):
    """They need one where the exact response to a displacement still grows at the highest frequencies."""
    machine, description, moved, held = drawn(seed, beams=0.0)
    fast = np.array([2.0**130, 2.0**131])
    expected = response(machine, moved, held, fast)
    if expected is None or not moved:
        return
    size = fast**2 * np.abs(expected[1][: len(machine.outputs)])
    grows = bool((size[:, :, 1] > 1.5 * size[:, :, 0]).any())
    read = replace(description, outputs=tuple(replace(output, derivative=2) for output in description.outputs))
    names = ([f"f{i}" for i in group] for group in (moved, held))
    model = prescribe_displacement(read.assemble(), *names)
    if not grows:
        assert model.to_statespace().nstates == 2 * model.ncoordinates
        return
    with pytest.raises(ValueError, match="needs a derivative of input"):
        model.to_statespace()


@given(seeds)
@examples(100)
def test_what_is_held_is_not_prescribed_once_more(seed):
    """At any place on its line it moves by nothing but rounding."""
    rng = np.random.default_rng(seed)
    angle, size = rng.uniform(-3.0, 3.0), 10.0 ** rng.uniform(-3, 3)
    corner = size * rng.uniform(-2.0, 2.0, 2) + size * rng.integers(-50, 50, 2)
    beside = corner + size * rng.uniform(-3.0, 3.0) * np.array([cos(angle), sin(angle)])
    body = RigidBody("body", GROUND.at(*(corner + size)), planar("x", "y", "theta"), 2.0, 0.7 * size**2)
    forces = (
        Force("hold", body.at(*corner), angle),
        Force("again", body.at(*beside), angle),
        Force("on", body.at(0.0)),
    )
    model = prescribe_displacement(Assembly((body,), (), forces).assemble(), hold="hold")
    with pytest.raises(ValueError, match="'again' is fully constrained"):
        prescribe_displacement(model, "again")
