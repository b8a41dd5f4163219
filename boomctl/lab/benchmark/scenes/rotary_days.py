"""A motor with a flexible beam, measured on four days: six parameters, and a sampled loop proved for what they leave open."""

from functools import cache
from math import inf
from typing import Any

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from boomctl.analysis.box.robustness import RobustStability, robust_stability
from boomctl.analysis.box.worst_case import WorstCase, worst_case
from boomctl.analysis.loops import feedback_loop
from boomctl.arrays import Array
from boomctl.identification.fit import fit
from boomctl.identification.result import FitResult
from boomctl.lab.benchmark.promise import Who, exact, number, seconds, times_as_fast
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.lti.python_control import control
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.discretise import discretize

_RULER = HubBeamParameters(0.4, 7800.0, 2e-5, 2e11, 1.667e-12, 2e-3, 0.02)  # of steel, 400 x 20 x 1 mm
_NAMES: tuple[str, ...] = ("gain", "friction", "youngs_modulus", "damping_ratio", "hub_inertia", "tip_mass")
# as drawn, and as it is in the middle of the days
_BEGIN: dict[str, float] = dict(zip(_NAMES, (1.0, 5e-3, 2e11, 0.01, 2e-3, 5e-3), strict=True))
_TRUE: dict[str, float] = dict(zip(_NAMES, (0.91, 8e-3, 1.86e11, 0.014, 2.2e-3, 8e-3), strict=True))  # SI units
_OMEGA = 2.0 * np.pi * np.geomspace(0.5, 40.0, 100)
_DAYS, _APART = 4, 0.01  # the last one is left out; deviation of each parameter from day to day
_ERRORS, _REPEATS = 0.03, (2, 12)  # of one measurement; of measurements a day
_STEP, _DELAY, _FASTEST = 0.004, 0.001, 300.0  # s; s, from sample to torque; rad/s, pole of the derivative
_TOLERANCE = 0.05  # of the worst case
_DRAWS: dict[Extent, int] = {"quick": 50, "whole": 400}  # points of the box whose responses make the band
_JUDGES = 30  # machines of the box that judge what is proved of all of them
_INSIDE = "points of the day left out inside the band [%]"


def rig(p: dict[str, float]) -> SecondOrderModel:
    """Return motor and beam: torque asked for, with a gain, and a force on the tip; the hub's angle, and the tip's place."""
    beam = hub_beam(_RULER, model="sfoam", modes=2, **{name: p[name] for name in _NAMES[2:]})  # type: ignore[call-overload]
    model = beam.structure().select(["torque", "tip_force"], ["hub_angle", "tip_displacement"])
    C, forces = np.array(model.C), model.ports.B[0] * np.array([p["gain"], 1.0])
    C[0, 0] += p["friction"]
    places = dict(zip(model.outputs, model.ports.L[0], strict=True))
    return SecondOrderModel(model.M, C, model.K, dict(zip(model.inputs, forces.T, strict=True)), places)


@cache
def days() -> "tuple[control.FrequencyResponseData, ...]":
    """Return the mean response of each day."""
    rng, found = np.random.default_rng(0), []
    for _ in range(_DAYS):
        day = {name: value * np.exp(_APART * rng.standard_normal()) for name, value in _TRUE.items()}
        G = response(day)
        E = rng.standard_normal((int(rng.integers(*_REPEATS, endpoint=True)), 2, *G.shape))
        G = G * (1.0 + _ERRORS * (E[:, 0] + 1j * E[:, 1])).mean(axis=0)
        found.append(control.frd(G, _OMEGA, inputs=["torque"], outputs=["hub_angle"]))
    return tuple(found)


def response(p: dict[str, float]) -> Array:
    """Return the response of the hub's angle to the torque, (1, 1, n)."""
    return np.asarray(rig(p).frequency_response(_OMEGA, ["torque"], ["hub_angle"]).frdata)


