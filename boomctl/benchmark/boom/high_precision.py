"""The spray boom in fifty digits, as a judge over everything else.

Nothing here is shared with :mod:`boomctl.structure`.  The boom is mirror-symmetric, so it is solved by halves: both
actuators move alike (symmetric), or opposite to each other (antisymmetric).  From the free tip, where force and moment
vanish, deflection and slope are carried inwards, over the spring, to the hinge, whose two conditions settle the two
unknowns of the tip.  A beam carries them by the Krylov functions of ``w'''' = beta^4 w``; a mesh of equal cubic
elements by the powers of one element's transfer matrix.  Fifty digits bear what such a shooting loses.
"""

from collections.abc import Callable, Iterable
from typing import Any

import mpmath as mp
import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters

DIGITS = 50

_Number = Any
_Lines = list[list[_Number]]
_SYMMETRIC, _ANTISYMMETRIC = 1, -1

_MASS = ((156, 22, 54, -13), (22, 4, 13, -3), (54, 13, 156, -22), (-13, -3, -22, 4))
_STIFFNESS = ((12, 6, -12, 6), (6, 4, -6, 2), (-12, -6, 12, -6), (6, 2, -6, 4))


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


def _times(A: _Lines, B: _Lines) -> _Lines:
    columns = list(zip(*B, strict=True))
    return [[mp.fdot(zip(line, column, strict=True)) for column in columns] for line in A]


def _krylov(beta: _Number, length: _Number) -> _Lines:
    """Return the matrix that carries deflection and its first three derivatives over ``length``."""
    z = beta * length
    ch, sh, c, s = mp.cosh(z), mp.sinh(z), mp.cos(z), mp.sin(z)
    k = ((ch + c) / 2, (sh + s) / (2 * beta), (ch - c) / (2 * beta**2), (sh - s) / (2 * beta**3))
    fourth = beta**4
    return [[k[j - i] if j >= i else fourth * k[4 + j - i] for j in range(4)] for i in range(4)]


def _start() -> _Lines:
    """Return the tip's state for a unit deflection, a unit slope, and a unit motion of the actuator."""
    one, zero = mp.mpc(1), mp.mpc(0)
    return [[one, zero, zero], [zero, one, zero], [zero] * 3, [zero] * 3]


def _exact_conditions(p: BoomParameters, s: _Number, parity: int) -> _Lines:
    """Return the two conditions at the hinge, each over tip deflection, tip slope and actuator motion.

    The coordinate runs from the tip inwards: slope and third derivative have the other sign than along ``x``.
    """
    mass, stiffness = _tube(p)
    stiffness = stiffness * (1 + s * p.structural_damping)
    beta = mp.sqrt(mp.sqrt(-s * s * mass / stiffness))
    spring = mp.mpf(p.spring_distance) / 2
    state = _times(_krylov(beta, mp.mpf(p.length) / 2 - spring), _start())
    pull = [-p.spring_stiffness * w for w in state[0]]
    pull[2] += p.spring_stiffness * _platform(p, parity, spring)
    state[3] = [w + force / stiffness for w, force in zip(state[3], pull, strict=True)]
    w, slope, bent, sheared = _times(_krylov(beta, spring), state)
    own, platform = _middle(p, parity, s)
    if parity == _SYMMETRIC:
        force = [-2 * stiffness * third + own * here for third, here in zip(sheared, w, strict=True)]
        force[2] += platform
        return [slope, force]
    moment = [2 * stiffness * second + own * here for second, here in zip(bent, slope, strict=True)]
    moment[2] -= platform
    return [w, moment]


def _element(p: BoomParameters, h: _Number, s: _Number) -> _Lines:
    """Return the dynamic stiffness of a cubic element over ``w1, phi1, w2, phi2``."""
    mass, stiffness = _tube(p)
    m, k = s * s * mass * h / 420, stiffness * (1 + s * p.structural_damping) / h**3
    scale = (mp.mpf(1), h, mp.mpf(1), h)
    return [[scale[i] * scale[j] * (m * _MASS[i][j] + k * _STIFFNESS[i][j]) for j in range(4)] for i in range(4)]


