"""Sampled loops over a box of parameters as polynomials of these, for proofs that their gain stays below a level.

From sample to sample the loop is ``x+ = A x + B w``, ``z = C x + D w``: exponentials of the parameters, whose Chebyshev
series end soon, for over the box the phase of a mode turns by a few radians a sample at most.  With ``z = (1 + s)/(1 - s)``
the unit circle becomes the imaginary axis, and the loop

    s (1 + A) x = (A - 1) x + (1 - s) B w,

again a polynomial of the parameters, with the derivative of what disturbs it.  Its largest singular value is that of the
sampled loop.  What the series leave out is measured at points drawn, and counted ten times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from boomctl.analysis.box.loop_pencil import LoopPencil
from boomctl.analysis.box.prove import with_rounding
from boomctl.analysis.box.response_cells import Polynomial, ResponseCells
from boomctl.analysis.box.zero_exclusion import Cell, CellProof, Terms, prove_pencil, value_at
from boomctl.analysis.loops import joined
from boomctl.arrays import Array, balance
from boomctl.chebyshev import FEW_PARAMETERS, Functions, fitted, points_along, tried_points
from boomctl.lti.frequency import singular_values
from boomctl.lti.rounding import SOLVED
from boomctl.lti.system import Lti, signal_scales
from boomctl.structure.families import Family, shares_of
from boomctl.structure.matrices import Structure
from boomctl.structure.response.modes import undamped_modes
from boomctl.structure.response.realization import realize

_EXACT = 1e-9  # share of the largest entry that a polynomial may miss (a choice: far below what damps a loop)
# The same of many parameters, whose products of different coordinates are left out: they count as what is missed does.
_COUPLED = 1e-6
_DEGREE = 32  # of a parameter, which is enough to tell that it is too large (a choice)
# points of a parameter's range at most, beyond which it is halved: coefficients of higher powers grow, and cancel (measured:
# cells become too many where a mode turns by more than some two radians a sample over a part)
_MOST_POINTS = 20
_MOST_PARTS = 64  # of a box at most (a choice of patience)
# ratio of the scales that balance a state matrix beyond which signals count, too (a choice: a boom's are 1e7 apart)
_UNEVEN = 1e10
_SPARE_POINTS = 2  # more than the last coefficient needs that is more than rounding (a choice)
_FAST = "the sampled loop changes too fast over the box"
_SPARE = 10.0  # times what they miss there that they are taken to miss anywhere (a choice)


@dataclass(frozen=True)
class SampledLoops:
    """A sampled loop over a part of a box, from what disturbs it to what is judged.

    Attributes
    ----------
    cell : Cell
        The part: parameters of the polynomials run from -1 to 1 across it.
    A, B : mapping
        Of products of parameters to matrices.
    C, D : ndarray
        What is judged; the same over the whole box.
    missed : pair of ndarray
        By how much entries of ``A`` and ``B`` may be off.
    dt : float
        Sampling time [s].
    """

    cell: Cell
    A: Polynomial
    B: Polynomial
    C: Array
    D: Array
    missed: tuple[Array, Array]
    dt: float

    @classmethod
    def over(
        cls, family: Family, K: Lti, inputs: Sequence[str], outputs: Sequence[str], delay: float
    ) -> tuple[SampledLoops, ...]:
        """Return the loops ``u = K y`` of a discrete controller, in parts that cover the box.

        Without signals nothing drives or judges them.

        Raises
        ------
        ValueError
            Loops that change too fast over the box.
        """
        raw = sampled_loops(family, K, inputs, outputs, delay)
        waiting, result = [Cell(np.zeros(family.nparameters), np.ones(family.nparameters))], []
        while waiting:
            cell = waiting.pop()
            at = _matrices(raw, cell)
            counts = [
                points_along(at, axis, _negligible, _DEGREE, _SPARE_POINTS) for axis in np.eye(family.nparameters)
            ]
            if max(counts) <= _MOST_POINTS:
                result.append(cls._of(cell, at, tuple(counts), K.dt, _groups(family)))
            elif np.prod(cell.reach) * _MOST_PARTS > 1.0:
                waiting += cell.halves(int(np.argmax(counts)))
            else:
                raise ValueError(f"{_FAST}: {_MOST_PARTS} parts of it would not be enough")
        return tuple(result)

    @classmethod
    def _of(
        cls, cell: Cell, at: Functions, counts: tuple[int, ...], dt: float, groups: Sequence[Sequence[int]]
    ) -> SampledLoops:
        """Return the loops over a part of the box, known at so many points of each parameter's range."""
        exact = _EXACT / SOLVED
        terms, off, miss = fitted(at, counts, at(tried_points(len(counts))), _negligible, exact, _FAST, groups)
        if miss > (_COUPLED / SOLVED if groups else exact):
            raise ValueError(f"{_FAST}: polynomials of it miss it by {miss * SOLVED:.2g}")
        A, B, C, D = (terms[letter] for letter in "ABCD")
        off = {letter: _SPARE * worst for letter, worst in off.items()}
        if len(C) == 1 and len(D) == 1:
            return cls(cell, A, B, C[()], D[()], (off["A"], off["B"]), dt)
        # what is judged becomes a state, a sample later: all gains stay what they are
        empty = {letter: np.zeros_like(terms[letter][()]) for letter in "ABCD"}
        p, n = empty["C"].shape
        below = {
            power: np.vstack([A.get(power, empty["A"]), C.get(power, empty["C"])]) for power in dict.fromkeys((*A, *C))
        }
        beside = {
            power: np.vstack([B.get(power, empty["B"]), D.get(power, empty["D"])]) for power in dict.fromkeys((*B, *D))
        }
        wider = ((0, 0), (0, p))
        return cls(
            cell,
            {power: np.pad(X, wider) for power, X in below.items()},
            beside,
            np.eye(p, n + p, n),
            np.zeros_like(empty["D"]),
            (np.pad(np.vstack([off["A"], off["C"]]), wider), np.vstack([off["B"], off["D"]])),
            dt,
        )

    @property
    def at_infinity(self) -> float:
        """A gain that is known beforehand: none, for all frequencies of a sampled loop are looked at."""
        return 0.0

    @cached_property
    def pencils(self) -> Terms:
        """The loop without what disturbs it, stable where the sampled one is."""
        eye = np.eye(len(self.A[()]))
        changes = {power: LoopPencil(A, A) for power, A in self.A.items() if power}
        return {(): LoopPencil(self.A[()] + eye, self.A[()] - eye), **changes}

    def even(self, level: float) -> tuple[Terms, Array]:
        """Return the even pencil at a level, and by how much entries of both its matrices may be off.

        The pencil ``z L - R`` (:func:`circle_pencil`) is affine in ``A`` and ``B``; with
        ``z = (1 + s)/(1 - s)`` it is ``s (L + R) - (R - L)``.
        """
        B_size, C_size = (float(np.linalg.norm(X)) for X in (self.B[()], self.C))
        up = (C_size / B_size) ** 0.5 if B_size > 0.0 and C_size > 0.0 else 1.0  # scales that make both alike
        b, C, D = up / level**0.5, self.C / (up * level**0.5), self.D / level
        empty = np.zeros_like(self.A[()]), np.zeros_like(self.B[()])
        fixed = np.array(circle_pencil(*empty, C, D))

        def changed(A: Array, B: Array) -> Array:
            return np.array(circle_pencil(A, b * B, C, D)) - fixed

        powers = dict.fromkeys((*self.A, *self.B))
        both = {q: changed(self.A.get(q, empty[0]), self.B.get(q, empty[1])) for q in powers}
        both[()] = both[()] + fixed
        return {q: LoopPencil(L + R, R - L) for q, (L, R) in both.items()}, changed(*self.missed).sum(axis=0)

    def prover(self, level: float) -> Callable[[Cell], CellProof]:
        """Return what tries to prove that the loop is stable and its norm below a level throughout a cell of parameters.

        That no singular value is at the level on the circle shows it only if all are below it at one frequency, the highest.
        """
        even, missed = self.even(level)
        missed, pencils = with_rounding(even, missed), self.pencils

        def prove(cell: Cell) -> CellProof:
            loop = self.at(cell.middle)
            below = singular_values(loop.response(np.array([loop.nyquist]), quiet=True))[0, 0] < level
            return prove_pencil(even, cell, bool(below) and value_at(pencils, cell.middle).stable, missed)

        return prove

    def responses(self) -> ResponseCells:
        """Return what bounds the response over cells of parameters and frequencies."""
        size = len(self.cell.middle)
        E, A = ({power: getattr(x, letter) for power, x in self.pencils.items()} for letter in "EA")
        return ResponseCells.of(E, A, self.B, self.C, self.D, size, {q: -X for q, X in self.B.items()}, self.missed)

    def at(self, delta: Array) -> Lti:
        """Return the sampled loop at a point, as a state-space system."""
        return Lti(_value(self.A, delta), _value(self.B, delta), self.C, self.D, dt=self.dt).balanced()


