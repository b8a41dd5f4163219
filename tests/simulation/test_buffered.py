"""CasADi functions in memory shared with NumPy: what they return is what a plain call returns."""

import casadi as ca
import numpy as np
import pytest

from boomctl.simulation.machine.buffered import Buffered, at_columns


def _function():
    """Return a function of vectors, one of them empty, with a structural zero among what it returns."""
    x, u, none = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("none", 0)
    sparse = ca.SX(4, 1)
    sparse[0], sparse[2] = x[0] * u[1], ca.sin(x[2])
    return ca.Function("some", [x, u, none], [ca.vertcat(x + u[0], ca.sumsqr(u)), sparse])


@pytest.mark.parametrize("count", [1, 2, 999, 1000, 1001, 2500])
def test_at_all_columns(count):
    rng = np.random.default_rng(count)
    x, u = rng.normal(size=(3, count)), rng.normal(size=(2, count))
    found = at_columns(_function(), x, u, np.zeros((0, count)))
    for each, wanted in zip(found, _function()(x, u, ca.DM.zeros(0, count)), strict=True):
        np.testing.assert_array_equal(each, np.array(ca.densify(wanted)))


def test_matrices_and_vectors_each_call_anew():
    """A mapped function of a vector and a matrix; what an earlier call returned stays as it was."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 2)
    steps = ca.Function("step", [x, u], [0.5 * x + u]).mapaccum("run", 4)
    run, rng = Buffered(steps), np.random.default_rng(0)
    given = [(rng.normal(size=2), rng.normal(size=(2, 4))) for _ in range(3)]
    found = [run(*each)[0] for each in given]
    for each, arguments in zip(found, given, strict=True):
        np.testing.assert_array_equal(each, np.array(steps(*arguments)))


def test_views_of_other_arrays_are_read_right():
    x = np.arange(24.0).reshape(4, 6)[::2, ::-2]
    twice = ca.Function("twice", [y := ca.SX.sym("y", 2, 3)], [2.0 * y])
    np.testing.assert_array_equal(Buffered(twice)(x)[0], 2.0 * x)
