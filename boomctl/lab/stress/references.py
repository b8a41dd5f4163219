"""True answers that share nothing with the package: closed forms, and small problems in sixty digits."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import flint
import mpmath as mp
import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.references.high_precision import MASS, STIFFNESS

DIGITS = 60  # lengths of ratio 1e6 cost some 18 digits of a stiffness matrix, twice: forty are left

_Number = Any


def pinned_mesh_frequency(count: int) -> float:
    """Return the first frequency of a pinned beam of ``count`` equal cubic elements, length, mass and stiffness one.

    A uniform mesh bends in sines: ``w_j = W sin(j pi/n)``, ``phi_j = F cos(j pi/n)``, which leaves two unknowns.
    """
    with mp.workdps(DIGITS):
        h, c, s = mp.mpf(1) / count, mp.cos(mp.pi / count), mp.sin(mp.pi / count)
        k11, k12, k22 = 24 * (1 - c), -12 * h * s, h * h * (8 + 4 * c)
        m11, m12, m22 = 312 + 108 * c, 26 * h * s, h * h * (8 - 6 * c)
        if count == 1:  # nothing between the ends: rotations alone
            ratio = k22 / m22
        else:
            a, b = m11 * m22 - m12**2, k11 * m22 + k22 * m11 - 2 * k12 * m12
            ratio = 2 * (k11 * k22 - k12**2) / (b + mp.sqrt(b * b - 4 * a * (k11 * k22 - k12**2)))
        return float(mp.sqrt(420 * ratio / h**4))


def _cantilever(nodes: Sequence[float], stiffness: Sequence[float], mass: Sequence[float]) -> tuple[Any, Any]:
    """Return mass and stiffness matrix of a clamped beam on the nodes given, of bending stiffnesses and masses per length."""
    n = 2 * len(nodes)
    M, K = mp.zeros(n), mp.zeros(n)
    for e, (left, right) in enumerate(pairwise(nodes)):
        h = mp.mpf(right) - mp.mpf(left)
        scale = (mp.mpf(1), h, mp.mpf(1), h)
        for i in range(4):
            for j in range(4):
                at = 2 * e + i, 2 * e + j
                M[at] += mp.mpf(mass[e]) * scale[i] * scale[j] * MASS[i][j] * h / 420
                K[at] += mp.mpf(stiffness[e]) * scale[i] * scale[j] * STIFFNESS[i][j] / h**3
    return M[2:, 2:], K[2:, 2:]


def cantilever_frequencies(
    nodes: Sequence[float],
    stiffness: Sequence[float] | None = None,
    mass: Sequence[float] | None = None,
    digits: int = DIGITS,
) -> Array:
    """Return all natural frequencies [rad/s] of a clamped beam of cubic elements on the nodes given, ascending.

    Bending stiffness and mass per length are those of each element, by default one.  Squares of frequencies that are 1e55
    apart want more digits than these 55 and those that are to be right.
    """
    even = [1.0] * (len(nodes) - 1)
    with mp.workdps(digits):
        M, K = _cantilever(nodes, stiffness or even, mass or even)
        root = mp.inverse(mp.cholesky(M))
        values = mp.eigsy(root * K * root.T, eigvals_only=True)
        return np.array(sorted(float(mp.sqrt(value)) for value in values))


def cantilever_response(nodes: Sequence[float], omega: Sequence[float]) -> Array:
    """Return the tip's motion for a force on it, undamped, at some frequencies."""
    with mp.workdps(DIGITS):
        M, K = _cantilever(nodes, *2 * [[1.0] * (len(nodes) - 1)])
        force = mp.zeros(K.rows, 1)
        force[K.rows - 2] = 1
        return np.array([complex(mp.lu_solve(K - mp.mpf(w) ** 2 * M, force)[K.rows - 2]) for w in omega])


def dense_response(M: Array, C: Array, K: Array, B: Array, L: Array, omega: Sequence[float]) -> Array:
    """Return the response of a second-order model as its matrices stand, (outputs, inputs, frequencies)."""
    with mp.workdps(DIGITS):
        M_, C_, K_, B_, L_ = (mp.matrix(np.asarray(x, dtype=float).tolist()) for x in (M, C, K, B, L))
        answers = []
        for w in omega:
            s = mp.mpc(0, w)
            D = K_ + s * C_ + s * s * M_
            answers.append(np.array((L_ * (mp.inverse(D) * B_)).tolist(), dtype=complex))
        return np.stack(answers, axis=2)


