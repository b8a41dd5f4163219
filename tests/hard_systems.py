"""State-space systems made hard on purpose, of fifteen kinds: seeded, up to 30 states, two signals at most on one side.

Of the last three rounding of the entries may change the answer by more than a certificate allows.
"""

from dataclasses import dataclass, replace

import control
import numpy as np
from scipy import linalg

EXACT = 2.0**-20  # grain of numbers that integer changes of coordinates keep exactly


@dataclass(frozen=True)
class Made:
    """Matrices on the way to a system."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def changed(self, T, back=None):
        """Return the same in coordinates ``z = T x``."""
        back = np.linalg.inv(T) if back is None else back
        return replace(self, A=T @ self.A @ back, B=T @ self.B, C=self.C @ back)

    def statespace(self):
        return control.ss(self.A, self.B, self.C, self.D)


def log_uniform(rng, low, high, count=None):
    return 10.0 ** rng.uniform(low, high, count)


def oscillator(frequency, ratio):
    return frequency * np.array([[-ratio, 1.0], [-1.0, -ratio]])


def oscillators(frequencies, ratios):
    """Return a block-diagonal A of oscillators."""
    return linalg.block_diag(*map(oscillator, frequencies, ratios))


def modes(rng, pairs, reals, damping=(-4.0, -0.5), decades=(-1.0, 1.0)):
    """Return a block-diagonal A of oscillators and lags."""
    ratios = log_uniform(rng, *damping, pairs)
    blocks = [oscillator(w, z) for w, z in zip(log_uniform(rng, *decades, pairs), ratios, strict=True)]
    return linalg.block_diag(*blocks, *(-log_uniform(rng, *decades, (reals, 1, 1))))


def count(rng, most=5):
    """Return how many: a few as a rule, and sometimes as many as 30 states hold."""
    return int(rng.integers(8, 14)) if rng.random() < 0.08 else int(rng.integers(1, most))


def with_signals(rng, A, feedthrough=0.0):
    rows, columns = [(1, 1), (2, 2), (1, 2), (3, 2), (2, 1)][int(rng.integers(5))]
    n, D = len(A), feedthrough * rng.standard_normal((rows, columns))
    return Made(A, rng.standard_normal((n, columns)), rng.standard_normal((rows, n)), D)


def orthogonal(rng, n):
    return np.linalg.qr(rng.standard_normal((n, n)))[0]


def unimodular(rng, n):
    """Return an integer matrix whose inverse is one of integers too, and that inverse."""
    lower = np.tril(rng.integers(-1, 2, (n, n)), -1) + np.eye(n)
    upper = np.triu(rng.integers(-1, 2, (n, n)), 1) + np.eye(n)
    T = lower @ upper
    return T, np.rint(np.linalg.solve(upper, np.linalg.inv(lower)))


def turned(rng, made):
    """Return a system in its own coordinates, or orthogonally mixed."""
    return made.changed(Q := orthogonal(rng, len(made.A)), Q.T) if rng.random() < 0.7 else made


def cluster(rng):
    pairs, reals = count(rng), int(rng.integers(0, 4))
    A = modes(rng, pairs, reals, decades=(0.0, 0.0), damping=(-4.0, -0.5))
    n = len(A)
    A = (
        A
        + np.kron(np.diag(log_uniform(rng, -12.0, -3.0, -(-n // 2)) * rng.standard_normal(-(-n // 2))), np.eye(2))[
            :n, :n
        ]
    )
    ratio = log_uniform(rng, -4.0, -0.5)
    for i in range(pairs):
        A[2 * i, 2 * i] = A[2 * i + 1, 2 * i + 1] = -ratio * (1.0 + log_uniform(rng, -12.0, -3.0))
    if rng.random() < 0.5:
        A += np.triu(rng.standard_normal((n, n)), 2) * log_uniform(rng, -6.0, 0.0)
    return turned(rng, with_signals(rng, A))


def defective(rng, longest=3, damping=(-1.5, -0.3)):
    chains = []
    for _ in range(int(rng.integers(1, 3))):
        length, coupling = int(rng.integers(2, longest + 1)), np.rint(rng.standard_normal() * 2**20 + 1.0) * EXACT
        if rng.random() < 0.5:
            block = np.rint(oscillator(1.0, log_uniform(rng, *damping)) * 2**20) * EXACT
        else:
            block = np.array([[-np.rint(log_uniform(rng, -1.0, 1.0) * 2**20) * EXACT]])
        k = len(block)
        chains.append(np.kron(np.eye(length), block) + coupling * np.kron(np.eye(length, k=1), np.eye(k)))
    made = with_signals(rng, linalg.block_diag(*chains))
    if rng.random() < 0.5:
        return made.changed(*unimodular(rng, len(made.A)))  # stays defective, to the last bit
    return turned(rng, made)


def light(rng):
    return turned(rng, with_signals(rng, modes(rng, count(rng), int(rng.integers(0, 3)), damping=(-12.0, -1.0))))


def scaled_states(rng):
    made = turned(rng, with_signals(rng, modes(rng, count(rng), int(rng.integers(0, 3)))))
    T = np.diag(log_uniform(rng, -6.0, 6.0, len(made.A)))
    return made.changed(T, np.diag(1.0 / np.diag(T)))


def mixed_states(rng, decades=3.0):
    made = with_signals(rng, modes(rng, count(rng), int(rng.integers(0, 3))))
    n = len(made.A)
    half = 0.5 * rng.uniform(0.0, decades)
    T = orthogonal(rng, n) @ np.diag(log_uniform(rng, -half, half, n)) @ orthogonal(rng, n)
    return made.changed(T)


def scaled_signals(rng):
    made = turned(rng, with_signals(rng, modes(rng, count(rng), int(rng.integers(0, 3))), feedthrough=rng.integers(2)))
    rows, columns = (log_uniform(rng, -8.0, 8.0, k) for k in made.D.shape)
    return replace(made, B=made.B * columns, C=rows[:, None] * made.C, D=rows[:, None] * made.D * columns)


def weakly_seen(rng, share):
    """Return a system some modes of which are moved, or read, by a share of the others."""
    A = modes(rng, count(rng), int(rng.integers(1, 4)), damping=(-6.0, -0.5))
    if rng.random() < 0.3:
        A = linalg.block_diag(A, oscillator(1.7, 0.0) if rng.random() < 0.5 else np.zeros((1, 1)))
        chosen = [len(A) - 1, len(A) - 2] if A[-1, -2:].any() else [len(A) - 1]
    else:
        first = 2 * int(rng.integers(0, max(1, len(A) // 2)))
        chosen = [first, first + 1] if first + 1 < len(A) and A[first, first + 1] else [first]
    made = with_signals(rng, A)
    which = int(rng.integers(3))
    if which != 1:
        made.B[chosen] *= share
    if which != 0:
        made.C[:, chosen] *= share
    return made


def hidden(rng):
    made = weakly_seen(rng, 0.0)
    return turned(rng, made) if rng.random() < 0.6 else made


def nearly_hidden(rng):
    return turned(rng, weakly_seen(rng, log_uniform(rng, -14.0, -5.0)))


def rigid(rng):
    bodies = [np.zeros((1, 1)), np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.0, -0.5]])]
    A = linalg.block_diag(bodies[int(rng.integers(3))], modes(rng, count(rng), int(rng.integers(0, 3))))
    made = with_signals(rng, A)
    return made.changed(*unimodular(rng, len(A))) if len(A) < 8 and rng.random() < 0.3 else turned(rng, made)


def spread(rng):
    return with_signals(rng, modes(rng, count(rng), int(rng.integers(1, 4)), decades=(-7.0, 7.0)))


def long_chains(rng):
    return defective(rng, longest=4, damping=(-3.0, -0.5))


def ill_mixed(rng):
    return mixed_states(rng, decades=6.0)


def spread_and_mixed(rng):
    made = spread(rng)
    return made.changed(Q := orthogonal(rng, len(made.A)), Q.T)


def feedthrough(rng):
    made = with_signals(rng, modes(rng, count(rng), int(rng.integers(0, 3))), log_uniform(rng, -6.0, 3.0))
    return turned(rng, made)


def near_the_axis(rng):
    A = modes(rng, count(rng), int(rng.integers(0, 3)))
    side = -1.0 if rng.random() < 0.6 else 1.0
    ratio = side * log_uniform(rng, -14.0, -5.0)
    last = oscillator(log_uniform(rng, -1.0, 1.0), -ratio) if rng.random() < 0.6 else np.array([[ratio]])
    made = with_signals(rng, linalg.block_diag(A, last))
    return turned(rng, made)


KINDS = {
    "cluster": cluster,
    "defective": defective,
    "light damping": light,
    "scaled states": scaled_states,
    "mixed states": mixed_states,
    "scaled signals": scaled_signals,
    "hidden": hidden,
    "nearly hidden": nearly_hidden,
    "rigid": rigid,
    "spread": spread,
    "feedthrough": feedthrough,
    "near the axis": near_the_axis,
    "long chains": long_chains,
    "ill mixed": ill_mixed,
    "spread and mixed": spread_and_mixed,
}
BEYOND = ("long chains", "ill mixed", "spread and mixed")  # what the digits given need not tell


def hard(seed):
    """Return the kind of a seed, and its system."""
    kind = tuple(KINDS)[seed % len(KINDS)]
    return kind, KINDS[kind](np.random.default_rng(seed)).statespace()
