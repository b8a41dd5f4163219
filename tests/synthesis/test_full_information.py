"""Full information: what the best controller could do if it saw all states, by Riccati solutions of SciPy's own."""

import control
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from tests.profiles import examples
from tests.synthesis.plants import random_plant

_SIZES = (1, 1, 1, 1)


def full_information_level(P: control.StateSpace) -> float:
    """Return the lowest level at which ``A'X + XA - X(B2 B2' - B1 B1'/g^2)X + C'C = 0`` has a stabilizing X >= 0."""
    scale = np.linalg.norm(P.D[:2, 2:])
    # D12 is rotated to [0; 1], so that cross terms go into A and C
    rotate = linalg.qr(P.D[:2, 2:])[0]
    C = np.roll(rotate.T @ P.C[:2], 1, axis=0)
    C[1] *= np.sign(np.roll(rotate.T @ P.D[:2, 2:], 1, axis=0)[1, 0])
    B1, B2 = P.B[:, :2], P.B[:, 2:] / scale
    A, C = P.A - B2 @ C[1:], C[:1]

    def reached(level: float) -> bool:
        weights = np.diag([-(level**2), -(level**2), 1.0])
        try:
            X = linalg.solve_continuous_are(A, np.hstack([B1, B2]), C.T @ C, weights)
        except np.linalg.LinAlgError:
            return False
        closed = A - (B2 @ B2.T - B1 @ B1.T / level**2) @ X
        stable = linalg.eigvals(closed).real.max() < -1e-6 * np.linalg.norm(closed)
        return bool(stable and linalg.eigvalsh(X)[0] >= -1e-9 * np.abs(X).max())

    low, high = 0.0, 1.0
    while not reached(high):
        low, high = high, 2.0 * high
    while high - low > 1e-5 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high


def seeing_everything(P: control.StateSpace, noise: float) -> control.StateSpace:
    """Return the plant with all states and disturbances measured, each with noise of its own."""
    n, seen = P.nstates, P.nstates + 2
    B = np.hstack([P.B[:, :2], np.zeros((n, seen)), P.B[:, 2:]])
    C = np.vstack([P.C[:2], np.eye(n), np.zeros((2, n))])
    D = np.zeros((2 + seen, 2 + seen + 1))
    D[:2, -1:], D[2:, 2:-1], D[2 + n :, :2] = P.D[:2, 2:], noise * np.eye(seen), np.eye(2)
    return control.ss(P.A, B, C, D)


@examples(12)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 5))
def test_seeing_everything_reaches_the_full_information_level(seed, n):
    """And seeing less never helps."""
    P = random_plant(seed, n, _SIZES, False)
    level = full_information_level(P)
    design, partial = bc.h_infinity(seeing_everything(P, 1e-5), n + 2, 1), bc.h_infinity(P, 1, 1)
    assert design.certificate.lower_bound <= 1.002 * min(level, partial.gamma)
    assert design.gamma <= 1.02 * level
    assert min(design.gamma, partial.gamma) >= level * (1.0 - 1e-4)
