"""Independent solutions: closed forms, and small problems solved in sixty digits."""

from itertools import pairwise

import flint
import mpmath as mp
import numpy as np

from boomctl.lab.benchmark.plain_boom import MASS, STIFFNESS

DIGITS = 60  # lengths of ratio 1e6 cost some 18 digits of a stiffness matrix, twice: forty are left


def pinned_mesh_frequency(count):
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


def _cantilever(nodes, stiffness, mass):
    """Return mass and stiffness matrix of a clamped beam of cubic elements between nodes."""
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


def cantilever_frequencies(nodes, stiffness=None, mass=None, digits=DIGITS):
    """Return all natural frequencies [rad/s] of a clamped beam of cubic elements between nodes, ascending.

    Bending stiffness and mass per length are those of each element, by default one.  Squares of frequencies that are 1e55
    apart want more digits than these 55 and those that are to be right.
    """
    even = [1.0] * (len(nodes) - 1)
    with mp.workdps(digits):
        M, K = _cantilever(nodes, stiffness or even, mass or even)
        root = mp.inverse(mp.cholesky(M))
        return np.array(sorted(float(mp.sqrt(value)) for value in mp.eigsy(root * K * root.T, eigvals_only=True)))


def cantilever_response(nodes, omega):
    """Return the tip's motion for a force on it, undamped, at some frequencies."""
    with mp.workdps(DIGITS):
        M, K = _cantilever(nodes, *2 * [[1.0] * (len(nodes) - 1)])
        force = mp.zeros(K.rows, 1)
        force[K.rows - 2] = 1
        return np.array([complex(mp.lu_solve(K - mp.mpf(w) ** 2 * M, force)[K.rows - 2]) for w in omega])


def dense_response(M, C, K, B, L, omega):
    """Return the response of a second-order model with these matrices, (outputs, inputs, frequencies)."""
    with flint.ctx.workdps(DIGITS):
        M, C, K, B, L = (flint.acb_mat(np.asarray(x, dtype=float).tolist()) for x in (M, C, K, B, L))
        places = [flint.acb(0, w) for w in omega]
        return np.stack([_complex(L * (K + C * s + M * (s * s)).solve(B)) for s in places], axis=2)


def _complex(matrix):
    return np.array([[complex(value) for value in row] for row in matrix.tolist()])


def clamped_free_roots(count):
    """Return the first roots of ``cos b cosh b = -1``, in sixty digits."""
    with mp.workdps(DIGITS):
        starts = ((k + mp.mpf(1) / 2) * mp.pi for k in range(count))
        return [mp.findroot(lambda b: mp.cos(b) + mp.sech(b), start) for start in starts]


def clamped_free_frequencies(count):
    """Return the first frequencies of a clamped beam whose length, mass per length and stiffness are one [rad/s]."""
    with mp.workdps(DIGITS):
        return np.array([float(b**2) for b in clamped_free_roots(count)])


def rotating_frequencies(modes, speed, p):
    """Return frequencies [rad/s] of a hub-beam: ``K2 + w^2 (D - M2)`` over clamped-free modes, integrals in sixty digits."""
    with mp.workdps(DIGITS):
        span, rho, radius, w2 = mp.mpf(p.length), mp.mpf(p.mass_per_length), mp.mpf(p.hub_radius), mp.mpf(speed) ** 2
        shapes = [_clamped_free(b) for b in clamped_free_roots(modes)]
        points = _gauss_points(max(40, 12 * modes))
        weights = mp.diag([c for _, c in points])
        heights = mp.matrix([[f(z, 0) for f, _ in shapes] for z, _ in points])
        slopes = mp.matrix([[f(z, 1) / span for f, _ in shapes] for z, _ in points])
        tips = mp.matrix([f(mp.mpf(1), 0) for f, _ in shapes])
        # int_x^L rhoA (r + s) ds, and the tip mass at the end
        pull = mp.diag([
            rho * (radius * span * (1 - z) + span**2 * (1 - z * z) / 2) + p.tip_mass * (radius + span) for z, _ in points
        ])  # fmt: skip
        squares = heights.T * weights * heights
        M = span * rho * squares + p.tip_mass * tips * tips.T
        D = span * slopes.T * weights * pull * slopes
        stiffness = mp.mpf(p.bending_stiffness)
        K = mp.diag([stiffness * b**4 / span**3 * squares[i, i] for i, (_, b) in enumerate(shapes)])
        root = mp.inverse(mp.cholesky(M))
        A = root * (K + w2 * (D - M)) * root.T
        return np.sqrt(np.array(sorted(float(v) for v in mp.eigsy((A + A.T) / 2, eigvals_only=True))))


def _clamped_free(root):
    """Return a mode over ``z = x/L`` with its derivatives, and its root; sixty digits bear the textbook's form."""
    ratio = (mp.sinh(root) - mp.sin(root)) / (mp.cosh(root) + mp.cos(root))

    def shape(z, derivative):
        x = root * z
        if derivative == 0:
            return mp.cosh(x) - mp.cos(x) - ratio * (mp.sinh(x) - mp.sin(x))
        return root * (mp.sinh(x) + mp.sin(x) - ratio * (mp.cosh(x) - mp.cos(x)))

    return shape, root


def _gauss_points(count):
    """Return points and weights of the Gauss rule over 0 to 1, as python-flint encloses them."""
    with flint.ctx.workdps(DIGITS + 5), mp.workdps(DIGITS):  # some more than are taken over
        roots = [flint.arb.legendre_p_root(count, k, weight=True) for k in range(count)]
        digits = [[mp.mpf(value.str(DIGITS, radius=False)) for value in pair] for pair in roots]
        return [((1 + x) / 2, weight / 2) for x, weight in digits]


def state_space_response(system, s):
    """Return the response of a system's matrices at a number of the complex plane, as a matrix of python-flint."""
    with flint.ctx.workdps(DIGITS):
        C, D = (flint.acb_mat(x.tolist()) for x in (system.C, system.D))
        n = len(system.A)
        if n == 0:
            return D
        A, B, one = (flint.acb_mat(x.tolist()) for x in (system.A, system.B, np.eye(n)))
        return C * (one * flint.acb(s) - A).solve(B) + D


def state_space_gain(system, points):
    """Return the largest singular value of a system's matrices at some numbers of the complex plane."""
    return max(float(np.linalg.norm(_complex(state_space_response(system, s)), 2)) for s in points)


def ramp_response(omega, zeta, times):
    """Return ``y`` of ``y'' + 2 z w y' + w^2 y = w^2 (w t)`` from rest, in sixty digits."""
    with mp.workdps(DIGITS):
        damping = mp.mpf(2.0 * zeta * omega) / mp.mpf(omega)
        z = damping / 2
        root = mp.sqrt(mp.mpc(z * z - 1))
        values = []
        for t in times:
            x = mp.mpf(omega) * mp.mpf(float(t))
            if abs(root) < mp.mpf(10) ** -20:
                free = mp.exp(-z * x) * (damping + (damping * z - 1) * x)
            else:
                slow, fast = -z + root, -z - root
                a = (-1 - damping * fast) / (slow - fast)  # y = x - 2z + a e^(slow x) + b e^(fast x), y(0) = y'(0) = 0
                free = a * mp.exp(slow * x) + (damping - a) * mp.exp(fast * x)
            values.append(float(mp.re(x - damping + free)))
        return np.array(values)
