"""Which parameters explain the measured frequencies of Table 1, and what they say of the 0.34 Hz that no model there has.

Anthonis & Ramon (2003) measured 0.34, 0.59, 0.88, 2.8 and 4.2 Hz; Table 2, with an exact beam, has 0.244 Hz for the first
and the others within 7 %.  Parameters are fitted to the measured row, with 20 finite elements and errors of one
relative size.
The first frequency is the boom's turning on its springs, which goes as ``L_k sqrt(k_s)``; the second and third are its
pushing against them, which goes as ``sqrt(k_s)`` alone: so a stiffer spring and a longer lever are distinguishable.
"""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.published import MEASURED_HZ
from boomctl.identification.fit import fit
from boomctl.identification.fit_result import FitResult
from boomctl.lab.papers.jobs import Chapter
from boomctl.report import Section, Table
from boomctl.structure.model import SecondOrderModel

READINGS = (
    ("spring_stiffness",),
    ("youngs_modulus",),
    ("spring_stiffness", "youngs_modulus"),
    ("spring_distance",),
    ("spring_distance", "spring_stiffness", "youngs_modulus"),
)
"""Free parameters of each fit."""

_ELEMENTS = 20  # finite ones: its frequencies are then those of the exact beam to 2e-4, at a tenth of the price
STARTS = 2  # starts of each fit
_LOG_STEP = 1e-4  # finite-difference step of log(parameter) for the derivative of the first frequency
_ABOUT = (
    "No parameter of Table 2 was changed for the rest of this report. Here parameters are fitted to the measured row, to see"
    " what it says of them: 20 finite elements, whose frequencies are the exact ones to 0.02 %; errors of one relative size,"
    " which is estimated; intervals of 95 %."
)


@dataclass(frozen=True)
class BoomUpdating:
    """Parameters from the measured frequencies.

    Attributes
    ----------
    parameters : BoomParameters
        Initial parameters.
    readings : tuple of FitResult
        One for each of :data:`READINGS`, to all five frequencies.
    without_first : FitResult
        Spring stiffness and modulus, to the second to fifth frequency.
    first_hz : float
        The first frequency that this predicts [Hz].
    first_interval_hz : (float, float)
        Where it lies with 95 %, parameters of the linearized model.
    """

    parameters: BoomParameters
    readings: tuple[FitResult, ...]
    without_first: FitResult
    first_hz: float
    first_interval_hz: tuple[float, float]

    def reading(self, *free: str) -> FitResult:
        """Return the fit in which these are free."""
        return self.readings[READINGS.index(free)]

    @property
    def lever(self) -> FitResult:
        """The fit of the spring distance alone."""
        return self.reading("spring_distance")

    @property
    def stiffness_of_turning(self) -> float:
        """Equivalent rotational spring between platform and boom, in addition to those of Table 2 [N m/rad]."""
        p = self.parameters
        return 0.5 * p.spring_stiffness * (self.lever.values["spring_distance"] ** 2 - p.spring_distance**2)


def updating_study(parameters: BoomParameters | None = None) -> BoomUpdating:
    """Fit the measured row of Table 1."""
    p = BoomParameters() if parameters is None else parameters
    modes = range(1, len(MEASURED_HZ) + 1)
    readings = tuple(fit(_boom, MEASURED_HZ, free, p, modes=modes, n_starts=STARTS) for free in READINGS)
    others = fit(_boom, MEASURED_HZ[1:], READINGS[2], p, modes=modes[1:], n_starts=STARTS)
    first = _first(others.parameters)
    slope = []
    for name, value in others.values.items():
        up, down = (_first(replace(others.parameters, **{name: value * np.exp(s)})) for s in (_LOG_STEP, -_LOG_STEP))
        slope.append((np.log(up) - np.log(down)) / (2.0 * _LOG_STEP * value))
    from scipy.special import stdtrit

    spread = float(stdtrit(others.dof, 0.975) * np.sqrt(np.array(slope) @ others.covariance @ np.array(slope)))
    ends = float(first * np.exp(-spread)), float(first * np.exp(spread))
    return BoomUpdating(p, readings, others, first, ends)


def _boom(parameters: BoomParameters) -> SecondOrderModel:
    return spray_boom(parameters, "finite", _ELEMENTS)


