"""Equations of motion of a slew as CasADi functions, and one explicit step of them.

A step integrates the linear part by its exact flow and the remainder by a fourth-order Runge-Kutta scheme in the frame of
that flow (Lawson 1967). The implicit steps, by collocation, are in `nlp.transcription`.
"""

from functools import lru_cache
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np
from scipy.interpolate import BPoly, PPoly

from boomctl.arrays import Array
from boomctl.slew.plant import SlewPlant
from boomctl.slew.torque import TorqueProfile, lines_between
from boomctl.symbolic import Places, lifted, symbols

_TAYLOR = 14  # terms of a linear motion: the truncation error is 1 / 15! = 8e-13 at |A h| = 1, below the replay's error
_NEAR = 0.97  # fraction of a peak above which a step may contain a larger value: 0.3 % at 40 steps in a period


class Kind(NamedTuple):
    """Equations shared by plants that differ in constants only.

    Attributes
    ----------
    n : int
        Number of states.
    layouts : tuple of Places
        Of the linear part and the input vector; for a machine also of the coordinate changes and the frequencies.
    equations : casadi.Function or None
        ``(x, torque, constants) -> (xdot, y)`` of a machine.
    """

    n: int
    layouts: tuple[Places, ...]
    equations: ca.Function | None


_KIND_OF: WeakKeyDictionary[SlewPlant, tuple[Kind, Array]] = WeakKeyDictionary()


def kind_of(plant: SlewPlant) -> tuple[Kind, Array]:
    """Return the kind of a plant, and its constants in one vector.

    It is cached as long as the plant exists: CFOAM's equations, which no other plant shares, take 0.2 s to build.
    """
    if plant in _KIND_OF:
        return _KIND_OF[plant]
    matrices, equations, constants = [plant.A, plant.B], None, np.zeros(0)
    if plant.machine is not None:
        equations, constants = plant.planned_machine._casadi_equations()
        matrices += [plant.to_state, plant.from_state, plant.frequencies]
    layouts, own = lifted(matrices)
    kind = Kind(plant.n, layouts, equations)
    return _KIND_OF.setdefault(plant, (kind, np.concatenate([own, constants])))


class _Symbols:
    """A plant whose constants are symbols."""

    def __init__(self, kind: Kind) -> None:
        own, matrices = symbols(kind.layouts)
        self.kind, self.n, self.constants = kind, kind.n, own
        self.A, self.B = matrices[0], matrices[1]
        self.frequencies: Any = None
        if kind.equations is not None:
            self.to_state, self.from_state, self.frequencies = matrices[2:]
            self.machine = ca.SX.sym("machine", kind.equations.size1_in(2))
            self.constants = ca.vertcat(own, self.machine)

    def rates(self, z: ca.SX, u: ca.SX) -> ca.SX:
        """``z'``."""
        if self.kind.equations is None:
            return ca.mtimes(self.A, z) + self.B * u
        turned = self.kind.equations(ca.mtimes(self.to_state, z), u, self.machine)[0]
        return ca.mtimes(self.from_state, turned)

    def remainder(self, z: ca.SX, u: ca.SX) -> ca.SX:
        """Return the accelerations less those of the undamped linear vibration under the torque."""
        half = self.n // 2
        return self.rates(z, u)[half:] - (self.B[half:] * u - self.frequencies**2 * z[:half])


@lru_cache
def rates_of(kind: Kind) -> ca.Function:
    """``(z, u, constants) -> z'`` of all plants of a kind, in SX."""
    plant, z, u = _Symbols(kind), ca.SX.sym("z", kind.n), ca.SX.sym("u")
    return ca.Function("rates", [z, u, plant.constants], [plant.rates(z, u)])


@lru_cache
def rate_jacobian_of(kind: Kind) -> ca.Function:
    """``(z, u, constants) -> z'`` and its Jacobian by (z, u), n x (n + 1), of all plants of a kind."""
    z, u, constants = rates_of(kind).sx_in()
    rates = rates_of(kind)(z, u, constants)
    jacobian = ca.jacobian(rates, ca.vertcat(z, u))
    return ca.Function("rate_jacobian", [z, u, constants], [rates, jacobian])


@lru_cache
def rate_hessian_of(kind: Kind) -> ca.Function:
    """``(z, u, constants, l) -> z'``, its Jacobian, and the Hessian of ``l^T z'``, by (z, u), of all plants of a kind."""
    (z, u, constants), weights = rates_of(kind).sx_in(), ca.SX.sym("l", kind.n)
    rates, jacobian = rate_jacobian_of(kind)(z, u, constants)
    hessian = ca.hessian(ca.dot(weights, rates), ca.vertcat(z, u))[0]
    return ca.Function("rate_hessian", [z, u, constants, weights], [rates, jacobian, hessian])


def row_rates(plant: SlewPlant, row: Array, z: Array, torque: Array, slope: Array) -> tuple[Array, Array]:
    """Return the first and second time derivatives of ``row z`` at k states under torques with given slopes."""
    (kind, constants), count = kind_of(plant), len(z)
    arguments = z.T, torque[None], slope[None], np.tile(row[:, None], count), np.tile(constants[:, None], count)
    first, second = (np.array(item).ravel() for item in _row_rates(kind).map(count)(*arguments))
    return first, second


