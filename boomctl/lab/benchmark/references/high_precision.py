"""The spray boom in fifty digits, as a judge over everything else.

Nothing here is shared with :mod:`boomctl.structure`.  The boom is mirror-symmetric, so it is solved by halves: both
actuators move alike (symmetric), or opposite to each other (antisymmetric).  From the free tip, where force and moment
vanish, deflection and slope are carried inwards, over the spring, to the hinge, whose two conditions settle the two
unknowns of the tip.  A beam carries them by the Krylov functions of ``w'''' = beta^4 w``; a mesh of equal cubic
elements by the powers of one element's transfer matrix.  Fifty digits bear what such a shooting loses.
"""

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters

DIGITS = 50  # to calculate with: 70 change no digit of a double, not even on 500 elements

_Number = Any
_Lines = list[list[_Number]]
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


def times(A: _Lines, B: _Lines) -> _Lines:
    """Return the product of two matrices."""
    columns = list(zip(*B, strict=True))
    return [[mp.fdot(zip(line, column, strict=True)) for column in columns] for line in A]


def carried(beta: _Number, length: _Number) -> _Lines:
    """Return the matrix that carries deflection and its first three derivatives over ``length``."""
    z = beta * length
    ch, sh, c, s = mp.cosh(z), mp.sinh(z), mp.cos(z), mp.sin(z)
    k = ((ch + c) / 2, (sh + s) / (2 * beta), (ch - c) / (2 * beta**2), (sh - s) / (2 * beta**3))
    fourth = beta**4
    return [[k[j - i] if j >= i else fourth * k[4 + j - i] for j in range(4)] for i in range(4)]


def _start(loads: int) -> _Lines:
    """Return the tip's state for a unit deflection, a unit slope, and none of the loads."""
    one, zero = mp.mpc(1), mp.mpc(0)
    return [[one if row == column < 2 else zero for column in range(2 + loads)] for row in range(4)]


def _exact_half(p: BoomParameters, s: _Number, parity: int) -> tuple[_Lines, _Lines]:
    """Return the two conditions at the hinge, and the readings: tip, stroke and, where the cradle moves, its slip.

    Each is over tip deflection and slope, and over the loads: motion of the actuator, force of the suspension, force on
    the cradle.  The coordinate runs from the tip inwards: slope and third derivative have the other sign than along ``x``.
    """
    mass, stiffness = _tube(p)
    stiffness = stiffness * (1 + s * p.structural_damping)
    beta = mp.sqrt(mp.sqrt(-s * s * mass / stiffness))
    spring = mp.mpf(p.spring_distance) / 2
    start = _start(3)
    state = times(carried(beta, mp.mpf(p.length) / 2 - spring), start)
    stroke = [*state[0]]
    stroke[_ACTUATOR] -= _platform(p, parity, spring)
    push = [-p.spring_stiffness * w for w in stroke]
    push[_SUSPENSION] += 1
    state[3] = [w + force / stiffness for w, force in zip(state[3], push, strict=True)]
    w, slope, bent, sheared = times(carried(beta, spring), state)
    own, platform = _middle(p, parity, s)
    if parity == _SYMMETRIC:
        force = [-2 * stiffness * third + own * here for third, here in zip(sheared, w, strict=True)]
        force[_ACTUATOR] += platform
        force[_CRADLE] -= 1
        slip = [*w]
        slip[_ACTUATOR] -= 1
        return [slope, force], [start[0], stroke, slip]
    moment = [2 * stiffness * second + own * here for second, here in zip(bent, slope, strict=True)]
    moment[_ACTUATOR] -= platform
    return [w, moment], [start[0], stroke]


def _element(p: BoomParameters, h: _Number, s: _Number) -> _Lines:
    """Return the dynamic stiffness of a cubic element over ``w1, phi1, w2, phi2``."""
    mass, stiffness = _tube(p)
    m, k = s * s * mass * h / 420, stiffness * (1 + s * p.structural_damping) / h**3
    scale = (mp.mpf(1), h, mp.mpf(1), h)
    return [[scale[i] * scale[j] * (m * MASS[i][j] + k * STIFFNESS[i][j]) for j in range(4)] for i in range(4)]


def _inwards(D: _Lines, load: list[_Number] | None = None) -> tuple[_Lines, list[_Number]]:
    """Return transfer matrix and offset of an element: from ``w, phi`` and end forces of its right to its left end."""
    a, b, c, d = D[2][0], D[2][1], D[3][0], D[3][1]
    determinant = a * d - b * c
    inverse = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]
    follow = times(inverse, [[-D[2][2], -D[2][3], 1, 0], [-D[3][2], -D[3][3], 0, 1]])
    carried = times([D[0][:2], D[1][:2]], follow)
    felt = [[-(carried[i][j] + (D[i][2 + j] if j < 2 else 0)) for j in range(4)] for i in range(2)]
    if load is None:
        return follow + felt, [mp.mpf(0)] * 4
    moved = [inverse[i][0] * load[2] + inverse[i][1] * load[3] for i in range(2)]
    offset = moved + [load[i] - D[i][0] * moved[0] - D[i][1] * moved[1] for i in range(2)]
    return follow + felt, offset


