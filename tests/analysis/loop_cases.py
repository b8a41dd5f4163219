"""Structures with controllers that do something to them, for the tests of loops."""

import control
import numpy as np

from boomctl.structure import SecondOrderModel

SIGNALS = {"inputs": ["y0", "y1"], "outputs": ["u0", "u1"]}


def chain(seed, n=4, damping=0.01):
    """Return a lightly damped chain of masses with two collocated pairs, ``u`` and ``y``, and a disturbance."""
    rng = np.random.default_rng(seed)
    M = np.diag(rng.uniform(0.5, 2.0, n))
    k = rng.uniform(1.0, 5.0, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    eye = np.eye(n)
    return SecondOrderModel(
        M, damping * K, K, {"u0": eye[0], "w": eye[n // 2], "u1": eye[-1]}, {"y0": eye[0], "z": eye[1], "y1": eye[-1]}
    )


def velocity_feedback(gain, corner=30.0):
    """Return ``u = -gain s/(1 + s/corner) y``, or its destabilising opposite for a negative gain."""
    eye = np.eye(2)
    return control.ss(-corner * eye, eye, gain * corner**2 * eye, -gain * corner * eye, **SIGNALS)