@lru_cache
def _row_rates(kind: Kind) -> ca.Function:
    """``(z, u, slope, row, constants) -> d/dt (row z), d^2/dt^2 (row z)`` of all plants of a kind."""
    plant, u, slope = _Symbols(kind), ca.SX.sym("u"), ca.SX.sym("slope")
    z, row = ca.SX.sym("z", kind.n), ca.SX.sym("row", kind.n)
    first = ca.dot(row, plant.rates(z, u))
    second = ca.jtimes(first, z, plant.rates(z, u)) + ca.jacobian(first, u) * slope
    return ca.Function("row_rates", [z, u, slope, row, plant.constants], [first, second])


def path_peak(plant: SlewPlant, kind: str, profile: TorqueProfile, time: Array, z: Array, enough: float = 0.0) -> float:
    """Return the largest absolute value of a row of the plant along a motion, including between the given times.

    Values and first two derivatives at both ends of a step define a polynomial of degree five. For a vibration of
    frequency w in steps of h its relative error is ``(w h)^6 / 46080``: 3e-10 with 40 steps in a period.  Steps that begin
    and end far below the larger of the peak and ``enough`` are skipped.
    """
    row = plant.rows[kind]
    values = z @ row
    size = np.abs(values)
    top = float(size.max())
    near = np.flatnonzero(np.maximum(size[:-1], size[1:]) >= _NEAR * max(top, enough))
    if not near.size:
        return top
    h = np.diff(time)[near]
    start, end, slope = (item[near] for item in lines_between(profile, time))
    v0, v1 = values[near], values[near + 1]
    s0, c0 = row_rates(plant, row, z[near], start, slope)
    s1, c1 = row_rates(plant, row, z[near + 1], end, slope)
    s0, s1, c0, c1 = 0.2 * h * s0, 0.2 * h * s1, 0.05 * h**2 * c0, 0.05 * h**2 * c1
    by_bernstein = BPoly(
        np.array([v0, v0 + s0, v0 + 2.0 * s0 + c0, v1 - 2.0 * s1 + c1, v1 - s1, v1]), np.arange(h.size + 1)
    )
    steps = PPoly.from_bernstein_basis(by_bernstein)
    return max(top, float(np.abs(steps(steps.derivative().roots(extrapolate=False))).max(initial=0.0)))


@lru_cache
def step_of(kind: Kind) -> ca.Function:
    """``(z, u, h, constants) -> z`` after a step h [s] on which the torque u is held."""
    z, u, h = ca.SX.sym("z", kind.n), ca.SX.sym("u"), ca.SX.sym("h")
    plant = _Symbols(kind)
    scheme = _flow if kind.equations is None else _lawson
    return ca.Function("step", [z, u, h, plant.constants], [scheme(plant, z, u, h)])


def _lawson(plant: _Symbols, z: ca.SX, u: ca.SX, h: ca.SX) -> ca.SX:
    """Return the state after one step: the remainder is integrated in the frame of the linear flow."""

    def changed(at: ca.SX) -> ca.SX:
        return ca.vertcat(ca.SX.zeros(plant.n // 2), plant.remainder(at, u))

    def carried(vector: ca.SX) -> ca.SX:
        return _flow(plant, vector, ca.SX(1, 1), 0.5 * h)

    k1 = changed(z)
    drifted = _flow(plant, z, u, 0.5 * h)
    pushed = carried(k1)
    k2 = changed(drifted + 0.5 * h * pushed)
    k3 = changed(drifted + 0.5 * h * k2)
    end = _flow(plant, drifted, u, 0.5 * h)
    k4 = changed(end + h * carried(k3))
    return end + h / 6.0 * (carried(pushed + 2.0 * (k2 + k3)) + k4)


def _flow(plant: _Symbols, z: ca.SX, u: ca.SX, h: ca.SX) -> ca.SX:
    """Return the linear motion after a time h under a held torque: modes in closed form, other plants by a Taylor series."""
    if plant.frequencies is None:
        term, total = ca.mtimes(plant.A, z) + plant.B * u, z
        for k in range(1, _TAYLOR + 1):
            term = term * (h / k)
            total, term = total + term, ca.mtimes(plant.A, term)
        return total
    half = plant.n // 2
    positions, speeds = [], []
    for k in range(half):
        p, v, w, push = z[k], z[half + k], plant.frequencies[k], plant.B[half + k] * u
        if w.nnz() == 0:  # the rigid motion
            positions.append(p + h * v + 0.5 * h**2 * push)
            speeds.append(v + h * push)
        else:
            c, s, bent = ca.cos(w * h), ca.sin(w * h), push / w**2
            positions.append((p - bent) * c + v * (s / w) + bent)
            speeds.append(v * c - (p - bent) * (w * s))
    return ca.vertcat(*positions, *speeds)
