"""Motion of the hub-beam, and result of a simulation."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple, final

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.rounding import EPS
from boomctl.lti.time_series import TimeSeries

# Factor on the most steps of a run above which a number predicted from a part of it is an error: it may be the hardest part.
HOPELESS = 2.0
CHUNK = 500  # Times evaluated at once; bounds the memory.
SMALL_DEFORMATION = 0.1  # of the length: the tip displacement up to which Bai et al. (2009) call a deformation small


@final
@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of hub and beam at k times, as returned by a solver.

    Attributes
    ----------
    tip : ndarray, k
        Transverse displacement of the free end in the hub's frame, m.
    small_deformation_until : callable
        Returns the time at which the displacement first exceeds a tenth of the length, s; inf if it never does.
    states : callable
        Returns coordinates and rates of hub and beam at the times, k x N each.
    error : float
        Estimated largest error of the free end's displacement, m.
    steps : int
        Number of integration steps.
    stages : tuple of str
        Methods that ran, in order.
    """

    tip: Array
    small_deformation_until: Callable[[], float]
    states: Callable[[], tuple[Array, Array]]
    error: float
    steps: int
    stages: tuple[str, ...]


def known_states(y: Array, rate: Array) -> tuple[Array, Array]:
    """Return coordinates and rates that are already computed: the `states` of a `Motion`, with bound arguments."""
    return y, rate


class Dynamics(NamedTuple):
    """Forces and inertias of a motion; meanings and units as in `SimulationResult`."""

    hub_acceleration: Array
    torque: Array
    inertia_torque: Array
    energy: Array
    angular_momentum: Array
    mass_matrix_margin: Array


class Details(NamedTuple):
    """Quantities that a `SimulationResult` computes on first access; meanings and units as there."""

    tip_extension: Array
    foreshortening: Array
    hub_angle: Array
    hub_speed: Array
    states: Array
    dynamics: Callable[[], Dynamics]


