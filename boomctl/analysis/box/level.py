"""Proof that the largest singular value of a loop stays below a level throughout a cell of parameters.

The loop is ``E x' = A x + B w``, ``z = C x + D w``.  ``E``, ``A`` and ``B`` are polynomials of the parameters: places and
momenta are its states, so that neither the inverse of the mass matrix nor a derivative of what comes in appears.  A singular
value is ``gamma`` at a frequency where the even (Hamiltonian) pencil

    s diag(E, E^T) - [[F, B R^-1 B^T], [-C^T (1 + D R^-1 D^T) C, -F^T]],   F = A + B R^-1 D^T C,   R = gamma^2 - D^T D

is singular (Bruinsma & Steinbuch 1990, with a matrix ``E``).  Where the loop is stable in the middle of a cell, ``gamma`` is
above the gain at infinite frequency, and no eigenvalue of the pencil can be imaginary anywhere in the cell, the loop is
stable throughout, and its norm is below ``gamma``: a pole on its way across the axis would make the norm pass ``gamma``
before, or, where it does not show, be such an eigenvalue itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from boomctl.analysis.box.loop_pencil import LoopPencil
from boomctl.analysis.box.response_cells import ResponseCells
from boomctl.analysis.box.zero_exclusion import Cell, CellProof, Terms, prove_pencil, value_at
from boomctl.analysis.loops import injected
from boomctl.arrays import Array
from boomctl.lti.frequency import largest_of
from boomctl.lti.system import Lti
from boomctl.structure.families import Family
from boomctl.structure.ports import FILTER_DAMPING

Polynomial = dict[tuple[int, ...], Array]


@dataclass(frozen=True)
class DrivenLoops:
    """A loop over a box, from what disturbs it to what is judged."""

    cell: Cell
    E: Polynomial
    A: Polynomial
    B: Polynomial
    C: Array
    D: Array

    @classmethod
    def of(cls, family: Family, K: Lti, inputs: Sequence[str], outputs: Sequence[str]) -> DrivenLoops:
        """Return the loops ``u = K (y + n) + v`` from some of the disturbances and the injected signals ``n`` and ``v``.

        Of a measured speed, ``y = a + b'``, the integral ``b`` moves to the other side: momenta are less by what acts in
        proportion to it, and the controller's states by what it brings to them.

        Raises
        ------
        ValueError
            A signal that needs more derivatives: measured ones may be places or speeds without a filter, judged ones places,
            or controls to which no speed is sent on at once.
        """
        center = family.nominal
        ports, n = center.ports, center.ncoordinates
        controls = [center.input_labels.index(name) for name in K.output_labels]
        labels = (*center.input_labels, *map(injected, K.output_labels + K.input_labels))
        entry = np.zeros((len(labels), len(inputs)))
        entry[[labels.index(name) for name in inputs], range(len(inputs))] = 1.0
        m = len(center.input_labels)
        at_plant, at_control, at_reading = (
            entry[:m],
            entry[m : m + len(K.output_labels)],
            entry[m + len(K.output_labels) :],
        )
        filtered = [(o, b) for o, b in enumerate(ports.bandwidths) if b is not None]
        k, f = len(K.A), 2 * len(filtered)
        size = 2 * n + f + k
        rows = [center.output_labels.index(name) for name in K.input_labels]
        judged = [center.output_labels.index(name) for name in outputs if name in center.output_labels]
        asked = sorted({*rows, *judged})
        if any(change.L.any() and change.L[:, asked].any() for _, change in family.coefficients):
            raise ValueError(
                "`outputs` must not change with the parameters in continuous time; of sampled loops they may."
            )
        plain = [[o for o in group if ports.bandwidths[o] is None] for group in (rows, judged)]
        columns = (ports.B, *(change.B for _, change in family.coefficients))
        derived = [X[1 + k :, group] for k, group in ((1, plain[0]), (0, plain[1])) for X in (ports.L, ports.E)]
        late = (*(X[2] @ at_plant for X in columns), *(X[1:, :, controls] for X in columns))
        if any(X.any() for X in (*derived, *late)):
            raise ValueError("`outputs` must be places, or accelerations behind a filter; measured ones may be speeds.")
        read, direct = np.zeros((len(center.output_labels), size)), ports.E[0] @ at_plant
        read[:, :n] = ports.L[0]
        unfiltered = np.array([b is None for b in ports.bandwidths])
        sped = np.zeros((len(center.output_labels), size))  # what of the outputs is the derivative of
        sped[:, :n] = unfiltered[:, None] * ports.L[1]
        sped_direct = unfiltered[:, None] * ports.E[1] @ at_plant
        A, B = np.zeros((size, size)), np.zeros((size, len(inputs)))
        for j, (o, b) in enumerate(filtered):
            first, second = 2 * n + 2 * j, 2 * n + 2 * j + 1
            (l0, l1, l2), (e0, e1, e2) = (X[:, o] for X in (ports.L, ports.E @ at_plant))
            turn = 2.0 * FILTER_DAMPING * b
            A[first, second], A[first, first], A[second, first] = 1.0, -turn, -(b**2)
            A[first, :n], A[second, :n] = b**2 * (l1 - turn * l2), b**2 * (l0 - b**2 * l2)
            B[first], B[second] = b**2 * (e1 - turn * e2), b**2 * (e0 - b**2 * e2)
            read[o], direct[o] = 0.0, b**2 * e2
            read[o, :n], read[o, first] = b**2 * l2, 1.0
        force, own = np.zeros((len(K.C), size)), slice(2 * n + f, size)  # what the controller sends
        force[:, own] = K.C
        force += K.D @ read[rows] + K.C @ K.B @ sped[rows]
        heard = direct[rows] + at_reading
        at_once = K.D @ heard + K.C @ K.B @ sped_direct[rows] + at_control
        impulse, impulse_direct = K.D @ sped[rows], K.D @ sped_direct[rows]  # whose derivative it sends besides
        sent = [K.output_labels.index(name) for name in outputs if name not in center.output_labels]
        if impulse[sent].any() or impulse_direct[sent].any():
            raise ValueError("`controller` must send no speed on at once where what it sends is judged.")
        A[own, own] = K.A
        A[own] += K.B @ read[rows] + K.A @ K.B @ sped[rows]
        B[own] = K.B @ heard + K.A @ K.B @ sped_direct[rows]
        E = np.diag(np.r_[np.zeros(n), np.ones(size - n)])
        A[:n, n : 2 * n] = np.eye(n)
        result: tuple[Polynomial, Polynomial, Polynomial] = {}, {}, {}
        for power, X, (acting, pushing, _) in (
            ((), center, ports.B),
            *((power, change, change.B) for power, change in family.coefficients),
        ):
            e, a, b = (np.zeros_like(item) if power else item for item in (E, A, B))
            e[:n, :n], a[:n, :n], a[n : 2 * n, :n] = X.M, -X.C, -X.K
            a[n : 2 * n] += acting[:, controls] @ force
            a[:n] += acting[:, controls] @ impulse
            b[:n] = pushing @ at_plant + acting[:, controls] @ impulse_direct
            b[n : 2 * n] = acting @ at_plant + acting[:, controls] @ at_once
            for total, item in zip(result, (e, a, b), strict=True):
                if not power or item.any():
                    total[power] = item
        order = np.argsort([name not in center.output_labels for name in outputs], kind="stable").argsort()
        whole = Cell(np.zeros(family.nparameters), np.ones(family.nparameters))
        return cls(
            whole,
            *result,
            np.vstack([read[judged], force[sent]])[order],
            np.vstack([direct[judged], at_once[sent]])[order],
        )

    @property
    def at_infinity(self) -> float:
        """The gain at infinite frequency."""
        return largest_of(self.D)

    @property
    def pencils(self) -> Terms:
        """The loop without what disturbs it."""
        empty = np.zeros_like(self.E[()])
        powers = dict.fromkeys((*self.E, *self.A))
        return {power: LoopPencil(self.E.get(power, empty), self.A.get(power, empty)) for power in powers}

    def responses(self) -> ResponseCells:
        """Return what bounds the response over cells of parameters and frequencies."""
        return ResponseCells.of(self.E, self.A, self.B, self.C, self.D, len(self.cell.middle))

    def even(self, gamma: float) -> Terms:
        """Return the even pencil at a level."""
        inverse = np.linalg.inv(gamma**2 * np.eye(self.D.shape[1]) - self.D.T @ self.D)
        n = len(self.E[()])
        result: dict[tuple[int, ...], tuple[Array, Array]] = {}

        def part(power: tuple[int, ...]) -> tuple[Array, Array]:
            return result.setdefault(tuple(sorted(power)), (np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))))

        for power, E in self.E.items():
            part(power)[0][:n, :n] += E
            part(power)[0][n:, n:] += E.T
        add = inverse @ self.D.T @ self.C
        for power, F in (*self.A.items(), *((power, B @ add) for power, B in self.B.items())):
            part(power)[1][:n, :n] += F
            part(power)[1][n:, n:] -= F.T
        for (p, B), (q, other) in product(self.B.items(), repeat=2):
            part((*p, *q))[1][:n, n:] += B @ inverse @ other.T
        part(())[1][n:, :n] -= self.C.T @ (self.C + self.D @ add)
        return {power: LoopPencil(E, A) for power, (E, A) in result.items()}

    def at(self, delta: Array) -> Lti:
        """Return the loop at a point, as a state-space system."""
        here = value_at(self.pencils, delta)
        B = sum(float(np.prod(delta[list(power)])) * item for power, item in self.B.items())
        solved = np.linalg.solve(here.E, np.hstack([here.A, np.asarray(B)]))
        n = len(here.E)
        return Lti(solved[:, :n], solved[:, n:], self.C, self.D).balanced()

    def prover(self, level: float) -> Callable[[Cell], CellProof]:
        """Return what tries to prove that the loop is stable and its norm below a level throughout a cell of parameters."""
        even, pencils = self.even(level), self.pencils
        return lambda cell: prove_pencil(even, cell, value_at(pencils, cell.middle).stable)
