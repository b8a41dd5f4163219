"""Cross sections: against integrals over their area, the spray boom's tube, and lines of thin walls."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import boomctl as bc
from boomctl.structure import (
    BeamSegment,
    circular_section,
    i_section,
    rectangular_section,
)
from tests.profiles import examples

SIZES = st.floats(1e-3, 1.0)
SHARES = st.floats(1e-9, 0.49)


def integrals(breadth, depth, corners=()):
    """Return area and second moment of a section that is so broad at each height above its middle."""
    edges = sorted({-0.5 * depth, 0.5 * depth, *corners, *(-c for c in corners)})
    area = sum(quad(breadth, a, b, epsabs=0.0)[0] for a, b in pairwise(edges))
    return area, sum(quad(lambda y: y * y * breadth(y), a, b, epsabs=0.0)[0] for a, b in pairwise(edges))


def of(section):
    return section.area, section.second_moment


@given(SIZES, SIZES, st.floats(1e-3, 0.49), st.floats(1e-3, 0.49))
@examples(20)
def test_sections_of_straight_walls_are_their_integrals(b, h, sides, covers):
    s, t = sides * b, covers * h
    inner = 0.5 * h - t
    tube = integrals(lambda y: b if abs(y) > inner else 2.0 * s, h, [inner])
    beam = integrals(lambda y: b if abs(y) > inner else s, h, [inner])
    assert of(rectangular_section(b, h, (s, t))) == pytest.approx(tube, rel=1e-8)
    assert of(i_section(b, h, s, t)) == pytest.approx(beam, rel=1e-8)
    assert of(rectangular_section(b, h)) == pytest.approx(integrals(lambda y: b, h), rel=1e-8)


@given(SIZES, st.floats(0.05, 0.49))
@examples(20)
def test_round_sections_are_their_integrals(d, share):
    def chord(y, diameter):
        return np.sqrt(max(diameter**2 - 4.0 * y * y, 0.0))

    hollow = (1.0 - 2.0 * share) * d
    ring = [
        p - q
        for p, q in zip(integrals(lambda y: chord(y, d), d), integrals(lambda y: chord(y, hollow), hollow), strict=True)
    ]
    assert of(circular_section(d, share * d)) == pytest.approx(ring, rel=1e-6)
    assert of(circular_section(d)) == pytest.approx(integrals(lambda y: chord(y, d), d), rel=1e-6)


@given(SIZES, SIZES, SHARES)
@examples(30)
def test_thin_walls_lose_no_digits(b, h, share):
    """To the first order in the wall, area and second moment are those of lines; the error is of the next order."""
    t = share * min(b, h)
    found = rectangular_section(b, h, t)
    assert found.area == pytest.approx(2.0 * t * (b + h), rel=2.0 * share + 1e-14)
    assert found.second_moment == pytest.approx(t * h * h * (h / 6.0 + b / 2.0), rel=4.0 * share + 1e-13)
    ring = circular_section(h, share * h)
    assert ring.second_moment == pytest.approx(np.pi * share * h**4 / 8.0, rel=3.0 * share + 1e-13)


def test_the_boom_is_made_of_its_tube():
    p = bc.BoomParameters()
    walls = 0.5 * (p.outer_height - p.inner_height), 0.5 * (p.outer_width - p.inner_width)
    section = rectangular_section(p.outer_height, p.outer_width, walls)
    beam = BeamSegment.from_cross_section(p.length, section, p.youngs_modulus, p.density, p.stiffness_damping)
    assert beam.bending_stiffness == pytest.approx(p.bending_stiffness, rel=1e-13)
    assert beam.mass_per_length == pytest.approx(p.mass_per_length, rel=1e-13)
    assert beam.stiffness_damping == p.stiffness_damping
