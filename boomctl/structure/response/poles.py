"""Undamped modes and damped poles of a second-order structure."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import ALIKE, DIGIT, EPS, ROOT, SUMMED
from boomctl.structure.damping import common_ratio
from boomctl.structure.elimination import DEPENDENT
from boomctl.structure.matrices import Structure, is_symmetric

SMALL = 60  # coordinates up to which modes are found in strain coordinates at once: they cost little more (a choice)
# beyond, they are found so where the noise of stiffness over mass is that many times its lowest value: from there on shapes
# found otherwise are off by more than 1e-10 (measured)
_GRADED = 30.0
_WHOLE = 100  # coordinates up to which all poles are found, so that none depends on how many are asked for (a choice)
# share of its size that a pole's imaginary part has at least: those of overdamped motions, of which many are nearly equal,
# leave the real axis by rounding
_CRITICAL = 1e-6
_SPREAD = 1e7  # of stiffnesses, from which on the softest mode counts as nearly floating (a choice)
_PASSES = 3  # with the shift at the lowest elastic mode (a choice)
_ALIKE = 10.0  # ratio of the lowest elastic mode's stiffness to the shift, up to which the shift stays (a choice)
_SPARE = 12  # modes beyond twice those wanted in a basis for damped poles (a choice)
PROMISED = 1e-8  # of frequencies, what rounding may be before a user is warned (a choice)
_LOST = "singular to rounding: expected elements that differ less, or a description from which its rows are known"
# of the square of the highest mode's frequency, a shift that static responses of the higher modes bear: they exist then of
# a floating structure too
_STATIC = 1e-6
_INDEPENDENT = 0.25  # Least square of the norm of a column after its second projection.
_NOISE = 1e3 * EPS  # of the largest stiffness over mass: rounding, with room (a choice)


def undamped_modes(structure: Structure, count: int | None = None) -> tuple[Array, Array]:
    """Return the lowest undamped angular frequencies [rad/s], ascending, and mass-normalized mode shapes (columns).

    Small structures with rows, and those whose stiffest element is too stiff for a stiffness matrix in double precision,
    are solved in strain coordinates.  Otherwise the pencil is solved upside down, ``M v = mu (K + alpha M) v``, so that
    the low modes are the largest eigenvalues and keep their digits on fine meshes; a Rayleigh quotient over the strain
    rows mends what rounding is left.  The shift ``alpha``, just above rounding, keeps floating structures definite; where
    one floats, or nearly does, the pencil is solved once more with the shift at its lowest elastic mode, or the softest
    modes would take the others' digits.

    Raises
    ------
    ValueError
        ``M`` is not positive definite, ``K`` not positive semidefinite, or they are not symmetric.
    """
    wanted = structure.n if count is None else min(count, structure.n)
    if structure.layout is not None and structure.n <= SMALL and structure.strain_form is not None:
        return _in_strains(structure, wanted)  # sums over rows are symmetric, and each coordinate has mass there
    M, K = structure.M, structure.K
    for name, matrix in (("M", M), ("K", K)):
        if abs(matrix - matrix.T).max() > 1e-9 * abs(matrix).max():
            raise ValueError(f"undamped modes need a symmetric {name}")
    if not (M.diagonal() > 0.0).all():
        raise ValueError("undamped modes need a positive definite M")
    if structure.graded and structure.strain_form is not None:
        return _in_strains(structure, wanted)
    shift = noise = _NOISE * float((np.abs(K.diagonal()) / M.diagonal()).max())
    try:
        stiffness, shapes = _near(structure, shift, wanted)
        for _ in range(_PASSES):
            elastic = stiffness[stiffness > 0.1 * noise]
            even = len(elastic) == len(stiffness) and stiffness[-1] <= _SPREAD * elastic[0] and not structure.graded
            if even or not len(elastic) or shift / _ALIKE <= elastic[0] <= _ALIKE * shift:
                break
            shift = float(elastic[0])
            stiffness, shapes = _near(structure, shift, wanted)
    except linalg.LinAlgError:
        return _in_strains(structure, wanted)
    if noise > _GRADED * max(float(stiffness[0]), 0.0) and structure.strain_form is not None:
        return _in_strains(structure, wanted)
    return _told(structure, np.sqrt(np.maximum(stiffness, 0.0)), shapes)


def _told(structure: Structure, frequencies: Array, shapes: Array) -> tuple[Array, Array]:
    """Return modes, rigid motions with a frequency of exactly zero: what the terms of ``v^T K v`` leave is rounding.

    Where a coordinate without stiffness moves alone, that is so of all its shape holds of the others, which is then zero:
    what has no share in the kinetic energy, and what is left strains nothing.
    """
    slow = np.flatnonzero(frequencies <= ROOT * frequencies.max(initial=0.0))
    if not len(slow):
        return frequencies, shapes
    shape, told, result = shapes[:, slow], frequencies.copy(), shapes.copy()
    moving = np.where(np.abs(shape) * np.sqrt(structure.M.diagonal())[:, None] > _NOISE, shape, 0.0)
    strained = np.einsum("ij,ij->j", moving, structure.K @ moving)
    terms, felt = (np.einsum("ij,ij->j", item, abs(structure.K) @ item) for item in (np.abs(shape), np.abs(moving)))
    alone = strained <= _NOISE * felt
    told[slow[alone | (frequencies[slow] ** 2 <= _NOISE * terms)]] = 0.0
    result[:, slow[alone]] = moving[:, alone]
    return told, result


def _in_strains(structure: Structure, count: int) -> tuple[Array, Array]:
    """Return the lowest modes in strain coordinates: some stiff elements do not spoil them there."""
    if structure.strain_form is None:
        raise ValueError(f"undamped modes: the stiffness matrix of {structure.n} coordinates is {_LOST}")
    frequencies, shapes = structure.strain_form.modes()
    return frequencies[:count], shapes[:, :count]


def _near(structure: Structure, shift: float, count: int) -> tuple[Array, Array]:
    """Return modal stiffnesses, ascending, and mass-normalized shapes, found with a shift."""
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
    shapes, rows = vectors / np.sqrt(mass), structure.elastic
    if rows is None:
        stiffness = np.einsum("ij,ij->j", shapes, K @ shapes)
    else:
        strain = rows.R @ shapes
        stiffness = np.einsum("ij,i,ij->j", strain, rows.k, strain)
    order = np.argsort(stiffness)
    return stiffness[order], shapes[:, order]


def first_order_poles(M: Array, C: Array, K: Array) -> Array:
    """Return all eigenvalues of ``s^2 M + s C + K``."""
    n = len(M)
    try:
        if not is_symmetric(M):
            raise linalg.LinAlgError
        L = linalg.cholesky(M, lower=True)
    except linalg.LinAlgError:
        A = blocks([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
        E = blocks([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), M]])
        poles = linalg.eigvals(A, E)
        return poles[np.isfinite(poles)]
    scaled_K = linalg.solve_triangular(L, linalg.solve_triangular(L, K, lower=True).T, lower=True)
    scaled_C = linalg.solve_triangular(L, linalg.solve_triangular(L, C, lower=True).T, lower=True).T
    return np.linalg.eigvals(blocks([[np.zeros((n, n)), np.eye(n)], [-scaled_K.T, -scaled_C]]))


def damped_poles(structure: Structure, count: int) -> Array:
    """Return the ``count`` poles of lowest positive imaginary part.

    Raises
    ------
    ValueError
        There are fewer.
    """
    return poles_and_rounding(structure, count)[0]


def poles_and_rounding(structure: Structure, count: int) -> tuple[Array, float]:
    """Return the ``count`` poles of lowest positive imaginary part, and what share of the last one rounding may be."""
    all_of_them = structure.graded or structure.n <= max(2 * count + 20, _WHOLE)
    if all_of_them and structure.strain_form is not None:
        poles = structure.strain_form.poles()
        lowest, slowest = _lowest(poles, count), np.abs(poles[poles != 0.0]).min()
        return lowest, DIGIT * float(np.abs(lowest[-1]) / slowest)
    result = _pole_basis(structure, count) if structure.n > 2 * count + 20 else None
    if result is None:
        return _lowest(first_order_poles(structure.M, structure.C, structure.K), count), 0.0
    frequencies, basis = result
    floats = frequencies[0] <= ROOT * frequencies[-1]  # all poles: those of rigid motions are exactly zero then
    moving = frequencies[frequencies > 0.0]
    noisy = structure.elastic is not None and len(moving) and structure.noise > _GRADED * moving[0] ** 2
    if (floats or noisy) and structure.strain_form is not None:
        return _lowest(structure.strain_form.poles(), count), 0.0
    small = structure.projected(basis)
    return _lowest(first_order_poles(small.M, small.C, small.K), count), 0.0


def _lowest(poles: Array, count: int) -> Array:
    upper = poles[poles.imag > _CRITICAL * np.abs(poles)]
    if len(upper) < count:
        raise ValueError(f"count = {count}: the model has only {len(upper)} damped eigenfrequencies")
    return upper[np.argsort(upper.imag)][:count]


def _pole_basis(structure: Structure, count: int) -> tuple[Array, Array] | None:
    """Return undamped frequencies, and a basis for the ``count`` lowest damped poles: modes, static responses to dampers.

    None for matrices without real modes.
    """
    try:
        frequencies, shapes = undamped_modes(structure, min(structure.n, 2 * count + _SPARE))
    except ValueError:
        return None
    shift = max(1e-3 * float(frequencies[-1]) ** 2, 1e-2)
    forces = damper_forces(structure, shapes)
    if not forces.shape[1]:
        return frequencies, shapes
    try:
        still = linalg.cho_solve(linalg.cho_factor(structure.K + shift * structure.M), forces)
    except linalg.LinAlgError:
        raise ValueError(f"poles: the stiffness matrix of {structure.n} coordinates is {_LOST}") from None
    return frequencies, np.hstack([shapes, _orthonormal(structure.M, still, shapes)])


def with_statics(
    structure: Structure, frequencies: Array, shapes: Array, loads: Array, order: int = 1
) -> tuple[Array, Array]:
    """Return undamped modes and static responses of the higher ones: frequencies [rad/s] and shapes (columns), ascending.

    The static responses are those to ``loads`` (columns), then, up to ``order``, those to the inertia of the static
    responses before.  With loads of inputs and :func:`damper_forces`, a projected structure responds to signals that vary
    slowly, damping included, as the whole one does.  Where all of that is no fewer than the coordinates, all modes are
    returned.

    Raises
    ------
    ValueError
        As of :func:`undamped_modes`.
    """
    shift = _STATIC * float(frequencies[-1]) ** 2
    if len(frequencies) < structure.n and shift > 0.0:
        shift = max(shift, _GRADED * structure.noise)
        basis, factor = shapes, linalg.cho_factor(structure.K + shift * structure.M)
        for _ in range(order):
            rest = loads - structure.M @ (shapes @ (shapes.T @ loads))
            rest = rest[:, np.linalg.norm(rest, axis=0) > ALIKE * np.linalg.norm(loads, axis=0)]
            if not rest.shape[1]:
                break
            statics = _orthonormal(structure.M, linalg.cho_solve(factor, rest), basis)
            basis, loads = np.hstack([basis, statics]), structure.M @ statics
        if basis.shape[1] < structure.n:
            added = basis[:, len(frequencies) :]
            squares, mix = linalg.eigh(structure.projected(added).K)
            above = np.sqrt(np.maximum(squares, frequencies[-1] ** 2))
            return np.concatenate([frequencies, above]), np.hstack([shapes, added @ mix])
    return undamped_modes(structure)


def _orthonormal(M: Array, block: Array, against: Array) -> Array:
    """Return an M-orthonormal basis of the columns of ``block``, M-orthogonal to ``against``."""
    size = np.sqrt(np.einsum("ij,ij->j", block, M @ block))
    kept = block[:, size > 0] / size[size > 0]
    # a column of which the second projection leaves little is rounding of the first
    for least in (0.0, _INDEPENDENT):
        kept = kept - against @ (against.T @ (M @ kept))
        if not kept.shape[1]:
            return kept
        values, mix = linalg.eigh(kept.T @ (M @ kept), check_finite=False)
        good = values > max(DEPENDENT**2 * max(values[-1], 1e-6), least)
        kept = kept @ (mix[:, good] / np.sqrt(values[good]))
    return kept


def damper_forces(structure: Structure, shapes: Array) -> Array:
    """Return forces of the dampers that are not in proportion to stiffness, as columns, for motions."""
    rows = structure.elastic
    if rows is None:
        K, C = structure.K, structure.C
        loaded = (C - common_ratio(C.diagonal(), K.diagonal()) * K) @ shapes
    else:  # through strains, whose differences keep the digits that those of two matrices lose
        common = common_ratio(rows.c, rows.k) * rows.k
        apart = np.where(np.abs(rows.c - common) > SUMMED * np.maximum(rows.c, common), rows.c - common, 0.0)
        loaded = rows.R.T @ (apart[:, None] * (rows.R @ shapes))
    left, size, _ = linalg.svd(loaded, full_matrices=False)
    least = max(1e-9 * size.max(initial=1e-300), SUMMED * float(np.linalg.norm(structure.C @ shapes)))
    return left[:, size > least]
