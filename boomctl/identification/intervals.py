"""Covariance of parameters from residuals that are correlated over frequency, or from data sets; and limits of intervals.

Errors of neighboring frequencies, and errors of the model, are correlated: the covariance of the linearized model is that of
errors whose covariance over frequency is estimated from the residuals, free of the bias by the fit, with a window that is
flat at small lags.  Each variance has its own dof.  For several data sets, such as days, the scatter of the parameters of
the data sets is used.

Sources: Worsley et al. (2002), NeuroImage 15 (bias by the fit); Politis & Romano (1995), J. Time Series Analysis 16 (window);
Satterthwaite (1946), Biometrics 2 (dof).
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from boomctl.arrays import Array
from boomctl.checks import real
from boomctl.identification.identifiability import IdentifiedSubspace
from boomctl.identification.measured import Measured
from boomctl.printing import count

_FEWEST = 12  # Fewest frequencies from which the correlation is estimated; of fewer, errors count as independent.
_REACH = 6  # Inverse of the largest lag of the correlation of residuals, relative to the number of frequencies.


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
    Q, R = np.linalg.qr(jacobian @ rows.T)
    lines, (n, r) = data.values.shape[-1], Q.shape
    series = data.kept.reshape(-1, lines).nonzero()[0]
    series = np.concatenate([series, series + series.max() + 1]) if np.iscomplexobj(data.values) else series
    columns = np.zeros((series.max() + 1, lines, r + 2))
    columns[series, entry] = np.column_stack([Q, residuals, np.ones(n)])
    lag = np.arange(max(lines // _REACH, 1) + 1)
    # products of the columns with those shifted by a lag to either side
    products = np.array(
        [np.tensordot(columns[:, k:], columns[:, : lines - k], ((0, 1), (0, 1))) for k in range(2 * lag[-1] + 1)]
    )
    products += products.transpose(0, 2, 1)
    trace, shifted = np.einsum("krr->k", products[:, :r, :r]), products[: len(lag)]
    of_fit, power = shifted[:, :r, :r], shifted[:, r, r]
    # expected products of residuals, which the fit lowers, for each covariance of errors
    expected = np.diag((1.0 + (lag == 0)) * shifted[:, -1, -1]) + np.einsum("krt,jrt->kj", of_fit, of_fit)
    expected -= 2.0 * (trace[np.add.outer(lag, lag)] + trace[np.abs(np.subtract.outer(lag, lag))])
    window = np.minimum(2.0 * (1.0 - lag / len(lag)), 1.0)
    estimate = window[:, None] * np.linalg.pinv(expected, hermitian=True)
    values, turned = np.linalg.eigh(np.tensordot(estimate @ power, of_fit, 1))
    values = np.maximum(values, 0.5 * power[0] / max(n - r, 1) / n)
    estimator = rows.T @ np.linalg.inv(R)
    covariance = estimator @ (turned * values) @ turned.T @ estimator.T
    # each variance is a quadratic form of the errors: its dof by the spectra of both
    waves = np.cos(np.pi * np.outer(lag, np.arange(lines)) / lines)
    forms = np.einsum("ir,krt,it->ik", estimator, of_fit, estimator) @ estimate @ waves
    forms *= np.maximum(estimate @ power @ waves, 0.0)
    square, most = np.square(forms).mean(axis=1), float(max(n - r, 1))
    dof = np.divide(n * np.square(forms.mean(axis=1)), square, out=np.full(len(square), most), where=square > 0.0)
    return Spread(covariance, np.clip(dof, 1.0, most), "residuals, correlated over frequency")


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
