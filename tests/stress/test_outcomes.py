"""The fixture of these tests: what passes and what fails, and whose errors and warnings count."""

import warnings

import numpy as np
import pytest

from boomctl.checks import positive
from boomctl.exceptions import AccuracyWarning


def warned():
    warnings.warn("off by a lot", AccuracyWarning, stacklevel=1)
    return 1.0


def refused():
    positive("mass", -1.0)


@pytest.mark.parametrize("compute", [lambda: 1e-4, lambda: (1e-2, False), warned, refused])
def test_check_error_passes_exact_uncertified_and_refused(check_error, compute):
    check_error(compute, 1e-3, may_refuse=True)


@pytest.mark.parametrize(
    ("compute", "error"),
    [
        (lambda: 1e-2, AssertionError),
        (lambda: (float("nan"), True), AssertionError),
        (lambda: float(np.square(np.float64(1e300)) * 0.0), AssertionError),  # a warning of an inner library
        (lambda: np.linalg.solve(np.zeros((2, 2)), np.ones(2)), np.linalg.LinAlgError),
        (
            lambda: np.ones(2) + np.ones(3),
            ValueError,
        ),  # of compiled code: its innermost line is here, and raises nothing
        (lambda: {}["mass"], KeyError),
    ],
)
def test_check_error_fails_for_anything_else(check_error, compute, error):
    with pytest.raises(error):
        check_error(compute, 1e-3, may_refuse=True)


def test_check_error_fails_where_an_answer_is_expected(check_error):
    with pytest.raises(ValueError, match="mass"):
        check_error(refused, 1e-3)
