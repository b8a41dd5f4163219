"""What the scenes of the hub-beam have in common: the machine, who answers with which model and tolerance, and the judge."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.exudyn import exudyn_tip
from boomctl.lab.benchmark.peers.integrators import Motion, Ode, scipy_motion
from boomctl.lab.benchmark.scene import Setting, asked, there
from boomctl.rotating_beam.assumed_modes import ASSUMED_MODES, AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp
from boomctl.rotating_beam.parameters import HubBeamParameters

_ATOL = 1e-15  # m: of ours, so that the relative tolerance alone decides
_NAMES = {"geometrically-exact": "geometrically exact beam"}
_CASADI = ("IDAS", "CVODES")


@dataclass(frozen=True)
class Drive:
    """A manoeuvre, the instants at which the tip is asked for [s], and how a user writes both.

    Attributes
    ----------
    manoeuvre : SpinUp or SineTorque
    timepts : ndarray, k
    call : str
    """

    manoeuvre: SpinUp | SineTorque
    timepts: Array
    call: str

    def tip(self, beam: Any, rtol: float) -> Array:
        """Return the tip's displacement by this package [m]."""
        return beam.simulate(self.manoeuvre, self.timepts, rtol=rtol, atol=_ATOL).tip_displacement


def until(end: float) -> Array:
    """Return instants ten a second [s]."""
    return np.linspace(0.0, end, round(10.0 * end) + 1)


def machine(change: float = 0.0) -> HubBeamParameters:
    """Return the machine of Bai et al. (2009) with another length, of which everything depends."""
    p = HubBeamParameters()
    return replace(p, length=p.length * (1.0 + change))


def judge(exact: Array) -> Callable[[Array], float]:
    """Return what takes a displacement to its largest error, over the largest displacement."""
    scale = float(np.abs(exact).max())
    return lambda tip: float(np.abs(tip - exact).max()) / scale


def ours(drive: Drive, model: str, cases: Iterable[tuple[int, float]]) -> Iterator[Setting]:
    """Give this package's settings of a model, each of a number of modes and a relative tolerance."""
    for modes, rtol in cases:
        setting = asked(
            _NAMES.get(model, model.upper()),
            f"{modes} modes, rtol {rtol:.0e}",
            lambda change, modes=modes: hub_beam(machine(change), model, modes),
            lambda beam, rtol=rtol: drive.tip(beam, rtol),
            ours=True,
            call=f'bc.hub_beam(p, "{model}", {modes}).simulate({drive.call}, t, rtol={rtol:.0e}, atol=1e-15)',
        )
        # to the exact beam's motion its building is nothing
        yield setting if model in ASSUMED_MODES else replace(setting, hot=None)


def integrated(
    drive: Drive, model: str, modes: int, methods: Iterable[tuple[str, tuple[float, ...]]]
) -> Iterator[Setting]:
    """Give general-purpose integrators on the equations of a model, each method at some tolerances."""

    def made(method: str, tolerance: float, change: float) -> Motion:
        beam = AssumedModesBeam(machine(change), model, modes)
        if method in _CASADI:
            return Ode.of(beam, drive.manoeuvre).motion(drive.timepts, method, tolerance)
        return scipy_motion(beam, drive.manoeuvre, drive.timepts, method, tolerance)

    for method, tolerances in methods:
        name = f"{'CasADi' if method in _CASADI else 'solve_ivp'} {method}, {model.upper()}"
        for tolerance in tolerances:
            label = f"{modes} modes, rtol {tolerance:.0e}"
            setting = asked(name, label, partial(made, method, tolerance), lambda motion: motion())
            yield setting if method in _CASADI else replace(setting, hot=None)  # solve_ivp has nothing to keep


def in_exudyn(drive: Drive, cases: Iterable[tuple[int, float]]) -> Iterator[Setting]:
    """Give exudyn's settings, each of a number of elements and a time step [s]; none where it is not installed."""
    if not there("exudyn"):
        return
    for elements, step in cases:
        yield Setting(
            competitor="exudyn, ANCF cables",
            label=f"{elements} elements, {step:g} s",
            ours=False,
            cold=lambda change, n=elements, h=step: exudyn_tip(machine(change), drive.manoeuvre, drive.timepts, n, h),
        )
