"""Sampled and continuous loops with a force limit, solved in ways that share nothing with the simulation's."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import integrate

from boomctl.arrays import Array

if TYPE_CHECKING:
    import control

_TERMS = 22


@dataclass(frozen=True)
class LoopScene:
    """A plant, a controller and signals, shared by all who simulate them.

    ``driven`` and ``measured`` are the places of the controls among the plant's inputs and of the measurements among
    its outputs, ``read`` those of the outputs compared; ``W`` are all inputs at all times.
    """

    plant: "control.StateSpace"
    controller: "control.StateSpace"
    time: Array
    W: Array
    limit: float
    driven: Array
    measured: Array
    read: Array

    def until(self, points: int) -> "LoopScene":
        """Return the beginning of the scene."""
        return LoopScene(
            self.plant,
            self.controller,
            self.time[:points],
            self.W[:, :points],
            self.limit,
            self.driven,
            self.measured,
            self.read,
        )


def extended_maps(A: Array, B: Array, h: float) -> tuple[Array, Array, Array]:
    """Return ``exp(A h)``, ``int exp(A s) ds B`` and ``int exp(A (h - s)) s ds B / h`` in extended precision."""
    n, m = B.shape
    big = np.zeros((n + 2 * m, n + 2 * m), dtype=np.longdouble)
    big[:n, :n], big[:n, n : n + m] = A * np.longdouble(h), B * np.longdouble(h)
    big[n : n + m, n + m :] = np.eye(m)
    halvings = max(0, int(np.ceil(np.log2(float(np.abs(big).sum(axis=1).max())))) + 3)
    small = big / np.longdouble(2.0) ** halvings
    total = np.eye(len(big), dtype=np.longdouble)
    term = total.copy()
    for k in range(1, _TERMS):
        term = term @ small / np.longdouble(k)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total[:n, :n], total[:n, n : n + m], total[:n, n + m :]


def sampled_reference(scene: LoopScene) -> Array:
    """Return the outputs of the loop whose discrete controller samples at each time, in extended precision."""
    P, K = scene.plant, scene.controller
    h = float(scene.time[-1] - scene.time[0]) / (len(scene.time) - 1)
    Phi, held, ramp = extended_maps(P.A, P.B, h)
    found = K.sample(h, method="bilinear")
    x, state = np.zeros(P.nstates, dtype=np.longdouble), np.zeros(K.nstates, dtype=np.longdouble)
    forcing = held @ scene.W[:, :-1] + ramp @ np.diff(scene.W, axis=1)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        everything = P.C @ x + P.D @ scene.W[:, k]
        y[:, k] = everything[scene.read].astype(float)
        heard = everything[scene.measured]
        u = np.clip(found.C @ state + found.D @ heard, -scene.limit, scene.limit)
        state = found.A @ state + found.B @ heard
        if k < len(scene.time) - 1:
            x = Phi @ x + held[:, scene.driven] @ u + forcing[:, k]
    return y


def continuous_reference(scene: LoopScene, tolerance: float = 1e-11) -> Array:
    """Return the outputs of the loop whose controller is continuous, integrated from sample to sample."""
    P, K = scene.plant, scene.controller
    n, h = P.nstates, float(scene.time[1] - scene.time[0])
    slopes = np.diff(scene.W, axis=1) / h
    Bu = P.B[:, scene.driven]
    z = np.zeros(n + K.nstates)
    y = np.empty((len(scene.read), len(scene.time)))
    for k in range(len(scene.time)):
        start, slope = scene.W[:, k], slopes[:, min(k, len(slopes.T) - 1)]
        y[:, k] = P.C[scene.read] @ z[:n] + P.D[scene.read] @ start

        def rate(t: float, z: Array, start: Array = start, slope: Array = slope) -> Array:
            w = start + slope * t
            heard = P.C[scene.measured] @ z[:n] + P.D[scene.measured] @ w
            u = np.clip(K.C @ z[n:] + K.D @ heard, -scene.limit, scene.limit)
            return np.concatenate([P.A @ z[:n] + P.B @ w + Bu @ u, K.A @ z[n:] + K.B @ heard])

        if k < len(scene.time) - 1:
            z = integrate.solve_ivp(rate, (0.0, h), z, "DOP853", rtol=tolerance, atol=1e-14).y[:, -1]
    return y
