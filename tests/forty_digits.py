"""An oracle in 40 digits: poles and responses of small state-space systems, and systems made hard on purpose."""

import control
import mpmath as mp
import numpy as np

DIGITS = 40
BESIDE = (-1.0, -0.3, 0.0, 0.3, 1.0)  # half-widths beside a resonance at which a response is looked at


def exact(matrix):
    return mp.matrix(np.asarray(matrix).tolist())


def poles(system):
    with mp.workdps(DIGITS):
        return mp.eig(exact(system.A), left=False, right=False) if system.A.size else []


def response(system, omega):
    """Return the response at one frequency; ``omega`` an mpmath number."""
    n = len(system.A)
    states = mp.inverse(mp.mpc(0, omega) * mp.eye(n) - exact(system.A)) * exact(system.B) if n else None
    return exact(system.D) if states is None else exact(system.C) * states + exact(system.D)


def largest(matrix):
    return float(np.linalg.norm(np.array(matrix.tolist(), dtype=complex), 2))


def resonances(*systems):
    with mp.workdps(DIGITS):
        return [mp.mpf(0), *(abs(p.imag) + t * abs(p.real) for s in systems for p in poles(s) for t in BESIDE)]


def largest_error(full, reduced, at=None):
    """Return the largest difference of two systems, at and beside all of their resonances: below the true norm."""
    with mp.workdps(DIGITS):
        at = resonances(full, reduced) if at is None else at
        return max(largest(response(full, w) - response(reduced, w)) for w in at)


def hard_system(seed, damping=(-8.0, -1.0)):
    """Return clusters, wide spreads and coupled oscillators in orthogonal, badly scaled and badly mixed coordinates."""
    rng = np.random.default_rng(seed)
    pairs = int(rng.integers(2, 6))
    w = np.full(pairs, 10 ** rng.uniform(-1.0, 1.0))
    if seed % 3 == 0:
        w = w * (1.0 + 10 ** rng.uniform(-9.0, -3.0) * rng.standard_normal(pairs))
    if seed % 3 == 1:
        w = 10 ** rng.uniform(-3.0, 3.0, pairs)
    A = np.zeros((2 * pairs, 2 * pairs))
    for i, (frequency, ratio) in enumerate(zip(w, 10 ** rng.uniform(*damping, pairs), strict=True)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = frequency * np.array([[-ratio, 1.0], [-1.0, -ratio]])
    if seed % 2:
        for i in range(pairs - 1):
            A[2 * i, 2 * i + 2] = 0.1 * rng.standard_normal()
    T = np.linalg.qr(rng.standard_normal(A.shape))[0]
    if seed % 5 > 2:
        T = T * 10.0 ** rng.uniform(-2.0, 2.0, len(A))
    if seed % 5 == 4:
        T = T @ np.linalg.qr(rng.standard_normal(A.shape))[0]
    back = np.linalg.inv(T)
    return control.ss(T @ A @ back, T @ rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A))) @ back, 0.0)
