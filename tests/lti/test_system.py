"""What becomes a system, with its names, and systems side by side."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from boomctl.boom.factory import spray_boom
from boomctl.lti import bilinear, system
from boomctl.lti.system import Lti, append, of, static
from tests.refusals import assert_refused, refusals

OMEGA = np.array([0.0, 0.3, 2.0, 50.0])


def random(seed: int, states: int, inputs: int, outputs: int, names: str = "") -> Lti:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(states, states)) - 3.0 * np.eye(states)
    B, C, D = (rng.normal(size=shape) for shape in ((states, inputs), (outputs, states), (outputs, inputs)))
    labels = (
        tuple(f"{names}{kind}{i}" for i in range(n)) for kind, n in (("u", inputs), ("y", outputs), ("x", states))
    )
    return Lti(A, B, C, D, *labels)


def at(system: Lti) -> np.ndarray:
    return np.moveaxis(system.response(OMEGA), 2, 0)


def test_side_by_side():
    a, b, gain = random(1, 2, 1, 3, "a"), random(2, 3, 2, 1, "b"), static(np.array([[2.0, 3.0]]), "pq", "r")
    joined = append(a, gain, b)
    assert joined.input_labels == (*a.input_labels, "p", "q", *b.input_labels)
    assert joined.output_labels == (*a.output_labels, "r", *b.output_labels)
    assert joined.state_labels == a.state_labels + b.state_labels
    G = at(joined)
    assert_allclose(G[:, :3, :1], at(a))
    assert_allclose(G[:, 3, 1:3], np.tile([2.0, 3.0], (4, 1)))
    assert_allclose(G[:, 4:, 3:], at(b))
    unnamed = append(a, static(np.eye(1)))
    assert (unnamed.input_labels, unnamed.output_labels, unnamed.state_labels) == ((), (), a.state_labels)
    assert not G[:, :3, 1:].any()


@pytest.mark.parametrize("bandwidth", [None, 20.0])
def test_lti_matches_python_control(bandwidth):
    model = spray_boom(accelerometer_bandwidth_hz=bandwidth)
    direct, there_and_back = of(model), of(model.to_statespace())
    for letter in "ABCD":
        np.testing.assert_array_equal(getattr(direct, letter), getattr(there_and_back, letter))
    for kind in ("input_labels", "output_labels", "state_labels", "dt"):
        assert getattr(direct, kind) == getattr(there_and_back, kind)


ONE = np.eye(1)
REFUSED = r"""
of(None, sampled=True) -> got NoneType; .* or control\.ss\(A, B, C, D\) makes one
of(spray_boom, sampled=True) -> got function
of(control.ss([[np.nan]], 1.0, 1.0, 0.0), sampled=True) -> expected finite numbers.*got A\[0, 0\] = nan
of(control.tf([np.nan], [1.0, 1.0]), sampled=True) -> expected finite coefficients
of(control.ss(0.5, 1.0, 1.0, 0.0, True), sampled=True) -> got dt = True, which names no sampling time
of(one.boom(), discrete=True) -> expected a sampling time, got continuous time
of(one.boom(), expected="a StateSpace") -> expected a StateSpace, got SecondOrderModel
lower_lft(static(np.array([[1.0, 1.0], [1.0, 0.5]])), static(2.0 * ONE)) -> not well-posed
continuous_image(Lti(-ONE, ONE, ONE, 0.0 * ONE, dt=0.1)) -> pole at z = -1
discrete_image(Lti(20.0 * ONE, ONE, ONE, 0.0 * ONE), 0.1) -> pole at 2/dt = 20 rad/s
bc.hinf_norm(control.tf([1.0, 0.0, 0.0], [1.0, 1.0])) -> proper
bc.hinf_norm(control.ss(-ONE, [[1.0, 1.0]], ONE, [[0.0, 0.0]], inputs=["u", "u"])) -> own for each of 2 inputs, got 1: u
"""


@refusals(REFUSED)
def test_system_that_is_none_is_refused(call, words):
    assert_refused(call, words, vars(bilinear) | vars(system) | globals())


def test_dots_in_names_become_what_python_control_allows():
    class Machine:
        def __lti__(self):
            return Lti(-np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), ("a.force",), ("a.place",), ("a.x1",))

    found = of(Machine())
    assert (found.input_labels, found.output_labels, found.state_labels) == (("a_force",), ("a_place",), ("a.x1",))