def _advanced(powers: list[_Lines], count: int, state: _Lines) -> _Lines:
    """Return the state ``count`` elements further inwards; ``powers`` are those of one element, 1, 2, 4, ..."""
    for bit, power in enumerate(powers):
        if count >> bit & 1:
            state = times(power, state)
    return state


def _mesh_conditions(p: BoomParameters, elements: int) -> Callable[[_Number], tuple[_Lines, _Lines]]:
    """Return a function of ``s``: the conditions at the hinge of both halves of a mesh of equal elements."""
    half, h, spring = elements // 2, mp.mpf(p.length) / elements, mp.mpf(p.spring_distance) / 2
    inner = min(int(spring / h), half - 1)
    t = spring / h - inner
    row = [1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3), 3 * t**2 - 2 * t**3, h * (t**3 - t**2)]

    def conditions(s: _Number) -> tuple[_Lines, _Lines]:
        D = _element(p, h, s)
        powers = [_inwards(D)[0]]
        while len(powers) < max(inner, half - 1 - inner).bit_length():
            powers.append(times(powers[-1], powers[-1]))
        outside = _advanced(powers, half - 1 - inner, _start(1))
        sprung = [[D[i][j] + p.spring_stiffness * row[i] * row[j] for j in range(4)] for i in range(4)]
        both = []
        for parity in (_SYMMETRIC, _ANTISYMMETRIC):
            pull = p.spring_stiffness * _platform(p, parity, spring)
            T, offset = _inwards(sprung, [pull * value for value in row])
            state = times(T, outside)
            for line, value in zip(state, offset, strict=True):
                line[_ACTUATOR] += value
            both.append(_mesh_hinge(p, s, parity, _advanced(powers, inner, state)))
        return both[0], both[1]

    return conditions


def _mesh_hinge(p: BoomParameters, s: _Number, parity: int, state: _Lines) -> _Lines:
    w, slope, force, moment = state
    own, platform = _middle(p, parity, s)
    held, free, end = (slope, w, force) if parity == _SYMMETRIC else (w, slope, moment)
    balance = [own * here - 2 * value for here, value in zip(free, end, strict=True)]
    balance[_ACTUATOR] += platform
    return [held, balance]


def _answers(conditions: _Lines, readings: _Lines) -> _Lines:
    """Return the readings for a unit of each load, where both conditions are met."""
    (a, b, *f), (c, d, *g) = conditions
    det = a * d - b * c
    ends = [((b * y - d * x) / det, (c * x - a * y) / det) for x, y in zip(f, g, strict=True)]
    return [
        [w * u + slope * v + load for (u, v), load in zip(ends, loads, strict=True)] for w, slope, *loads in readings
    ]


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
            symmetric, antisymmetric = (np.array(half, dtype=complex) for half in halves)
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
        conditions = _mesh_conditions(p, elements)
        tip = _start(1)[:1]
        both = [conditions(mp.mpc(0, float(w))) for w in np.atleast_1d(omega)]
        return np.stack(
            [_of_sides(*(np.array(_answers(half, tip), dtype=complex) for half in halves)) for halves in both], axis=2
        )


def sigma_of(response: Array) -> Array:
    """Return the singular values, descending, of a mirror-symmetric response ``[[a, b], [b, a]]``."""
    a, b = response[0, 0], response[0, 1]
    values = np.abs(np.array([a + b, a - b]))
    return -np.sort(-values, axis=0)


def tip_transfer(p: BoomParameters, s: _Number) -> tuple[_Number, _Number]:
    """Return how the tips follow the actuators, moving alike and opposite, at a complex frequency; in mpmath's digits."""
    symmetric, antisymmetric = (_exact_half(p, s, parity) for parity in (_SYMMETRIC, _ANTISYMMETRIC))
    return _answers(*symmetric)[0][0], _answers(*antisymmetric)[0][0]


def damped_eigenvalues(p: BoomParameters, starts: Array, digits: int = 30) -> Array:
    """Return the exact damped eigenvalue next to each start."""

    def determinant(s: _Number) -> _Number:
        lines = [_exact_half(p, s, parity)[0] for parity in (_SYMMETRIC, _ANTISYMMETRIC)]
        return mp.fprod(a * d - b * c for (a, b, *_), (c, d, *_) in lines)

    with mp.workdps(digits):
        close = [(mp.mpc(complex(s)), mp.mpc(complex(s) * (1 + 1e-6))) for s in np.atleast_1d(starts)]
        # a step of half of the digits leaves an error of nearly all of them; a further one may be noise over noise
        tol = mp.mpf(10) ** (-digits // 2)
        found = [mp.findroot(determinant, pair, solver="secant", tol=tol, verify=False) for pair in close]
        return np.array([complex(root) for root in found])
