"""Independent solutions to compare with: Lagrange multipliers, matrix exponentials, the boom in 50 digits."""

import mpmath as mp
import numpy as np
from scipy import linalg, sparse

__all__ = [
    "ROOTS",
    "constrained",
    "dense",
    "direct",
    "exact_boom_response",
    "gauss",
    "integrated",
    "kkt_response",
    "motions",
    "natural_frequencies",
    "prescribed_motion",
    "state_space_response",
]

ROOTS = {
    "clamped-free": (1.8751040687119611, 4.694091132974175, 7.854757438237613, 10.995540734875467),
    "free-free": (4.730040744862704, 7.853204624095838, 10.995607838001671, 14.137165491257464),
    "pinned-free": (3.9266023120479188, 7.068582745628732, 10.210176122813031, 13.351768777754093),
    "pinned-pinned": (np.pi, 2 * np.pi, 3 * np.pi, 4 * np.pi),
}
"""``beta L`` of uniform beams, in textbooks since Rayleigh: natural frequency ``beta^2 sqrt(EI/rhoA)``."""


def dense(matrix):
    """Return a matrix as an ndarray."""
    return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix)


def direct(model, omega):
    """Return the response of a force-driven model, (outputs, inputs, frequencies), one solution a frequency."""
    M, C, K = (dense(x) for x in (model.M, model.C, model.K))
    B, L = model.ports.B[0], model.ports.L[0]
    return np.stack([L @ np.linalg.solve(K + 1j * w * C - w * w * M, B) for w in omega], axis=2)


def natural_frequencies(model):
    """Return the undamped natural frequencies [rad/s], ascending: ``1/(1 + omega^2)`` are the eigenvalues solved for.

    Good to some ``eps (1 + omega^2)``, relative, also beside rigid-body modes.
    """
    mu = linalg.eigvalsh(dense(model.M), dense(model.K) + dense(model.M))[::-1]
    return np.sqrt(np.maximum(1.0 / mu - 1.0, 0.0))


def kkt_response(matrices, B, L, moved, forced, omega):
    """Return displacements and multipliers of the Lagrange-multiplier system, in extended precision.

    ``[D, -J; J^T, 0] [z; f_p] = [B_forced f; d]`` with ``J = B[:, moved]``.

    Returns
    -------
    Y : (outputs, moved + forced, frequencies) complex array
        ``L z`` for unit displacements, then for unit forces.
    F : (moved, moved + forced, frequencies) complex array
        The forces ``f_p``.
    """
    M, C, K = (dense(x).astype(np.longdouble) for x in matrices)
    n, k, m = len(M), len(moved), len(forced)
    s = 1j * np.asarray(omega, dtype=np.longdouble)[:, None, None]
    A = np.zeros((len(omega), n + k, n + k), dtype=np.clongdouble)
    A[:, :n, :n] = K + s * C + s * s * M
    A[:, :n, n:], A[:, n:, :n] = -B[:, moved], B[:, moved].T
    rhs = np.zeros((len(omega), n + k, k + m), dtype=np.clongdouble)
    rhs[:, n:, :k], rhs[:, :n, k:] = np.eye(k), B[:, forced]
    X = gauss(A, rhs)
    return tuple(np.moveaxis(part, 0, 2).astype(complex) for part in (L.astype(np.longdouble) @ X[:, :n], X[:, n:]))


def gauss(A, rhs):
    """Solve ``A[f] X[f] = rhs[f]`` by elimination with row pivoting, in the precision of the operands."""
    A, X = A.copy(), rhs.copy()
    every, n = np.arange(len(A)), A.shape[1]
    for k in range(n):
        pivot = k + np.abs(A[:, k:, k]).argmax(axis=1)
        for matrix in (A, X):
            matrix[every, pivot], matrix[:, k] = matrix[:, k].copy(), matrix[every, pivot].copy()
        factor = A[:, k + 1 :, k] / A[:, k, k][:, None]
        A[:, k + 1 :] -= factor[:, :, None] * A[:, k][:, None]
        X[:, k + 1 :] -= factor[:, :, None] * X[:, k][:, None]
    for k in reversed(range(n)):
        X[:, k] = (X[:, k] - np.einsum("fj,fjm->fm", A[:, k, k + 1 :], X[:, k + 1 :])) / A[:, k, k][:, None]
    return X


