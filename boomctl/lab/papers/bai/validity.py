"""How far each model may be trusted: all five against the geometrically exact beam, over the torque."""

from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.papers.bai.comparison import ADDED, MODEL_COLOURS, Chart, Claim, Line, Panel, Part, peak
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import sine_torque
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import SimulationError

MODELS = {
    "TLAM": "tlam",
    "SFOAM": "sfoam",
    "SFOAM, consistent": "sfoam-consistent",
    "FOAM": "foam",
    "CFOAM": "cfoam",
}
EXACT = "geometrically-exact"
# amplitudes [N m] from where all models agree to twice what the hub is driven with, in steps of some 2 times
TORQUES = (5.0, 11.0, 24.0, 50.0, 100.0, 200.0, 400.0, 800.0)
# and of some 1.4 times, for who has twice the time
FULL_TORQUES = (5.0, 7.5, 11.0, 16.0, 24.0, 36.0, 50.0, 75.0, 100.0, 140.0, 200.0, 280.0, 400.0, 560.0, 800.0)
THRESHOLDS = (0.01, 0.05, 0.2)  # errors of the tip over its peak that a drawing, a design or a guess would bear
TIME = np.linspace(0.0, 30.0, 1501)  # [s]: 10 s of torque and 20 s of what it leaves
MODES = 8  # with which the exact beam has converged, so that differences are those of the models


@dataclass(frozen=True, eq=False)
class Validity:
    """Errors of the tip displacement against the geometrically exact beam.

    Attributes
    ----------
    torques : ndarray, k
        Amplitude of the sine torque of 10 s, N m.
    whole, residual : dict of str to ndarray, k
        By model: largest error over the largest displacement, until 30 s, and after the torque has ended (10 s); inf
        where the model could not be followed.
    """

    torques: Array
    whole: dict[str, Array]
    residual: dict[str, Array]


def tips(model: str, torques: tuple[float, ...]) -> list[Array]:
    """Return the tip displacement of a model over :data:`TIME` for each torque [m]; inf where it cannot be followed."""
    return [_tip(model, torque) for torque in torques]


def judged(torques: tuple[float, ...], found: dict[str, list[Array]]) -> Validity:
    """Judge the tips of all models by those of the geometrically exact beam."""
    late, exact = TIME > 10.0, found[EXACT]
    whole, residual = {}, {}
    for label, model in MODELS.items():
        pairs = list(zip(found[model], exact, strict=True))
        whole[label] = np.array([_error(tip, true) for tip, true in pairs])
        residual[label] = np.array([_error(tip[late], true[late]) for tip, true in pairs])
    return Validity(np.array(torques), whole, residual)


def _tip(model: str, torque: float) -> Array:
    beam = hub_beam(HubBeamParameters(), model, MODES)
    try:
        return beam.simulate(sine_torque(torque, 10.0, 10.0), TIME, rtol=1e-6).tip_displacement
    except SimulationError:
        return np.full(TIME.size, np.inf)


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
    low, high = np.log(errors[k - 1]), np.log(errors[k])
    share = (np.log(threshold) - low) / (high - low)
    return float(np.exp(np.log(torques[k - 1]) + share * np.log(torques[k] / torques[k - 1])))


def section(data: Validity) -> Part:
    """The picture and what it says."""
    levels = tuple((threshold, f"{100 * threshold:g} %") for threshold in THRESHOLDS)
    styles = {"SFOAM, consistent": "s--", "FOAM": "^:", "TLAM": "o-", "SFOAM": "v-", "CFOAM": "D-"}

    def panel(title: str, errors: dict[str, Array]) -> Panel:
        lines = tuple(
            Line(label, data.torques, np.where(np.isfinite(e), e, np.nan), styles[label], MODEL_COLOURS[label])
            for label, e in errors.items()
        )
        return Panel(
            title,
            "largest torque [N m]",
            "error of v(L) over its peak",
            lines,
            logarithmic="xy",
            levels=levels,
            ylim=(1e-5, 3.0),
            legend="lower right",
            xticks=(5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 400.0, 800.0),
        )

    chart = Chart(
        "validity",
        "Not in the paper: where each model leaves the geometrically exact beam; sine torque of 10 s, 8 modes, "
        f"{len(data.torques)} torques, between which the limits in the table are interpolated, to some 5 % "
        f"(boomctl reproduce --full takes {len(FULL_TORQUES)})",
        (panel("(a) whole motion, 30 s", data.whole), panel("(b) residual vibration, 10 to 30 s", data.residual)),
        columns=2,
    )
    kinds = (("whole motion", data.whole), ("residual vibration", data.residual))
    claims = tuple(
        Claim(
            "validity",
            f"{label} against the geometrically exact beam",
            "; ".join(f"{name}: leaves " + _limits(data.torques, errors[label]) for name, errors in kinds),
            ADDED,
            "error of the tip displacement over its peak",
        )
        for label in data.whole
    )
    return Part("Where each model stops being true", (chart,), claims=claims)


def _limits(torques: Array, errors: Array) -> str:
    texts = []
    for threshold in THRESHOLDS:
        torque = leaves(torques, errors, threshold)
        place = f"above {torques[-1]:g}" if np.isinf(torque) else f"at {torque:.3g}"
        texts.append(f"{100 * threshold:g} % {place if torque > torques[0] else f'below {torques[0]:g}'} N m")
    return ", ".join(texts)
