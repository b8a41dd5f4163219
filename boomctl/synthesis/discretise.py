"""Discretization of continuous-time controllers."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, known, positive, up_to
from boomctl.lti.bilinear import discretized
from boomctl.lti.rounding import LEVEL
from boomctl.lti.system import controller_of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller

_METHODS = ("tustin", "zoh")


@one_blas_thread
def discretize(
    controller: "Controller",
    sample_time: float,
    method: str = "tustin",
    *,
    samples_per_period: float = 4.0,
    prewarp_omega: float | None = None,
) -> "control.StateSpace":
    """Discretize a controller, and check that the sampling rate is sufficient for its poles.

    Parameters
    ----------
    controller : control.StateSpace, control.TransferFunction, or a design, which holds one
        In continuous time.
    sample_time : float
        Time between samples [s].
    method : "tustin" or "zoh"
        Bilinear transformation (frequency response on a warped frequency axis), or zero-order hold (exact for inputs
        held between samples, with a delay of half a sample).
    samples_per_period : float
        Minimum number of samples in ``2 pi/|p|`` for every pole ``p``; at least 2, the Nyquist limit.
    prewarp_omega : float, optional
        Frequency at which "tustin" is exact [rad/s]; by default 0.

    Returns
    -------
    control.StateSpace
        In discrete time, with the labels and the scales of the controller.

    Raises
    ------
    TypeError, ValueError
        If `controller` is not a continuous-time system, if an entry is not finite, if the method is unknown, or if
        the sampling rate is too low for a pole; the message contains the required rate.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="stroke", outputs="force")
    >>> bc.discretize(lag, 0.1).A.round(4)
    array([[0.8182]])
    """
    source: Any = getattr(controller, "controller", controller)
    if hasattr(source, "__lti__"):
        raise TypeError(
            f"`controller` must be a StateSpace, got {type(source).__name__}. Sample a structure by its"
            f" .to_statespace(dt={sample_time}), with delayed controls by boomctl.analysis.sample_plant."
        )
    K, T, warped = controller_of(source), positive("sample_time", sample_time), None
    known("method", method, _METHODS)
    if positive("samples_per_period", samples_per_period) < 2.0:
        raise ValueError(
            f"`samples_per_period` must be at least 2, the limit of Nyquist, got {exactly(samples_per_period)}."
        )
    if prewarp_omega is not None:
        warped = positive("prewarp_omega", prewarp_omega)
        if method != "tustin":
            raise ValueError(f'`prewarp_omega` must be None unless `method` is "tustin", got method {method!r}.')
        if warped >= np.pi / T:
            raise ValueError(
                f"`prewarp_omega` must be less than pi/sample_time = {up_to(np.pi / T)} rad/s, got {exactly(warped)}."
            )
    corner = 2.0 / T if warped is None else warped / np.tan(0.5 * warped * T)
    _check_poles(K.poles, T, samples_per_period, corner if method == "tustin" else np.inf)
    return discretized(K, T, method, warped).statespace(f"{source.name}_discrete")


def _check_poles(poles: Array, T: float, samples: float, corner: float) -> None:
    """Raise ``ValueError`` if a pole has too few samples a period, or is at a corner, where Tustin's rule is singular."""
    fastest = complex(poles[np.argmax(np.abs(poles))]) if len(poles) else 0j
    needed = samples * abs(fastest) / (2.0 * np.pi)
    if needed * T > 1.0:
        raise ValueError(
            f"`sample_time` must be at most {up_to(1.0 / needed)} s ({samples:g} samples per period of the controller pole"
            f" at {fastest:.4g} rad/s), got {exactly(T)} s. Sample faster, or remove faster poles by"
            f" reduce_controller(P, K, fastest_pole={2.0 * np.pi / (samples * T):.4g})."
        )
    for pole in poles[np.abs(poles / corner - 1.0) <= LEVEL]:
        raise ValueError(
            f"`sample_time` must not put the controller's unstable pole at {pole:.4g} rad/s on 2/sample_time, where Tustin's"
            ' rule is singular. Sample faster, or use method "zoh".'
        )
