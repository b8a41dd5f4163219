"""Contributions of each stiffness, damping and mass to the dynamic stiffness of a structure with exact beams."""

from collections.abc import Callable, Sequence

import numpy as np

from boomctl.arrays import Array
from boomctl.structure.beams.dynamic_stiffness import segment_terms
from boomctl.structure.layout import Weights
from boomctl.structure.parts import BeamSegment

Lines = tuple[Array, Array, Array]


def unit_terms(left: Lines, right: Lines, forces: Array, six: Callable[[Array, Array], Array] = segment_terms) -> Array:
    """Return ``left^T right`` of each elastic row, each mass row and each segment, six of these, and last the forces.

    ``six`` returns the matrices that multiply the six functions, from four rows of ``S`` a segment.
    """
    (N, R, S), (N_r, R_r, S_r) = left, right
    count = len(S) // 4
    ends, ends_r = S.reshape(count, 4, S.shape[1]), S_r.reshape(count, 4, S_r.shape[1])
    bending = [six(a, b) for a, b in zip(ends, ends_r, strict=True)]
    return np.concatenate([R[:, :, None] * R_r[:, None, :], N[:, :, None] * N_r[:, None, :], *bending, forces[None]])


def term_weights(weights: Weights, segments: Sequence[BeamSegment]) -> Array:
    """Return the weights of :func:`unit_terms` in the coefficients of ``1, s, s^2`` and six functions per kind of segment."""
    kinds, six = kinds_of(segments), np.arange(6)
    elastic, inertia = len(weights.k), len(weights.k) + len(weights.m)
    result = np.zeros((3 + 6 * len(kinds), inertia + 6 * len(segments) + 1))
    result[0, :elastic], result[1, :elastic], result[2, elastic:inertia] = weights.k, weights.c, weights.m
    result[0, -1] = 1.0
    for i, segment in enumerate(segments):
        row = 3 + 6 * kinds.index(segment)
        result[row + six, inertia + 6 * i + six] = segment.bending_stiffness / segment.length**3
    return result


def kinds_of(segments: Sequence[BeamSegment]) -> tuple[BeamSegment, ...]:
    """Return the kinds of segments: those alike once."""
    return tuple(dict.fromkeys(segments))
