"""The spray boom as a user of other programs would write it: cubic finite elements in NumPy, and what solves them.

Nothing here is shared with :mod:`boomctl.structure`.  Coordinates are deflection and slope of each node, so that the matrices
are banded; the platform is where the actuators put it, and cradle and middle of the boom move with the hinge.
"""

from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np
from scipy import signal
from scipy.linalg import solve_banded

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.python_control import control

MASS = ((156, 22, 54, -13), (22, 4, 13, -3), (54, 13, 156, -22), (-13, -3, -22, 4))
"""Consistent mass of a cubic element over ``w1, h phi1, w2, h phi2``, times 420 / (m h)."""
STIFFNESS = ((12, 6, -12, 6), (6, 4, -6, 2), (-12, -6, 12, -6), (6, 2, -6, 4))
"""Its stiffness, times h^3 / (E I)."""
_WIDTH = 3  # rows above and below the diagonal of the matrices


def varied(p: BoomParameters, change: float) -> BoomParameters:
    """Return parameters with another spring."""
    return replace(p, spring_stiffness=p.spring_stiffness * (1.0 + change))


@dataclass(frozen=True)
class PlainBoom:
    """``M q'' + C q' + K q = F d + G d'``; ``d``: both actuators, left and right [m]; tips are the first and last deflection.

    An odd number of elements puts the hinge into the middle of one.
    """

    M: Array
    C: Array
    K: Array
    F: Array
    G: Array

    @classmethod
    def of(cls, p: BoomParameters, elements: int, change: float = 0.0) -> "PlainBoom":
        """Return the boom on a mesh of equal elements, its springs changed."""
        p, n, h = varied(p, change), 2 * (elements + 1), p.length / elements
        M, K = np.zeros((n, n)), np.zeros((n, n))
        scale = np.outer([1.0, h, 1.0, h], [1.0, h, 1.0, h])
        for k in range(0, n - 2, 2):
            M[k : k + 4, k : k + 4] += scale * MASS * p.mass_per_length * h / 420.0
            K[k : k + 4, k : k + 4] += scale * STIFFNESS * p.bending_stiffness / h**3
        middle, turn = _row(p, elements, 0.0), _row(p, elements, 0.0, slope=True)
        M += np.outer(middle, middle) * (p.boom_mass - p.tube_mass + p.cradle_mass)
        M += np.outer(turn, turn) * (p.boom_inertia - p.tube_inertia)
        C = p.stiffness_damping * K
        C += np.outer(middle, middle) * p.cradle_damping + np.outer(turn, turn) * p.hinge_damping
        shift, angle = np.array([0.5, 0.5]), np.array([-1.0, 1.0]) / p.actuator_distance  # of the platform, over d
        G = p.cradle_damping * np.outer(middle, shift) + p.hinge_damping * np.outer(turn, angle)
        F = np.zeros((n, 2))
        for x in (-p.spring_distance / 2, p.spring_distance / 2):
            spring = _row(p, elements, x)
            K += np.outer(spring, spring) * p.spring_stiffness
            F += np.outer(spring, shift + x * angle) * p.spring_stiffness
        return cls(M, C, K, F, G)

    def statespace(self) -> tuple[Array, Array, Array, Array]:
        """Return ``A, B, C, D`` over ``q`` and ``q' - M^-1 G d``."""
        n = len(self.M)
        solved = np.linalg.solve(self.M, np.hstack([self.K, self.C, self.F, self.G]))
        stiffness, damping, force, rate = np.split(solved, (n, 2 * n, 2 * n + 2), axis=1)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
        return A, np.vstack([rate, force - damping @ rate]), np.eye(2 * n)[[0, n - 2]], np.zeros((2, 2))


def _row(p: BoomParameters, elements: int, x: float, slope: bool = False) -> Array:
    """Return the row that reads deflection, or slope, at ``x`` from the hinge [m]."""
    h = p.length / elements
    k = min(int((x + p.length / 2) / h), elements - 1)
    t = (x + p.length / 2) / h - k
    row = np.zeros(2 * (elements + 1))
    if slope:
        row[2 * k : 2 * k + 4] = (6 * t**2 - 6 * t) / h, 1 - 4 * t + 3 * t**2, (6 * t - 6 * t**2) / h, 3 * t**2 - 2 * t
    else:
        row[2 * k : 2 * k + 4] = (
            1 - 3 * t**2 + 2 * t**3,
            h * (t - 2 * t**2 + t**3),
            3 * t**2 - 2 * t**3,
            h * (t**3 - t**2),
        )
    return row


def control_boom(boom: PlainBoom) -> control.StateSpace:
    """Return python-control's system of the plain boom."""
    return control.ss(*boom.statespace())


def control_sigma(system: control.StateSpace, omega: Array) -> Array:
    """Return python-control's singular values."""
    return np.abs(np.asarray(control.singular_values_response(system, omega).frdata)[:, 0])


def pymor_norm(boom: PlainBoom) -> float:
    """Return pyMOR's H-infinity norm, without its messages."""
    import_module("pymor.core.logger").set_log_levels({"pymor": "ERROR"})
    return float(import_module("pymor.models.iosys").LTIModel.from_matrices(*boom.statespace()).hinf_norm())


def banded_sigma(boom: PlainBoom, omega: Array) -> Array:
    """Return the singular values by SciPy's banded solver, a frequency after the other."""
    M, C, K = (np.zeros((2 * _WIDTH + 1, len(boom.M))) for _ in range(3))
    for matrix, band in ((boom.M, M), (boom.C, C), (boom.K, K)):
        for k in range(-_WIDTH, _WIDTH + 1):
            band[_WIDTH - k, max(k, 0) : max(k, 0) + len(matrix) - abs(k)] = np.diag(matrix, k)
    result = np.empty((len(omega), 2, 2), complex)
    for k, w in enumerate(omega):
        solved = solve_banded(
            (_WIDTH, _WIDTH), K + 1j * w * C - w * w * M, boom.F + 1j * w * boom.G, check_finite=False
        )
        result[k] = solved[[0, -2]]
    return np.linalg.svd(result, compute_uv=False).T


def lsim(boom: PlainBoom, time: Array, inputs: Array) -> Array:
    """Return the motion of the tips by SciPy's ``lsim``."""
    return signal.lsim(signal.StateSpace(*boom.statespace()), inputs.T, time)[1].T
