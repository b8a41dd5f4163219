"""Nyquist curve of a loop, its encirclements of -1, and the critical disk.

With ``L`` the loop's response under negative feedback, ``det(I + L)`` is the product of ``s - p`` over the closed loop's
poles, divided by the product over the open loop's poles.  With open-loop poles on the axis passed on the right, its winding
number about zero is the number of unstable open-loop poles minus the number of unstable closed-loop poles (Nyquist 1932): the
encirclements are computed from the poles.

A sampled loop is evaluated through the bilinear transformation, which maps the unit circle to the imaginary axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.looking.given import looked_at, matrices
from boomctl.analysis.loops import joined, sign_advice
from boomctl.analysis.margins import DiskMargin, grid_of_loop, single_disk
from boomctl.arrays import Array
from boomctl.checks import no_signals, nonnegative
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import DRAWN, smooth_curve
from boomctl.lti.modal import boundary_sides, diagonalized, sides
from boomctl.lti.system import controller_of, of, series, static
from boomctl.printing import count, listed
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
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
        disk_margin=single_disk(S) if len(signals) == 1 and not closed else None,
        _advice=sign_advice(P, K, delay) if closed and controller is not None else "",
    )
