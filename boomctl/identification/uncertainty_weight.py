"""Bound of the difference between a measured response and a model over frequency."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import some_names, whole
from boomctl.identification.intervals import confident
from boomctl.identification.measured import RESPONSE, Measured, answered
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, append
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.identification.response import FrequencyResponseEstimate

_MAX_ORDER = 12  # Most poles: more follow single frequencies, and the roots of the polynomials lose accuracy.
_POLE_RATIO = 1.5  # Ratio of the poles above the highest frequency, so that their residues are separate.
# Magnitudes below this fraction of the largest one are rounded up to it for the fit.
_SMALL = 1e-3
_BEYOND = np.geomspace(1.0, 1e3, 101)[
    1:
]  # Frequencies beyond the band over its limits; further out a filter is at its asymptote.


@one_blas_thread
def uncertainty_weight(
    data: "FrequencyResponseEstimate | control.FrequencyResponseData | Sequence[Any]",
    model: Any,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    probability: float = 0.95,
    order: int = 6,
    fall: int = 2,
) -> "control.StateSpace":
    """Return filters that bound the difference of a measured response and a model, entry by entry.

    At each measured frequency the magnitude of an entry is at least the magnitude of measured less modeled response, plus
    a bound on the measurement error.  Below the lowest frequency it is at least the magnitude there, above the highest
    frequency it falls from the magnitude there; real poles interpolate between frequencies, and fill valleys between
    resonances.

    Parameters
    ----------
    data : FrequencyResponseEstimate, FrequencyResponseData, or a list of such
        As in `fit`; data without ``deviation`` are treated as exact.  The largest difference of several data sets counts.
    model : SecondOrderModel, StateSpace or FrequencyResponseData
        The model, such as ``model(found.parameters)`` of a fit, or ``found.model`` of an identification.
    inputs, outputs : str or sequence of str, optional
        Requested entries, by names of measured signals; by default all.
    probability : float
        Probability that an entry is within its bound at a measured frequency, between 0.5 and 1, for normal errors.
    order : int
        Number of poles of each entry, at most 12, distributed over the measured frequencies.
    fall : int
        Power of frequency with which entries fall above the measured frequencies, at most ``order``: 2 for displacements by
        forces, 1 for speeds, 0 for accelerations.

    Returns
    -------
    control.StateSpace
        Stable, ``order`` states for each entry; for ``additive_uncertainty`` of `robust_stability`.

    Raises
    ------
    TypeError, ValueError
        If the data are not a complex response, a signal is unknown, the model does not return the measured entries or equals
        the data in an entry, or a number is out of range.

    Notes
    -----
    The bound is for one model, such as the model at the fitted parameters.  `robust_stability` adds it to every model of a
    family, so that a proof holds for more plants than those consistent with the record.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> def cart(*masses):  # a mass on a spring, and small ones on stiff springs that a model may leave out
    ...     k = np.array([30.0, 400.0])[: len(masses)]
    ...     K = np.diag(k + np.r_[k[1:], 0.0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    ...     first = np.eye(len(masses))[0]
    ...     return bc.structure.SecondOrderModel(np.diag(masses), 0.01 * K, K, {"force": first}, {"place": first})
    >>> H = cart(1.0, 0.05).frequency_response(np.geomspace(1.0, 200.0, 80))
    >>> W = bc.identification.uncertainty_weight(H, cart(1.05))
    >>> left = abs(H.frdata - cart(1.05).frequency_response(H.omega).frdata)
    >>> bool((abs(W(1j * H.omega)) >= left[0, 0]).all())
    True
    """
    level = confident("probability", probability)
    poles = whole("order", order, most=_MAX_ORDER)
    falling = whole("fall", fall, 0, poles)
    measured = Measured.of(data, None, None, "absolute", None, None)
    if measured.kind != RESPONSE or measured.omega is None or measured.labels is None:
        raise TypeError(f"data: expected a complex frequency response, got {measured.kind}")
    ins, outs = (
        some_names(what, wanted, there)
        for what, wanted, there in zip(("input", "output"), (inputs, outputs), measured.labels, strict=True)
    )
    left = np.abs(measured.values - answered(model, measured)[0])
    if measured.noise is not None:  # real and imaginary part normal: the size of their error is Rayleigh's
        hidden = np.where(measured.kept, measured.noise * np.where(measured.kept, measured.spread, 0.0), 0.0)
        left += np.sqrt(-2.0 * np.log(1.0 - level)) * hidden
    omega, entries = measured.omega, []
    for y in outs:
        for u in ins:
            at = measured.labels[1].index(y), measured.labels[0].index(u)
            use = measured.kept[at] & (omega > 0.0)
            if not left[at][use].any():
                raise ValueError(
                    f"model: expected one that leaves something of what was measured from {u} to {y}, got none"
                )
            entries.append(overbound(omega[use], left[at][use], poles, falling))
    every, sent = append(*entries), np.tile(np.eye(len(ins)), (len(outs), 1))  # an entry's input, and its output
    read = np.kron(np.eye(len(outs)), np.ones(len(ins)))
    bound = Lti(every.A, every.B @ sent, read @ every.C, read @ every.D @ sent, ins, outs)
    return bound.statespace("uncertainty band")


def overbound(omega: Array, size: Array, order: int, fall: int) -> Lti:
    """Return a filter with real poles whose magnitude is at least ``size`` at all frequencies, and near it on average.

    Below the lowest frequency it is at least the magnitude there, and above the highest one, with the given slope. Its
    squared magnitude is a sum of bands, each flat between two neighboring poles and falling to either side. Their heights
    are found by a linear program.

    Parameters
    ----------
    omega, size : (n,) ndarray
        Frequencies [rad/s], above zero, and magnitudes there, not all zero.
    order : int
        Poles, at most ``_MAX_ORDER``, as evenly spaced over the logarithm of the frequencies as may be.
    fall : int
        Power of frequency with which it falls above them, at most ``order``.
    """
    from scipy.optimize import linprog  # long to import, and few come here

    low, high = float(omega.min()), float(omega.max())
    extra = max(fall - 1, 0)
    poles = np.r_[np.geomspace(low, high, order - extra), high * _POLE_RATIO ** np.arange(1, extra + 1)]
    unit, top, count = float(np.sqrt(low * high)), float(size.max()), len(omega)
    below, above = size[omega == low].max(), size[omega == high].max()
    omega = np.r_[omega, low / _BEYOND, high * _BEYOND]
    size = np.r_[size, np.full(len(_BEYOND), below), above * _BEYOND**-fall]
    v, squares = np.square(omega / unit), np.square(poles / unit)
    after = np.r_[np.cumprod(squares[::-1])[::-1], 1.0]  # products of the squares from a pole on
    exponents = np.arange(order - fall + 1)
    bands = (
        np.exp(np.log(v)[:, None] * exponents - np.log(v[:, None] + squares).sum(axis=1)[:, None]) * after[exponents]
    )
    wanted = np.square(size / top)
    squares = np.maximum(wanted, _SMALL**2)[:, None]
    least = np.zeros(len(exponents))  # the first and the last band alone reach what is wanted beyond all frequencies
    for band, end in ((0, count + len(_BEYOND) - 1), (-1, len(omega) - 1)):
        least[band] = max(least[band], wanted[end] / bands[end, band])
    cost = (bands / squares)[:count].mean(axis=0)
    result = linprog(cost, A_ub=-bands / squares, b_ub=-wanted / squares[:, 0], bounds=[(x, None) for x in least])
    if result.x is None:
        raise ArithmeticError(f"no filter of order {order} was found above the magnitudes: {result.message}")
    heights = np.maximum(result.x, 0.0) * after[exponents]
    last = int(np.flatnonzero(heights)[-1])
    zeros = -unit * np.sqrt(-np.roots(heights[last::-1]).astype(complex))
    gain = top * float(np.sqrt(heights[last])) * unit ** (order - last)
    residues = np.array(
        [gain * np.prod(-pole - zeros).real / np.prod(np.delete(poles, k) - pole) for k, pole in enumerate(poles)]
    )
    root = np.sqrt(np.abs(residues))
    C, D = (np.sign(residues) * root)[None, :], np.array([[gain if last == order else 0.0]])
    filters = Lti(np.diag(-poles), root[:, None], C, D)
    there = np.abs(filters.response(omega)[0, 0])
    spare = max(float((size / there).max()), 1.0) * (1.0 + ALIKE)  # The linear program ends within its tolerance.
    return Lti(filters.A, filters.B, spare * filters.C, spare * filters.D)