@final
@dataclass(frozen=True)
class SimulationResult(TimeSeries):
    """Motion of the hub-beam at the requested times.

    Arrays have one value per time (k of them) unless their shape is given. All quantities except the displacement of the
    free end are computed on first access.

    Attributes
    ----------
    model : str
        Name of the model, as in `hub_beam`.
    time : ndarray
        Times, s.
    tip_displacement : ndarray
        Transverse displacement v of the free end x = L in the hub's frame, m.
    tip_extension : ndarray
        Extension w_1 of the beam at x = L, as in Figs. 5b and 6b of Bai et al. (2009), m; zero for models without axial
        modes. The free end moves axially by ``tip_extension + foreshortening`` in the hub's frame.
    foreshortening : ndarray
        Axial displacement w_c at x = L due to bending at constant length, Eq. (3), m; <= 0, and zero for TLAM.
    hub_angle, hub_speed, hub_acceleration : ndarray
        Motion of the hub, rad, rad/s, rad/s^2.
    torque : ndarray
        Torque on the hub, N m: the one applied, or the one that the prescribed motion needs.
    inertia_torque : ndarray
        Q_theta, N m: the terms of the hub's equation that are quadratic in the velocities, on the side of the torque
        (Eq. 32; 37 for CFOAM). For SFOAM as printed it is the omitted term, evaluated along its motion.
    energy : ndarray
        Kinetic plus elastic energy of the model, J.
    angular_momentum : ndarray
        Angular momentum of the model about the hub's axis, kg m^2/s.
    states : ndarray, k x n
        States in the order and with the names of ``to_nlsys()``: coordinates (hub angle first), then their rates.
    small_deformation_until : float
        Time at which the transverse tip displacement first exceeds a tenth of the length, s; inf if it never does up to the
        last requested time.
    error_estimate : float
        Estimated largest error of the tip displacement, m. For assumed-modes models it is the solver's error. For a
        geometrically exact beam it includes the truncation of its polynomials, for which a beam with a specified number is
        simulated again on first access.
    n_steps : int
        Number of integration steps.
    details : callable
        Computes the quantities that are not stored.
    stages : tuple of str
        Solution methods, in the order in which they ran. A method that did not reach the tolerance is marked with
        "(given up)"; the next one then solved the same motion.

    Examples
    --------
    >>> import boomctl as bc
    >>> beam = bc.hub_beam(modes=2)
    >>> run = beam.simulate(bc.spin_up(final_speed=2.0, duration=10.0), [0.0, 5.0, 10.0, 20.0])
    >>> run.tip_displacement[1:].round(3)  # [m], as run["tip_displacement"]
    array([-0.454,  0.008,  0.012])
    >>> run.small_deformation_until
    inf
    """

    model: str
    time: Array
    tip_displacement: Array
    n_steps: int
    details: Callable[[], Details] = field(repr=False, compare=False)
    _error: Callable[[], float] = field(repr=False, compare=False)
    _small_until: Callable[[], float] = field(repr=False, compare=False)
    stages: tuple[str, ...] = ()

    def __repr__(self) -> str:
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s, {len(self.time)} times"
        error = f"{', '.join(self.stages)}: {self.n_steps} steps, error estimated {self.error_estimate:.1e}"
        tip = f"largest tip displacement {np.abs(self.tip_displacement).max():.6g} m"
        if np.isfinite(self.small_deformation_until):
            tip += f", beyond a tenth of the length after {self.small_deformation_until:.4g} s"
        return f"SimulationResult: {self.model}, {span}\n  {tip}\n  {error}"

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw torque, hub and tip over time, and mark where the deformation is not small.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes for torque, hub angle, hub speed and tip displacement; by default a new figure of pyplot.
        **style
            Line properties of matplotlib; a ``label`` is prefixed to the curves' names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Axes drawn on, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.rotating_beam").plot_simulation(self, ax, **style)

    def _outputs(self) -> dict[str, Array]:
        names = ("hub_angle", "hub_speed", "tip_displacement", "tip_extension", "foreshortening")
        return {name: getattr(self, name) for name in names}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque}

    def __figures__(self) -> dict[str, float]:
        """Return the values that a comparison shows."""
        return {
            "tip displacement: rms [m]": float(np.sqrt(np.mean(self.tip_displacement**2))),
            "tip displacement: peak [m]": float(np.abs(self.tip_displacement).max()),
            "torque: rms [N m]": float(np.sqrt(np.mean(self.torque**2))),
            "torque: peak [N m]": float(np.abs(self.torque).max()),
            "final hub angle [rad]": float(self.hub_angle[-1]),
        }

    @cached_property
    def error_estimate(self) -> float:
        """Estimated largest error of the tip displacement, m."""
        return self._error()

    @cached_property
    def small_deformation_until(self) -> float:
        """Time at which the tip displacement first exceeds a tenth of the length, s."""
        return self._small_until()

    @cached_property
    def _details(self) -> Details:
        return self.details()

    @cached_property
    def _dynamics(self) -> Dynamics:
        return self._details.dynamics()

    @property
    def tip_extension(self) -> Array:
        """Extension w_1 of the beam at x = L, m."""
        return self._details.tip_extension

    @property
    def foreshortening(self) -> Array:
        """Axial displacement w_c at x = L due to bending at constant length, m."""
        return self._details.foreshortening

    @property
    def hub_angle(self) -> Array:
        """Hub angle, rad."""
        return self._details.hub_angle

    @property
    def hub_speed(self) -> Array:
        """Hub speed, rad/s."""
        return self._details.hub_speed

    @property
    def hub_acceleration(self) -> Array:
        """Hub acceleration, rad/s^2."""
        return self._dynamics.hub_acceleration

    @property
    def torque(self) -> Array:
        """Torque on the hub, N m."""
        return self._dynamics.torque

    @property
    def inertia_torque(self) -> Array:
        """Q_theta, N m."""
        return self._dynamics.inertia_torque

    @property
    def energy(self) -> Array:
        """Kinetic plus elastic energy, J."""
        return self._dynamics.energy

    @property
    def angular_momentum(self) -> Array:
        """Angular momentum about the hub's axis, kg m^2/s."""
        return self._dynamics.angular_momentum

    @property
    def states(self) -> Array:
        """States in the order of ``to_nlsys()``, k x n."""
        return self._details.states


def small_deformation_until(
    time: Array, tip_displacement: Array, length: float, tip_rate: Callable[[slice], Array]
) -> float:
    """Return the time at which ``|tip_displacement|`` first exceeds ``length / 10``, s; inf if it never does.

    Parameters
    ----------
    time, tip_displacement : ndarray, k
        Times [s] and transverse displacements of the free end [m].
    length : float
        Length of the beam, m.
    tip_rate : callable
        Returns the rates of the displacement at a slice of the times, m/s; the displacement between two is a cubic.
    """
    limit = SMALL_DEFORMATION * length
    outside = np.flatnonzero(np.abs(tip_displacement) > limit)
    if outside.size == 0:
        return math.inf
    last = int(outside[0])
    if last == 0:
        return float(time[0])
    first, side = last - 1, np.sign(tip_displacement[last])
    step = time[last] - time[first]
    before, after = (float(side * tip_displacement[end] - limit) for end in (first, last))
    rates = (side * step * tip_rate(slice(first, last + 1))).tolist()
    low, high = 0.0, 1.0
    while high - low > EPS:
        s = 0.5 * (low + high)
        cubic = before * (1 + 2 * s) * (1 - s) ** 2 + after * s**2 * (3 - 2 * s)
        cubic += rates[0] * s * (1 - s) ** 2 - rates[1] * s**2 * (1 - s)
        low, high = (low, s) if cubic > 0.0 else (s, high)
    return float(time[first] + high * step)
