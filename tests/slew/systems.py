"""Linear systems with known minimum times."""

import control
import mpmath as mp
import numpy as np


def rigid(inertia: float) -> control.StateSpace:
    """A rigid body."""
    return control.ss([[0, 1], [0, 0]], [[0], [1 / inertia]], [[1, 0]], 0)


def two_masses(rate: float = 1.0) -> control.StateSpace:
    """Two unit masses, a unit spring, the force on the first, which is the one that is moved; in other units of time."""
    k = rate**2
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k, k, 0, 0], [k, -k, 0, 0]]
    return control.ss(A, [[0], [0], [k], [0]], [[1, 0, 0, 0]], 0)


def two_masses_exact() -> tuple[float, np.ndarray]:
    """Minimum time and switches of the unit move under unit force, from the switching equations in 40 digits.

    Antisymmetric about the middle T/2 with switches T/2 - b, T/2, T/2 + b. The rigid mode (mass 2) is to move by one:
    ``T^2/4 - (T/2)^2 ... = 2``, the vibration (sqrt 2 rad/s) is to end at rest.
    """
    with mp.workdps(40):
        w = mp.sqrt(2)

        def equations(half, b):
            # double integral of the torque, signs + - + -, with switches half - b, half, half + b
            t = [mp.mpf(0), half - b, half, half + b, 2 * half]
            signs = [1, -1, 1, -1]
            turn = sum(
                s * ((2 * half - a) ** 2 - (2 * half - c) ** 2) / 2 for s, a, c in zip(signs, t, t[1:], strict=False)
            )
            # antisymmetric: the cosine about the middle vanishes, the sine has to
            swing = sum(
                s * (mp.cos(w * (a - half)) - mp.cos(w * (c - half))) for s, a, c in zip(signs, t, t[1:], strict=False)
            )
            return turn - 2, swing

        half, b = mp.findroot(equations, (mp.mpf("2.1"), mp.mpf("1.1")))
        return float(2 * half), np.array([float(half - b), float(half), float(half + b)])
