"""The spray boom as a user of other programs would write it down: thirty lines of NumPy, cubic finite elements.

Nothing here is shared with :mod:`boomctl.structure`.  Coordinates are deflection and slope of each node, which also makes the
matrices banded; the platform is where the actuators put it, and cradle and middle of the boom move with the hinge.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters

_MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0  # times m h
_STIFFNESS = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float)  # times E I / h^3


@dataclass(frozen=True)
class PlainBoom:
    """``M q'' + C q' + K q = F d + G d'``; ``d``: both actuators, left and right [m].  Outputs: deflections of the tips.

    Matrices are sparse; an odd number of elements puts the hinge into the middle of one.
    """

    M: sparse.csc_array
    C: sparse.csc_array
    K: sparse.csc_array
    F: Array
    G: Array

    @classmethod
    def of(cls, p: BoomParameters, elements: int) -> "PlainBoom":
        """Return the boom on a mesh of equal elements."""
        n, h = 2 * (elements + 1), p.length / elements
        scale = np.array([1.0, h, 1.0, h])
        rows = (2 * np.arange(elements)[:, None, None] + np.arange(4)[:, None] + np.zeros((4, 4), int)).ravel()
        columns = (2 * np.arange(elements)[:, None, None] + np.arange(4) + np.zeros((4, 4), int)).ravel()
        of_each = np.outer(scale, scale)

        def assembled(element: Array) -> sparse.csc_array:
            values = np.broadcast_to(element * of_each, (elements, 4, 4)).ravel()
            return sparse.coo_array((values, (rows, columns)), shape=(n, n)).tocsc()

        M = assembled(_MASS * p.mass_per_length * h)
        beam = assembled(_STIFFNESS * p.bending_stiffness / h**3)
        middle, turn = _row(p, elements, 0.0), _row(p, elements, 0.0, slope=True)
        M = M + (p.boom_mass - p.tube_mass + p.cradle_mass) * _square(middle)
        M = M + (p.boom_inertia - p.tube_inertia) * _square(turn)
        C = p.structural_damping * beam + p.cradle_damping * _square(middle) + p.hinge_damping * _square(turn)
        shift, angle = np.array([[0.5, 0.5]]), np.array([[-1.0, 1.0]]) / p.actuator_distance  # of the platform, over d
        G = p.cradle_damping * middle.T @ shift + p.hinge_damping * turn.T @ angle
        K, F = beam, np.zeros((n, 2))
        for x in (-p.spring_distance / 2, p.spring_distance / 2):
            spring = _row(p, elements, x)
            K, F = K + p.spring_stiffness * _square(spring), F + p.spring_stiffness * spring.T @ (shift + x * angle)
        return cls(sparse.csc_array(M), sparse.csc_array(C), sparse.csc_array(K), np.asarray(F), np.asarray(G))

    @cached_property
    def tips(self) -> Array:
        """The rows of the tips' deflections, left and right."""
        rows = np.zeros((2, self.M.shape[0]))
        rows[0, 0] = rows[1, -2] = 1.0
        return rows

    def statespace(self) -> tuple[Array, Array, Array, Array]:
        """Return ``A, B, C, D`` over ``q`` and ``q' - M^-1 G d``, dense."""
        n = self.M.shape[0]
        solved = np.linalg.solve(self.M.toarray(), np.hstack([self.K.toarray(), self.C.toarray(), self.F, self.G]))
        stiffness, damping, force, rate = np.split(solved, (n, 2 * n, 2 * n + 2), axis=1)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
        B = np.vstack([rate, force - damping @ rate])
        return A, B, np.hstack([self.tips, np.zeros((2, n))]), np.zeros((2, 2))

    def descriptor(self) -> tuple[sparse.csc_array, Array, Array, sparse.csc_array]:
        """Return ``A, B, C, E`` over ``q`` and ``M q' + C q - G d``, sparse."""
        n = self.M.shape[0]
        A = sparse.block_array([[-self.C, sparse.eye_array(n)], [-self.K, None]], format="csc")
        E = sparse.block_array([[self.M, None], [None, sparse.eye_array(n)]], format="csc")
        return A, np.vstack([self.G, self.F]), np.hstack([self.tips, np.zeros((2, n))]), E


def _square(row: sparse.csr_array) -> sparse.csc_array:
    return sparse.csc_array(row.T @ row)


def _row(p: BoomParameters, elements: int, x: float, slope: bool = False) -> sparse.csr_array:
    """Return the row that reads deflection, or slope, at a place ``x`` from the hinge [m]."""
    h = p.length / elements
    k = min(int((x + p.length / 2) / h), elements - 1)
    t = (x + p.length / 2) / h - k
    if slope:
        values = [(6 * t**2 - 6 * t) / h, 1 - 4 * t + 3 * t**2, (6 * t - 6 * t**2) / h, 3 * t**2 - 2 * t]
    else:
        values = [1 - 3 * t**2 + 2 * t**3, h * (t - 2 * t**2 + t**3), 3 * t**2 - 2 * t**3, h * (t**3 - t**2)]
    columns = 2 * k + np.arange(4)
    return sparse.csr_array((values, (np.zeros(4, int), columns)), shape=(1, 2 * (elements + 1)))
