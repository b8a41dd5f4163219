"""Comparison of optimal and classical slews under the same torque limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, known, mapping, nonnegative, positive, real, sequence
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import compact, table_html
from boomctl.slew.plant import SlewPlant, plant_of
from boomctl.slew.problem import warn_of_turns
from boomctl.slew.result import SlewResult
from boomctl.slew.shapers import input_shaper, rest_to_rest_torque, spin_up_torque
from boomctl.slew.torque import TorqueProfile
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam

CLASSICAL = (
    ("bang-bang", "none"),
    ("smoothed", "none"),
    ("versine", "none"),
    ("bang-bang", "ZV"),
    ("bang-bang", "ZVD"),
    ("bang-bang", "EI"),
    ("versine", "ZV"),
)
SPIN_UPS = (
    ("constant", "none"),
    ("smooth", "none"),
    ("constant", "ZV"),
    ("constant", "ZVD"),
    ("constant", "EI"),
    ("smooth", "ZV"),
)
_CHANGES = (0.9, 1.1)  # factors of the beam's frequencies: the usual robustness test of shapers
# time points during the slew, and within 1.5 slowest periods after the end: resolution of the plots
_DURING, _AFTER = 401, 121


@dataclass(frozen=True, eq=False)
class SlewRow(TimeSeries):
    """Metrics and motion of one slew.

    Attributes
    ----------
    name : str
        Name of the slew.
    duration : float
        Duration [s].
    residual_vibration : float
        Largest tip displacement after the end [m].
    angle_error : float
        Mean error of the hub angle after the end [rad]; 0 for a spin-up, whose angle is free.
    speed_error : float
        Mean error of the hub speed after the end [rad/s].
    max_root_moment : float
        Largest bending moment at the clamp during the slew [N m].
    effort : float
        Integral of the torque squared [N^2 m^2 s].
    residual_vibration_low, residual_vibration_high : float
        Residual vibration with the beam's frequencies 10 % lower and higher [m].
    vibrations : ndarray, m
        Residual vibration for each tip mass of the comparison [m].
    torque_profile : TorqueProfile
        The torque over time.
    time, tip_displacement : ndarray, k
        Time points during and after the slew [s], and the tip displacement at them [m].
    """

    name: str
    duration: float
    residual_vibration: float
    angle_error: float
    speed_error: float
    max_root_moment: float
    effort: float
    residual_vibration_low: float
    residual_vibration_high: float
    vibrations: Array
    torque_profile: TorqueProfile
    time: Array
    tip_displacement: Array

    __repr__ = compact

    def _outputs(self) -> dict[str, Array]:
        return {"tip_displacement": self.tip_displacement}

    def _inputs(self) -> dict[str, Array]:
        return {"torque": self.torque_profile(self.time)}


@dataclass(frozen=True, eq=False)
class SlewComparison:
    """Slews of one beam through one angle, or spin-ups to one speed (angle None), under one torque limit.

    Attributes
    ----------
    angle : float or None
        Slew angle [rad]; None for spin-ups.
    torque_limit : float
        Largest torque either way [N m].
    rows : tuple of SlewRow
        Metrics and motion of each slew.
    final_speed : float
        Hub speed at the end [rad/s].
    tip_masses : ndarray, m
        Tip masses of the additional simulations [kg].
    """

    angle: float | None
    torque_limit: float
    rows: tuple[SlewRow, ...]
    final_speed: float = 0.0
    tip_masses: Array = field(default_factory=lambda: np.zeros(0))

    def __repr__(self) -> str:
        what = f"{self.angle:.6g} rad" if self.angle is not None else f"spin-ups to {self.final_speed:.6g} rad/s"
        lines = [
            f"  {x.name}: {x.duration:.4g} s, residual vibration {x.residual_vibration:.3g} m" for x in self.rows[:3]
        ]
        more = [f"  ... {len(self.rows) - 3} more"] if len(self.rows) > 3 else []
        return "\n".join([f"SlewComparison: {what}, {self.torque_limit:.6g} N m", *lines, *more])

    def _repr_html_(self) -> str:
        loads = [f"tip mass {mass:g} kg" for mass in self.tip_masses]
        heads = ("slew", "duration [s]", "vibration [m]", "10 % softer", "10 % stiffer", *loads, "root moment [N m]")
        rows = [
            (
                x.name,
                *(
                    f"{y:.4g}"
                    for y in (x.duration, x.residual_vibration, x.residual_vibration_low, x.residual_vibration_high)
                ),
                *(f"{y:.4g}" for y in (*x.vibrations, x.max_root_moment)),
            )
            for x in self.rows
        ]
        return table_html(repr(self).partition("\n")[0], heads, rows)

    def __getitem__(self, name: str) -> SlewRow:
        """Return a slew by its name."""
        known("slew", name, [line.name for line in self.rows])
        return next(line for line in self.rows if line.name == name)

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return [line.name for line in self.rows]

    def plot(self, ax: Any = None, *, names: Sequence[str] = (), **style: Any) -> Array:
        """Draw torques and tip displacements over time, vibration over duration and, if any, over tip masses.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on: the torque of each slew shown, the tip, the vibration, and the vibration over tip masses if
            there are any. If None, a new figure is created.
        names : sequence of str, optional
            Slews to draw over time, by default the first four. The vibration of all slews is drawn.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the line labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_slew_comparison(self, ax, names=names, **style)


