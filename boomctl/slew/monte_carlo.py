"""Monte Carlo study of a tracked slew with random machine parameters."""

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
    """Monte Carlo study of a tracked slew.

    Attributes
    ----------
    time : (N,) ndarray
        Time points [s].
    samples : dict of str to (runs,) ndarray
        "tip_mass" [kg], "stiffness" (factor), "friction" and "disturbance_torque" [N m] of each run.
    outputs : dict of str to (runs, N) ndarray
        "hub_angle" [rad], "hub_speed" [rad/s], "tip_displacement" [m], "root_moment" [N m], and the "torque" [N m].
    reference : dict of str to (N,) ndarray
        The same outputs in the plan.
    residual_vibration : (runs,) ndarray
        Largest distance of the tip from the plan within 1.5 slowest periods after the end and `settling_time` [m].
    angle_error : (runs,) ndarray
        Deviation of the hub from the plan at the last time [rad].
    settling_time : float
        Time after the end at which the evaluation of the vibration starts [s].
    duration : float
        Duration of the slew [s].
    feedback : bool
        True if the controller was active.
    seed : int
        Seed of the random parameters.
    seeds : (runs,) ndarray
        Seeds of the noise of each run.
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
        how = "with feedback" if self.feedback else "feedforward only"
        waited = f" from {self.settling_time:.3g} s after the end" if self.settling_time else ""
        runs = f"{count(len(self.residual_vibration), 'run')} {how}, seed {self.seed}"
        return (
            f"TrackingStudy: {runs}\n  {'; '.join(ranges) or 'no spread'}\n"
            f"  vibration{waited}: median {middle:.3g} m, 95 % below {most:.3g} m, "
            f"maximum {self.residual_vibration.max():.3g} m\n"
            f"  hub angle error at the end: 95 % below {off:.3g} rad"
        )

    def __getitem__(self, name: str) -> Array:
        """Return an output of all runs by name."""
        return self.outputs[known("output", name, tuple(self.outputs))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.outputs)

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw hub angle, tip displacement and torque of all runs: median, quartiles, and the central 90 %.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on: hub angle less the plan, tip displacement, torque and the distribution of the residual
            vibration. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes, in the order of ``ax``.
        """
        return import_module("boomctl.plotting.slew").plot_tracking_study(self, ax, **style)


def drawn(
    name: str, distribution: Any, runs: int, rng: np.random.Generator, center: float | None, nominal: float
) -> Array:
    """Return a sample of a distribution, one value per run.

    Parameters
    ----------
    distribution : None, float, (low, high), or (runs,) array_like
        None: nominal. Number: the same in all runs, or a relative half-width if there is a center. Two numbers: uniform
        between them. Array: one value per run; with two runs, two numbers are an array.
    center : float or None
        Center of the relative half-width.

    Raises
    ------
    TypeError, ValueError
    """
    even = rng.random(runs)  # always drawn, so that the samples do not depend on each other
    if distribution is None:
        return np.full(runs, nominal)
    values = plain_array(name, distribution)
    if values.ndim == 0:
        width = real(name, distribution)
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
