"""The spray boom in fifty digits, as a judge over everything else.

Nothing here is shared with :mod:`boomctl.structure`.  The boom is mirror-symmetric, so it is solved by halves: both
actuators move alike (symmetric), or opposite to each other (antisymmetric).  From the free tip, where force and moment
vanish, deflection and slope are carried inwards, over the spring, to the hinge, whose two conditions settle the two
unknowns of the tip.  A beam carries them by the Krylov functions of ``w'''' = beta^4 w``; a mesh of equal cubic
elements by the powers of one element's transfer matrix.  Fifty digits bear what such a shooting loses.
"""

from collections.abc import Iterator
from typing import Any

import mpmath as mp
import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters

DIGITS = 50  # to calculate with: 70 change no digit of a double, not even on 500 elements

_Number = Any
_Matrix = Any  # of mpmath
_SYMMETRIC, _ANTISYMMETRIC = 1, -1  # parity: the sign with which the left half follows the right one
_ACTUATOR, _SUSPENSION, _CRADLE = 2, 3, 4  # columns of the loads, behind those of tip deflection and slope

# a cubic (Hermite) beam element over w1, h phi1, w2, h phi2: consistent mass over m h / 420, stiffness over E I / h^3
MASS = ((156, 22, 54, -13), (22, 4, 13, -3), (54, 13, 156, -22), (-13, -3, -22, 4))
STIFFNESS = ((12, 6, -12, 6), (6, 4, -6, 2), (-12, -6, 12, -6), (6, 2, -6, 4))


def _tube(p: BoomParameters) -> tuple[_Number, _Number]:
    """Return mass per length and bending stiffness of the tube."""
    outer, inner, high, low = (mp.mpf(v) for v in (p.outer_width, p.inner_width, p.outer_height, p.inner_height))
    return p.density * (high * outer - low * inner), p.youngs_modulus * (high * outer**3 - low * inner**3) / 12


def _platform(p: BoomParameters, parity: int, x: _Number) -> _Number:
    """Return the platform's displacement at ``x`` when the right actuator moves by one."""
    return mp.mpf(1) if parity == _SYMMETRIC else 2 * mp.mpf(x) / p.actuator_distance


def _middle(p: BoomParameters, parity: int, s: _Number) -> tuple[_Number, _Number]:
    """Return what resists the motion of the boom's middle: force (moment) per motion of boom, and of platform."""
    mass, _ = _tube(p)
    length = mp.mpf(p.length)
    if parity == _SYMMETRIC:
        beyond = p.boom_mass - mass * length + p.cradle_mass
        return beyond * s * s + p.cradle_damping * s, -p.cradle_damping * s
    beyond = p.boom_inertia - mass * length**3 / 12
    return beyond * s * s + p.hinge_damping * s, -p.hinge_damping * s * 2 / mp.mpf(p.actuator_distance)


def carried(beta: _Number, length: _Number) -> _Matrix:
    """Return the matrix that carries deflection and its first three derivatives over ``length``."""
    z = beta * length
    ch, sh, c, s = mp.cosh(z), mp.sinh(z), mp.cos(z), mp.sin(z)
    k = ((ch + c) / 2, (sh + s) / (2 * beta), (ch - c) / (2 * beta**2), (sh - s) / (2 * beta**3))
    fourth = beta**4
    return mp.matrix([[k[j - i] if j >= i else fourth * k[4 + j - i] for j in range(4)] for i in range(4)])


def _start(loads: int) -> _Matrix:
    """Return the tip's state for a unit deflection, a unit slope, and none of the loads."""
    start = mp.zeros(4, 2 + loads)
    start[0, 0] = start[1, 1] = 1
    return start


def _stacked(*rows: _Matrix) -> _Matrix:
    return mp.matrix([list(row) for row in rows])


