"""Covariance of parameters from residuals that are correlated over frequency, or from data sets; and limits of intervals.

Errors of neighboring frequencies, and errors of the model, are correlated: the covariance of the linearized model is that of
errors with the correlation of the residuals.  For several data sets, such as days, the scatter of the parameters of the data
sets is used.

Source: Newey & West (1987), Econometrica 55 (correlated residuals).
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from boomctl.arrays import Array
from boomctl.checks import real
from boomctl.identification.identifiability import IdentifiedSubspace
from boomctl.identification.measured import Measured
from boomctl.printing import count

_FEWEST = (
    12  # Fewest frequencies from which the correlation is estimated; with fewer, errors are treated as independent.
)
_REACH = 5  # Inverse of the largest lag of the correlation of residuals, relative to the number of frequencies.


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


def of_residuals(jacobian: Array, residuals: Array, data: Measured, identified: IdentifiedSubspace) -> Spread | None:
    """Return the spread from residuals that are correlated over frequency, None for few frequencies."""
    if data.omega is None or not identified.rank:
        return None
    entry = data.labeled(np.argsort(np.argsort(data.omega, kind="stable")))
    if len(np.unique(entry)) < _FEWEST:
        return None
    rows = identified.directions[: identified.rank]
    J = jacobian @ rows.T
    lines, (n, r) = data.values.shape[-1], J.shape
    series = data.kept.reshape(-1, lines).nonzero()[0]
    series = np.concatenate([series, series + series.max() + 1]) if np.iscomplexobj(data.values) else series
    left, columns = np.zeros((series.max() + 1, lines)), np.zeros((series.max() + 1, lines, r))
    left[series, entry], columns[series, entry] = residuals, J
    result, lost, reach = J.T @ J, 1.0, max(lines // _REACH, 1)
    for lag in range(1, reach + 1):
        correlation = float((left[:, :-lag] * left[:, lag:]).sum() / np.square(left).sum())
        coefficient = correlation * (1.0 - lag / (reach + 1.0))
        product = np.einsum("skr,skt->rt", columns[:, :-lag], columns[:, lag:])
        result = result + coefficient * (product + product.T)
        lost += 2.0 * coefficient**2
    values, turned = np.linalg.eigh(result)
    result = (turned * np.maximum(values, np.linalg.eigvalsh(J.T @ J)[0] / n)) @ turned.T
    dof = max(n - r, 1)
    estimator = rows.T @ np.linalg.inv(J.T @ J)
    covariance = float(np.square(residuals).sum()) / dof * (estimator @ result @ estimator.T)
    return Spread(covariance, np.full(len(covariance), dof / lost), "residuals, correlated over frequency")


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