def state_space_response(system, omega):
    """Return the response of a state space, (outputs, inputs, frequencies)."""
    A, B, C, D = (np.asarray(x) for x in (system.A, system.B, system.C, system.D))
    one = np.eye(len(A))
    return np.stack([C @ np.linalg.solve(1j * w * one - A, B) + D for w in omega], axis=2)


def motions(rng, count, omega):
    """Return ``S, R, w0`` of a generator ``w' = S w, d = R w``: every ``d`` a random cubic plus a sine of ``omega``."""
    S = np.zeros((6, 6))
    S[0, 1] = S[1, 2] = S[2, 3] = 1.0
    S[4, 5], S[5, 4] = omega, -omega
    return S, rng.standard_normal((count, 6)), rng.standard_normal(6)


def integrated(A, x0, timepts):
    """Return the states of ``x' = A x`` at the times given, one column a time."""
    return np.stack([linalg.expm(A * t) @ x0 for t in timepts], axis=1)


def constrained(matrices, J, S, R):
    """Return ``N, P, A`` of the prescribed motion ``J^T z = R w``.

    ``z = P w + N v`` and ``(v, v', w)' = A (v, v', w)``; ``N`` is an orthonormal basis of the null space of ``J^T``.
    """
    M, C, K = matrices
    N = linalg.null_space(J.T)
    P = linalg.lstsq(J.T, R)[0]
    forcing = -N.T @ (M @ P @ S @ S + C @ P @ S + K @ P)
    m = N.T @ M @ N
    k, r = N.shape[1], len(S)
    A = np.zeros((2 * k + r, 2 * k + r))
    A[:k, k : 2 * k] = np.eye(k)
    A[k : 2 * k] = np.linalg.solve(m, np.hstack([-N.T @ K @ N, -N.T @ C @ N, forcing]))
    A[2 * k :, 2 * k :] = S
    return N, P, A


def prescribed_motion(matrices, J, S, R, w0, v0, timepts):
    """Return the coordinates ``z`` and their rates, one column a time, from ``v(0), v'(0) = v0``."""
    N, P, A = constrained(matrices, J, S, R)
    k = N.shape[1]
    x = integrated(A, np.concatenate([*v0, w0]), timepts)
    return P @ x[2 * k :] + N @ x[:k], P @ S @ x[2 * k :] + N @ x[k : 2 * k]


def _solve(lines, rhs):
    """Return the solutions, one list a column of ``rhs``."""
    LU, pivots = mp.mp.LU_decomp(mp.matrix(lines))
    columns = [mp.matrix(list(rhs[:, c])) for c in range(rhs.shape[1])]
    return [list(mp.mp.U_solve(LU, mp.mp.L_solve(LU, column, pivots))) for column in columns]


def exact_boom_response(p, omega, digits=50):
    """Return the boom's displacement-driven response, (outputs, inputs, frequencies), from the beam equation.

    The deflection between tip, spring, hinge, spring and tip is a sum of four exponentials; unknown are their factors,
    the hinge force and the cradle's motion.  Order of signals: as of :func:`boomctl.spray_boom`.
    """
    with mp.workdps(digits):
        columns = [_boom_solution(p, mp.mpf(float(w))) for w in np.atleast_1d(omega)]
        return np.stack([np.array([[complex(v) for v in line] for line in y], dtype=complex) for y in columns], axis=2)


def _boom_solution(p, w):
    boom = _BoomEquations(p, w)
    boom.free_ends()
    boom.junctions()
    boom.cradle()
    X = _solve(boom.A, boom.rhs)
    marks, none = boom.marks, [mp.mpf(0)] * 3

    def deflection(x, segment, c):
        return mp.fdot(X[c][4 * segment : 4 * segment + 4], boom.shape(segment, x, 0))

    lines = [[deflection(marks[0], 0, c) for c in range(5)], [deflection(marks[4], 3, c) for c in range(5)]]
    for x, segment in ((marks[1], 0), (marks[3], 3)):
        platform = boom.platform(x) + none
        lines.append([deflection(x, segment, c) - platform[c] for c in range(5)])
    platform = boom.platform(marks[2]) + none
    lines.append([X[c][_CRADLE] - platform[c] for c in range(5)])
    return lines


_CRADLE, _HINGE = 16, 17


