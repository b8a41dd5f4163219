"""Weights: their gains at the ends, at the corner, and bad numbers."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import boomctl as bc
from tests.profiles import examples

CORNER = st.floats(1e-2, 1e3)
ORDER = st.sampled_from([1, 2])
FAR = 1e7


def gain(weight, omega):
    return abs(weight(1j * omega))


@examples(25)
@given(g=st.floats(1e-3, 1e3), corner=CORNER, order=ORDER)
def test_low_and_high_pass_share_the_corner(g, corner, order):
    low, high = bc.low_pass(g, corner, order), bc.synthesis.high_pass(g, corner, order)
    assert_allclose([gain(low, 0.0), gain(high, FAR * corner)], g, rtol=1e-6)
    assert_allclose([gain(low, corner), gain(high, corner)], g / np.sqrt(2.0), rtol=1e-9)
    assert gain(high, 0.0) <= 1e-9 * g
    assert_allclose(gain(low, 1e3 * corner), g * 1e-3**order, rtol=1e-3)


@examples(25)
@given(a=st.floats(1e-3, 1e3), ratio=st.floats(1e-4, 1e4), corner=CORNER, order=ORDER)
def test_shelves_go_from_one_gain_to_the_other(a, ratio, corner, order):
    weight = bc.shelf(a, a * ratio, corner, order)
    assert_allclose(gain(weight, 0.0), a, rtol=1e-9)
    assert_allclose(gain(weight, FAR * 1e4 * corner), a * ratio, rtol=1e-6)
    assert_allclose(gain(weight, corner), a * np.sqrt(ratio), rtol=1e-6)
    assert (weight.poles().real < 0.0).all()


@examples(25)
@given(g=st.floats(1e-3, 1e3), low=CORNER, ratio=st.floats(1.01, 1e3))
def test_band_pass_is_down_by_three_decibels_at_both_ends(g, low, ratio):
    weight = bc.synthesis.band_pass(g, low, low * ratio)
    assert_allclose(gain(weight, low * np.sqrt(ratio)), g, rtol=1e-9)
    assert_allclose([gain(weight, low), gain(weight, low * ratio)], g / np.sqrt(2.0), rtol=1e-9)