def _groups(family: Family) -> list[list[int]]:
    """Return the parameters of each coordinate of a family of many, whose coordinates are not coupled; otherwise none.

    From sample to sample such a coordinate moves by its own parameters; a controller with feedthrough couples it with others.
    """
    if family.nparameters <= FEW_PARAMETERS:
        return []
    matrices = [getattr(family.nominal, letter) for letter in "MCK"]
    owners: list[set[int]] = [set() for _ in range(family.nominal.ncoordinates)]
    for power, change in family.coefficients:
        if change.B.any() or change.L.any():
            return []
        for X in (getattr(change, letter) for letter in "MCK"):
            matrices.append(X)
            for i in np.flatnonzero(np.diag(X)):
                owners[i].update(power)
    if any((np.diag(np.diag(X)) != X).any() for X in matrices):
        return []
    groups: list[set[int]] = []
    for own in owners:
        met = [group for group in groups if group & own]
        groups = [group for group in groups if not group & own] + ([own.union(*met)] if own else [])
    return [sorted(group) for group in groups]


def sampled_loops(
    family: Family, K: Lti, inputs: Sequence[str], outputs: Sequence[str], delay: float
) -> Callable[[Array], Lti]:
    """Return what makes the sampled loop at a point of a box, in states that change smoothly with the parameters.

    Without signals nothing drives or judges it.  Places that nothing feels, as a hub's angle, are left out of it; a family
    without such places is taken in the modes of its middle, which keep digits that a fine mesh would lose.
    """
    given = family.nominal
    read = [name for name in given.output_labels if name in {*K.input_labels, *outputs}]
    driven = [name for name in given.input_labels if name in {*K.output_labels, *inputs}]
    structure, V = given.structure, np.eye(given.ncoordinates)
    if not family._unfelt:
        try:
            V = undamped_modes(given.structure)[1]
        except ValueError:
            pass  # no real modes: over its coordinates, then
        else:
            structure = given.structure.projected(V, given.coordinates)
    ports = given.ports.congruent(V).select(driven, read)
    columns, lines = (
        [given.input_labels.index(name) for name in driven],
        [given.output_labels.index(name) for name in read],
    )
    middle = (structure.M, structure.C, structure.K, ports.B, ports.L)
    changes = [
        (
            *(V.T @ X @ V for X in (change.M, change.C, change.K)),
            V.T @ change.B[:, :, columns],
            change.L[:, lines] @ V if change.L.any() else np.zeros_like(ports.L),
        )
        for _, change in family.coefficients
    ]
    stacks = [np.array([change[i] for change in changes]).reshape(len(changes), *X.shape) for i, X in enumerate(middle)]

    def whole(delta: Array) -> Lti:
        shares = shares_of(family, delta)
        M, C, stiffness, B, L = (X + np.tensordot(shares, stack, 1) for X, stack in zip(middle, stacks, strict=True))
        here = Structure.of(M, C, stiffness, given.coordinates)
        loop = joined(realize(here, replace(ports, B=B, L=L)), K, delay).system
        if inputs and outputs:
            places = (
                [loop.input_labels.index(name) for name in inputs],
                [loop.output_labels.index(name) for name in outputs],
            )
            return loop.between(*places)
        n = len(loop.A)
        return Lti(loop.A, np.zeros((n, 1)), np.zeros((1, n)), np.zeros((1, 1)), dt=loop.dt)

    center = whole(np.zeros(family.nparameters))
    eye = np.eye(len(center.A))
    unfelt = [i for i in family._unfelt if (center.A[:, i] == eye[i]).all() and not center.C[:, i].any()]
    kept = np.setdiff1d(np.arange(len(eye)), unfelt)

    def felt(delta: Array) -> Lti:
        loop = whole(delta)
        return Lti(loop.A[np.ix_(kept, kept)], loop.B[kept], loop.C[:, kept], loop.D, dt=loop.dt)

    return felt if unfelt else whole


