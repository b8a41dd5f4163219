"""Campbell diagrams: natural frequencies over the hub speed, and the speeds at which a multiple of it meets one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from math import isfinite
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import DIGIT
from boomctl.printing import count, listed

_TURN = 2.0 * np.pi  # rad of a turn


@dataclass(frozen=True)
class CriticalSpeed:
    """Hub speed of which a multiple equals a natural frequency, so that an excitation of this order is in resonance.

    Attributes
    ----------
    order : float
        Multiple of the hub speed.
    mode : int
        Number of the mode, from 1, in the order of the frequencies.
    hub_speed : float
        Critical hub speed [rad/s].
    frequency_hz : float
        Natural frequency at this speed [Hz].

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.hub_beam(modes=3).campbell([0.0, 2.0, 4.0]).critical_speeds[0]
    CriticalSpeed: 3 x 0.986253 rad/s, mode 1 at 0.4709 Hz
    """

    order: float
    mode: int
    hub_speed: float
    frequency_hz: float

    def __repr__(self) -> str:
        return f"CriticalSpeed: {self.order:g} x {self.hub_speed:.6g} rad/s, mode {self.mode} at {self.frequency_hz:.4g} Hz"


@dataclass(frozen=True)
class CampbellDiagram:
    """Natural frequencies over the hub speed.

    Attributes
    ----------
    model : str
        Name of the beam's model.
    hub_speeds : (k,) ndarray
        Requested speeds below the divergence speed; if others were requested, also speeds just below it [rad/s].
    eigenfrequencies_hz : (k, n) ndarray
        Ascending at each speed [Hz].
    critical_speeds : tuple of CriticalSpeed
        Speeds at which a multiple of the hub speed equals a frequency, between the requested speeds, ascending.
    divergence_speed : float
        Hub speed at which the stiffness is lost [rad/s]; ``inf`` if it never is.
    orders : tuple of float
        Multiples of the hub speed.

    Examples
    --------
    >>> import boomctl as bc
    >>> diagram = bc.hub_beam(modes=3).campbell([0.0, 2.0, 4.0])
    >>> diagram
    CampbellDiagram: sfoam, 3 frequencies, 0 to 4 rad/s
      critical speeds: 3 x 0.9863 rad/s (mode 1), 2 x 1.511 rad/s (mode 1), 1 x 3.415 rad/s (mode 1)
    >>> diagram.eigenfrequencies_hz.shape  # speeds, frequencies
    (3, 3)
    """

    model: str
    hub_speeds: Array = field(repr=False)
    eigenfrequencies_hz: Array = field(repr=False)
    critical_speeds: tuple[CriticalSpeed, ...]
    divergence_speed: float
    orders: tuple[float, ...]

    def __repr__(self) -> str:
        span = f"{self.hub_speeds[0]:.6g} to {self.hub_speeds[-1]:.6g} rad/s"
        modes = count(self.eigenfrequencies_hz.shape[1], "frequency", "frequencies")
        lost = f"; stiffness lost at {self.divergence_speed:.6g} rad/s" if isfinite(self.divergence_speed) else ""
        met = [f"{c.order:g} x {c.hub_speed:.4g} rad/s (mode {c.mode})" for c in self.critical_speeds]
        return f"CampbellDiagram: {self.model}, {modes}, {span}{lost}\n  critical speeds: {listed(met)}"

    def plot(self, ax: Any = None, **style: Any) -> Any:
        """Draw the frequencies over the hub speed, its multiples, and circles at the critical speeds.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes; by default a new figure of pyplot.  The multiples are not drawn again on axes that already have a diagram.
        **style
            Line properties of matplotlib for the frequencies.

        Returns
        -------
        matplotlib.axes.Axes
            Axes drawn on.
        """
        return import_module("boomctl.plotting.rotating_beam").plot_campbell(self, ax, **style)


def campbell_diagram(
    model: str, frequencies: Callable[[float], Array], speeds: Array, orders: tuple[float, ...], lost: float
) -> CampbellDiagram:
    """Return a diagram from a function that returns the frequencies [Hz] at a hub speed below ``lost``."""
    from scipy import optimize  # long to import

    values = np.array([frequencies(float(speed)) for speed in speeds])
    result = []
    for order in orders:
        difference = values - order * speeds[:, None] / _TURN
        for mode in range(values.shape[1]):
            zeros = np.flatnonzero(difference[:, mode] == 0.0)
            roots = [float(speeds[k]) for k in zeros if speeds[k] > 0.0]

            def gap(speed: float, order: float = order, mode: int = mode) -> float:
                return float(frequencies(speed)[mode] - order * speed / _TURN)

            for k in np.flatnonzero(difference[:-1, mode] * difference[1:, mode] < 0.0):
                roots.append(float(optimize.brentq(gap, speeds[k], speeds[k + 1], rtol=DIGIT)))  # type: ignore[arg-type]
            result += [CriticalSpeed(order, mode + 1, root, order * root / _TURN) for root in roots]
    result.sort(key=lambda crossing: crossing.hub_speed)
    return CampbellDiagram(model, speeds, values, tuple(result), lost, orders)
