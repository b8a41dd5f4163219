"""Checks at the boundary: whatever comes in, the message names the parameter."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl import checks


@given(st.floats(1e-90, 1e90), st.sampled_from([1.0, -1.0]), st.floats(-1e-7, 1e-7))
def test_offered_limit_is_valid(size, sign, share):
    limit = sign * size
    assert float(checks.up_to(limit)) <= limit <= float(checks.from_on(limit))
    assert abs(float(checks.up_to(limit)) / limit - 1.0) <= 1e-6
    beside = limit * (1.0 + share)
    assert (checks.exactly(limit) == checks.exactly(beside)) == (limit == beside)


def test_limits_of_few_digits_are_offered_as_they_are():
    assert [checks.up_to(x) for x in (0.1, 1e-12, 3.0, 1e60)] == ["0.1", "1e-12", "3", "1e+60"]
    assert (checks.up_to(2.0 / 3.0), checks.from_on(2.0 / 3.0)) == ("0.6666666", "0.6666667")


@pytest.mark.parametrize(
    ("check", "value"),
    [
        (checks.real, 10**400),
        (checks.nonnegative, 10**400),
        (checks.finite_array, [1.0, [2.0]]),
        (checks.finite_array, [1.0, np.nan]),
        (checks.finite_array, [1.0j]),
        (checks.frequencies, [1.0, [2.0]]),
        (checks.plain_array, [1.0, [2.0]]),
        (lambda name, value: checks.names(name, value, ("a", "b")), 2),
        (checks.sequence, "text"),
        (checks.sequence, 3.0),
        (checks.sequence, np.array(1.0)),
        (checks.truth, np.ones(2)),
        (checks.truth, 1),
        (checks.path, 3),
        (checks.path, b"bytes"),
        (lambda name, value: checks.mapping(name, value, "names to numbers"), [1.0]),
        (lambda name, value: checks.instance(name, value, (int, float)), "text"),
        (lambda name, value: checks.within(name, value, 0.0, 1.0), 1.0 + 1e-15),
        (checks.real, 1e200),
        (checks.positive, 5e-324),
        (checks.whole, 10**40),
    ],
)
def test_what_is_not_expected_is_refused_by_name(check, value):
    with pytest.raises((TypeError, ValueError), match=r"^given.*: expected "):
        check("given", value)


def sampled_lead():
    mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="place", outputs="force")
    return bc.margins(mass, bc.discretize(lead, 0.05), delay=0.2)


def integrator_at_rest():
    rotor = control.ss([[0.0, 2.0], [-2.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    return bc.sigma(rotor, [2.0])


WARNED = {
    "method with an inner __init__": lambda: bc.BoomParameters().replace(density=2000.0),
    "reduction": lambda: bc.reduce(control.ss(-np.eye(2), np.ones((2, 1)), np.ones((1, 2)), 0.0), order=2),
    "margins of a sampled loop": sampled_lead,
    "response at a pole": integrator_at_rest,
}


@pytest.mark.parametrize("call", WARNED.values(), ids=WARNED)
def test_warning_names_line_of_user(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    assert caught
    assert {warning.filename for warning in caught} == {__file__}
