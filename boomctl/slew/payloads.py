"""What one torque does to several payloads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, mapping, nonnegative, sequence
from boomctl.lti.time_series import TimeSeries
from boomctl.printing import compact, table_html
from boomctl.slew.plant import SlewMachine, plant_of
from boomctl.slew.result import SlewResult
from boomctl.threads import one_blas_thread

_SWEEP = 21  # payloads of a curve of vibrations: it is drawn
_COARSE = {"rtol": 1e-5, "atol": 1e-6}  # a tenth of what a picture shows
# instants on the way, after the end, and after the end in a sweep: all are drawn
_DURING, _AFTER, _SWEPT = 301, 121, 61


@dataclass(frozen=True, eq=False)
class PayloadLine(TimeSeries):
    """One slew with one payload.

    Attributes
    ----------
    slew : str
        Name of the slew.
    tip_mass : float
        The payload [kg].
    planned : bool
        Whether the slew was planned for it.
    peak_tip : float
        Largest tip displacement on the way [m].
    vibration : float
        Largest tip displacement after the end [m].
    angle_error : float
        Error of the hub angle, its mean after the end [rad].
    time, tip_displacement : ndarray, k
        Instants on the way and afterwards [s], and the tip displacement then [m].
    """

    slew: str
    tip_mass: float
    planned: bool
    peak_tip: float
    vibration: float
    angle_error: float
    time: Array
    tip_displacement: Array

    __repr__ = compact

    def _outputs(self) -> dict[str, Array]:
        return {"tip_displacement": self.tip_displacement}


@dataclass(frozen=True, eq=False)
class PayloadComparison:
    """Slews with several payloads.

    Attributes
    ----------
    lines : tuple of PayloadLine
        One for each slew and payload.
    durations : dict of str to float
        How long each slew takes [s].
    masses : ndarray, k
        A fine range of payloads [kg].
    vibrations : dict of str to ndarray
        What each slew leaves over that range [m].
    """

    lines: tuple[PayloadLine, ...]
    durations: dict[str, float]
    masses: Array
    vibrations: dict[str, Array]

    def __repr__(self) -> str:
        lines = []
        for name, duration in list(self.durations.items())[:3]:
            worst = self.worst(name)
            lines.append(
                f"  {name}: {duration:.4g} s, vibration up to {worst.vibration:.3g} m (at {worst.tip_mass:.4g} kg)"
            )
        more = [f"  ... {len(self.durations) - 3} more"] if len(self.durations) > 3 else []
        masses = ", ".join(f"{mass:.4g}" for mass in sorted({line.tip_mass for line in self.lines}))
        return "\n".join([f"PayloadComparison: tip masses {masses} kg", *lines, *more])

    def _repr_html_(self) -> str:
        heads = ("slew", "tip mass [kg]", "planned for", "peak tip [m]", "vibration [m]", "angle error [rad]")
        rows = [
            (
                x.slew,
                f"{x.tip_mass:.4g}",
                "yes" if x.planned else "no",
                *(f"{y:.4g}" for y in (x.peak_tip, x.vibration, x.angle_error)),
            )
            for x in self.lines
        ]
        return table_html("Slews with several payloads", heads, rows)

    def worst(self, slew: str, planned: bool | None = None) -> PayloadLine:
        """Return the payload with which a slew leaves most vibration.

        Parameters
        ----------
        slew : str
            Name of the slew.
        planned : bool, optional
            True: only of payloads that the slew was planned for.  False: only of others.  By default of all.

        Returns
        -------
        PayloadLine
            The slew with that payload.
        """
        lines = [line for line in self.lines if line.slew == slew and planned in (None, line.planned)]
        return max(lines, key=lambda line: line.vibration)

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw tip displacements over time and vibration over payload.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: one a slew, and the vibration; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it; a ``label`` stands before their names.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting").plot_payloads(self, ax, **style)


@one_blas_thread
def compare_payloads(
    slews: Mapping[str, SlewResult], tip_masses: Sequence[float], nominal: float = 0.0
) -> PayloadComparison:
    """Play slews of a hub-beam from rest to rest with several payloads.

    Parameters
    ----------
    slews : mapping of str to SlewResult
        The slews by name; all of the same beam.
    tip_masses : sequence of float
        The payloads [kg].
    nominal : float
        The tip mass of the beam that all slews were planned for [kg]; some may be planned for others too.

    Returns
    -------
    PayloadComparison
        Vibration and errors of each slew with each payload; ``.plot()`` draws them.

    Raises
    ------
    TypeError, ValueError
        Slews of a linear system; a bad mass; no mass.

    Examples
    --------
    >>> import boomctl as bc
    >>> fast = bc.optimal_slew(bc.hub_beam(modes=1), angle=1.0, torque_limit=200.0)
    >>> found = bc.slew.compare_payloads({"fast": fast}, [0.0, 0.5])
    >>> [(line.tip_mass, round(line.vibration, 2)) for line in found.lines]  # kg, m
    [(0.0, 0.0), (0.5, 3.64)]
    """
    masses = [nonnegative("tip_masses", mass) for mass in sequence("tip_masses", tip_masses, "masses in kg")]
    for name, slew in mapping("slews", slews, "names to slews").items():
        instance(f"slews[{name!r}]", slew, SlewResult)
    if not masses or not slews:
        raise ValueError("tip_masses: expected one payload at least, and one slew")
    machine = next(iter(slews.values())).plan.problem.plants[0].machine
    if machine is None:
        raise TypeError("slews: expected those of a hub-beam")
    rest = 1.5 * plant_of(machine.with_tip_mass(max(masses))).period
    lines = tuple(
        _line(name, slew, machine, mass, planned=mass in (nominal, *slew.plan.problem.tip_masses), rest=rest)
        for name, slew in slews.items()
        for mass in masses
    )
    sweep = np.linspace(min(masses), max(masses), _SWEEP)
    vibrations = {}
    for name, slew in slews.items():
        after, history = slew.duration + np.linspace(0.0, rest, _SWEPT), slew.history
        loaded = (machine.with_tip_mass(float(mass)) for mass in sweep)
        motions = (each.simulate(history, after, **_COARSE) for each in loaded)
        vibrations[name] = np.array([np.abs(motion.tip_displacement).max() for motion in motions])
    return PayloadComparison(lines, {name: slew.duration for name, slew in slews.items()}, sweep, vibrations)


def _line(name: str, slew: SlewResult, machine: SlewMachine, mass: float, *, planned: bool, rest: float) -> PayloadLine:
    """Play one slew with one payload, and watch it for a time after its end [s]."""
    history, angle = slew.history, slew.plan.problem.angle
    t = np.concatenate([np.linspace(0.0, slew.duration, _DURING)[:-1], slew.duration + np.linspace(0.0, rest, _AFTER)])
    r = machine.with_tip_mass(mass).simulate(history, t)
    late, tip = t >= slew.duration, np.abs(r.tip_displacement)
    angles = r.hub_angle[late]
    error = 0.0 if angle is None else float(0.5 * (angles.max() + angles.min()) - angle)
    return PayloadLine(
        slew=name,
        tip_mass=mass,
        planned=planned,
        peak_tip=float(tip[~late].max()),
        vibration=float(tip[late].max()),
        angle_error=error,
        time=t,
        tip_displacement=r.tip_displacement,
    )
