"""Poles and transmission zeros of a system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.looking.given import matrices
from boomctl.arrays import Array
from boomctl.lti.modal import sides, transmission_zeros
from boomctl.printing import between, count
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class PoleZeroResult:
    """Poles and transmission zeros.

    Attributes
    ----------
    poles, zeros : complex ndarray
        Ascending in size [rad/s]; in discrete time ``z``.
    input_labels, output_labels : tuple of str
        Between which signals the zeros are.
    dt : float
        Sampling time [s]; 0 in continuous time.
    """

    poles: Array = field(repr=False)
    zeros: Array = field(repr=False)
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    dt: float = 0.0

    def __repr__(self) -> str:
        side = sides(self.poles, self.dt)
        some = [f"{int((side > 0).sum())} unstable"] if (side > 0).any() else []
        some += [f"{int((side == 0).sum())} undamped or integrating"] if (side == 0).any() else []
        numbers = f"{count(len(self.poles), 'pole')}, {count(len(self.zeros), 'zero')}"
        slowest = self.poles[np.argmax(self.poles.real if not self.dt else np.abs(self.poles))] if len(side) else None
        last = "" if slowest is None else f"; slowest pole {complex(slowest.real, abs(slowest.imag)):.6g}"
        said = f" ({', '.join(some)})" if some else ""
        return f"PoleZeroResult: {between(self.input_labels, self.output_labels)}\n  {numbers}{said}{last}"

    @property
    def response(self) -> Any:
        """The same as python-control's ``PoleZeroData``."""
        from control.pzmap import PoleZeroData

        return PoleZeroData(self.poles, self.zeros, dt=self.dt or 0, sysname="system")

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw poles as crosses and zeros as circles, those of the lowest modes; lines of equal damping behind them.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        **style
            Of the marks, as matplotlib's lines take it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.looking").plot_pole_zero(self, ax, **style)


@one_blas_thread
def pzmap(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> PoleZeroResult:
    """Return the poles and the transmission zeros of a system.

    It has the short name that python-control gives to its map of poles and zeros.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction, or a result
        What is looked at.  Of a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) it is the closed loop; of a reduction the
        reduced system.
    inputs, outputs : str or sequence of str, optional
        Between which signals.  By default all; of a boom model, platform actuators and tips.

    Returns
    -------
    PoleZeroResult
        Poles and zeros; ``.plot()`` draws them, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown signals.

    Examples
    --------
    >>> import boomctl as bc
    >>> jolt, yaw = bc.split_symmetric(bc.spray_boom())
    >>> found = bc.pzmap(yaw, "suspension_anti", "stroke_anti")  # a force and where it acts: zeros between the poles
    >>> abs(found.poles[found.poles.imag > 0][:2]).round(2), abs(found.zeros[found.zeros.imag > 0][:1]).round(2)
    (array([ 1.54, 17.51]), array([4.66]))
    """
    result = matrices(system, inputs, outputs)
    poles, zeros = _ascending(result.poles), _ascending(transmission_zeros(result))
    return PoleZeroResult(poles, zeros, result.input_labels, result.output_labels, result.dt)


def _ascending(values: Array) -> Array:
    return values[np.lexsort((values.imag, np.abs(values)))]