def _value(terms: Polynomial, delta: Array) -> Array:
    return np.asarray(sum(float(np.prod(delta[list(power)])) * X for power, X in terms.items()))


def _matrices(raw: Callable[[Array], Lti], cell: Cell) -> Functions:
    """Return what gives stacked matrices, balanced in the middle of a part of a box, at points of the part."""
    middle = raw(cell.middle)
    scale = balance(middle.A)[1]
    if scale.max() > _UNEVEN * scale.min():  # of states that hardly act on others nothing else holds the scales
        scale = signal_scales(middle.A, middle.B, middle.C)

    def at(places: Sequence[Array]) -> dict[str, Array]:
        loops = [raw(cell.middle + cell.reach * place) for place in places]
        A, B, C, D = (np.array([getattr(loop, letter) for loop in loops]) for letter in "ABCD")
        return {"A": A * scale / scale[:, None], "B": B / scale[:, None], "C": C * scale, "D": D}

    return at


def _negligible(stacks: Mapping[str, Array]) -> dict[str, float]:
    return {letter: SOLVED * float(np.abs(stack).max(initial=0.0)) for letter, stack in stacks.items()}


def circle_pencil(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, Array]:
    """Return ``L, R``, affine in ``A`` and ``B``: ``z L - R`` is singular on the circle where a singular value is one."""
    n, m = B.shape
    left, right = np.zeros((2 * n + m, 2 * n + m)), np.zeros((2 * n + m, 2 * n + m))
    left[:n, :n], left[n : 2 * n, n : 2 * n], left[2 * n :, n : 2 * n] = np.eye(n), A.T, B.T
    right[:n, :n], right[:n, 2 * n :] = A, B
    right[n : 2 * n, :n], right[n : 2 * n, n : 2 * n], right[n : 2 * n, 2 * n :] = -C.T @ C, np.eye(n), -C.T @ D
    right[2 * n :, :n], right[2 * n :, 2 * n :] = -D.T @ C, np.eye(m) - D.T @ D
    return left, right
