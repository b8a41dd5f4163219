"""Sampled loops with a limited control in python-control, and in ``solve_ivp`` restarted at each sample."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from boomctl.arrays import Array
from boomctl.lti.python_control import control


@dataclass(frozen=True)
class Loop:
    """A sampled loop: the controller reads at each sample, its limited control is held to the next.

    Attributes
    ----------
    rate : callable
        Takes time, state and control to the rate of the state.
    read : callable
        Takes index of the sample and state to what is measured, and what is compared.
    law : control.StateSpace
        The controller, discrete.
    limit : float
        Of each control.
    time : ndarray
        The samples [s].
    states : int
        Number of states of the plant.
    """

    rate: Callable[[float, Any, Any], Any]
    read: Callable[[int, Array], tuple[Array, Array]]
    law: control.StateSpace
    limit: float
    time: Array
    states: int

    def advanced(self, advance: Callable[[int, Array, Array], Array], kind: Any = float) -> Array:
        """Return what is compared; ``advance`` takes index, state and control to the state at the next sample."""
        law, x, state = self.law, np.zeros(self.states, kind), np.zeros(self.law.nstates, kind)
        found = []
        for k in range(len(self.time)):
            measured, compared = self.read(k, x)
            found.append(np.asarray(compared, float))
            if k < len(self.time) - 1:
                u = np.clip(law.C @ state + law.D @ measured, -self.limit, self.limit)
                state = law.A @ state + law.B @ measured
                x = advance(k, x, u)
        return np.array(found)

    def restarted(self, method: str, rtol: float) -> Array:
        """Return what is compared, by ``solve_ivp`` from each sample to the next."""
        options = {"rtol": max(rtol, 3e-14), "atol": 1e-3 * rtol}

        def advance(k: int, x: Array, u: Array) -> Array:
            ends = self.time[k], self.time[k + 1]
            return solve_ivp(lambda t, x: self.rate(t, x, u), ends, x, method, **options).y[:, -1]

        return self.advanced(advance)


def interconnected(
    plant: Any, law: control.StateSpace, limit: float, inputs: list[str], outputs: list[str], *more: Any
) -> control.NonlinearIOSystem:
    """Return python-control's loop of a plant, a controller and a limit of each control.

    Parameters
    ----------
    plant : control.StateSpace or control.NonlinearIOSystem
    law : control.StateSpace
        In the plant's time; its inputs are outputs of the plant or inputs of the loop, its outputs inputs of the plant.
    limit : float
    inputs, outputs : list of str
        Of the loop.
    *more
        Further systems of the loop.
    """
    names = [str(name) for name in law.output_labels]
    asked = [f"asked_{name}" for name in names]
    law = control.ss(law.A, law.B, law.C, law.D, plant.dt, inputs=law.input_labels, outputs=asked, name="law")

    def clipped(t: float, x: Array, u: Array, params: dict[str, Any]) -> Array:
        return np.clip(u, -limit, limit)

    limits = control.nlsys(None, clipped, inputs=asked, outputs=names, dt=plant.dt, name="limits")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # outputs that no one reads
        return control.interconnect(
            [plant, law, limits, *more], inplist=inputs, inputs=inputs, outlist=outputs, outputs=outputs
        )


def responded(loop: control.NonlinearIOSystem, time: Array, inputs: Array, method: str, rtol: float) -> Array:
    """Return the outputs of a loop by ``input_output_response``, (samples, outputs)."""
    options = {"rtol": rtol, "atol": 1e-3 * rtol}
    found = control.input_output_response(loop, time, inputs, solve_ivp_method=method, solve_ivp_kwargs=options)
    return np.asarray(found.outputs).reshape(-1, len(time)).T
