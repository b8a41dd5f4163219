"""Small systems that several rooms try: oscillators, repeated poles, gains; and machines in other units."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel


def named(A: Array, B: Array, C: Array, D: Array | None = None, dt: float = 0.0) -> Lti:
    """Return a system of matrices, of inputs ``u0``, ``u1``, ..., outputs ``y0``, ... and states ``x0``, ..."""
    D = np.zeros((len(C), B.shape[1])) if D is None else D
    counts = (("u", D.shape[1]), ("y", len(D)), ("x", len(A)))
    inputs, outputs, states = (tuple(f"{letter}{i}" for i in range(n)) for letter, n in counts)
    return Lti(A, B, C, D, inputs, outputs, states, dt=dt)


def oscillator(zeta: float, omega: float = 1.0) -> Lti:
    """Return ``y'' + 2 z w y' + w^2 y = w^2 u``; the states are ``y`` and ``y'/w``."""
    A = np.array([[0.0, omega], [-omega, -2.0 * zeta * omega]])
    return named(A, np.array([[0.0], [omega]]), np.array([[1.0, 0.0]]))


def mass_on_spring(zeta: float) -> SecondOrderModel:
    """Return the same for 1 rad/s as a model of a mass, ``u0`` the force on it and ``y0`` its place."""
    return SecondOrderModel([[1.0]], [[2.0 * zeta]], [[1.0]], {"u0": [1.0]}, {"y0": [1.0]})


def repeated_pole(count: int, rate: float = 1.0) -> Lti:
    """Return ``1/(s/rate + 1)^count``."""
    A = rate * (-np.eye(count) + np.diag(np.ones(count - 1), 1))
    return named(A, rate * np.eye(count)[:, -1:], np.eye(count)[:1])


def static(gain: float, dt: float = 0.0) -> Lti:
    """Return the controller ``u0 = gain y0``."""
    K = Lti(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]]), ("y0",), ("u0",))
    return replace(K, dt=dt)


def in_other_units(p: Any, powers: Mapping[str, tuple[float, float, float]], unit: str, scale: float) -> Any:
    """Return parameters where a unit of "length", "force" or "time" is so many times smaller.

    ``powers`` are those of length, force and time in the unit of each parameter.
    """
    place = ("length", "force", "time").index(unit)
    return replace(p, **{name: getattr(p, name) * scale ** float(each[place]) for name, each in powers.items()})
