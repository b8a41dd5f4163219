"""Stability of a loop whose plant is known only by its frequency response, such as a boom with exact beams.

The winding number of ``det(I - G(jw) K(jw))`` about zero yields the unstable poles of the loop (Nyquist).  The determinant
is evaluated along the axis in steps that are halved until its phase changes little in a step and in its halves, and its value
at the midpoint is near the chord.  Above a frequency from which on ``|G K| < 1``, the determinant does not wind any more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.loops import named_response, signals_of
from boomctl.arrays import Array
from boomctl.checks import frequencies, plain_array, whole
from boomctl.lti.frequency import BEYOND, CURVE, Resonances, singular_values
from boomctl.lti.modal import side_of_axis
from boomctl.lti.system import Lti, controller_of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

# Largest change of the phase in a step and in its halves.
_STEP = np.deg2rad(30.0)
# Largest distance of the value at a step's midpoint from the chord, relative to the smaller end value.
_STRAIGHT = 0.2
_HALVINGS = 40  # Largest number of halvings of a step; beyond it the loop has a pole on the axis.
_SMALL = 0.5  # Loop gain that is regarded as below one at all higher frequencies.
_DECADES = 2.0  # Range over which the loop gain must be below this value, in decades.
_WIDER = 1.5  # Factor between two candidates for the first frequency of this range.
_TRIES = 60  # Number of candidates: ten decades.
_WHOLE = 1e-3  # Largest distance of the winding number from an integer.


@dataclass(frozen=True)
class NyquistStability:
    """Stability of a loop by the winding number of ``det(I - G K)``.

    Attributes
    ----------
    stable : bool
        True if the loop is stable.
    unstable_poles : int
        Number of unstable poles of the loop.
    encirclements : int
        Counter-clockwise encirclements of zero by ``det(I - G K)`` over the full axis.
    unstable_controller_poles : int
        Number of unstable poles of the controller; the plant has none.
    min_return_difference, min_return_difference_omega : float
        Smallest computed singular value of ``I - G K``, and its frequency [rad/s].
    omega_max : float
        Frequency from which on the loop gain was below one, over two further decades [rad/s].
    nfev : int
        Number of frequencies at which the plant was evaluated on the curve.
    omega, curve : (n,) ndarray
        Frequencies [rad/s], and ``det(I - G K) - 1`` at these frequencies, whose critical point is -1.
    """

    stable: bool
    unstable_poles: int
    encirclements: int
    unstable_controller_poles: int
    min_return_difference: float
    min_return_difference_omega: float
    omega_max: float
    nfev: int
    omega: Array = field(repr=False)
    curve: Array = field(repr=False)

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the curve around -1.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.looking").plot_exact_loop(self, ax, **style)

    def __repr__(self) -> str:
        verdict = "stable" if self.stable else f"{self.unstable_poles} unstable poles"
        least = f"{self.min_return_difference:.4g} at {self.min_return_difference_omega:.4g} rad/s"
        beyond = f"loop gain below 1 above {self.omega_max:.4g} rad/s (evaluated, not proved)"
        head = f"NyquistStability: {verdict}\n  least singular value of I - G K {least}"
        return f"{head}\n  {beyond}; {self.nfev} frequencies evaluated"


@one_blas_thread
def nyquist_stability(
    plant: Callable[[Array], control.FrequencyResponseData],
    controller: control.StateSpace,
    plant_poles: ArrayLike,
    max_nfev: int = 200_000,
) -> NyquistStability:
    """Determine the stability of the loop ``u = K y`` for a stable plant known only by its frequency response.

    The method is the generalized Nyquist criterion: the winding number of ``det(I - G K)`` about zero along the axis.

    Parameters
    ----------
    plant : function from frequencies [rad/s] to control.FrequencyResponseData
        A stable plant with named signals, such as ``lambda w: boomctl.exact_frequency_response(p, w)``.
    controller : control.StateSpace
        Controller with ``u = K y``. Signals are matched by name.
    plant_poles : array_like of complex
        Estimates of the plant's lightly damped poles [rad/s], such as those of a fine mesh; the frequency steps are small
        near them.  The loop gain may exceed one up to twice the largest of these and of the controller's poles.
    max_nfev : int
        Largest number of frequencies at which the plant is evaluated.

    Returns
    -------
    NyquistStability
        Stability of the loop, number of unstable poles, and smallest return difference.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, signal names do not match, the controller has poles on the imaginary axis, or the
        loop gain does not fall below one.
    ArithmeticError
        If the winding number is not determined: a pole of the loop is on the imaginary axis, or too close to it.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> def boom(omega):
    ...     return bc.spray_boom().frequency_response(omega, "suspension_left", "stroke_left")
    >>> poles = bc.spray_boom().to_statespace().poles()
    >>> damper = control.ss([[-30.0]], [[30.0]], [[3e3]], [[-3e3]], inputs="stroke_left", outputs="suspension_left")
    >>> bc.analysis.nyquist_stability(boom, damper, poles[abs(poles) < 50.0]).unstable_poles
    0
    """
    K, limit = controller_of(controller).balanced(), whole("max_nfev", max_nfev)
    own, side = K.poles, side_of_axis(K.poles)
    if (side == 0).any():
        raise ValueError("controller: expected no pole on the imaginary axis (an integrator, an undamped mode)")
    near: Array = np.concatenate([_estimates(plant_poles), own])
    near = near[np.abs(near) > 0.0]
    near = near.real + 1j * np.abs(near.imag)
    end = _end(plant, K, 2.0 * float(np.abs(near).max(initial=1.0)))
    low = float(np.abs(near).min(initial=1.0)) / BEYOND

    def difference(omega: Array) -> Array:
        G, gain = _gains(plant, K, omega)
        return np.eye(G.shape[1]) - G @ gain

    omega, values = followed(difference, Resonances(near, low, end).curve([0.0, end]), limit)
    determinants = np.linalg.det(values)
    turned = float(np.angle(determinants[1:] / determinants[:-1]).sum())
    rest = float(np.angle(np.linalg.eigvals(values[-1])).sum())
    windings = (turned - rest) / np.pi
    count = round(windings)
    if abs(windings - count) > _WHOLE:
        raise ArithmeticError(f"det(I - G K) encircles zero {windings:.4f} times, not an integer")
    unstable = int((side > 0).sum())
    if unstable - count < 0:
        raise ArithmeticError(
            f"{count} encirclements, {unstable} unstable poles of the controller: the plant is unstable"
        )
    least = singular_values(values.transpose(1, 2, 0))[-1]
    best = int(np.argmin(least))
    closest = float(least[best]), float(omega[best])
    counts = unstable - count, count, unstable
    return NyquistStability(count == unstable, *counts, *closest, end, len(omega), omega, determinants - 1.0)


def _estimates(poles: ArrayLike) -> Array:
    array = np.atleast_1d(plain_array("plant_poles", poles))
    if array.dtype.kind not in "iufc" or array.ndim != 1:
        raise TypeError(f"plant_poles: expected numbers in one dimension, got shape {array.shape} of {array.dtype}")
    if array.size:
        frequencies("sizes of plant_poles", np.abs(array))
    return array.astype(complex)


def _gains(plant: Callable[[Array], control.FrequencyResponseData], K: Lti, omega: Array) -> tuple[Array, Array]:
    """Return the responses ``G`` and ``K`` between the controller's signals, stacks (frequency first)."""
    data = named_response(plant, omega)
    acting, measured = signals_of(K, data.input_labels, data.output_labels)
    return np.asarray(data.frdata)[np.ix_(measured, acting)].transpose(2, 0, 1), K.response(omega).transpose(2, 0, 1)


