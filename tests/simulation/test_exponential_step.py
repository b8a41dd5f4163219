"""Stumpff's functions, of which exponential steps are made."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.simulation.machine.exponential_step import stumpff
from tests.profiles import examples


@examples(60)
@given(st.floats(1e-8, 1e4))
def test_stumpff_functions(y):
    values = [float(item) for item in stumpff(np.array(y))]
    with mpmath.workdps(40):
        for k, value in enumerate(values, start=1):
            exact = mpmath.hyper([1], [mpmath.mpf(k + 1) / 2, mpmath.mpf(k + 2) / 2], -mpmath.mpf(y) / 4)
            # away from 0 the functions oscillate about 1/y: that is the size to compare with
            assert value == pytest.approx(float(exact / math.factorial(k)), rel=1e-12, abs=1e-14 / max(1.0, y))
