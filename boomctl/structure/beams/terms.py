"""What each weight of a structure with exact beams adds to numbers that follow linearly from its dynamic stiffness."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.structure.beams.dynamic_stiffness import segment_terms
from boomctl.structure.layout import Weights
from boomctl.structure.parts import BeamSegment

Lines = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Terms:
    """What each weight adds to numbers that follow linearly from dynamic stiffness and right-hand side.

    Attributes
    ----------
    elastic : (links, ...) ndarray
        For each spring's stiffness; for each damper's damping likewise.
    inertia : (mass rows, ...) ndarray
    bending : (segments, 6, ...) ndarray
        For each segment's ``EI/l^3``, by six functions of frequency.
    forces : (...) ndarray
        What is there whatever the weights: the columns of the forces.
    """

    elastic: Array
    inertia: Array
    bending: Array
    forces: Array

    @classmethod
    def of(
        cls, left: Lines, right: Lines, forces: Array, six: Callable[[Array, Array], Array] = segment_terms
    ) -> "Terms":
        """Return ``left^T weight right`` for each weight, of rows ``N, R, S``; numbers are the entries.

        ``six`` returns the matrices that multiply the six functions, from four rows of ``S`` a segment.
        """
        (N, R, S), (N_r, R_r, S_r) = left, right
        count = len(S) // 4
        ends, ends_r = S.reshape(count, 4, S.shape[1]), S_r.reshape(count, 4, S_r.shape[1])
        return cls(
            elastic=R[:, :, None] * R_r[:, None, :],
            inertia=N[:, :, None] * N_r[:, None, :],
            bending=np.array([six(a, b) for a, b in zip(ends, ends_r, strict=True)]).reshape(count, 6, *forces.shape),
            forces=forces,
        )

    def mapped(self, numbers: Callable[[Array], Array]) -> "Terms":
        """Return what each weight adds to other numbers, which follow linearly from these."""
        return Terms(*(numbers(item) for item in (self.elastic, self.inertia, self.bending, self.forces)))

    def weighed(self, weights: Weights, shares: Array) -> Array:
        """Return the numbers that multiply ``1, s, s^2`` and six functions a kind of segment."""
        size = self.forces.size
        elastic, inertia = self.elastic.reshape(-1, size), self.inertia.reshape(-1, size)
        fixed = weights.k @ elastic + self.forces.ravel(), weights.c @ elastic, weights.m @ inertia
        bending = shares @ self.bending.reshape(-1, 6 * size)
        return np.concatenate([fixed, bending.reshape(-1, size)])


def kinds_of(segments: Sequence[BeamSegment]) -> tuple[tuple[BeamSegment, ...], Array]:
    """Return the kinds of segments, and how much of the unit stiffness of each segment is of each kind."""
    kinds = tuple(dict.fromkeys(segments))
    shares = np.zeros((len(kinds), len(segments)))
    for i, segment in enumerate(segments):
        shares[kinds.index(segment), i] = segment.bending_stiffness / segment.length**3
    return kinds, shares