def _inwards(D: _Lines, load: list[_Number] | None = None) -> tuple[_Lines, list[_Number]]:
    """Return transfer matrix and offset of an element: from ``w, phi`` and end forces of its right to its left end."""
    a, b, c, d = D[2][0], D[2][1], D[3][0], D[3][1]
    determinant = a * d - b * c
    inverse = [[d / determinant, -b / determinant], [-c / determinant, a / determinant]]
    follow = _times(inverse, [[-D[2][2], -D[2][3], 1, 0], [-D[3][2], -D[3][3], 0, 1]])
    carried = _times([D[0][:2], D[1][:2]], follow)
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
            state = _times(power, state)
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
            powers.append(_times(powers[-1], powers[-1]))
        outside = _advanced(powers, half - 1 - inner, _start())
        sprung = [[D[i][j] + p.spring_stiffness * row[i] * row[j] for j in range(4)] for i in range(4)]
        both = []
        for parity in (_SYMMETRIC, _ANTISYMMETRIC):
            pull = p.spring_stiffness * _platform(p, parity, spring)
            T, offset = _inwards(sprung, [pull * value for value in row])
            state = _times(T, outside)
            for line, value in zip(state, offset, strict=True):
                line[2] += value
            both.append(_mesh_hinge(p, s, parity, _advanced(powers, inner, state)))
        return both[0], both[1]

    return conditions


def _mesh_hinge(p: BoomParameters, s: _Number, parity: int, state: _Lines) -> _Lines:
    w, slope, force, moment = state
    own, platform = _middle(p, parity, s)
    held, free, end = (slope, w, force) if parity == _SYMMETRIC else (w, slope, moment)
    balance = [own * here - 2 * value for here, value in zip(free, end, strict=True)]
    balance[2] += platform
    return [held, balance]


def _tip(conditions: _Lines) -> complex:
    """Return the tip's deflection for a unit motion of the actuator."""
    (a, b, f), (c, d, g) = conditions
    return complex((b * g - d * f) / (a * d - b * c))


def _full(halves: Iterable[tuple[complex, complex]]) -> Array:
    """Return actuators -> tips, (2, 2, frequencies), of tip motions of the two halves."""
    symmetric, antisymmetric = np.array(list(halves), dtype=complex).reshape(-1, 2).T
    same, other = 0.5 * (symmetric + antisymmetric), 0.5 * (symmetric - antisymmetric)
    return np.array([[same, other], [other, same]])


def exact_response(p: BoomParameters, omega: Array, digits: int = DIGITS) -> Array:
    """Return the response of the tips to the actuators with an exact beam, shape (2, 2, frequencies).

    Parameters
    ----------
    p : BoomParameters
    omega : ndarray
        Angular frequencies above zero [rad/s].
    digits : int
        How many to calculate with.
    """
    with mp.workdps(digits):
        points = [mp.mpc(0, float(w)) for w in np.atleast_1d(omega)]
        return _full(
            (_tip(_exact_conditions(p, s, _SYMMETRIC)), _tip(_exact_conditions(p, s, _ANTISYMMETRIC))) for s in points
        )


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
        both = [conditions(mp.mpc(0, float(w))) for w in np.atleast_1d(omega)]
        return _full((_tip(symmetric), _tip(antisymmetric)) for symmetric, antisymmetric in both)


def sigma_of(response: Array) -> Array:
    """Return the singular values, descending, of a mirror-symmetric response ``[[a, b], [b, a]]``."""
    a, b = response[0, 0], response[0, 1]
    values = np.abs(np.array([a + b, a - b]))
    return -np.sort(-values, axis=0)


def damped_eigenvalues(p: BoomParameters, starts: Array, digits: int = 30) -> Array:
    """Return the exact damped eigenvalue next to each start."""

    def determinant(s: _Number) -> _Number:
        lines = [_exact_conditions(p, s, parity) for parity in (_SYMMETRIC, _ANTISYMMETRIC)]
        return mp.fprod(a * d - b * c for (a, b, _), (c, d, _) in lines)

    with mp.workdps(digits):
        close = [(mp.mpc(complex(s)), mp.mpc(complex(s) * (1 + 1e-6))) for s in np.atleast_1d(starts)]
        return np.array([complex(mp.findroot(determinant, pair, solver="secant", verify=False)) for pair in close])
