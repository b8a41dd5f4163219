"""What parameters cannot explain of a measured response, as a bound over frequency."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.checks import some_names, whole
from boomctl.identification.blocks import confident
from boomctl.identification.measured import RESPONSE, Measured, answered
from boomctl.lti.overbound import MOST, overbound
from boomctl.lti.system import Lti, append
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.identification.response import FrequencyResponseEstimate


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
    """Return filters that bound what a measured response has beside a model, entry by entry.

    At each measured frequency an entry is at least the size of measured less model, and as much more as the deviation of the
    measurement may hide.  Beyond them it is at least the size at the lowest of them, and at the highest, falling; between
    them it is what its real poles say, and valleys between resonances are filled.

    Parameters
    ----------
    data : FrequencyResponseEstimate, FrequencyResponseData, or a list of such
        As `fit` takes it; without ``deviation`` the measurement is taken for exact.  Of several data sets the largest counts.
    model : SecondOrderModel, StateSpace, FrequencyResponseData, ...
        The model, such as ``model(found.parameters)`` of a fit, or ``found.model`` of an identification.
    inputs, outputs : str or sequence of str, optional
        Entries wanted, by names in what was measured; by default all.
    probability : float
        That an entry is within its bound at a measured frequency, between 0.5 and 1: errors are taken for normal.
    order : int
        Poles of each entry, at most 12, spread over the measured frequencies.
    fall : int
        Power of frequency with which entries fall above the measured frequencies, at most ``order``: 2 of displacements that
        forces cause, 1 of speeds, 0 of accelerations.

    Returns
    -------
    control.StateSpace
        Stable, ``order`` states for each entry; for ``additive_uncertainty`` of `robust_stability`.

    Raises
    ------
    TypeError, ValueError
        What was measured is no complex response; unknown signals; a model that does not answer as was measured, or that
        leaves nothing of an entry; numbers out of range.

    Notes
    -----
    The band belongs to a model, such as that at the fitted parameters.  `robust_stability` adds it to every model of a
    family, so that what is proved holds for more plants than the record leaves open.

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
    poles = whole("order", order, most=MOST)
    falling = whole("fall", fall, 0, poles)
    seen = Measured.of(data, None, None, "absolute", None, None)
    if seen.kind != RESPONSE or seen.omega is None or seen.labels is None:
        raise TypeError(f"data: expected a complex frequency response, got {seen.kind}")
    ins, outs = (
        some_names(what, wanted, there)
        for what, wanted, there in zip(("input", "output"), (inputs, outputs), seen.labels, strict=True)
    )
    left = np.abs(seen.values - answered(model, seen)[0])
    if seen.noise is not None:  # real and imaginary part normal: the size of their error is Rayleigh's
        hidden = np.where(seen.kept, seen.noise * np.where(seen.kept, seen.spread, 0.0), 0.0)
        left += np.sqrt(-2.0 * np.log(1.0 - level)) * hidden
    omega, entries = seen.omega, []
    for y in outs:
        for u in ins:
            at = seen.labels[1].index(y), seen.labels[0].index(u)
            use = seen.kept[at] & (omega > 0.0)
            if not left[at][use].any():
                raise ValueError(
                    f"model: expected one that leaves something of what was measured from {u} to {y}, got none"
                )
            entries.append(overbound(omega[use], left[at][use], poles, falling))
    every, sent = append(*entries), np.tile(np.eye(len(ins)), (len(outs), 1))  # an entry's input, and its output
    read = np.kron(np.eye(len(outs)), np.ones(len(ins)))
    bound = Lti(every.A, every.B @ sent, read @ every.C, read @ every.D @ sent, ins, outs)
    return bound.statespace("uncertainty band")