class _BoomEquations:
    """Eighteen equations for four factors in each of four segments, the cradle's motion and the hinge force."""

    def __init__(self, p, w):
        self.p, self.s = p, mp.mpc(0, w)
        half, spring = mp.mpf(p.length) / 2, mp.mpf(p.spring_distance) / 2
        height, width, inner = mp.mpf(p.outer_height), mp.mpf(p.outer_width), mp.mpf(p.inner_height)
        line_mass = p.density * (height * width - inner * p.inner_width)
        second = (height * width**3 - inner * mp.mpf(p.inner_width) ** 3) / 12
        self.EI = p.youngs_modulus * second * (1 + self.s * p.structural_damping)
        self.beta = mp.root(w**2 * line_mass / self.EI, 4)
        self.marks = [-half, -spring, mp.mpf(0), spring, half]
        self.mass = p.boom_mass - line_mass * p.length
        self.inertia = p.boom_inertia - line_mass * mp.mpf(p.length) ** 3 / 12
        self.A = [[mp.mpf(0)] * 18 for _ in range(18)]
        self.rhs = np.full((18, 5), mp.mpf(0), dtype=object)

    def shape(self, segment, x, derivative):
        """Return a derivative of the four exponentials of a segment at ``x``, decaying ones from either end."""
        roots = [-self.beta, self.beta, mp.j * self.beta, -mp.j * self.beta]
        a, b = x - self.marks[segment], self.marks[segment + 1] - x
        waves = [
            mp.exp(-self.beta * a),
            mp.exp(-self.beta * b),
            mp.exp(mp.j * self.beta * a),
            mp.exp(-mp.j * self.beta * a),
        ]
        return [root**derivative * wave for root, wave in zip(roots, waves, strict=True)]

    def platform(self, x):
        """Return the platform's displacement at ``x`` for a unit displacement of either actuator."""
        return [mp.mpf(1) / 2 - x / self.p.actuator_distance, mp.mpf(1) / 2 + x / self.p.actuator_distance]

    def add(self, row, segment, values, factor=1):
        for i, value in enumerate(values):
            self.A[row][4 * segment + i] += factor * value

    def free_ends(self):
        """Neither moment nor shear at the tips."""
        for row, (segment, end, derivative) in enumerate([(0, 0, 2), (0, 0, 3), (3, 4, 2), (3, 4, 3)]):
            self.add(row, segment, self.shape(segment, self.marks[end], derivative), 1 / self.beta**derivative)

    def junctions(self):
        """Deflection and slope are continuous; moment and shear jump by what acts there."""
        for j in (1, 2, 3):
            for derivative in range(4):
                row, factor = 4 * j + derivative, self.EI if derivative > 1 else mp.mpf(1)
                self.add(row, j, self.shape(j, self.marks[j], derivative), factor)
                self.add(row, j - 1, self.shape(j - 1, self.marks[j], derivative), -factor)
        self.springs()
        self.hinge()

    def springs(self):
        """``EI w'''`` jumps by minus the force that resists the deflection; the suspension pushes boom forward."""
        for j, column in ((1, 2), (3, 3)):
            row, k = 4 * j + 3, self.p.spring_stiffness
            self.add(row, j, self.shape(j, self.marks[j], 0), k)
            self.rhs[row, :2] = [k * v for v in self.platform(self.marks[j])]
            self.rhs[row, column] = mp.mpf(1)

    def hinge(self):
        """``EI w''`` jumps by the moment that resists the slope, ``EI w'''`` by inertia and the hinge force."""
        s, damping, distance = self.s, self.p.hinge_damping, mp.mpf(self.p.actuator_distance)
        self.add(10, 2, self.shape(2, self.marks[2], 1), -(self.inertia * s * s + damping * s))
        self.rhs[10, :2] = [damping * s / distance, -damping * s / distance]
        self.add(11, 2, self.shape(2, self.marks[2], 0), self.mass * s * s)
        self.A[11][_HINGE] = mp.mpf(1)

    def cradle(self):
        """The hinge carries the cradle along, and its force acts on the cradle backwards."""
        p, s, middle = self.p, self.s, self.marks[2]
        self.add(_CRADLE, 2, self.shape(2, middle, 0))
        self.A[_CRADLE][_CRADLE] = mp.mpf(-1)
        self.A[_HINGE][_CRADLE] = p.cradle_mass * s * s + p.cradle_damping * s
        self.A[_HINGE][_HINGE] = mp.mpf(-1)
        self.rhs[_HINGE, :2] = [p.cradle_damping * s * v for v in self.platform(middle)]
        self.rhs[_HINGE, 4] = mp.mpf(1)
