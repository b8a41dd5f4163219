"""Elements of very different length: no digits are lost to the stiffest, and rigid motions are told apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.structure import GROUND, Assembly, Beam, BeamSegment, FiniteElements, Force, Output, fixed, planar
from tests.profiles import examples
from tests.references import ROOTS, dense
from tests.strategies import random_machine, seeds


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
        assert np.abs(slow.T @ dense(structure.M) @ slow - np.eye(rigid + 2)).max() < 1e-9
        assert np.abs(form.V.T @ dense(structure.M) @ form.V - form.N.T @ form.N).max() < 1e-9


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
