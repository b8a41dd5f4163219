"""Poles at zero and their Jordan chains, told by structure in whatever coordinates; block-diagonal forms."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.lti.modal import block_diagonal, diagonalized, spectral_parts, split, without_integrators
from boomctl.lti.system import Lti
from tests.profiles import examples
from tests.strategies import seeds

CONDITIONS = st.sampled_from([1e5, 1e6, 2.0**26])


def integrating(rng, chains, slow):
    """Chains of integrators beside slow and fast stable poles, coupled, in random orthogonal coordinates."""
    count, n = sum(chains), sum(chains) + 6
    A = linalg.block_diag(*(np.eye(length, k=1) for length in chains), np.zeros((6, 6)))
    A[count, count], A[count + 1, count + 1] = -slow, -0.3
    A[-4:, -4:] = np.kron(np.diag([1.0, 7.0]), np.array([[-0.01, 1.0], [-1.0, -0.01]]))
    A[:count, count:] = rng.standard_normal((count, n - count))
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    return Lti(Q @ A @ Q.T, Q @ rng.standard_normal((n, 2)), rng.standard_normal((2, n)) @ Q.T, np.zeros((2, 2)))


@examples(60)
@given(seeds, st.sampled_from([(1,), (2,), (1, 1), (2, 1), (3,), (2, 2), (4,)]), st.floats(-5.0, 0.0))
def test_all_poles_at_zero_are_found_and_come_out_exactly_there(seed, chains, exponent):
    system = integrating(np.random.default_rng(seed), chains, 10.0**exponent)
    found = without_integrators(system)
    count = sum(chains)
    assert len(found.retained.A) == count
    assert not np.linalg.matrix_power(found.retained.A, count).any()  # nilpotent, exactly
    parts = spectral_parts(system)
    fast, kept = parts.rest, parts.retained
    assert len(kept.A) == count
    assert fast.poles.real.max() < -1e-6
    omega = np.geomspace(0.1, 30.0, 60)  # above what rounding does to a chain of four at zero
    whole, parts = system.response(omega), fast.response(omega) + kept.response(omega)
    # what decouples a chain of k from a slow pole is as large as its k-th power, and cancels in the sum
    assert np.abs(whole - parts).max() <= 1e-8 * 10.0 ** (-exponent * max(chains)) * np.abs(whole).max()


@examples(40)
@given(seeds, st.floats(-13.0, -1.0))
def test_slow_poles_are_not_taken_for_integrators(seed, exponent):
    rng = np.random.default_rng(seed)
    slow = 10.0**exponent
    lags = np.diag([-slow, -slow, -1.0]) + np.diag([rng.uniform(-1.0, 1.0), 0.0], 1)
    for A in (lags, np.array([[0.0, 1.0], [-slow, -1.0]]), -np.eye(12) + np.diag(np.full(11, 40.0), 1)):
        system = Lti(A, np.ones((len(A), 1)), np.ones((1, len(A))), np.zeros((1, 1)))
        assert not len(without_integrators(system).retained.A)


@examples(40)
@given(seeds)
def test_split_system_is_the_sum_of_its_parts(seed):
    """The first part has the poles chosen, here those of the slow lag and of the last pair, and no direct way."""
    rng = np.random.default_rng(seed)
    system = replace(integrating(rng, (1,), 0.01), D=rng.standard_normal((2, 2)))
    chosen = (np.abs(system.poles + 0.01) < 1e-3) | (np.abs(system.poles) > 5.0)
    parts = split(system, chosen)
    one, other = parts.retained, parts.rest
    for part, poles in ((one, system.poles[chosen]), (other, system.poles[~chosen])):
        np.testing.assert_allclose(np.sort_complex(part.poles), np.sort_complex(poles), atol=1e-9)
    assert not one.D.any()
    assert parts.error_bound < 1e-9
    omega = np.geomspace(0.1, 30.0, 20)
    whole = system.response(omega)
    assert np.abs(one.response(omega) + other.response(omega) - whole).max() <= 1e-9 * np.abs(whole).max()


def test_nothing_but_integrators():
    system = Lti(np.diag([1.0, 1.0], 1), np.ones((3, 1)), np.ones((1, 3)), np.zeros((1, 1)))
    found = without_integrators(system)
    assert len(found.retained.A) == 3
    assert not len(found.rest.A)
    omega = np.array([0.5, 2.0])
    np.testing.assert_allclose(found.retained.response(omega), system.response(omega), rtol=1e-13)


def _checked(A, condition):
    """Return the widths of the blocks, after a look at what they promise."""
    blocks, columns, widths = block_diagonal(A, condition)
    assert np.linalg.cond(columns) <= condition
    ends = np.cumsum(widths)
    inside = linalg.block_diag(*(np.ones((width, width)) for width in widths))
    assert sum(widths) == len(A) == ends[-1]
    np.testing.assert_allclose(A @ columns, columns @ (blocks * inside), atol=1e-12 * condition * np.abs(A).max())
    return widths


@examples(60)
@given(st.integers(0, 10_000), st.integers(1, 14), CONDITIONS)
def test_form_is_similar(seed, n, condition):
    assert max(_checked(np.random.default_rng(seed).standard_normal((n, n)), condition)) <= n


@examples(30)
@given(st.integers(0, 10_000), st.integers(2, 5), CONDITIONS)
def test_poles_that_are_one_stay_together(seed, size, condition):
    rng = np.random.default_rng(seed)
    jordan = linalg.block_diag(np.diag(np.ones(size - 1), 1), np.diag([-1.0, -3.0]))
    V = linalg.qr(rng.standard_normal((len(jordan), len(jordan))))[0]
    assert max(_checked(V @ jordan @ V.T, condition)) == size


def test_modal_coordinates_keep_slow_modes_beside_fast_ones():
    half, omega = 2.0 ** np.array([-9, -6, 10, 11]), 2.0 ** np.array([0, 3, 21, 22])
    modes = linalg.block_diag(*([[-a, w], [-w, -a]] for a, w in zip(half, omega, strict=True)))
    T = np.eye(8)
    T[4:, :4] = np.random.default_rng(0).integers(-2, 3, (4, 4))  # So small integers leave no rounding error.
    inverse = 2.0 * np.eye(8) - T
    system = Lti(T @ modes @ inverse, T @ np.ones((8, 1)), np.ones((1, 8)) @ inverse, np.zeros((1, 1)))
    s = 1j * omega[:, None] + half
    exact = (2.0 * s / (s**2 + omega**2)).sum(axis=1)
    assert np.allclose(diagonalized(system).response(omega)[0, 0], exact, rtol=1e-12, atol=0.0)
