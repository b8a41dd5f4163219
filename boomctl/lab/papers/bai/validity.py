"""Range of validity of each model: comparison with the geometrically exact beam, over the torque."""

import numpy as np

from boomctl.arrays import Array
from boomctl.exceptions import SimulationError
from boomctl.lab.papers.bai.comparison import ADDED, MODELS, Claim, Panel, Part, lines, peak
from boomctl.maneuvers import sine_torque
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters

# amplitudes [N m] from where all models agree to twice what the hub is driven with, in steps of some 2 times
TORQUES = (5.0, 11.0, 24.0, 50.0, 100.0, 200.0, 400.0, 800.0)
THRESHOLDS = (0.01, 0.05, 0.2)  # Errors of the tip displacement, relative to its peak.
TIME = np.linspace(0.0, 30.0, 1501)  # [s]: 10 s of torque and 20 s of what it leaves
MODES = 8  # with which the exact beam has converged, so that differences are those of the models

Errors = dict[str, dict[str, Array]]
"""By part of the motion and by model: largest error of the tip over the largest displacement, for each torque."""


def tips(model: str, torques: tuple[float, ...]) -> list[Array]:
    """Return the tip displacement of a model over :data:`TIME` for each torque [m]; inf where it cannot be followed."""
    beam, result = hub_beam(HubBeamParameters(), model, MODES), []
    for torque in torques:
        try:
            result.append(beam.simulate(sine_torque(torque, 10.0, 10.0), TIME, rtol=1e-6).tip_displacement)
        except SimulationError:
            result.append(np.full(TIME.size, np.inf))
    return result


def tip_errors(tips: dict[str, list[Array]]) -> Errors:
    """Return the errors of all models, by label, against the exact beam: until 30 s, and after the torque (10 s)."""
    exact = tips["exact"]
    return {
        part: {
            label: np.array([_error(tip[at], true[at]) for tip, true in zip(tips[label], exact, strict=True)])
            for label in MODELS
            if label != "exact"
        }
        for part, at in {"whole motion": TIME >= 0.0, "residual vibration": TIME > 10.0}.items()
    }


def _error(tip: Array, true: Array) -> float:
    return peak(tip - true) / peak(true) if np.isfinite(tip).all() else float("inf")


def leaves(torques: Array, errors: Array, threshold: float) -> float:
    """Torque at which an error first exceeds a threshold, on a straight line in logarithms; inf if it never does.

    Parameters
    ----------
    torques, errors : ndarray, k
        Torques ascending; errors may be inf.
    threshold : float

    Returns
    -------
    float
        The first torque if the error exceeds the threshold there already.
    """
    above = np.flatnonzero(errors > threshold)
    if above.size == 0:
        return float("inf")
    k = int(above[0])
    if k == 0 or not np.isfinite(errors[k]):
        return float(torques[k])
    return float(np.exp(np.interp(np.log(threshold), np.log(errors[k - 1 : k + 1]), np.log(torques[k - 1 : k + 1]))))


def section(torques: Array, computed: Errors) -> Part:
    """Return the picture and what it says."""

    def panel(title: str, errors: dict[str, Array]) -> Panel:
        return Panel(
            title,
            "error of v(L) over its peak",
            lines(torques, {label: np.where(np.isfinite(e), e, np.nan) for label, e in errors.items()}, "ovs^D"),
            "largest torque [N m]",
            logarithmic="xy",
            levels=tuple((threshold, f"{100 * threshold:g} %") for threshold in THRESHOLDS),
            ylim=(1e-5, 3.0),
            legend="lower right",
            xticks=tuple(torques),
        )

    caption = (
        "Not in the paper: where each model leaves the geometrically exact beam; sine torque of 10 s, 8 modes, "
        f"{len(torques)} torques, between which the limits in the table are interpolated, to some 5 %"
    )
    titles = {"(a) whole motion, 30 s": "whole motion", "(b) residual vibration, 10 to 30 s": "residual vibration"}
    panels = tuple(panel(title, computed[part]) for title, part in titles.items())
    claims = tuple(
        Claim(
            "validity",
            f"{label} against the geometrically exact beam",
            "; ".join(f"{name}: leaves " + _limits(torques, errors[label]) for name, errors in computed.items()),
            ADDED,
            "error of the tip displacement over its peak",
        )
        for label in computed["whole motion"]
    )
    return Part("Where each model stops being true", "validity", caption, panels, claims=claims)


def _limits(torques: Array, errors: Array) -> str:
    texts = []
    for threshold in THRESHOLDS:
        torque = leaves(torques, errors, threshold)
        text = f"above {torques[-1]:g}" if np.isinf(torque) else f"at {torque:.3g}"
        texts.append(f"{100 * threshold:g} % {text if torque > torques[0] else f'below {torques[0]:g}'} N m")
    return ", ".join(texts)
