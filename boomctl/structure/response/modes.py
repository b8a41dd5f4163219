"""Undamped modes of a structure."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import EPS, ROOT
from boomctl.structure.layout import weigh
from boomctl.structure.matrices import Structure

SMALL = 60  # Coordinates up to which modes are computed in strain coordinates at once: they cost little more.
# Noise of stiffness over mass, in units of its lowest value, above which shapes from matrices have errors above 1e-10.
GRADED = 30.0
_NOISE = 1e3 * EPS  # Rounding: of stiffness over mass, of strain energy over its terms, of coordinates of unit mass.
_STIFFER = 1e7  # Of stiffnesses, from which on the softest mode counts as nearly floating.


def undamped_modes(structure: Structure, count: int | None = None) -> tuple[Array, Array]:
    """Return the lowest undamped angular frequencies [rad/s], ascending, and mass-normalized mode shapes (columns).

    All modes of structures with rows, those of small structures, and those whose stiffest element is too stiff for a
    stiffness matrix in double precision are computed in strain coordinates.  Otherwise the inverse pencil
    ``M v = mu (K + alpha M) v`` is solved, whose largest eigenvalues are the low modes, which are accurate on fine meshes.  A
    Rayleigh quotient over the strain rows corrects the remaining rounding error.  The shift ``alpha``, just above rounding,
    makes floating structures definite.  For floating or nearly floating structures the pencil is solved again with the shift
    at the lowest elastic mode, because the softest modes would reduce the accuracy of the others.

    Raises
    ------
    ValueError
        ``M`` is not positive definite, ``K`` not positive semidefinite, or they are not symmetric.
    """
    wanted = structure.n if count is None else min(count, structure.n)
    form = structure.strain_form if count is None or structure.n <= SMALL or structure.graded else None
    frequencies, shapes = _inverted_modes(structure, wanted) if form is None else form.modes()
    return frequencies[:wanted], shapes[:, :wanted]


def _inverted_modes(structure: Structure, count: int) -> tuple[Array, Array]:
    """Return the lowest modes from the inverted pencil; where rounding spoils them, all from strains if these are known."""
    M, _, K = structure.matrices
    for name, matrix in (("M", M), ("K", K)):
        if abs(matrix - matrix.T).max() > 1e-9 * abs(matrix).max():
            raise ValueError(f"undamped modes need a symmetric {name}")
    if not (M.diagonal() > 0.0).all():
        raise ValueError("undamped modes need a positive definite M")
    noise = _NOISE / EPS * structure.noise
    stiffness, shapes = _near(structure, noise if K.any() else 1.0, count)
    elastic = stiffness[stiffness > 0.1 * noise]
    if len(elastic) and (len(elastic) < len(stiffness) or stiffness[-1] > _STIFFER * elastic[0]):
        stiffness, shapes = _near(structure, float(elastic[0]), count)
    if noise > GRADED * max(float(stiffness[0]), 0.0) and structure.strain_form is not None:
        return structure.strain_form.modes()
    return _with_rigid_motions(structure, np.sqrt(np.maximum(stiffness, 0.0)), shapes)


def _with_rigid_motions(structure: Structure, frequencies: Array, shapes: Array) -> tuple[Array, Array]:
    """Return modes, those whose ``v^T K v`` is the rounding of its terms with a frequency of exactly zero.

    If a coordinate without stiffness moves alone, the other coordinates of a shape are zero: they do not contribute to the
    kinetic energy, and the remainder has no strain.  Setting small coordinates to zero may strain another rigid motion, so
    shapes are tested as they are, too.
    """
    slow = np.flatnonzero(frequencies <= ROOT * np.sqrt(structure.noise / EPS))
    if not len(slow):
        return frequencies, shapes
    shape, exact, result = shapes[:, slow], frequencies.copy(), shapes.copy()
    moving = np.where(np.abs(shape) * np.sqrt(structure.M.diagonal())[:, None] > _NOISE, shape, 0.0)
    strained = np.einsum("ij,ij->j", moving, structure.K @ moving)
    terms, left = (np.einsum("ij,ij->j", item, abs(structure.K) @ item) for item in (np.abs(shape), np.abs(moving)))
    alone = strained <= _NOISE * left
    exact[slow[alone | (frequencies[slow] ** 2 <= _NOISE * terms)]] = 0.0
    result[:, slow[alone]] = moving[:, alone]
    return exact, result


def _near(structure: Structure, shift: float, count: int) -> tuple[Array, Array]:
    """Return modal stiffnesses, ascending, and mass-normalized shapes, computed with a shift."""
    M, K = structure.M, structure.K
    chosen = None if count == len(M) else (len(M) - count, len(M) - 1)
    try:
        _, vectors = linalg.eigh(M, K + shift * M, subset_by_index=chosen)
    except linalg.LinAlgError:
        raise ValueError("undamped modes need a positive semidefinite K") from None
    vectors = vectors[:, ::-1]
    mass = np.einsum("ij,ij->j", vectors, M @ vectors)
    if not (mass > 0.0).all():
        raise ValueError("undamped modes need a positive definite M")
    shapes = vectors / np.sqrt(mass)
    strain = structure.layout.R @ shapes
    stiffness = np.einsum("ij,ij->j", strain, weigh(structure.weights.k, strain))
    order = np.argsort(stiffness)
    return stiffness[order], shapes[:, order]