def clamped_free_roots(count: int) -> list[_Number]:
    """Return the first roots of ``cos b cosh b = -1``, in sixty digits."""
    with mp.workdps(DIGITS):
        starts = ((k + mp.mpf(1) / 2) * mp.pi for k in range(count))
        return [mp.findroot(lambda b: mp.cos(b) + mp.sech(b), start) for start in starts]


def clamped_free_frequencies(count: int) -> Array:
    """Return the first frequencies of a clamped beam whose length, mass per length and stiffness are one [rad/s]."""
    with mp.workdps(DIGITS):
        return np.array([float(b**2) for b in clamped_free_roots(count)])


def rotating_frequencies(
    modes: int, speed: float, *, length: float, mass: float, stiffness: float, radius: float, tip_mass: float
) -> Array:
    """Return frequencies [rad/s] of ``K2 + w^2 (D - M2)`` over clamped-free modes, all integrals in sixty digits.

    ``mass`` per length, ``stiffness`` in bending, ``radius`` of the hub, at whose rim the beam is clamped.
    """
    with mp.workdps(DIGITS):
        span, rho, w2 = mp.mpf(length), mp.mpf(mass), mp.mpf(speed) ** 2
        shapes = [_clamped_free(b) for b in clamped_free_roots(modes)]
        points = _gauss_points(max(40, 12 * modes))
        weights = mp.diag([c for _, c in points])
        heights = mp.matrix([[f(z, 0) for f, _ in shapes] for z, _ in points])
        slopes = mp.matrix([[f(z, 1) / span for f, _ in shapes] for z, _ in points])
        tips = mp.matrix([f(mp.mpf(1), 0) for f, _ in shapes])
        # int_x^L rhoA (r + s) ds, and the tip mass at the end
        pull = mp.diag([
            rho * (radius * span * (1 - z) + span**2 * (1 - z * z) / 2) + tip_mass * (radius + span) for z, _ in points
        ])  # fmt: skip
        squares = heights.T * weights * heights
        M = span * rho * squares + tip_mass * tips * tips.T
        D = span * slopes.T * weights * pull * slopes
        K = mp.diag([mp.mpf(stiffness) * b**4 / span**3 * squares[i, i] for i, (_, b) in enumerate(shapes)])
        root = mp.inverse(mp.cholesky(M))
        A = root * (K + w2 * (D - M)) * root.T
        values = mp.eigsy((A + A.T) / 2, eigvals_only=True)
        return np.sqrt(np.array(sorted(float(v) for v in values)))


def _clamped_free(root: _Number) -> tuple[Callable[[_Number, int], _Number], _Number]:
    """Return a mode over ``z = x/L`` with its derivatives, and its root; sixty digits bear the textbook's form."""
    ratio = (mp.sinh(root) - mp.sin(root)) / (mp.cosh(root) + mp.cos(root))

    def shape(z: _Number, derivative: int) -> _Number:
        x = root * z
        if derivative == 0:
            return mp.cosh(x) - mp.cos(x) - ratio * (mp.sinh(x) - mp.sin(x))
        return root * (mp.sinh(x) + mp.sin(x) - ratio * (mp.cosh(x) - mp.cos(x)))

    return shape, root


def _gauss_points(count: int) -> list[tuple[_Number, _Number]]:
    """Return points and weights of the Gauss rule over 0 to 1, as python-flint encloses them."""
    with flint.ctx.workdps(DIGITS + 5), mp.workdps(DIGITS):  # some more than are taken over
        roots = [flint.arb.legendre_p_root(count, k, weight=True) for k in range(count)]
        digits = [[mp.mpf(each.str(DIGITS, radius=False)) for each in pair] for pair in roots]
        return [((1 + x) / 2, weight / 2) for x, weight in digits]


def state_space_response(A: Array, B: Array, C: Array, D: Array, s: _Number) -> Any:
    """Return the response at a number of the complex plane, the matrices taken as they stand."""
    with mp.workdps(DIGITS):
        A_, B_, C_, D_ = (mp.matrix(np.asarray(x, dtype=float).tolist()) for x in (A, B, C, D))
        if not A_.rows:
            return D_
        X = mp.inverse(s * mp.eye(A_.rows) - A_)
        return C_ * (X * B_) + D_


def state_space_gain(A: Array, B: Array, C: Array, D: Array, places: Sequence[_Number]) -> float:
    """Return the largest singular value at some numbers of the complex plane."""
    found = [state_space_response(A, B, C, D, s) for s in places]
    return max((float(np.linalg.norm(np.array(G.tolist(), dtype=complex), 2)) for G in found), default=0.0)