def _end(plant: Callable[[Array], control.FrequencyResponseData], controller: Lti, start: float) -> float:
    """Return a frequency above which the loop gain stays below one."""
    for end in (start * _WIDER ** np.arange(_TRIES)).tolist():
        G, K = _gains(plant, controller, end * np.logspace(0.0, _DECADES, CURVE))
        # in the units of the controls, or in those of the measurements
        sizes = np.minimum(*(singular_values(L.transpose(1, 2, 0))[0] for L in (K @ G, G @ K)))
        if (sizes < _SMALL).all():
            return end
    raise ValueError("the loop gain does not fall below one: let the controller roll off")


def followed(difference: Callable[[Array], Array], grid: Array, limit: int) -> tuple[Array, Array]:
    """Return frequencies and a stack of ``I - G K``, so dense that the phase of the determinant is unique."""
    omega, values, open_ = grid, difference(grid), np.arange(len(grid) - 1)  # steps, by their first indices
    for _ in range(_HALVINGS):
        if not len(open_):
            return omega, values
        if len(omega) + len(open_) > limit:
            break
        middle = 0.5 * (omega[open_] + omega[open_ + 1])
        result = difference(middle)
        a, b, m = (np.linalg.det(x) for x in (values[open_], values[open_ + 1], result))
        if (m == 0.0).any():
            break
        coarse = np.abs(m - 0.5 * (a + b)) >= _STRAIGHT * np.minimum(np.abs(a), np.abs(b))
        coarse |= (np.abs(np.angle([m / a, b / m, b / a])) >= _STEP).any(axis=0)
        omega, values = np.insert(omega, open_ + 1, middle), np.insert(values, open_ + 1, result, axis=0)
        left = (open_ + np.arange(len(open_)))[coarse]
        open_ = np.sort(np.append(left, left + 1))
    raise ArithmeticError("the loop's phase could not be followed: it has a pole on the imaginary axis, or close to it")
