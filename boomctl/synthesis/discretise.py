"""Controllers for a computer: a sampled version of a controller in continuous time, names kept."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, from_on, known, positive, up_to
from boomctl.lti.bilinear import discretized
from boomctl.lti.system import controller_of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller

_METHODS = ("tustin", "zoh")
_CORNER = 1e-6  # relative distance from 2/T within which a pole counts as lying there: ten digits are then lost


@one_blas_thread
def discretize(
    controller: "Controller",
    sample_time: float,
    method: str = "tustin",
    *,
    samples_per_period: float = 4.0,
    prewarp_omega: float | None = None,
) -> "control.StateSpace":
    """Return a controller that runs once a sample, refused where it is sampled too slowly for its poles.

    Parameters
    ----------
    controller : control.StateSpace, control.TransferFunction, or a design, which holds one
        In continuous time.
    sample_time : float
        Time between samples [s].
    method : "tustin" or "zoh"
        Trapezoidal rule (keeps the frequency response, but for a warped axis), or exact for inputs held between samples
        (delays them by half a sample).
    samples_per_period : float
        Least number of samples in ``2 pi/|p|`` for every pole ``p``; not below 2, the limit of Nyquist.
    prewarp_omega : float, optional
        Frequency at which "tustin" is exact [rad/s]; by default 0.

    Returns
    -------
    control.StateSpace
        In discrete time, inputs, outputs and states named as the controller's, in the same scales.

    Raises
    ------
    TypeError, ValueError
        Not a continuous-time state space, not finite; unknown method; a sampling rate too low for a pole, which is
        named with the rate that it needs.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="stroke", outputs="force")
    >>> bc.discretize(lag, 0.1).A.round(4)
    array([[0.8182]])
    """
    given: Any = getattr(controller, "controller", controller)
    if hasattr(given, "__lti__"):
        raise TypeError(
            f"controller: expected StateSpace, got {type(given).__name__}; a structure is sampled by its"
            f" .to_statespace(dt={sample_time}), with late controls by boomctl.analysis.sample_plant"
        )
    K = controller_of(given)
    T = positive("sample_time", sample_time)
    known("method", method, _METHODS)
    if positive("samples_per_period", samples_per_period) < 2.0:
        raise ValueError(
            f"samples_per_period = {exactly(samples_per_period)}: expected at least 2, the limit of Nyquist"
        )
    warped = None
    if prewarp_omega is not None:
        if method != "tustin":
            raise ValueError(f"prewarp_omega: expected only with method 'tustin', got method {method!r}")
        warped = positive("prewarp_omega", prewarp_omega)
        if warped >= np.pi / T:
            raise ValueError(
                f"prewarp_omega = {exactly(warped)}: expected less than pi/sample_time = {up_to(np.pi / T)} rad/s"
            )
    _check_rate(K.poles, T, samples_per_period)
    if method == "tustin":
        _check_corner(K.poles, T if warped is None else 2.0 * np.tan(0.5 * warped * T) / warped)
    return discretized(K, T, method, warped).statespace(f"{given.name}_discrete")


def _check_corner(poles: Array, T: float) -> None:
    """Raise ``ValueError`` if a pole lies at ``2/T``, where the trapezoidal rule has no solution."""
    for pole in poles[np.abs(poles * T - 2.0) <= _CORNER]:
        raise ValueError(
            f"sample_time: the trapezoidal rule sends the unstable pole of the controller at {pole:.4g} rad/s, twice "
            "the rate of the samples, to infinity; sample faster, or use method 'zoh'"
        )


def _check_rate(poles: Array, T: float, samples: float) -> None:
    """Raise ``ValueError`` naming the fastest pole if it sees fewer samples a period than wanted."""
    if not len(poles):
        return
    fastest = complex(poles[np.argmax(np.abs(poles))])
    needed = samples * abs(fastest) / (2.0 * np.pi)
    if needed * T > 1.0:
        raise ValueError(
            f"sample_time = {exactly(T)} s: too long for the pole of the controller at {fastest:.4g} rad/s, which needs "
            f"{from_on(needed)} Hz or more ({samples:g} samples in each {2.0 * np.pi / abs(fastest):.4g} s); sample faster,"
            f" or take faster poles out: reduce_controller(P, K, fastest_pole={2.0 * np.pi / (samples * T):.4g})"
        )