def _exact_half(p: BoomParameters, s: _Number, parity: int) -> tuple[_Matrix, _Matrix]:
    """Return the two conditions at the hinge, and the readings: tip, stroke and, where the cradle moves, its slip.

    Each is over tip deflection and slope, and over the loads: motion of the actuator, force of the suspension, force on
    the cradle.  The coordinate runs from the tip inwards: slope and third derivative have the other sign than along ``x``.
    """
    mass, stiffness = _tube(p)
    stiffness = stiffness * (1 + s * p.structural_damping)
    beta = mp.sqrt(mp.sqrt(-s * s * mass / stiffness))
    spring = mp.mpf(p.spring_distance) / 2
    start = _start(3)
    state = carried(beta, mp.mpf(p.length) / 2 - spring) * start
    stroke = state[0, :]
    stroke[_ACTUATOR] -= _platform(p, parity, spring)
    push = -p.spring_stiffness * stroke
    push[_SUSPENSION] += 1
    state[3, :] += push / stiffness
    state = carried(beta, spring) * state
    w, slope, bent, sheared = (state[k, :] for k in range(4))
    own, platform = _middle(p, parity, s)
    if parity == _SYMMETRIC:
        force = own * w - 2 * stiffness * sheared
        force[_ACTUATOR] += platform
        force[_CRADLE] -= 1
        slip = w.copy()
        slip[_ACTUATOR] -= 1
        return _stacked(slope, force), _stacked(start[0, :], stroke, slip)
    moment = own * slope + 2 * stiffness * bent
    moment[_ACTUATOR] -= platform
    return _stacked(w, moment), _stacked(start[0, :], stroke)


def _element(p: BoomParameters, h: _Number, s: _Number) -> _Matrix:
    """Return the dynamic stiffness of a cubic element over ``w1, phi1, w2, phi2``."""
    mass, stiffness = _tube(p)
    scale = mp.diag([1, h, 1, h])
    m, k = s * s * mass * h / 420, stiffness * (1 + s * p.structural_damping) / h**3
    return scale * (m * mp.matrix(MASS) + k * mp.matrix(STIFFNESS)) * scale


def _inwards(D: _Matrix, load: _Matrix) -> tuple[_Matrix, _Matrix]:
    """Return transfer matrix and offset of an element: from ``w, phi`` and end forces of its right to its left end."""
    known, found = mp.zeros(2, 5), mp.zeros(4, 5)
    known[:, :2], known[:, 2:4], known[:, 4] = -D[2:, 2:], mp.eye(2), load[2:, 0]
    found[:2, :] = D[2:, :2] ** -1 * known
    found[2:, :] = -D[:2, :2] * found[:2, :]
    found[2:, :2] -= D[:2, 2:]
    found[2:, 4] += load[:2, 0]
    return found[:, :4], found[:, 4]


def _mesh_halves(p: BoomParameters, elements: int, s: _Number) -> Iterator[_Matrix]:
    """Give the two conditions at the hinge of either half of a mesh of equal elements."""
    half, h, spring = elements // 2, mp.mpf(p.length) / elements, mp.mpf(p.spring_distance) / 2
    inner = min(int(spring / h), half - 1)
    t = spring / h - inner
    column = mp.matrix([1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3), 3 * t**2 - 2 * t**3, h * (t**3 - t**2)])
    D = _element(p, h, s)
    plain, _ = _inwards(D, mp.zeros(4, 1))
    outside, inside = plain ** (half - 1 - inner) * _start(1), plain**inner
    for parity in (_SYMMETRIC, _ANTISYMMETRIC):
        pull = p.spring_stiffness * _platform(p, parity, spring)
        sprung, offset = _inwards(D + p.spring_stiffness * column * column.T, pull * column)
        state = sprung * outside
        state[:, _ACTUATOR] += offset
        state = inside * state
        w, slope, force, moment = (state[k, :] for k in range(4))
        own, platform = _middle(p, parity, s)
        held, free, end = (slope, w, force) if parity == _SYMMETRIC else (w, slope, moment)
        balance = own * free - 2 * end
        balance[_ACTUATOR] += platform
        yield _stacked(held, balance)


def _answers(conditions: _Matrix, readings: _Matrix) -> _Matrix:
    """Return the readings for a unit of each load, where both conditions are met."""
    return readings[:, 2:] - readings[:, :2] * conditions[:, :2] ** -1 * conditions[:, 2:]


