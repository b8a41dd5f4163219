"""Elements of very different length, up to 1e11 times: no digits are lost to the stiffest, or the user is warned."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.norm import LOST
from boomctl.exceptions import AccuracyWarning
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    FiniteElements,
    Force,
    Output,
    SpringDamper,
    fixed,
    planar,
    revolute,
)
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.poles import damped_poles
from tests.profiles import examples
from tests.references import ROOTS
from tests.strategies import random_machine, seeds
from tests.stress.references import cantilever_frequencies


def graded_pair(seed):
    """Return a boom with random nodes, and one with three more a hair's breadth beside some of them."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5)) if rng.random() < 0.8 else 40
    half = np.linspace(0.2, 5.9, count) + rng.uniform(0.0, 0.05, count)
    beside = [half[:2] + 10.0 ** rng.uniform(-11.0, -5.0, 2), 10.0 ** rng.uniform(-11.0, -4.0, 1)]
    booms = []
    for right in (np.unique([*half, 6.0]), np.unique(np.concatenate([half, *beside, [6.0]]))):
        booms.append(bc.spray_boom(elements=tuple(np.concatenate([-right[::-1], [0.0], right]))))
    return booms


@given(seeds)
@examples(30)
def test_a_boom_with_elements_of_no_length_is_the_boom_without(seed):
    """Modes, damped poles, responses, and the peak, which no locking of a half or short element changes.

    Where an element is so short that the last digits of its stiffness decide the peak, this is said, and the bounds hold.
    """
    plain, short = graded_pair(seed)
    modes, poles = (find(plain.structure, 4) for find in (lambda s, n: undamped_modes(s, n)[0], damped_poles))
    assert undamped_modes(short.structure, 4)[0] == pytest.approx(modes, rel=1e-4)
    assert np.abs(damped_poles(short.structure, 4) / poles - 1.0).max() < 1e-4
    omega = np.array([0.1, 1.5, 5.0])
    found, truth = (model.frequency_response(omega).frdata for model in (short, plain))
    assert np.abs(found - truth).max() < 1e-4 * np.abs(truth).max()
    certified, peak = bc.sigma(short).certificate, bc.sigma(plain).peak
    assert certified.lower_bound <= peak * 1.0001 <= certified.upper_bound * 1.0002
    if certified.certified:
        assert certified.lower_bound == pytest.approx(peak, rel=1e-4)
    else:
        assert certified.method.startswith(LOST)


def unlike_sections(seed):
    """Return sections of bending stiffnesses up to 1e12 apart, and nodes down to 1e-12 beside each other."""
    rng = np.random.default_rng(seed)
    cuts = np.sort(rng.uniform(0.05, 0.95, int(rng.integers(1, 4))))
    lengths = np.diff(np.concatenate([[0.0], cuts, [1.0]]))
    sections = [
        BeamSegment(length, 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-6, 6)) for length in lengths.tolist()
    ]
    marks = np.concatenate([[0.0], np.cumsum(lengths)])
    marks[-1] = 1.0
    beside = rng.choice(marks[:-1], int(rng.integers(1, 4))) + 10.0 ** rng.uniform(-12.0, -6.0)
    nodes = np.unique(np.concatenate([marks, beside, rng.uniform(0.02, 0.98, int(rng.integers(0, 4)))]))
    return sections, nodes


def clamped(sections, nodes):
    beam = Beam("beam", GROUND.at(0.0), fixed(), (0.0, 0.0), sections, FiniteElements(tuple(nodes)))
    return Assembly([beam], forces=[Force("tip", beam.at(1.0))], outputs=[Output("tip", beam.at(1.0))]).assemble()


def true_frequencies(sections, nodes):
    """Of the same elements, in 130 digits, since stiffnesses are up to 1e55 apart [rad/s]."""
    ends = np.cumsum([section.length for section in sections])[:-1]
    of = [sections[k] for k in np.searchsorted(ends, 0.5 * (nodes[1:] + nodes[:-1]))]
    stiffness, mass = [each.bending_stiffness for each in of], [each.mass_per_length for each in of]
    return cantilever_frequencies(nodes.tolist(), stiffness, mass, digits=130)


@pytest.mark.slow
@given(seeds)
@examples(60)
def test_frequencies_of_tiny_elements_accurate_or_warned(seed):
    sections, nodes = unlike_sections(seed)
    try:
        model = clamped(sections, nodes)
    except ValueError as error:
        assert "one node for both" in str(error)  # noqa: PT017
        return
    truth = true_frequencies(sections, nodes)
    for count in range(1, model.ncoordinates + 1):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", AccuracyWarning)
            try:
                found = 2.0 * np.pi * model.eigenfrequencies_hz(count)
            except ValueError as error:  # what is faster than rounding can tell does not come out as an oscillation
                assert truth[count - 1] > 1e9 * truth[0], error  # noqa: PT017
                break
        assert said or found == pytest.approx(truth[:count], rel=1e-8)


