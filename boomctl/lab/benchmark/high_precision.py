"""The spray boom with an exact beam in fifty digits, a reference for everything else.

Nothing here is shared with :mod:`boomctl.structure`.  The boom is mirror-symmetric, so it is solved by halves: both
actuators move alike (symmetric), or opposite to each other (antisymmetric).  From the free tip, where force and moment
vanish, deflection and slope are carried inwards, over the spring, to the hinge, whose two conditions settle the two
unknowns of the tip, carried by the Krylov functions of the beam.  Fifty digits compensate the cancellation of this method.
"""

from typing import Any

import mpmath as mp
import numpy as np
from scipy.optimize import minimize_scalar

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters

DIGITS = 50  # to calculate with: 70 change no digit of a double

_SYMMETRIC, _ANTISYMMETRIC = 1, -1  # parity: the sign with which the left half follows the right one
_ACTUATOR, _SUSPENSION, _CRADLE = 2, 3, 4  # columns of the loads, behind those of tip deflection and slope


def _tube(p: BoomParameters) -> tuple[Any, Any]:
    """Return mass per length and bending stiffness of the tube."""
    outer, inner, high, low = (mp.mpf(v) for v in (p.outer_width, p.inner_width, p.outer_height, p.inner_height))
    return p.density * (high * outer - low * inner), p.youngs_modulus * (high * outer**3 - low * inner**3) / 12


def _platform(p: BoomParameters, parity: int, x: Any) -> Any:
    """Return the platform's displacement at ``x`` when the right actuator moves by one."""
    return mp.mpf(1) if parity == _SYMMETRIC else 2 * mp.mpf(x) / p.actuator_distance


def _middle(p: BoomParameters, parity: int, s: Any) -> tuple[Any, Any]:
    """Return what resists the motion of the boom's middle: force (moment) per motion of boom, and of platform."""
    mass, _ = _tube(p)
    length = mp.mpf(p.length)
    if parity == _SYMMETRIC:
        beyond = p.boom_mass - mass * length + p.cradle_mass
        return beyond * s * s + p.cradle_damping * s, -p.cradle_damping * s
    beyond = p.boom_inertia - mass * length**3 / 12
    return beyond * s * s + p.hinge_damping * s, -p.hinge_damping * s * 2 / mp.mpf(p.actuator_distance)


def carried(beta: Any, length: Any) -> Any:
    """Return the matrix that carries deflection and its first three derivatives over ``length``."""
    z = beta * length
    ch, sh, c, s = mp.cosh(z), mp.sinh(z), mp.cos(z), mp.sin(z)
    k = ((ch + c) / 2, (sh + s) / (2 * beta), (ch - c) / (2 * beta**2), (sh - s) / (2 * beta**3))
    fourth = beta**4
    return mp.matrix([[k[j - i] if j >= i else fourth * k[4 + j - i] for j in range(4)] for i in range(4)])


def _start(loads: int) -> Any:
    """Return the tip's state for a unit deflection, a unit slope, and none of the loads."""
    start = mp.zeros(4, 2 + loads)
    start[0, 0] = start[1, 1] = 1
    return start


def _stacked(*rows: Any) -> Any:
    return mp.matrix([list(row) for row in rows])


def _exact_half(p: BoomParameters, s: Any, parity: int) -> tuple[Any, Any]:
    """Return the two conditions at the hinge, and the readings: tip, stroke and, where the cradle moves, its slip.

    Each is over tip deflection and slope, and over the loads: motion of the actuator, force of the suspension, force on
    the cradle.  The coordinate runs from the tip inwards: slope and third derivative have the other sign than along ``x``.
    """
    mass, stiffness = _tube(p)
    stiffness = stiffness * (1 + s * p.stiffness_damping)
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


def _answers(conditions: Any, readings: Any) -> Any:
    """Return the readings for a unit of each load, where both conditions are met."""
    return readings[:, 2:] - readings[:, :2] * conditions[:, :2] ** -1 * conditions[:, 2:]


def _as_array(matrix: Any) -> Array:
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
    result = []
    with mp.workdps(digits):
        for w in np.atleast_1d(omega):
            s = mp.mpc(0, float(w))
            halves = (_answers(*_exact_half(p, s, parity)) for parity in (_SYMMETRIC, _ANTISYMMETRIC))
            symmetric, antisymmetric = map(_as_array, halves)
            whole = np.zeros((5, 5), dtype=complex)
            whole[:4, :4] = _of_sides(symmetric[:2, :2], antisymmetric[:, :2])
            whole[4, :4], whole[:4, 4] = 0.5 * symmetric[2, :2].repeat(2), symmetric[:2, 2].repeat(2)
            whole[4, 4] = symmetric[2, 2]
            result.append(whole)
    return np.stack(result, axis=2)


def sigma_of(response: Array) -> Array:
    """Return the singular values, descending, of a mirror-symmetric response ``[[a, b], [b, a]]``."""
    a, b = response[0, 0], response[0, 1]
    values = np.abs(np.array([a + b, a - b]))
    return -np.sort(-values, axis=0)


def tip_transfer(p: BoomParameters, s: Any) -> tuple[Any, Any]:
    """Return how the tips follow the actuators, moving alike and opposite, at a complex frequency; in mpmath's digits."""
    symmetric, antisymmetric = (_exact_half(p, s, parity) for parity in (_SYMMETRIC, _ANTISYMMETRIC))
    return _answers(*symmetric)[0, 0], _answers(*antisymmetric)[0, 0]


def peak_in_many_digits(p: BoomParameters) -> float:
    """Return the largest singular value over all frequencies, next to the largest of a grid up to 10 Hz."""

    def height(w: float) -> float:
        with mp.workdps(DIGITS):
            return max(float(abs(value)) for value in tip_transfer(p, mp.mpc(0, w)))

    grid = 2 * np.pi * np.geomspace(0.1, 10.0, 500)
    k = int(np.argmax([height(w) for w in grid]))
    result = minimize_scalar(
        lambda w: -height(w), bounds=grid[[k - 1, k + 1]], method="bounded", options={"xatol": 1e-9}
    )
    return -float(result.fun)