def _as_array(matrix: _Matrix) -> Array:
    return np.array(matrix.tolist(), dtype=complex)


def _of_sides(symmetric: Array, antisymmetric: Array) -> Array:
    """Return readings over loads, each left and right, from those of the two halves."""
    same, other = 0.5 * (symmetric + antisymmetric), 0.5 * (symmetric - antisymmetric)
    return np.kron(same, np.eye(2)) + np.kron(other, [[0.0, 1.0], [1.0, 0.0]])


def exact_response(p: BoomParameters, omega: Array, digits: int = DIGITS) -> Array:
    """Return the response of the boom with an exact beam, (outputs, inputs, frequencies); signals as for ``spray_boom``.

    Parameters
    ----------
    p : BoomParameters
    omega : ndarray
        Angular frequencies above zero [rad/s].
    digits : int
        How many to calculate with.
    """
    found = []
    with mp.workdps(digits):
        for w in np.atleast_1d(omega):
            s = mp.mpc(0, float(w))
            halves = (_answers(*_exact_half(p, s, parity)) for parity in (_SYMMETRIC, _ANTISYMMETRIC))
            symmetric, antisymmetric = map(_as_array, halves)
            whole = np.zeros((5, 5), dtype=complex)
            whole[:4, :4] = _of_sides(symmetric[:2, :2], antisymmetric[:, :2])
            whole[4, :4], whole[:4, 4] = 0.5 * symmetric[2, :2].repeat(2), symmetric[:2, 2].repeat(2)
            whole[4, 4] = symmetric[2, 2]
            found.append(whole)
    return np.stack(found, axis=2)


def mesh_response(p: BoomParameters, omega: Array, elements: int, digits: int = DIGITS) -> Array:
    """Return the response of the tips to the actuators of a mesh of equal cubic elements, shape (2, 2, frequencies).

    Raises
    ------
    ValueError
        ``elements`` is odd, so that the hinge is not at a node.
    """
    if elements < 2 or elements % 2:
        raise ValueError(f"elements = {elements}: expected an even number, with a node at the hinge")
    with mp.workdps(digits):
        tip = _start(1)[0, :]
        both = [_mesh_halves(p, elements, mp.mpc(0, float(w))) for w in np.atleast_1d(omega)]
        return np.stack([_of_sides(*(_as_array(_answers(half, tip)) for half in halves)) for halves in both], axis=2)


def sigma_of(response: Array) -> Array:
    """Return the singular values, descending, of a mirror-symmetric response ``[[a, b], [b, a]]``."""
    a, b = response[0, 0], response[0, 1]
    values = np.abs(np.array([a + b, a - b]))
    return -np.sort(-values, axis=0)


def tip_transfer(p: BoomParameters, s: _Number) -> tuple[_Number, _Number]:
    """Return how the tips follow the actuators, moving alike and opposite, at a complex frequency; in mpmath's digits."""
    symmetric, antisymmetric = (_exact_half(p, s, parity) for parity in (_SYMMETRIC, _ANTISYMMETRIC))
    return _answers(*symmetric)[0, 0], _answers(*antisymmetric)[0, 0]


def damped_eigenvalues(p: BoomParameters, starts: Array, digits: int = 30) -> Array:
    """Return the exact damped eigenvalue next to each start."""

    def determinant(s: _Number) -> _Number:
        both = (_exact_half(p, s, parity)[0] for parity in (_SYMMETRIC, _ANTISYMMETRIC))
        return mp.fprod(line[0, 0] * line[1, 1] - line[0, 1] * line[1, 0] for line in both)

    with mp.workdps(digits):
        close = [(mp.mpc(complex(s)), mp.mpc(complex(s) * (1 + 1e-6))) for s in np.atleast_1d(starts)]
        # a step of half of the digits leaves an error of nearly all of them; a further one may be noise over noise
        tol = mp.mpf(10) ** (-digits // 2)
        found = [mp.findroot(determinant, pair, solver="secant", tol=tol, verify=False) for pair in close]
        return np.array([complex(root) for root in found])
