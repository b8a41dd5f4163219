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
        In ascending order of modulus [rad/s]; ``z`` in discrete time.
    input_labels, output_labels : tuple of str
        Signals of the zeros.
    dt : float
        Sampling time [s]; 0 for continuous time.
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
        kinds = f" ({', '.join(some)})" if some else ""
        return f"PoleZeroResult: {between(self.input_labels, self.output_labels)}\n  {numbers}{kinds}{last}"

    @property
    def response(self) -> Any:
        """Poles and zeros as python-control's ``PoleZeroData``."""
        from control.pzmap import PoleZeroData

        return PoleZeroData(self.poles, self.zeros, dt=self.dt or 0, sysname="system")

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw poles as crosses and zeros as circles, for the lowest modes, over lines of equal damping.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Marker properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.looking").plot_pole_zero(self, ax, **style)


@one_blas_thread
def pzmap(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction | Any,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
) -> PoleZeroResult:
    """Return the poles and the transmission zeros of a system.

    The name is python-control's short name of ``pole_zero_map``.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace or TransferFunction, or a result
        System to evaluate.  For a design (``lqr``, ``lqg``, ``h2``, ``h_infinity``) the closed loop, for a reduction the
        reduced system.
    inputs, outputs : str or sequence of str, optional
        Signals.  If None, all signals; for a boom model, platform actuators and tips.

    Returns
    -------
    PoleZeroResult
        Poles and zeros; ``.plot()`` draws them, ``.response`` is python-control's.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type or a signal is unknown.

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
