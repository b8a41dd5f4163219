"""Nyquist's criterion: curves and encirclements of loops, from poles or from frequency responses alone.

With ``L`` the loop's response under negative feedback, ``det(I + L)`` is the product of ``s - p`` over the closed loop's
poles, divided by the product over the open loop's poles.  With open-loop poles on the axis passed on the right, its winding
number about zero is the number of unstable open-loop poles minus the number of unstable closed-loop poles (Nyquist 1932): the
encirclements are computed from the poles.  A sampled loop is evaluated through the bilinear transformation, which maps the
unit circle to the imaginary axis.

If the plant is known only by its frequency response, such as a boom with exact beams, the winding number of
``det(I - G(jw) K(jw))`` about zero yields the unstable poles of the loop.  The determinant is evaluated along the axis in
steps that are halved until its phase changes little in a step and in its halves, and its value at the midpoint is near the
chord.  Above a frequency from which on ``|G K| < 1``, the determinant does not wind any more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.loops import joined, named_response, sign_advice, signals_of
from boomctl.analysis.margins import DiskMargin, disk_margins, grid_of_loop
from boomctl.analysis.sigma import looked_at, matrices
from boomctl.arrays import Array
from boomctl.checks import frequencies, no_signals, nonnegative, plain_array, whole
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import BEYOND, CURVE, DRAWN, Resonances, singular_values, smooth_curve
from boomctl.lti.modal import boundary_sides, diagonalized, side_of_axis, sides
from boomctl.lti.system import Lti, controller_of, of, series, static
from boomctl.printing import count, listed
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


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


@dataclass(frozen=True, eq=False)
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
    estimates = np.atleast_1d(plain_array("plant_poles", plant_poles))
    if estimates.dtype.kind not in "iufc" or estimates.ndim != 1:
        raise TypeError(
            f"plant_poles: expected numbers in one dimension, got shape {estimates.shape} of {estimates.dtype}"
        )
    if estimates.size:
        frequencies("sizes of plant_poles", np.abs(estimates))
    near: Array = np.concatenate([estimates, own])
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


@dataclass(frozen=True, eq=False)
class NyquistResult:
    """Nyquist curve of a loop, with its encirclements.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    curve : (n,) complex ndarray
        Loop gain ``L`` under negative feedback; for several signals ``det(I + L) - 1``, with the same critical point -1.
    signals : tuple of str
        Signals at which the loop is opened simultaneously.
    encirclements : int
        Counter-clockwise encirclements of -1 by the full curve, negative frequencies included: unstable poles of the open
        loop minus unstable poles of the closed loop.
    open_loop_unstable_poles, closed_loop_unstable_poles : int
        Numbers of unstable poles of the open and of the closed loop.
    disk_margin : DiskMargin or None
        Disk margin at this signal; None for several signals (see :func:`boomctl.margins`) or an unstable loop.
    """

    omega: Array
    curve: Array = field(repr=False)
    signals: tuple[str, ...]
    encirclements: int
    open_loop_unstable_poles: int
    closed_loop_unstable_poles: int
    disk_margin: DiskMargin | None
    _advice: str = field(default="", repr=False, compare=False)

    def __repr__(self) -> str:
        opened, closed = (
            count(number, "unstable pole")
            for number in (self.open_loop_unstable_poles, self.closed_loop_unstable_poles)
        )
        turns = f"{self.encirclements} encirclements of -1, {opened} of the open loop"
        verdict = "stable" if self.stable else f"{closed} of the closed loop"
        disk = "" if self.disk_margin is None else f"; disk margin {self.disk_margin.alpha:.4g}"
        advice = f"\n  {self._advice}" if self._advice else ""
        return f"NyquistResult: opened at {listed(self.signals, 60)}\n  {turns}: {verdict}{disk}{advice}"

    @property
    def stable(self) -> bool:
        """True if the closed loop is stable."""
        return self.closed_loop_unstable_poles == 0

    @property
    def response(self) -> control.FrequencyResponseData:
        """The curve as python-control's frequency response."""
        from boomctl.lti.python_control import control

        return control.frd(self.curve[None, None, :], self.omega, name="loop")

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the curve around -1, with the critical disk that it does not enter.

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
        return import_module("boomctl.plotting.looking").plot_nyquist(self, ax, **style)


