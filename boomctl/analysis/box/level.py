"""Proof that the largest singular value of a loop stays below a level throughout a cell of parameters.

The loop is ``E x' = A x + B w``, ``z = C x + D w``; ``E``, ``A`` and ``B`` are polynomials of the parameters.  A singular
value is ``gamma`` at a frequency if this pencil is singular there, which is even except for factors without a zero on the
imaginary axis (Bruinsma & Steinbuch 1990, with a matrix ``E``, and with ``w = (1 - s/r) v`` instead of the inverse of
``gamma^2 - D^T D``):

    [s E - A, 0, -(1 - s/r) B; C^T C, -s E^T - A^T, (1 - s/r) C^T D; D^T C, -B^T, (1 - s/r) (D^T D - gamma^2)].

If the loop is stable at the midpoint of a cell, ``gamma`` is above the gain at infinite frequency, and no eigenvalue of the
pencil can be imaginary anywhere in the cell, the loop is stable throughout, and its norm is below ``gamma``: a pole that
crosses the axis raises the norm above ``gamma`` before, or, if it does not contribute to the response, is such an eigenvalue.

A sampled loop ``x+ = A x + B w`` becomes with ``z = (1 + s)/(1 - s)`` the loop ``s (1 + A) x = (A - 1) x + (1 - s) B w``: the
unit circle is the imaginary axis, and ``r`` is one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from boomctl.analysis.box.polynomials import ROUNDING, Cell, Polynomial, poles_of, stable, value_at
from boomctl.analysis.box.zero_exclusion import axis_to_halve
from boomctl.arrays import Array, blocks
from boomctl.lti.system import Lti


@dataclass(frozen=True)
class LoopPart:
    """Closed loop over a part of a box, from its inputs to its evaluated outputs; without both for stability alone.

    Attributes
    ----------
    cell : Cell
        The part: parameters of the polynomials range from -1 to 1 across it.
    pencils : mapping
        Coefficients ``[E, A]`` by products of parameters.
    B : mapping
        Coefficients of ``B`` by products of parameters.
    C, D : ndarray
        Matrices of the evaluated outputs; the same over the entire box.
    errors : pair of ndarray
        Error bounds of the entries of ``E`` and ``A`` (one for both), and of ``B``.
    dt : float
        Sampling time of the loop whose image this is [s]; 0 in continuous time.
    """

    cell: Cell
    pencils: Polynomial
    B: Polynomial
    C: Array
    D: Array
    errors: tuple[Array, Array]
    dt: float = 0.0

    def at(self, delta: Array) -> Lti:
        """Return the loop at a point of the part, as a state-space system."""
        (E, A), B = value_at(self.pencils, delta), value_at(self.B, delta)
        if self.dt:
            return Lti(0.5 * (E + A), B, self.C, self.D, dt=self.dt).balanced()
        return Lti(np.linalg.solve(E, A), np.linalg.solve(E, B), self.C, self.D).balanced()

    def even(self, level: float) -> tuple[Polynomial, Array]:
        """Return the pencil that is singular where a singular value is at a level, and the error bounds of its entries."""
        C, D = self.C / level, self.D / level
        n, m = self.B[()].shape
        CC, CD, rest = C.T @ C, C.T @ D, np.eye(m) - D.T @ D
        sampled, sizes = float(self.dt > 0.0), np.abs(poles_of(self.pencils[()]))
        back = 1.0 if self.dt else 1.0 / float(np.median(sizes))  # one over the rate ``r``
        none, empty = np.zeros((n, n)), np.zeros((n, m))
        result = {}
        for power in dict.fromkeys((*self.pencils, *self.B)):
            (E, A), B = self.pencils.get(power, (none, none)), self.B.get(power, empty)
            left = [[E, none, back * B], [none, -E.T, empty], [empty.T, -sampled * B.T, 0.0 * rest]]
            right = [[A, none, B], [none, A.T, empty], [empty.T, B.T, 0.0 * rest]]
            result[power] = np.array([blocks(left), blocks(right)])
        result[()][0, n:] -= blocks([[sampled * CC, none, back * CD], [sampled * CD.T, empty.T, -back * rest]])
        result[()][1, n:] -= blocks([[CC, none, CD], [CD.T, empty.T, -rest]])
        off, driven = self.errors
        return result, blocks([[off, none, driven], [none, off.T, empty], [empty.T, driven.T, 0.0 * rest]])

    def prover(self, level: float) -> Callable[[Cell], int | None]:
        """Return a function that proves stability and a norm below a level throughout a cell, or returns the axis to halve.

        If no singular value is at the level on the axis, all are below it if they are at one frequency, here zero.
        """
        driven = self.C.any() and any(X.any() for X in self.B.values())
        terms, error = self.even(level) if driven else (self.pencils, self.errors[0])
        if error.any():  # rounding of sums included
            error = error + ROUNDING * sum(np.abs(X).sum(axis=0) for X in terms.values())

        def prove(cell: Cell) -> int | None:
            pencil, B = value_at(self.pencils, cell.middle), value_at(self.B, cell.middle)
            holds = stable(pencil) and np.linalg.norm(self.D - self.C @ np.linalg.solve(pencil[1], B), 2) < level
            return axis_to_halve(terms, cell, bool(holds), error)

        return prove