@given(seeds)
@examples(60)
def test_rigid_modes_with_tiny_elements(seed):
    """Rows of strains up to 1e20 apart: a spring holds a clamped or hinged beam, and leaves a free one its rotation."""
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.2, 1.0, int(rng.integers(2, 6))).tolist()
    sections = [BeamSegment(length, 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-4, 8)) for length in lengths]
    inner = np.sort(rng.uniform(0.01, 0.99, 5)) * sum(lengths)
    nodes = np.unique([0.0, sum(lengths), *inner, *(inner[:2] + 10.0 ** rng.uniform(-11.0, -3.0, 2))])
    joint, rigid = [(fixed(), 0), (planar("y", "theta"), 1), (revolute(), 0)][int(rng.integers(3))]
    beam = Beam("beam", GROUND.at(0.0), joint, (0.0, 0.0), sections, FiniteElements(tuple(nodes)))
    place = float(inner[2])
    spring = SpringDamper(beam.at(place), GROUND.at(place), "y", 10.0 ** rng.uniform(-2, 10))
    try:
        model = Assembly([beam], [spring]).assemble()
    except ValueError as error:
        assert "one node for both" in str(error)  # noqa: PT017
        return
    assert (undamped_modes(model.structure)[0] == 0.0).sum() == rigid


def cantilever(elements, joint=fixed()):  # noqa: B008
    """Return a beam from x = 0 on, pushed and read at its end."""
    beam = Beam("beam", GROUND.at(0.0), joint, (0.0, 0.0), (BeamSegment(1.0, 1.0, 1.0),), FiniteElements(elements))
    return Assembly((beam,), (), (Force("f", beam.at(beam.length)),), (Output("y", beam.at(beam.length)),)).assemble()


@pytest.mark.parametrize("d", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8])
def test_a_very_short_element_changes_nothing(d):
    """In the limit it is a node more, which no motion needs."""
    short, without = cantilever((0.0, 0.25, 0.5, 0.5 + d, 0.75, 1.0)), cantilever((0.0, 0.25, 0.5, 0.75, 1.0))
    lowest, expected = short.eigenfrequencies_hz(3), without.eigenfrequencies_hz(3)
    assert lowest == pytest.approx(expected, rel=20.0 * d + 1e-11)
    omega = np.array([0.0, 1.0, 10.0])
    for asked in (omega, np.linspace(0.0, 15.0, 400)):
        response, limit = (model.frequency_response(asked).frdata for model in (short, without))
        assert np.abs(response - limit).max() < (200.0 * d + 1e-11) * np.abs(limit).max()
        values = bc.sigma(short, asked).sigma
        assert values == pytest.approx(np.abs(response[0]), rel=1e-9)
    assert short.frequency_response([0.0]).frdata[0, 0, 0] == pytest.approx(1.0 / 3.0, rel=1e-10)


@given(seeds, st.floats(-8.0, -1.0), st.integers(3, 8))
@examples(60)
def test_stiffness_is_one_and_rigid_motions_strain_nothing(seed, exponent, elements):
    """Of any mesh, however uneven: rows over strain coordinates are orthonormal, mass is that of the matrices."""
    rng = np.random.default_rng(seed)
    widths = rng.uniform(0.2, 1.0, elements)
    widths[rng.integers(elements)] = 10.0**exponent
    nodes = tuple(np.concatenate([[0.0], np.cumsum(widths / widths.sum())[:-1], [1.0]]))
    for joint, rigid in ((fixed(), 0), (planar("y", "theta"), 2)):
        structure = cantilever(nodes, joint=joint).structure
        form = structure.strain_form
        assert form.rigid == rigid
        frequencies, shapes = form.modes()
        assert (frequencies[:rigid] == 0.0).all()
        assert (frequencies[rigid:] > 0.0).all()
        root = ROOTS["free-free" if rigid else "clamped-free"][0] ** 2
        # an upper bound (Rayleigh), at worst that of one element alone, sqrt(720) of a free beam
        assert root * (1.0 - 1e-9) <= frequencies[rigid] <= 1.2 * root
        slow = shapes[:, : rigid + 2]
        assert np.abs(slow.T @ structure.M @ slow - np.eye(rigid + 2)).max() < 1e-9
        assert np.abs(form.V.T @ structure.M @ form.V - form.N.T @ form.N).max() < 1e-9


@given(seeds)
def test_frequencies_do_not_depend_on_how_many_are_asked_for(seed):
    model = random_machine(seed).assemble()
    if model.ncoordinates > 100:
        return
    one = model.eigenfrequencies_hz(1)
    for count in (2, 4, 8):
        try:
            several = model.eigenfrequencies_hz(count)
        except ValueError:
            break
        assert several[0] == pytest.approx(one[0], rel=1e-12)
