"""Reduction of discrete systems: the error on a dense grid of the unit circle, bounds, Hankel values, what is kept."""

import control
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import linalg

from boomctl import reduce
from boomctl.exceptions import ReductionError
from tests.lti.test_hidden_modes import floating_chain
from tests.profiles import examples
from tests.reduction.test_reduce import METHODS, gap, response
from tests.reduction.test_truth import exact_error
from tests.strategies import seeds

pytestmark = pytest.mark.filterwarnings("ignore::boomctl.exceptions.LowerOrderWarning")


@examples(30)
@given(seeds, st.sampled_from(METHODS), st.sampled_from([-1.0, 1.0]))
def test_error_beside_a_pole_on_the_unit_circle_is_bounded(seed, method, pole):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 13))
    A = rng.standard_normal((n, n))
    A *= (1.0 - 10.0 ** rng.uniform(-4, -0.3)) / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.standard_normal((n + 1, 2)), rng.standard_normal((2, n + 1))
    full = control.ss(linalg.block_diag(A, pole), B, C, rng.standard_normal((2, 2)), 0.05)
    found = reduce(full, int(rng.integers(2, n + 1)), method)
    angles = np.append(np.linspace(1e-3, 3.14, 1001), np.abs(np.angle(np.linalg.eigvals(A))))
    worst = gap(full, found.system, np.clip(angles, 1e-3, 3.14) / 0.05).max()
    assert worst <= found.error_norm * (1.0 + 1e-5) + 1e-9
    assert found.error_norm <= found.error_bound * (1.0 + 1e-5)
    assert (found.retained_order, found.system.dt) == (1, 0.05)
    assert found.curves.omega[-1] <= np.pi / 0.05


@examples(30)
@given(st.integers(0, 10_000))
def test_hankel_values_are_those_of_the_discrete_gramians(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 13))
    A = rng.standard_normal((n, n))
    A *= (1.0 - 10.0 ** rng.uniform(-4, -0.3)) / np.abs(np.linalg.eigvals(A)).max()
    system = control.ss(A, rng.standard_normal((n, 2)), rng.standard_normal((2, n)), rng.standard_normal((2, 2)), 0.05)
    P = linalg.solve_discrete_lyapunov(system.A, system.B @ system.B.T)
    Q = linalg.solve_discrete_lyapunov(system.A.T, system.C.T @ system.C)
    exact = np.sqrt(np.sort(np.abs(np.linalg.eigvals(P @ Q)))[::-1])
    found = reduce(system, 1).hankel_singular_values
    assert found == pytest.approx(exact[: len(found)], rel=1e-5, abs=1e-6 * exact[0])


@pytest.mark.parametrize(("seed", "order"), [(0, 4), (13, 3)])
def test_order_above_that_of_the_image_is_tried(seed, order):
    """Of slow poles in coordinates of badly mixed units, rounding of the map adds a percent to the error."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 9))
    A = np.diag(-np.sort(-(1.0 - 10.0 ** rng.uniform(-9.0, -1.0, n))))
    T = np.linalg.qr(rng.standard_normal((n, n)))[0] * 10.0 ** rng.uniform(-1.5, 1.5, n)
    T = T @ np.linalg.qr(rng.standard_normal((n, n)))[0]
    B, C = T @ rng.standard_normal((n, 2)), rng.standard_normal((2, n)) @ np.linalg.inv(T)
    full = control.ss(T @ A @ np.linalg.inv(T), B, C, 0.0, 0.1)
    wanted = (1.0 - 1e-3) * reduce(full, order).error_norm
    assert reduce(full, order + 1).error_norm <= wanted  # the next one will do
    assert reduce(full, max_error=wanted).order == order + 1


@examples(200)
@given(seed=seeds)
def test_sampled_rigid_body_is_retained(seed):
    """What is refused is refused for rounding of its matrices, not for a pole that one half keeps and the other does not."""
    rng = np.random.default_rng(seed)
    A, B, _ = floating_chain(rng)
    C = rng.standard_normal((1, len(A)))
    fastest = np.abs(np.linalg.eigvals(A)).max()
    P = control.sample_system(control.ss(A, B, C, 0.0), float(10.0 ** rng.uniform(-1.7, 0.0) / fastest))
    try:
        found = reduce(P, int(rng.integers(2, len(A))), METHODS[int(rng.integers(4))])
    except ReductionError as refused:
        assert "may change its response without bound" in str(refused)  # noqa: PT017
        return
    omega = np.geomspace(0.05, np.pi, 60) / P.dt
    assert (
        gap(P, found.system, omega).max() <= found.error_norm * (1.0 + 1e-6) + 1e-6 * np.abs(response(P, omega)).max()
    )


@examples(100)
@example(seed=46, method="balanced")  # refused: rounding of the map exceeds the bound
@given(seed=st.integers(0, 10**6), method=st.sampled_from(METHODS))
def test_split_of_unstable_pole_counts_in_error(seed, method):
    """In random coordinates of any condition up to 1e6."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 11))
    slow = rng.standard_normal((n - 2, n - 2))
    slow *= (1.0 - 10.0 ** rng.uniform(-6.5, -3.0)) / np.abs(np.linalg.eigvals(slow)).max()
    A = linalg.block_diag(slow, np.diag(1.0 + 10.0 ** rng.uniform(-3.0, 0.0, 2)))
    ways = [linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2)]
    T = ways[0] @ np.diag(10.0 ** rng.uniform(-3.0, 3.0, n)) @ ways[1]
    B, C, back = rng.standard_normal((n, 2)), rng.standard_normal((2, n)), np.linalg.inv(T)
    full = control.ss(T @ A @ back, T @ B, C @ back, 0.0, 0.1)
    try:
        found = reduce(full, int(rng.integers(2, n)), method)
    except (ReductionError, ValueError):  # refused, or fewer states than are kept: nothing is said of it
        return
    assert exact_error(full, found.system) <= found.error_norm * (1.0 + 1e-12)


@pytest.mark.slow
@examples(60)
@example(seed=28)
@example(seed=64)
@example(seed=96)
@example(seed=153)
@given(seed=st.integers(0, 10**6))
def test_in_a_band_and_beside_it_errors_are_those_on_the_circle(seed):
    """Rounding of the map there and back counts: of slow poles that hardly decay it is more than the error."""
    rng = np.random.default_rng(seed)
    blocks = []
    for _ in range(int(rng.integers(1, 4))):
        angle = 10.0 ** rng.uniform(-4.0, 0.0)
        turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        blocks.append((1.0 - 10.0 ** rng.uniform(-9.0, -1.0)) * np.array(turn))
    A = linalg.block_diag(*blocks, np.diag(1.0 - 10.0 ** rng.uniform(-7.0, 0.0, 2)))
    n = len(A)
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    full = control.ss(Q @ A @ Q.T, rng.standard_normal((n, 2)), rng.standard_normal((2, n)), np.zeros((2, 2)), 1.0)
    band = tuple(np.sort(10.0 ** rng.uniform(-4.0, 0.0, 2)))
    order, method = int(rng.integers(1, n)), str(rng.choice(["balanced", "singular-perturbation"]))
    try:
        found = reduce(full, order, method, omega_range=band)
    except (ReductionError, ValueError):  # refused: nothing is said of it
        return
    assert exact_error(full, found.system, band) <= (1.0 + 1e-9) * found.error_norm
    assert exact_error(full, found.system) <= (1.0 + 1e-9) * found.error_bound
