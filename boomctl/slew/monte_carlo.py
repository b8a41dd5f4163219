"""A tracked slew, followed many times by machines that differ at random."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, known, plain_array, real
from boomctl.printing import count


@dataclass(frozen=True, repr=False, eq=False)
class TrackingStudy:
    """Many runs of a tracked slew.

    Attributes
    ----------
    time : (N,) ndarray
        Instants [s].
    samples : dict of str to (runs,) ndarray
        "tip_mass" [kg], "stiffness" (what multiplies it), "friction" and "disturbance_torque" [N m] of each run.
    outputs : dict of str to (runs, N) ndarray
        "hub_angle" [rad], "hub_speed" [rad/s], "tip_displacement" [m], "root_moment" [N m], and the "torque" [N m].
    reference : dict of str to (N,) ndarray
        The same in the plan.
    residual_vibration : (runs,) ndarray
        Largest distance of the tip from the plan within 1.5 slowest periods after the end, or after what was waited [m].
    angle_error : (runs,) ndarray
        Distance of the hub from the plan at the last instant [rad].
    settling_time : float
        Time after the end from which a vibration counts [s].
    duration : float
        Of the slew [s].
    feedback : bool
        Whether the controller reacted.
    seed : int
        Of what was drawn.
    seeds : (runs,) ndarray
        Of the noise of each run.
    error_estimate : float
        Estimated largest error of the tip and of the hub angle times the radius of the free end [m].
    """

    time: Array
    samples: dict[str, Array]
    outputs: dict[str, Array]
    reference: dict[str, Array]
    residual_vibration: Array
    angle_error: Array
    settling_time: float
    duration: float
    feedback: bool
    seed: int
    seeds: Array
    error_estimate: float

    def __repr__(self) -> str:
        ranges = [
            f"{name} {row.min():.3g} to {row.max():.3g}" for name, row in self.samples.items() if np.ptp(row) > 0.0
        ]
        middle, most = np.quantile(self.residual_vibration, [0.5, 0.95])
        off = np.quantile(np.abs(self.angle_error), 0.95)
        how = "with feedback" if self.feedback else "plan alone"
        waited = f" from {self.settling_time:.3g} s after the end" if self.settling_time else ""
        runs = f"{count(len(self.residual_vibration), 'run')} {how}, seed {self.seed}"
        return (
            f"TrackingStudy: {runs}\n  {'; '.join(ranges) or 'all alike'}\n"
            f"  vibration{waited}: {middle:.3g} m in the middle, {most:.3g} m in 95 %, "
            f"{self.residual_vibration.max():.3g} m at most\n"
            f"  hub off by {off:.3g} rad at the end in 95 %"
        )

    def __getitem__(self, name: str) -> Array:
        """Return an output of all runs by name."""
        return self.outputs[known("output", name, tuple(self.outputs))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.outputs)

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw hub angle, tip displacement and torque of all runs: the middle one, the middle half, and nine of ten.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Where to draw: hub angle less the plan, tip displacement, torque and the distribution of what vibration is
            left; by default a new figure of pyplot.
        **style
            Of the curves, as matplotlib's lines take it.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Those drawn on, in the order in which ``ax`` names them.
        """
        return import_module("boomctl.plotting.slew").plot_tracking_study(self, ax, **style)


def drawn(name: str, given: Any, runs: int, rng: np.random.Generator, center: float | None, nominal: float) -> Array:
    """Return one number a run, as a distribution is given.

    Parameters
    ----------
    given : None, float, (low, high), or (runs,) array_like
        Nominal; a number: the same in all runs, or a relative half-width where there is a center; even between two; or as
        listed, which two numbers of two runs are.
    center : float or None
        Around which a number is a relative half-width.

    Raises
    ------
    TypeError, ValueError
    """
    even = rng.random(runs)  # drawn always, so that one distribution does not change the others
    if given is None:
        return np.full(runs, nominal)
    values = plain_array(name, given)
    if values.ndim == 0:
        width = real(name, given)
        if center is None:
            return np.full(runs, width)
        if not 0.0 <= width < 1.0:
            raise ValueError(f"{name} = {exactly(width)}: expected a half-width from 0 to less than 1, or two ends")
        return center * (1.0 + width * (2.0 * even - 1.0))
    if values.shape == (2,) and runs != 2:
        low, high = (real(f"{name}[{i}]", item) for i, item in enumerate(values.tolist()))
        if low > high:
            raise ValueError(f"{name} = ({low:g}, {high:g}): expected the lower end first")
        return low + (high - low) * even
    if values.shape != (runs,):
        raise ValueError(
            f"{name} has shape {values.shape}; expected a number, the two ends of a range, or one for each of {runs} runs"
        )
    return np.array([real(f"{name}[{i}]", item) for i, item in enumerate(values.tolist())])