def rotary_days(extent: Extent) -> Scene:
    """Return the scene of the beam."""

    def inside(fitted: FitResult) -> float:
        sizes = np.array([np.abs(response(p)).ravel() for p in _drawn(fitted.family(), _DRAWS[extent])])
        size, beyond = np.abs(days()[-1].frdata).ravel(), stats.norm.ppf(0.975) * _ERRORS / np.sqrt(_REPEATS[0])
        within = (size > (1.0 - beyond) * sizes.min(axis=0)) & (size < (1.0 + beyond) * sizes.max(axis=0))
        return 100.0 * float(within.mean())

    ours, scipys = Who("fit"), Who("scipy least_squares")
    proof, worst = Who("robust_stability"), Who("worst_case")
    _box()  # for all who are given it, and nobody's time
    return Scene(
        key="rotary-days",
        title="Six parameters of a motor with a flexible beam, and a sampled loop proved for what they leave open",
        question=f"From gain and phase at {len(_OMEGA)} frequencies on {_DAYS - 1} days to six parameters with intervals;"
        " from the boxes of 95 % of these days to a proof that a sampled PD with notch is stable, and to its worst case.",
        measure="Of a fit: relative error of the response, root mean square over the frequencies, against that of the machine"
        " in the middle of the days. Of a proof: 1 where nothing is proved. Of a worst case: its bound above what was found."
        f" Both are infinite where one of {_JUDGES} machines drawn from the box says otherwise.",
        settings=(
            _of(ours, _fitted, "bc.fit(rig, days, list(begin), begin, starts=1)"),
            Setting(scipys.name, "differences", False, _least_squares),
            _of(proof, _proved, "bc.robust_stability(family, K, delay=0.001)"),
            _of(worst, _worst, 'bc.worst_case(family, K, "tip_force", "hub_angle", delay=0.001)'),
        ),
        error=_error,
        remarks=(
            f"Days differ by {100 * _APART:g} % in each parameter; a day is the mean of {_REPEATS[0]} to {_REPEATS[1]}"
            f" measurements with errors of {100 * _ERRORS:g} %. The last one is left out of the fit.",
            "SciPy's fit is of the same model and gives no intervals.",
        ),
        promises=(
            *(
                exact(ours, 0.02),
                number(ours, _INSIDE, 96.0, least=True),
                exact(proof, 0.0),
                exact(worst, 1.001 * _TOLERANCE),
            ),
            *(seconds(ours, 7.5, "cold"), seconds(proof, 4.0, "cold"), seconds(worst, 5.0, "cold")),
            times_as_fast(ours, scipys, None, "cold"),
        ),
        found=lambda answer: {_INSIDE: inside(answer)} if isinstance(answer, FitResult) else {},
        shows="promises",
    )


def _of(who: Who, solve: Any, call: str) -> Setting:
    return Setting(who.name, "six parameters", True, solve, call=call)


def _error(answer: Any) -> float:
    if isinstance(answer, FitResult | dict):
        G = response(answer.parameters if isinstance(answer, FitResult) else answer)
        return float(np.sqrt(np.square(np.abs(G / response(_TRUE) - 1.0)).mean()))
    # machines of the box, each judged by itself: by its poles and its response
    loops = [feedback_loop(rig(p), _controller(0.0), delay=_DELAY) for p in _drawn(_box(), _JUDGES)]
    if max(float(np.abs(loop.poles()).max()) for loop in loops) >= 1.0:
        return inf
    if isinstance(answer, RobustStability):
        return float(not answer.proved)
    omega = np.geomspace(0.1, np.pi / _STEP, 1000)
    gains = [np.abs(control.frequency_response(loop["hub_angle", "tip_force"], omega).frdata).max() for loop in loops]
    return inf if max(gains) > answer.upper_bound else answer.upper_bound / answer.norm.value - 1.0


def _drawn(family: Family, count: int) -> list[dict[str, float]]:
    """Return parameters of machines within the box of a family."""
    rng = np.random.default_rng(1)
    return [{**_BEGIN, **{name: rng.uniform(*ends) for name, ends in family.ranges.items()}} for _ in range(count)]


def _fitted(change: float = 0.0) -> FitResult:
    begin = {name: value * (1.0 + change) for name, value in _BEGIN.items()}
    return fit(rig, days()[:-1], list(begin), begin, starts=1)


def _least_squares(change: float) -> dict[str, float]:
    names, begin = list(_BEGIN), np.log(list(_BEGIN.values())) + np.log1p(change)
    measured = np.log(np.array([day.frdata.ravel() for day in days()[:-1]]))

    def apart(x: Array) -> Array:
        # logarithms of the ratio: errors grow with the response
        ratio: Array = np.log(response(dict(zip(names, np.exp(x), strict=True))).ravel() / np.exp(measured))
        return np.concatenate([ratio.real.ravel(), ratio.imag.ravel()])

    return dict(zip(names, np.exp(least_squares(apart, begin).x).tolist(), strict=True))


@cache
def _box() -> Family:
    """Return the family of the union of the boxes of the days."""
    first, *others = (fit(rig, day, list(_BEGIN), _BEGIN, starts=1) for day in days()[:-1])
    return first.family(union_with=others)


def _controller(change: float) -> "control.StateSpace":
    """Return a PD with a notch at the first vibration, as it runs."""
    s = control.tf("s")
    law = -(1.0 + change) * (0.3 + 0.03 * s / (s / _FASTEST + 1.0))
    notch = (s**2 + 24.0 * s + 3600.0) / (s**2 + 96.0 * s + 3600.0)  # 60 rad/s, dampings of 0.2 and 0.8
    K = control.ss(law * notch)
    return discretize(control.ss(K.A, K.B, K.C, K.D, inputs=["hub_angle"], outputs=["torque"]), _STEP)


def _proved(change: float) -> RobustStability:
    return robust_stability(_box(), _controller(change), delay=_DELAY)


def _worst(change: float) -> WorstCase:
    return worst_case(_box(), _controller(change), "tip_force", "hub_angle", delay=_DELAY, tolerance=_TOLERANCE)
