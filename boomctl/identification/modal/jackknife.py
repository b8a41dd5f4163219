"""Errors of a fit of common poles from blocks of the data that are left out in turn (jackknife)."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from boomctl.arrays import Array
from boomctl.identification.modal.common_poles import CommonPoles, curvature, pull

BLOCKS = 24  # Blocks of a record: standard deviations are known to 15 %.
_LEVERAGE = 0.9  # Largest leverage of a block on a coefficient: the rest of the record has information on it.
_LARGEST = 0.98  # Largest leverage of a block on an error.


def deviations(fit: CommonPoles, count: int = BLOCKS) -> Array:
    """Compute standard deviations of the poles from blocks that are left out.

    The gradient of the sum of squares is a sum over time.  The share of a block gives the step of the poles if the block
    is left out, by one Gauss-Newton step with the residues solved for.

    Blocks of a record have equal information on the poles: the motion after an impact would otherwise be in one of them.
    Few blocks are long: their deviation includes how the structure changes from one to the next.

    Returns
    -------
    (k, 2) ndarray
        Of the logarithm of each pole's decay rate, and of its frequency over the decay rate.
    """
    factors, p = fit.factors, fit.residuals.shape[1]
    k, w = len(factors), factors.shape[2]
    total = fit.normal_equations[0]
    total = total + np.diag(np.diagonal(total) == 0.0)  # the frequency of a real pole is no parameter
    weights = np.einsum("kjwp,kjvp,kj->kwv", factors, factors, 1.0 / np.diagonal(total).reshape(k, 2))

    def information(part: Array) -> Array:
        """Return the fraction of each row in the curvature of each parameter, summed over the parameters."""
        jacobian = part[:, : k * w].T.reshape(k, w, -1)
        return ((weights @ jacobian) * jacobian).sum(axis=(0, 1))

    steps = []
    parts = (np.concatenate(both, axis=1) for both in zip(fit.derivatives_over_time, fit.over_time, strict=True))
    for block in _blocks(fit, tuple(parts), count, information):
        jacobian, basis, left = np.split(block, [k * w, -p], axis=1)
        own = curvature(factors, jacobian.T @ jacobian)
        gradient = pull(factors, jacobian.T @ (left + _left_out(basis, left)))
        steps.append(np.linalg.solve(total - _LEVERAGE * own, gradient))
    deviations = np.array(steps) - np.mean(steps, axis=0)
    return np.sqrt(np.square(deviations).sum(axis=0) * (len(steps) - 1) / len(steps)).reshape(-1, 2)


def left_out_errors(fit: CommonPoles) -> Array:
    """Compute the sum of squared errors of each block if the residues are fitted without the block."""
    p = fit.residuals.shape[1]
    result = []
    for block in _blocks(fit, fit.over_time, BLOCKS):
        basis, left = np.split(block, [-p], axis=1)
        result.append(np.square(left + _left_out(basis, left)).sum())
    return np.array(result)


def _left_out(basis: Array, left: Array) -> Array:
    """Return by how much the residuals of a block grow if the coefficients are fitted without the block."""
    rows, columns = basis.shape
    if rows < columns:
        leverage = basis @ basis.T
        return np.linalg.solve(np.eye(rows) - _LARGEST * leverage, leverage @ left)
    return basis @ np.linalg.solve(np.eye(columns) - _LARGEST * (basis.T @ basis), basis.T @ left)


def _blocks(
    fit: CommonPoles, parts: tuple[Array, ...], count: int, information: Callable[[Array], Array] | None = None
) -> list[Array]:
    """Return blocks of rows: over time, of equal length or information, or groups of lines of a frequency response."""
    if not fit.data.lengths:
        group = np.arange(len(parts[0])) // 2 % count  # each resonance has lines in many groups
        return [parts[0][group == k] for k in range(group.max() + 1)]
    length = sum(map(len, parts)) / count
    result = []
    for part in parts:
        ends = np.linspace(0, len(part), max(round(len(part) / length), 1) + 1).astype(int)
        if information is not None:
            before = np.append(0.0, np.cumsum(information(part)))
            ends = np.unique(np.searchsorted(before, before[-1] * ends / len(part)))
        result += [part[begin:end] for begin, end in pairwise(ends)]
    return result