@one_blas_thread
def nyquist(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    controller: control.StateSpace | control.TransferFunction | Any | None = None,
    *,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    delay: float = 0.0,
) -> NyquistResult:
    """Return the Nyquist curve of a loop and its encirclements of -1.

    The name is python-control's short name of ``nyquist_plot``.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction
        Without a controller: the loop gain ``L`` under negative feedback, as in python-control, with as many outputs as
        inputs.  With a controller: the plant, with named signals.
    controller : control.StateSpace, TransferFunction, or a design, optional
        Controller with ``u = K y``, signals matched by name, as in :func:`boomctl.margins`: then ``L = -K G``.  A
        discrete-time controller defines the sampled loop.
    inputs, outputs : str or sequence of str, optional
        Signals of the system in the loop.  If None, all signals; for a boom's loop gain, platform actuators and tips.
    delay : float, optional
        Computation delay [s].  Requires a discrete-time controller.

    Returns
    -------
    NyquistResult
        Frequencies, curve, encirclements and unstable poles; ``.plot()`` draws it with the critical disk.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, the numbers of outputs and inputs differ, signal names do not match, the loop is
        not well-posed, or a pole is at ``z = -1``.
    ArithmeticError
        If a pole of the closed loop is on the imaginary axis (the unit circle), or so close to it that the encirclements
        cannot be determined.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> motor = control.ss([[0.0, 1.0], [0.0, -1.0]], [[0.0], [1.0]], [[0.5, 0.0]], 0.0)
    >>> found = bc.nyquist(motor)
    >>> found.stable, round(found.disk_margin.phase_margin_deg, 1)
    (True, 60.0)
    """
    no_signals("controller", controller, "a controller")
    if controller is None:
        if nonnegative("delay", delay):
            raise ValueError(f"delay = {delay!r}: expected 0 without a controller")
        P = matrices(system, inputs, outputs)
        if P.D.shape[0] != P.D.shape[1]:
            many = f"{len(P.output_labels)} and {len(P.input_labels)}"
            raise ValueError(f"system: expected as many outputs as inputs, got {many}")
        K = replace(static(-np.eye(len(P.D)), P.output_labels, P.input_labels), dt=P.dt)
    else:
        P = of(looked_at(system), "plant", sampled=True).select(inputs, outputs)
        K = controller_of(controller, sampled=True, scales=P.scales)
    loop, m = joined(P, K, delay), len(K.C)
    opened, S = series(loop.plant, K).balanced(), loop.sensitivity.between(range(m), range(m))
    signals = loop.controls if controller is not None else P.output_labels
    if (sides(S.poles, S.dt) == 0).any():
        raise ArithmeticError(
            "encirclements are not determined: the closed loop has a pole on the stability boundary, or too close to it"
        )
    unstable, closed = int((boundary_sides(opened) > 0).sum()), int((sides(S.poles, S.dt) > 0).sum())
    image = continuous_image(S)
    quick = diagonalized(image) or image
    grid = grid_of_loop(np.append(image.poles, continuous_image(opened).poles), places=DRAWN)

    def determinant(omega: Array) -> Array:
        """Return ``det(I + L) - 1``."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return 1.0 / np.linalg.det(quick.response(omega).transpose(2, 0, 1)) - 1.0

    omega, curve = smooth_curve(determinant, grid[grid > 0.0])
    return NyquistResult(
        omega=omega_of_image(omega, S.dt),
        curve=curve,
        signals=signals,
        encirclements=unstable - closed,
        open_loop_unstable_poles=unstable,
        closed_loop_unstable_poles=closed,
        disk_margin=disk_margins(S, [[0]])[0][0] if len(signals) == 1 and not closed else None,
        _advice=sign_advice(P, K, delay) if closed and controller is not None else "",
    )
