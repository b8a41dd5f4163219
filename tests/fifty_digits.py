"""The spray boom in fifty digits: a mesh of equal cubic elements, and the damped eigenvalues of the exact beam."""

import mpmath as mp
import numpy as np

from boomctl.lab.benchmark import high_precision as exact
from boomctl.lab.benchmark.high_precision import DIGITS
from boomctl.lab.benchmark.plain_boom import MASS, STIFFNESS

PARITIES = (1, -1)  # symmetric, antisymmetric
ACTUATOR = 2  # column of the load


def _element(p, h, s):
    """Return the dynamic stiffness of a cubic element over ``w1, phi1, w2, phi2``."""
    mass, stiffness = exact._tube(p)
    scale = mp.diag([1, h, 1, h])
    m, k = s * s * mass * h / 420, stiffness * (1 + s * p.stiffness_damping) / h**3
    return scale * (m * mp.matrix(MASS) + k * mp.matrix(STIFFNESS)) * scale


def _inwards(D, load):
    """Return transfer matrix and offset of an element: from ``w, phi`` and end forces of its right to its left end."""
    known, found = mp.zeros(2, 5), mp.zeros(4, 5)
    known[:, :2], known[:, 2:4], known[:, 4] = -D[2:, 2:], mp.eye(2), load[2:, 0]
    found[:2, :] = D[2:, :2] ** -1 * known
    found[2:, :] = -D[:2, :2] * found[:2, :]
    found[2:, :2] -= D[:2, 2:]
    found[2:, 4] += load[:2, 0]
    return found[:, :4], found[:, 4]


def _mesh_halves(p, elements, s):
    """Give the two conditions at the hinge of either half of a mesh of equal elements."""
    half, h, spring = elements // 2, mp.mpf(p.length) / elements, mp.mpf(p.spring_distance) / 2
    inner = min(int(spring / h), half - 1)
    t = spring / h - inner
    column = mp.matrix([1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3), 3 * t**2 - 2 * t**3, h * (t**3 - t**2)])
    D = _element(p, h, s)
    plain, _ = _inwards(D, mp.zeros(4, 1))
    outside, inside = plain ** (half - 1 - inner) * exact._start(1), plain**inner
    for parity in PARITIES:
        pull = p.spring_stiffness * exact._platform(p, parity, spring)
        sprung, offset = _inwards(D + p.spring_stiffness * column * column.T, pull * column)
        state = sprung * outside
        state[:, ACTUATOR] += offset
        state = inside * state
        w, slope, force, moment = (state[k, :] for k in range(4))
        own, platform = exact._middle(p, parity, s)
        held, free, end = (slope, w, force) if parity == PARITIES[0] else (w, slope, moment)
        balance = own * free - 2 * end
        balance[ACTUATOR] += platform
        yield exact._stacked(held, balance)


def mesh_response(p, omega, elements, digits=DIGITS):
    """Return the response of the tips to the actuators of a mesh of equal cubic elements, shape (2, 2, frequencies).

    Raises
    ------
    ValueError
        ``elements`` is odd, so that the hinge is not at a node.
    """
    if elements < 2 or elements % 2:
        raise ValueError(f"elements = {elements}: expected an even number, with a node at the hinge")
    with mp.workdps(digits):
        tip = exact._start(1)[0, :]
        both = [_mesh_halves(p, elements, mp.mpc(0, float(w))) for w in np.atleast_1d(omega)]
        return np.stack(
            [exact._of_sides(*(exact._as_array(exact._answers(half, tip)) for half in halves)) for halves in both],
            axis=2,
        )


def damped_eigenvalues(p, starts, digits=30):
    """Return the exact damped eigenvalue next to each start."""

    def determinant(s):
        both = (exact._exact_half(p, s, parity)[0] for parity in PARITIES)
        return mp.fprod(line[0, 0] * line[1, 1] - line[0, 1] * line[1, 0] for line in both)

    with mp.workdps(digits):
        close = [(mp.mpc(complex(s)), mp.mpc(complex(s) * (1 + 1e-6))) for s in np.atleast_1d(starts)]
        # a step of half of the digits leaves an error of nearly all of them; a further one may be noise over noise
        tol = mp.mpf(10) ** (-digits // 2)
        found = [mp.findroot(determinant, pair, solver="secant", tol=tol, verify=False) for pair in close]
        return np.array([complex(root) for root in found])
