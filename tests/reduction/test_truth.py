"""Reductions are what they say: errors and bounds against responses in 300 binary digits, at and beside all poles."""

from contextlib import suppress

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

import boomctl as bc
from boomctl.exceptions import ReductionError
from tests.hard_systems import oscillators
from tests.lti.test_proof import response, size, with_many_digits
from tests.profiles import examples
from tests.reduction.test_reduce import METHODS
from tests.strategies import seeds

pytestmark = pytest.mark.filterwarnings("ignore::boomctl.exceptions.LowerOrderWarning")


def stable(rng, kind):
    """Return oscillators and lags in orthogonal or badly scaled coordinates, a matrix far from normal, or one of steps."""
    n = int(rng.integers(3, 8))
    if kind == "steps":
        A = rng.standard_normal((n, n))
        A *= (1.0 - 10.0 ** rng.uniform(-4, -0.3)) / np.abs(np.linalg.eigvals(A)).max()
    elif kind == "triangular":
        A = np.triu(30.0 * rng.standard_normal((n, n)), 1) - np.diag(10.0 ** rng.uniform(-1, 1, n))
    else:
        w, z = 10.0 ** rng.uniform(-1, 2, n // 2), 10.0 ** rng.uniform(-3, -0.3, n // 2)
        A = linalg.block_diag(oscillators(w, z), *([-(10.0 ** rng.uniform(-1, 2))] * (n % 2)))
        Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
        A = Q @ A @ Q.T
    B, C, D = (rng.standard_normal(shape) for shape in ((n, 2), (1 + n % 2, n), (1 + n % 2, 2)))
    d = 10.0 ** rng.uniform(-3, 3, n) if kind == "scaled" else np.ones(n)
    return A * d / d[:, None], B / d[:, None], C * d, D * rng.integers(2)


def sampled(rng, A, B, C, D=0.0):
    dt = 10.0 ** rng.uniform(-2, 0) / np.abs(np.linalg.eigvals(A)).max()
    held = linalg.expm(dt * np.block([[A, B], [np.zeros((2, len(A) + 2))]]))
    return control.ss(held[: len(A), : len(A)], held[: len(A), len(A) :], C, D, dt)


def exact_error(full, reduced, band=None):
    """Return the largest difference at all poles and on a refined grid: a lower bound of the norm of the error."""
    dt = full.dt or 0.0
    poles = np.concatenate([system.poles() for system in (full, reduced) if system.nstates])
    width = np.maximum(np.abs(1.0 - np.abs(poles)), 1e-9) if dt else np.abs(poles.real)
    middle = np.abs(np.angle(poles)) if dt else np.abs(poles.imag)
    grid = np.concatenate([[0.0], np.abs(poles), *(middle + k * width for k in (-3, -1, -0.3, 0, 0.3, 1, 3))])
    grid = np.concatenate([grid, np.geomspace(0.1, 10.0, 12) * middle.max()]) / (dt or 1.0)
    grid = np.unique(np.clip(grid, *((0.0, np.pi / dt if dt else np.inf) if band is None else band)))
    values = [error_at(full, reduced, w) for w in grid]
    for _ in range(6):  # each time around the largest value, at a quarter of the distances
        best = int(np.argmax(values))
        near = grid[max(best - 1, 0) : best + 2]
        more = np.setdiff1d(np.concatenate([near[:-1] + k * np.diff(near) for k in (0.25, 0.5, 0.75)]), grid)
        values += [error_at(full, reduced, w) for w in more]
        order = np.argsort(np.concatenate([grid, more]))
        grid, values = np.concatenate([grid, more])[order], [values[k] for k in order]
    return max(values)


@with_many_digits
def error_at(full, reduced, omega):
    return size(response(full, omega) - response(reduced, omega))


@given(seeds)
@examples(40)
def test_no_error_exceeds_what_was_verified_bounded_or_wanted(seed):
    """And it is attained where it is said to be; no smaller system comes nearer than the Hankel values left out."""
    rng = np.random.default_rng(seed)
    kind = ("plain", "scaled", "triangular", "steps")[seed % 4]
    A, B, C, D = stable(rng, kind)
    steps, continuous = kind == "steps", rng.random() < 0.4
    full = control.ss(A, B, C, D, 0.05 * steps) if steps or continuous else sampled(rng, A, B, C, D)
    for method in METHODS:
        order = int(rng.integers(0, len(A) + 1))
        try:
            found = bc.reduce(full, order, method)
        except ReductionError:
            continue
        assert found.system.nstates == found.order <= order
        error = exact_error(full, found.system)
        assert error <= found.error_norm * (1.0 + 1e-12)
        assert error <= found.error_bound * (1.0 + 1e-12)
        assert found.order < len(A) or found.error_norm == 0.0
        if steps:
            assert error >= 0.5 * found.error_norm
        norm = found.certificate
        assert norm.lower_bound <= found.error_bound * (1.0 + 1e-3)
        if np.isfinite(norm.peak_omega):
            assert error_at(full, found.system, norm.peak_omega) >= norm.lower_bound * (1.0 - 1e-9)
    wanted = 10.0 ** rng.uniform(-14, 0) * np.linalg.norm(B) * np.linalg.norm(C)
    method = METHODS[seed // 4 % 4]
    found = bc.reduce(full, max_error=wanted, method=method)
    assert found.error_norm <= wanted
    assert exact_error(full, found.system) <= wanted
    assert found.hankel_singular_values[found.order :].max(initial=0.0) <= wanted
    if found.order and method in METHODS[:2]:  # no lower order will do
        with suppress(ReductionError):
            assert bc.reduce(full, found.order - 1, method).error_norm > wanted * (1.0 - 1e-4)


@given(seeds)
@examples(200)
def test_modal_choice_with_unstable_pole(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    w, z = 10.0 ** rng.uniform(-1, 2, count), 10.0 ** rng.uniform(-5, -2, count)
    A = linalg.block_diag(oscillators(w, z), 10.0 ** rng.uniform(-2, 1))
    n = len(A)
    U, _, V = np.linalg.svd(rng.standard_normal((n, n)))
    T, inverse = (M @ V for M in (U * np.geomspace(1.0, 30.0, n), U / np.geomspace(1.0, 30.0, n)))
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((1, n))
    found = bc.reduce(control.ss(T @ A @ inverse.T, T @ B, C @ inverse.T, 0.0), n - 2, "modal")
    assert (found.retained_order, found.order) == (1, n - 2)
    assert found.error_norm <= found.error_bound < np.inf


@pytest.mark.parametrize("method", ["balanced", "singular-perturbation"])
def test_a_band_may_reach_half_the_sampling_rate(method):
    full = control.ss(np.diag([0.1, 0.2, 0.3]), np.ones((3, 1)), np.ones((1, 3)), 0.0, 0.1)
    found = bc.reduce(full, 2, method, omega_range=(1.0, np.pi / 0.1))
    assert exact_error(full, found.system) <= found.error_bound


def test_states_without_a_static_answer_are_named(monkeypatch):
    def singular(system, count):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("boomctl.reduction.reducers.residualised", singular)
    full = control.ss(np.diag([-1.0, -2.0]), np.ones((2, 1)), np.ones((1, 2)), 0.0)
    with pytest.raises(ReductionError, match="order 1: the truncated states have no static response"):
        bc.reduce(full, 1, "singular-perturbation", omega_range=(1.0, 2.0))


@pytest.mark.parametrize(("seed", "order"), [(3, 8), (4, 6), (7, 8), (9, 8)])
def test_no_narrow_peak_within_a_band_exceeds_the_error(seed, order):
    """A resonance beside a broader one of nearly the same height: rounding takes its crossings of a level off the axis."""
    rng = np.random.default_rng(seed)
    w, z = (0.443, 0.467, 4.83, 5.97, 44.2, 71.9), (5e-4, 1.5e-2, 1.3e-3, 1.6e-3, 9e-4, 3e-4)
    A = linalg.block_diag(*([[0.0, a], [-a, -2.0 * b * a]] for a, b in zip(w, z, strict=True)))
    full = control.ss(A, rng.standard_normal((12, 1)), rng.standard_normal((1, 12)), 0.0)
    found = bc.reduce(full, order, omega_range=(0.0, 0.48))
    omega = np.linspace(0.43, 0.48, 2001)
    off = full(1j * omega) - found.system(1j * omega)
    assert np.abs(off).max() <= found.error_norm * (1.0 + 1e-9)


def lightly_damped(seed):
    """Return two to four oscillators, every second one with little damping and a high peak, continuous or sampled."""
    rng = np.random.default_rng(seed)
    pairs = int(rng.integers(2, 5))
    light = np.arange(pairs) % 2 == 0
    w = 10.0 ** rng.uniform(-1, 1, pairs)
    z = 10.0 ** np.where(light, rng.uniform(-8, -4, pairs), rng.uniform(-3, -0.3, pairs))
    A = oscillators(w, z)
    gains = np.repeat(10.0 ** np.where(light, rng.uniform(-1, 2, pairs), rng.uniform(-3, 0, pairs)), 2)
    B, C = gains[:, None] * rng.standard_normal((len(A), 2)), rng.standard_normal((1, len(A))) * gains
    if seed % 2:
        Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
        A, B, C = Q @ A @ Q.T, Q @ B, C @ Q.T
    return sampled(rng, A, B, C) if rng.random() < 0.3 else control.ss(A, B, C, 0.0)


# the quick sample has seeds at which rounding of light poles or of Hamiltonian eigenvalues hides the error
@pytest.mark.parametrize("sample", [(94, 96), pytest.param(range(250), marks=pytest.mark.slow)])
def test_errors_beside_shared_light_poles_are_true(sample):
    """Full and reduced system have nearly the same pole, beside which their responses cancel."""
    refused = 0
    for seed in sample:
        full = lightly_damped(seed)
        for method, order in zip(METHODS, np.random.default_rng(seed).integers(2, full.nstates, 4), strict=True):
            try:
                found = bc.reduce(full, int(order), method)
            except (ReductionError, ValueError):
                refused += 1
                continue
            error = exact_error(full, found.system)
            assert error <= found.error_norm * (1.0 + 1e-9)
            assert error <= found.error_bound * (1.0 + 1e-9)
            bc.prove(found)
    assert refused <= 0.6 * len(sample)  # of four methods


@pytest.mark.parametrize("sample", [range(3), pytest.param(range(120), marks=pytest.mark.slow)])
def test_errors_in_bands_count_no_rounding_elsewhere(sample):
    for seed in sample:
        full, rng = lightly_damped(seed), np.random.default_rng(seed)
        w = np.abs(np.angle(full.poles())) / full.dt if full.dt else np.abs(full.poles())
        band = np.sort(np.exp(rng.uniform(np.log(0.3 * w.min()), np.log(w.max()), 2)))
        for method in METHODS[:2]:
            try:
                found = bc.reduce(full, int(rng.integers(2, full.nstates)), method, omega_range=tuple(band))
            except (ReductionError, ValueError):
                continue
            error = exact_error(full, found.system, band)
            assert error <= found.error_norm * (1.0 + 1e-9)
            assert found.error_norm <= 1.1 * error
            assert exact_error(full, found.system) <= found.error_bound * (1.0 + 1e-9)
            assert found.certificate.lower_bound <= found.error_norm
            bc.prove(found)


def nonminimal(seed):
    """Return a system in random coordinates with modes that inputs do not reach or outputs do not show; its minimal order."""
    rng = np.random.default_rng(seed)
    pairs = int(rng.integers(1, 4))
    w, z, k = 10.0 ** rng.uniform(-0.5, 1.0, pairs), 10.0 ** rng.uniform(-2.5, -0.3, pairs), 2 * pairs
    A = oscillators(w, z)
    B, C = rng.standard_normal((k, 2)), rng.standard_normal((1, k))
    unreached, unseen = int(rng.integers(1, 4)), int(rng.integers(0, 4))
    n = k + unreached + unseen
    A = linalg.block_diag(A, np.diag(-(10.0 ** rng.uniform(-0.5, 1.0, n - k))))
    A[:k, k : k + unreached] = rng.standard_normal((k, unreached))
    A[k + unreached :, : k + unreached] = rng.standard_normal((unseen, k + unreached))
    B = np.vstack([B, np.zeros((unreached, 2)), rng.standard_normal((unseen, 2))])
    C = np.hstack([C, rng.standard_normal((1, unreached)), np.zeros((1, unseen))])
    left, right = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    T = left * 10.0 ** rng.uniform(-1, 1, n) @ right
    A, B, C = T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T)
    return (sampled(rng, A, B, C) if rng.random() < 0.3 else control.ss(A, B, C, 0.0)), k


@pytest.mark.parametrize("sample", [range(1), pytest.param(range(80), marks=pytest.mark.slow)])
def test_hidden_modes_are_removed_without_error(sample):
    for seed in sample:
        full, order = nonminimal(seed)
        size = bc.hinf_norm(full).lower_bound
        for method in METHODS[:3]:
            found = bc.reduce(full, order, method)
            error = exact_error(full, found.system)
            assert error <= found.error_norm * (1.0 + 1e-9)
            assert found.error_norm <= 1.1 * error
            assert found.error_norm <= 1e-10 * size
            assert bc.reduce(full, max_error=1e-9 * size, method=method).order == order
