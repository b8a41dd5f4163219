"""Checks at the boundary: whatever comes in, the message names the parameter."""

import numpy as np
import pytest

from boomctl import checks


@pytest.mark.parametrize("check", [checks.real, checks.positive, checks.nonnegative])
def test_an_integer_beyond_floating_point_is_refused_by_name(check):
    with pytest.raises(ValueError, match="gain: expected a finite number"):
        check("gain", 10**400)


@pytest.mark.parametrize("check", [checks.finite_array, checks.frequencies, checks.plain_array])
def test_rows_of_different_lengths_are_refused_by_name(check):
    with pytest.raises(ValueError, match="track: expected an array, got rows of different lengths"):
        check("track", [1.0, [2.0]])


@pytest.mark.parametrize("wanted", [2, 1.0, object()])
def test_names_that_are_none_are_refused_by_name(wanted):
    with pytest.raises(TypeError, match=r"output = .*: expected a name or a sequence of names"):
        checks.names("output", wanted, ("a", "b"))


@pytest.mark.parametrize("name", [np.array(["a", "b"]), np.array([1.0, 2.0]), 3, None])
def test_what_is_no_name_is_unknown(name):
    with pytest.raises(ValueError, match="unknown output"):
        checks.known("output", name, ("a", "b"))
