"""Damped poles of a second-order structure."""

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, blocks
from boomctl.lti.rounding import ALIKE, DEPENDENT, DIGIT, ROOT, SUMMED, warn_of_rounding
from boomctl.printing import count as counted
from boomctl.structure.layout import weigh
from boomctl.structure.matrices import Structure, is_symmetric
from boomctl.structure.response.modes import GRADED, undamped_modes

_DENSE = 100  # Coordinates up to which all poles are computed, so that none depends on how many are requested.
# Least imaginary part of an oscillatory pole, relative: overdamped motions, of which many are nearly equal, leave the real
# axis by rounding.
_CRITICAL = 1e-6
_EXTRA = 12  # Modes beyond twice those requested in a basis for damped poles.
WARN_RTOL = 1e-8  # Warn above this rounding error of a frequency.
# Of the square of the highest mode's frequency: a shift with which static responses of a floating structure exist.
_STATIC = 1e-6
_INDEPENDENT = 0.25  # Least square of the norm of a column after its second projection.


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


def damped_poles(structure: Structure, count: int, limit: float = WARN_RTOL, least: int | None = None) -> Array:
    """Return the ``count`` poles of lowest positive imaginary part.

    Raises
    ------
    ValueError
        If there are fewer than ``least`` poles, by default ``count``.

    Warns
    -----
    AccuracyWarning
        If the relative rounding error of the last pole may exceed ``limit``.
    """
    form, moving, modes = None, structure, None
    if structure.graded or structure.n <= max(2 * count + 20, _DENSE):
        form = structure.strain_form
    if form is None and structure.n > 2 * count + 20 and is_symmetric(structure.C):
        try:  # Modes and static responses to dampers are a basis for the lowest poles.
            frequencies, V = undamped_modes(structure, 2 * count + _EXTRA)
            modes = with_statics(structure, frequencies, V, damper_forces(structure, V))
            moving = structure.projected(modes[1])
            if structure.noise > GRADED * modes[0][0] ** 2:  # Poles of rigid motions are then exactly zero.
                form = structure.strain_form
        except ValueError:  # Matrices without real modes.
            pass
    if form is not None:
        poles = form.poles()
    else:
        poles = first_order_poles(*moving.matrices)
        if (np.abs(poles) ** 2 <= GRADED * structure.noise).any():
            poles = _poles_off_zero(structure, modes)
    upper = poles[poles.imag > _CRITICAL * np.abs(poles)]
    if len(upper) < (count if least is None else least):
        found = counted(len(upper), "damped eigenfrequency", "damped eigenfrequencies")
        raise ValueError(f"count = {count}: the model has only {found}")
    lowest = upper[np.argsort(upper.imag)][:count]
    if form is not None and len(lowest):
        error = DIGIT * float(np.abs(lowest[-1]) / np.abs(poles[poles != 0.0]).min())
        warn_of_rounding("the highest eigenfrequency", error, limit)
    return lowest


def _poles_off_zero(structure: Structure, modes: tuple[Array, Array] | None) -> Array:
    """Return the poles in modes, by default all, without those of rigid motions at zero, which rounding moves.

    Rigid motions that no damper resists and no gyroscopic force couples to others are omitted.  The others have one pole at
    zero each, or two if no force acts between rigid motions.
    """
    try:
        frequencies, V = modes or undamped_modes(structure)
    except ValueError:  # Matrices without real modes.
        return first_order_poles(*structure.matrices)
    C, terms = V.T @ structure.C @ V, np.abs(V).T @ np.abs(structure.C) @ np.abs(V)
    turned = (np.abs(C - C.T) > ROOT * terms.max()).any(axis=0)
    kept = (frequencies > 0.0) | (C.diagonal() > ROOT * terms.diagonal()) | turned
    rigid = kept & (frequencies == 0.0)
    zeros = 2 * rigid.sum() - np.linalg.matrix_rank(C[np.ix_(rigid, rigid)], ROOT * terms.max()) if rigid.any() else 0
    poles = first_order_poles(*structure.projected(V[:, kept]).matrices)
    return poles[np.argsort(np.abs(poles))[zeros:]]


def with_statics(
    structure: Structure, frequencies: Array, shapes: Array, loads: Array, order: int = 1
) -> tuple[Array, Array]:
    """Return undamped modes and static responses of the higher ones: frequencies [rad/s] and shapes (columns), ascending.

    The static responses are those to ``loads`` (columns), then, up to ``order``, those to the inertia of the static
    responses before.  With loads of inputs and :func:`damper_forces`, a projected structure responds to signals that vary
    slowly, damping included, as the full one does.  If the basis is not smaller than the number of coordinates, all modes are
    returned.

    Raises
    ------
    ValueError
        See :func:`undamped_modes`.
    """
    shift = _STATIC * float(frequencies[-1]) ** 2
    if len(frequencies) < structure.n and shift > 0.0:
        shift = max(shift, GRADED * structure.noise)
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
            squares, mix = np.linalg.eigh(structure.projected(added).K)
            above = np.sqrt(np.maximum(squares, frequencies[-1] ** 2))
            return np.concatenate([frequencies, above]), np.hstack([shapes, added @ mix])
    return undamped_modes(structure)


def _orthonormal(M: Array, block: Array, against: Array) -> Array:
    """Return an M-orthonormal basis of the columns of ``block``, M-orthogonal to ``against``."""
    size = np.sqrt(np.einsum("ij,ij->j", block, M @ block))
    columns = block[:, size > 0] / size[size > 0]
    # A column that nearly vanishes in the second projection is rounding error of the first.
    for least in (0.0, _INDEPENDENT):
        columns = columns - against @ (against.T @ (M @ columns))
        if not columns.shape[1]:
            return columns
        values, mix = linalg.eigh(columns.T @ (M @ columns), check_finite=False)
        good = values > max(DEPENDENT**2 * max(values[-1], 1e-6), least)
        columns = columns @ (mix[:, good] / np.sqrt(values[good]))
    return columns


def damper_forces(structure: Structure, shapes: Array) -> Array:
    """Return forces of the dampers that are not in proportion to stiffness, as columns, for motions."""
    R, (_, excess) = structure.layout.R, structure.weights.uneven_damping()
    loaded = R.T @ weigh(excess, R @ shapes)  # Through strains, whose differences are accurate.
    left, size, _ = linalg.svd(loaded, full_matrices=False)
    least = max(1e-9 * size.max(initial=1e-300), SUMMED * float(np.linalg.norm(structure.C @ shapes)))
    return left[:, size > least]
