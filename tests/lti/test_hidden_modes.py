"""Modes that no input moves: those of floating chains, whose rigid motion is a double pole that rounding takes apart."""

import control
import numpy as np
from hypothesis import given
from scipy.linalg import block_diag

import boomctl as bc
from boomctl.lti.hidden_modes import unmoved
from tests.profiles import examples
from tests.strategies import seeds


def floating_chain(rng):
    """Return masses between springs and dampers, free at both ends: matrices, and what of the force pushes the whole."""
    n = int(rng.integers(2, 5))
    k = 10.0 ** rng.uniform(0.0, 4.0) * rng.uniform(0.5, 2.0, n - 1)
    m, f = rng.uniform(0.5, 20.0, n), rng.standard_normal(n)
    K = np.diag([*k, 0.0]) + np.diag([0.0, *k]) - np.diag(k, 1) - np.diag(k, -1)
    if rng.random() < 0.5:
        f -= f.mean()
    else:
        f += np.sign(f.sum())
    pushed = bool(abs(f.sum()) > 0.5)
    rates = K / m[:, None]
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-rates, -(10.0 ** rng.uniform(-4.0, -2.0)) * rates]])
    return A, np.concatenate([np.zeros(n), f / m])[:, None], pushed


@examples(500)
@given(seed=seeds)
def test_floating_body_controllability_in_any_units(seed):
    rng = np.random.default_rng(seed)
    A, B, pushed = floating_chain(rng)
    dt = 0.0
    if rng.random() < 0.6:
        dt = float(10.0 ** rng.uniform(-2.5, -0.3) / np.abs(np.linalg.eigvals(A)).max())
        held = control.sample_system(control.ss(A, B, np.eye(len(A)), 0.0), dt)
        A, B = held.A, held.B
    units = 10.0 ** rng.integers(-4, 5, len(A))
    A, B = A * units[:, None] / units, B * units[:, None]
    hidden = unmoved(A, B, [f"x{i}" for i in range(len(A))], dt=dt)
    assert bool(hidden) != pushed
    if pushed and dt:
        bc.lqr(control.ss(A, B, np.eye(len(A)), 0.0, dt), np.diag(units**-2.0), 1.0)


@examples(300)
@given(seed=seeds)
def test_copies_of_a_mode_need_as_many_inputs(seed):
    rng = np.random.default_rng(seed)
    copies, inputs = (int(rng.integers(1, 4)) for _ in range(2))
    omega = 10.0 ** rng.uniform(-1.0, 1.0)
    one = np.array([[0.0, omega], [-omega, 0.0]]) if rng.random() < 0.5 else np.array([[float(rng.choice([0.0, 0.3]))]])
    A = block_diag(*([one] * copies), np.diag(-(10.0 ** rng.uniform(-1.0, 1.0, 2))))
    turn = np.linalg.qr(rng.standard_normal(A.shape))[0]
    hidden = unmoved(turn @ A @ turn.T, rng.standard_normal((len(A), inputs)), [f"x{i}" for i in range(len(A))])
    assert len(hidden) == max(copies - inputs, 0)


@examples(40)
@given(seed=seeds)
def test_integrators_in_series_are_controllable_from_the_last(seed):
    """Rounding takes their pole apart, and its pieces have directions of their own: they are coupled, not hidden."""
    rng = np.random.default_rng(seed)
    A = block_diag(np.eye(3, k=1), np.diag([-1.0, -3.0]))
    T = np.linalg.qr(rng.standard_normal((5, 5)))[0] * 10.0 ** rng.uniform(-2.0, 2.0, 5)
    T = T @ np.linalg.qr(rng.standard_normal((5, 5)))[0]
    B = T @ [[0.0], [0.0], [1.0], [1.0], [1.0]]
    assert not unmoved(T @ A @ np.linalg.inv(T), B, [f"x{i}" for i in range(5)])