@one_blas_thread
def compare_slews(
    system: AssumedModesBeam,
    angle: float | None,
    torque_limit: float,
    optimal: Mapping[str, SlewResult] | None = None,
    final_speed: float = 0.0,
    *,
    tip_masses: Sequence[float] = (),
) -> SlewComparison:
    """Simulate classical and planned optimal slews on a hub-beam and compare their metrics.

    The shapers are tuned to the first mode with the hub free. The frequencies are changed by 10 % through the beam's
    bending stiffness. The torques do not depend on the tip mass.

    Parameters
    ----------
    system : hub-beam
        Result of `hub_beam`.
    angle : float or None
        Slew angle [rad]; None for a spin-up.
    torque_limit : float
        Largest torque either way [N m].
    optimal : mapping of str to SlewResult, optional
        Planned slews by name.
    final_speed : float
        Hub speed at the end of a spin-up [rad/s].
    tip_masses : sequence of float
        Tip masses of additional simulations of each slew [kg].

    Returns
    -------
    SlewComparison
        Duration, residual vibration and effort of each slew; ``.plot()`` draws them.

    Raises
    ------
    TypeError, ValueError
        If an argument has the wrong type or is out of range, or `system` is not a hub-beam.

    Warns
    -----
    BoomctlWarning
        If the angle exceeds one revolution: it may be in degrees.

    Examples
    --------
    >>> import boomctl as bc
    >>> found = bc.slew.compare_slews(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> for name in ("bang-bang", "bang-bang, ZV"):
    ...     print(name, round(found[name].duration, 2), round(found[name].residual_vibration, 2))  # s, m
    bang-bang 2.2 3.72
    bang-bang, ZV 3.18 0.02
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> found = bc.slew.compare_slews(bc.hub_beam(modes=1), 1.0, 200.0, {"fast": fast}, tip_masses=(0.0, 0.5))
    >>> found["fast"].vibrations.round(2)  # m
    array([0.  , 3.64])
    """
    plant = plant_of(system)
    if plant.machine is None:
        raise TypeError(f"system = {type(system).__name__}: expected a hub-beam")
    limit = positive("torque_limit", torque_limit)
    planned = {} if optimal is None else mapping("optimal", optimal, "names to slews")
    for name, item in planned.items():
        instance(f"optimal[{name!r}]", item, SlewResult)
    if angle is not None:
        warn_of_turns(real("angle", angle))
    torques = {name: result.torque_profile for name, result in planned.items()}
    torques |= _classical(plant, angle, real("final_speed", final_speed), limit)
    others = [plant.machine.with_stiffness_factor(factor**2) for factor in _CHANGES]
    masses = [nonnegative("tip_masses", mass) for mass in sequence("tip_masses", tip_masses, "masses in kg")]
    loaded = [plant.machine.with_tip_mass(mass) for mass in masses]
    heaviest = plant_of(plant.machine.with_tip_mass(max(masses))).period if masses else 0.0
    lines = []
    for name, profile in torques.items():
        after = profile.duration + np.linspace(0.0, 1.5 * plant.period, _AFTER)
        t = np.concatenate([np.linspace(0.0, profile.duration, _DURING)[:-1], after])
        r = plant.machine.simulate(profile, t)
        low, high = (_vibration(item, profile, after) for item in others)
        later = profile.duration + np.linspace(0.0, 1.5 * heaviest, _AFTER)
        late = t >= after[0]
        lines.append(
            SlewRow(
                name=name,
                duration=profile.duration,
                residual_vibration=float(np.abs(r.tip_displacement[late]).max()),
                angle_error=0.0 if angle is None else _middle(r.hub_angle[late]) - angle,
                speed_error=_middle(r.hub_speed[late]) - final_speed,
                max_root_moment=float(np.abs(r.states @ plant.machine._root_moment_row).max()),
                effort=profile.effort,
                residual_vibration_low=low,
                residual_vibration_high=high,
                vibrations=np.array([_vibration(item, profile, later) for item in loaded]),
                torque_profile=profile,
                time=t,
                tip_displacement=r.tip_displacement,
            )
        )
    return SlewComparison(angle, limit, tuple(lines), final_speed, np.array(masses))


def _vibration(machine: AssumedModesBeam, profile: TorqueProfile, time: Array) -> float:
    """Return the largest tip displacement under a torque at given times [m]."""
    return float(np.abs(machine.simulate(profile, time).tip_displacement).max())


def _classical(plant: SlewPlant, angle: float | None, final_speed: float, limit: float) -> dict[str, TorqueProfile]:
    """Return classical torques by name: slews through an angle, or spin-ups if it is None."""
    if (angle is None) == (final_speed == 0.0):
        raise ValueError(f"final_speed = {final_speed:g}: expected an angle, or a speed not zero with angle None")
    assert plant.inertia is not None
    bodies = {"smoothed": "smoothed bang-bang", "constant": "constant torque", "smooth": "smooth torque"}
    torques = {}
    for shape, name in SPIN_UPS if angle is None else CLASSICAL:
        train, body = input_shaper(name, *plant.vibration), bodies.get(shape, shape)
        if angle is None:
            profile = spin_up_torque(shape, train, final_speed, plant.inertia, limit)
        else:
            profile = rest_to_rest_torque(shape, train, real("angle", angle), plant.inertia, limit)
        torques[body if name == "none" else f"{body}, {name}"] = profile
    return torques


def _middle(values: Array) -> float:
    return float(0.5 * (values.max() + values.min()))
