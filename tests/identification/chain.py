"""Three masses in a chain, in closed form where there is one: a model that costs next to nothing."""

import numpy as np

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


def response(p, omega):
    """Return the response of the last mass to a force on the first, damping in proportion to the stiffness."""
    M, K = matrices(p)
    dynamic = K[None] * (1.0 + 1j * p["c"] * omega[:, None, None]) - omega[:, None, None] ** 2 * M[None]
    return np.linalg.solve(dynamic, np.array([1.0, 0.0, 0.0])[:, None])[:, 2, 0][None, None, :]
