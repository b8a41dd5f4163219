"""Covariance of parameters from blocks of the data or from data sets, instead of a formula for white noise.

Errors of neighboring frequencies, and errors of the model, are correlated.  Omitting a block of frequencies changes the
parameters by the joint effect of its errors; the scatter of these changes gives the deviation of the parameters (a jackknife,
by one Gauss-Newton step each).  If few blocks contain information on a parameter, this deviation is inaccurate; it is shrunk
towards the deviation by all residuals with their correlation.  For several data sets, such as days, the scatter of the
parameters of the data sets is used.

Sources: Bell & McCaffrey (2002), Survey Methodology 28 (dof of blocks); Newey & West (1987), Econometrica 55
(correlated residuals); Smyth (2004), Stat. Appl. Genet. Mol. Biol. 3 (shrinkage of standard deviations).
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from boomctl.arrays import Array
from boomctl.checks import real
from boomctl.identification.identifiability import IdentifiedSubspace
from boomctl.identification.measured import Measured
from boomctl.printing import count

_BLOCKS = 12  # Blocks of frequencies, wide enough for nearly uncorrelated errors.
_FEWEST = 6  # Fewest blocks: a deviation is known to a third; with fewer, errors are treated as independent.
_LINES = 2  # Fewest frequencies per block on average.
_COMMON = 16.0  # Dof of the common variance that single variances are shrunk to.
_REACH = 5  # Inverse of the largest lag of the correlation of residuals, relative to the number of frequencies.
_ALONE = 0.999  # Largest leverage of a block on a combination: the rest of the data must contribute too.


@dataclass(frozen=True)
class Spread:
    """Covariance of the coordinates of parameters, and its source.

    Attributes
    ----------
    covariance : (p, p) ndarray
        Of the coordinates.
    dof : (p,) ndarray
        Dof of each deviation, for Student's t.
    source : str
        What it is from, in words.
    """

    covariance: Array
    dof: Array
    source: str


def of_sets(estimates: Array) -> Spread:
    """Return the spread of estimates from another data set, from the estimates of each data set (sets, p)."""
    size = len(estimates)
    result = np.atleast_2d(np.cov(estimates.T, ddof=1)) * (1.0 + 1.0 / size)
    source = f"scatter of {count(size, 'data set')}, for a further one"
    return Spread(result, np.full(estimates.shape[1], size - 1.0), source)


def of_blocks(jacobian: Array, residuals: Array, data: Measured, identified: IdentifiedSubspace) -> Spread | None:
    """Return the spread from blocks of frequencies, None if there are too few blocks.

    Blocks are contiguous, each with about the same information on the parameters.
    """
    if data.omega is None or not identified.rank:
        return None
    entry = data.labeled(np.argsort(np.argsort(data.omega, kind="stable")))
    lines = len(data.omega)
    blocks = min(_BLOCKS, len(np.unique(entry)) // _LINES)
    if blocks < _FEWEST:
        return None
    rows = identified.directions[: identified.rank]
    J = jacobian @ rows.T
    inverse = np.linalg.inv(J.T @ J)
    say = np.bincount(entry, np.einsum("nr,rs,ns->n", J, inverse, J), lines)
    position = np.minimum((np.cumsum(say) - 0.5 * say) / say.sum() * blocks, blocks - 1).astype(int)
    block = np.unique(position[entry], return_inverse=True)[1]
    moved, leverages = [], []
    for k in range(block.max() + 1):
        own = J[block == k]
        curvature = own.T @ own
        moved.append(np.linalg.solve(J.T @ J - _ALONE * curvature, own.T @ residuals[block == k]) @ rows)
        leverages.append(np.einsum("ri,rs,si->i", rows, inverse @ curvature @ inverse, rows))
    total, parts = np.array(moved), np.array(leverages)
    size = len(total)
    whole = parts.sum(axis=0)
    parts = parts / np.where(whole > 0.0, whole, 1.0)
    own = np.maximum(1.0 / np.maximum(np.square(parts).sum(axis=0), 1.0 / size) - 1.0, 0.0)
    separate = total.T @ total * (size - 1.0) / size
    together, dof = _correlated(J, residuals, data, entry)
    together = rows.T @ inverse @ together @ inverse @ rows
    common = min(_COMMON, dof)
    weight = np.sqrt(np.outer(own, own))
    covariance = (weight * separate + common * together) / (np.outer(*2 * [np.sqrt(own + common)]))
    return Spread(covariance, own + common, f"{count(size, 'block')} of neighboring frequencies")


def _correlated(J: Array, residuals: Array, data: Measured, entry: Array) -> tuple[Array, float]:
    """Return the covariance of ``J^T`` errors, which are correlated as the residuals are, and its dof."""
    lines, series = data.values.shape[-1], data.kept.reshape(-1, data.values.shape[-1]).nonzero()[0]
    series = np.concatenate([series, series + series.max() + 1]) if np.iscomplexobj(data.values) else series
    left, columns = np.zeros((series.max() + 1, lines)), np.zeros((series.max() + 1, lines, J.shape[1]))
    left[series, entry], columns[series, entry] = residuals, J
    n, r = J.shape
    power = float(np.square(residuals).sum()) / max(n - r, 1)
    result, lost, reach = columns.reshape(-1, r).T @ columns.reshape(-1, r), 1.0, max(lines // _REACH, 1)
    for lag in range(1, reach + 1):
        coefficient = float((left[:, :-lag] * left[:, lag:]).sum() / np.square(left).sum()) * (
            1.0 - lag / (reach + 1.0)
        )
        product = np.einsum("skr,skt->rt", columns[:, :-lag], columns[:, lag:])
        result = result + coefficient * (product + product.T)
        lost += 2.0 * coefficient**2
    values, turned = np.linalg.eigh(result)
    whole = np.linalg.eigvalsh(J.T @ J)
    return power * (turned * np.maximum(values, whole[0] / n)) @ turned.T, max(n - r, 1) / lost


def confident(name: str, value: object) -> float:
    """Return a probability from 0.5 to below 1."""
    result = real(name, value)
    if not 0.5 <= result < 1.0:
        raise ValueError(f"{name} = {value!r}: expected a number from 0.5 to below 1")
    return result


def limits(confidence: float, dof: Array) -> Array:
    """Return the number of standard deviations of a confidence level: Student's t, or normal for infinite dof."""
    tail = 0.5 + 0.5 * confidence
    finite = np.isfinite(dof)
    return np.where(finite, special.stdtrit(np.where(finite, dof, 1.0), tail), special.ndtri(tail))
