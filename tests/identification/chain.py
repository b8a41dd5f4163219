"""Three masses in a chain, in closed form where there is one: a model that costs next to nothing."""

import numpy as np
from scipy import linalg

from boomctl.structure import SecondOrderModel

CHAIN = {"m1": 2.0, "m2": 1.0, "m3": 0.5, "k1": 900.0, "k2": 400.0, "k3": 300.0, "c": 1e-3}
OMEGA = np.geomspace(3.0, 60.0, 40)


def matrices(p):
    """Return mass and stiffness: ground - k1 - m1 - k2 - m2 - k3 - m3."""
    M = np.diag([p["m1"], p["m2"], p["m3"]])
    k1, k2, k3 = p["k1"], p["k2"], p["k3"]
    return M, np.array([[k1 + k2, -k2, 0.0], [-k2, k2 + k3, -k3], [0.0, -k3, k3]])


def frequencies(p):
    """Return the undamped eigenfrequencies [Hz]."""
    M, K = matrices(p)
    root = 1.0 / np.sqrt(np.diag(M))
    return np.sqrt(np.linalg.eigvalsh(root[:, None] * K * root)) / (2.0 * np.pi)


def response(p, omega=OMEGA):
    """Return the response of the last mass to a force on the first, damping in proportion to the stiffness."""
    M, K = matrices(p)
    dynamic = K[None] * (1.0 + 1j * p["c"] * omega[:, None, None]) - omega[:, None, None] ** 2 * M[None]
    return np.linalg.solve(dynamic, np.array([1.0, 0.0, 0.0])[:, None])[:, 2, 0][None, None, :]


def three_masses(parameters):
    """Return the chain as a model, forces on its first two masses, places of all; every mode has the damping given."""
    M, K = matrices(CHAIN)
    damping = parameters["damping"] if isinstance(parameters, dict) else parameters
    squares, shapes = linalg.eigh(K, M)
    C = M @ shapes @ np.diag(2.0 * damping * np.sqrt(squares)) @ shapes.T @ M
    unit = np.eye(3)
    outputs = {f"y{k + 1}": unit[k] for k in range(3)}
    return SecondOrderModel(M, C, K, {"f1": unit[0], "f2": unit[1]}, outputs)


def response_of_record(model, u, step, power=0):
    """Return the outputs of a record of band-limited inputs that repeats for ever, or derivatives of them."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(u), step)
    G = np.asarray(model.frequency_response(omega).frdata) * (1j * omega) ** power
    return np.fft.irfft(np.einsum("oik,ki->ko", G, np.fft.rfft(u, axis=0)), len(u), axis=0)
