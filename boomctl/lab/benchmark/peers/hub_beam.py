"""What the scenes of the hub-beam have in common: the machine, who answers with which model and tolerance, and the judge."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.exudyn import exudyn_available, exudyn_tip
from boomctl.lab.benchmark.peers.integrators import (
    Motion,
    casadi_spin_up,
    casadi_torque,
    scipy_spin_up,
    scipy_torque,
)
from boomctl.lab.benchmark.scene import Setting
from boomctl.rotating_beam.assumed_modes import ASSUMED_MODES, AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp
from boomctl.rotating_beam.parameters import HubBeamParameters

_ATOL = 1e-15  # m: of ours, so that the relative tolerance alone decides
_NAMES = {"geometrically-exact": "geometrically exact beam"}


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

    def in_scipy(self, beam: AssumedModesBeam, method: str, tolerance: float) -> Motion:
        """Return the same motion in one of ``solve_ivp``'s methods."""
        if isinstance(self.manoeuvre, SineTorque):
            return scipy_torque(beam, self.manoeuvre, method, self.timepts)(tolerance)
        return scipy_spin_up(beam, method, self.timepts)(tolerance)

    def in_casadi(self, beam: AssumedModesBeam, method: str, tolerance: float) -> Motion:
        """Return the same motion in one of CasADi's integrators."""
        if isinstance(self.manoeuvre, SineTorque):
            return casadi_torque(beam, self.manoeuvre, method, self.timepts)(tolerance)
        return casadi_spin_up(beam, method, self.timepts)(tolerance)


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

        def tip(beam: Any, rtol: float = rtol) -> Array:
            return drive.tip(beam, rtol)

        def cold(change: float, modes: int = modes, tip: Callable[[Any], Array] = tip) -> Array:
            return tip(hub_beam(machine(change), model, modes))

        yield Setting(
            competitor=_NAMES.get(model, model.upper()),
            label=f"{modes} modes, rtol {rtol:.0e}",
            ours=True,
            cold=cold,
            hot=tip if model in ASSUMED_MODES else None,  # to the exact beam's motion its building is nothing
            prepare=lambda modes=modes: hub_beam(machine(), model, modes),
            call=f'bc.hub_beam(p, "{model}", {modes}).simulate({drive.call}, t, rtol={rtol:.0e}, atol=1e-15)',
        )


def integrated(
    drive: Drive, model: str, modes: int, methods: Iterable[tuple[str, tuple[float, ...]]]
) -> Iterator[Setting]:
    """Give general-purpose integrators on the equations of a model, each method at some tolerances."""
    for method, tolerances in methods:
        casadi = method in ("IDAS", "CVODES")
        for tolerance in tolerances:

            def build(
                change: float, method: str = method, casadi: bool = casadi, tolerance: float = tolerance
            ) -> Motion:
                beam = AssumedModesBeam(machine(change), model, modes)
                return (
                    drive.in_casadi(beam, method.lower(), tolerance)
                    if casadi
                    else drive.in_scipy(beam, method, tolerance)
                )

            yield Setting(
                competitor=f"{'CasADi' if casadi else 'solve_ivp'} {method}, {model.upper()}",
                label=f"{modes} modes, rtol {tolerance:.0e}",
                ours=False,
                cold=lambda change, build=build: build(change)(),
                hot=(lambda motion: motion()) if casadi else None,  # solve_ivp has nothing to keep
                prepare=lambda build=build: build(0.0),
            )


def in_exudyn(drive: Drive, cases: Iterable[tuple[int, float]]) -> Iterator[Setting]:
    """Give exudyn's settings, each of a number of elements and a time step [s]; none where it is not installed."""
    if not exudyn_available():
        return
    for elements, step in cases:
        yield Setting(
            competitor="exudyn, ANCF cables",
            label=f"{elements} elements, {step:g} s",
            ours=False,
            cold=lambda change, n=elements, h=step: exudyn_tip(machine(change), drive.manoeuvre, drive.timepts, n, h),
        )


def missing_exudyn() -> tuple[str, ...]:
    """Name exudyn where it is not installed."""
    return () if exudyn_available() else ("exudyn: not installed",)