def _first(parameters: BoomParameters) -> float:
    return float(_boom(parameters).eigenfrequencies_hz(1)[0])


def updating_chapter(p: BoomParameters) -> Chapter:
    """Fit parameters to the measured row of Table 1, and draw the one that explains it."""
    from boomctl.plotting.canvas import figure_of, picture

    study = updating_study(p)
    caption = "Measured frequencies, those of Table 2, and those of the fitted distance."
    shown = picture("boom_updating", figure_of(study.lever.plot), caption)
    title = "What the measured frequencies say of the parameters"
    section = Section(title, (_ABOUT, *_findings(study)), (_table(study),), (shown,))
    return Chapter((section,), {"updating": _results(study)})


def _findings(study: BoomUpdating) -> tuple[str, str]:
    p, lever = study.parameters, study.lever
    low, high = study.first_interval_hz
    every = study.reading(*READINGS[-1])
    held = [name for name in READINGS[2] if _holds(every, name, getattr(p, name))]
    names = " and ".join(held)
    confirmed = f" Freed as well, {names} keep the values of Table 2 within their intervals." if held else ""
    measured = MEASURED_HZ[0]
    comes = "may come from" if low <= measured <= high else "does not come from"
    inside = "holds" if _holds(lever, "spring_distance", p.actuator_distance) else "does not hold"
    return (
        f"Without the first frequency, spring stiffness and modulus meet the other four to"
        f" {100.0 * study.without_first.error_std:.1f} %, and predict {study.first_hz:.3f} Hz for the first"
        f" ({low:.3f} to {high:.3f}): the measured {measured:g} Hz {comes} a stiffer spring, which would move the second"
        " and third frequency too.",
        f"One parameter explains all five to {100.0 * lever.error_std:.1f} %: a spring distance of"
        f" {lever.values['spring_distance']:.3f} m ({lever.interval_text('spring_distance')}) in place of"
        f" {p.spring_distance:g} m.{confirmed} The interval {inside} the distance of the actuators,"
        f" {p.actuator_distance:g} m. The frequencies do not tell this from anything else that changes the stiffness of"
        f" turning alone, such as {study.stiffness_of_turning:.0f} N m/rad in the hinge, by bearings, pipes or hoses: how"
        " stiff the machine turns is what they say, not by what.",
    )


def _holds(result: FitResult, name: str, value: float) -> bool:
    low, high = result.intervals[name]
    return low <= value <= high


def _table(study: BoomUpdating) -> Table:
    others = study.without_first
    rows = [("none (Table 2)", None, _boom(study.parameters).eigenfrequencies_hz(len(MEASURED_HZ)))]
    rows += [(", ".join(result.names), result, result.best_fit) for result in study.readings]
    rows += [(f"{', '.join(others.names)} (to the last four)", others, np.array([study.first_hz, *others.best_fit]))]
    lines: list[tuple[str, ...]] = [("measured", "", *(f"{value:g}" for value in MEASURED_HZ), "", "")]
    for words, result, hz in rows:
        rms = 100.0 * np.sqrt(np.mean(np.square(np.log(hz / np.array(MEASURED_HZ)))))
        values, certified = "", ""
        if result:
            values = "; ".join(f"{result.values[name]:.4g} ({result.interval_text(name)})" for name in result.names)
            certified = "yes" if result.success else "no"
        lines.append((words.replace("_", " "), values, *(f"{value:.4f}" for value in hz), f"{rms:.1f}", certified))
    heads = ("free", "fitted (95 % interval)", *"12345", "rms %", "certified")
    caption = "Parameters fitted to the measured row of Table 1, and the frequencies they give [Hz]."
    return Table(heads, tuple(lines), caption)


def _results(study: BoomUpdating) -> dict[str, object]:
    """Return the study's numbers for ``results.json``."""

    def numbers(fit: FitResult) -> dict[str, object]:
        return {
            "values": fit.values,
            "intervals": fit.intervals,
            "fitted_hz": fit.best_fit,
            "deviation": fit.error_std,
            "certified": fit.success,
        }

    return {
        "readings": {", ".join(result.names): numbers(result) for result in study.readings},
        "without_first": numbers(study.without_first),
        "predicted_first_hz": study.first_hz,
        "predicted_first_interval_hz": study.first_interval_hz,
        "stiffness_of_turning": study.stiffness_of_turning,
    }
