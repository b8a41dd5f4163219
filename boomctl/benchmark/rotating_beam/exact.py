"""Run time of the geometrically exact beam, FOAM and SFOAM against their distance from the converged exact beam."""

import time
from dataclasses import replace

import numpy as np

from boomctl.arrays import Array
from boomctl.benchmark.report import Row
from boomctl.benchmark.rotating_beam.exudyn import exudyn_available, exudyn_tip
from boomctl.benchmark.rotating_beam.peers import in_turns
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp

SCENES: dict[str, tuple[SpinUp | SineTorque, Array]] = {
    "Against the exact beam: spin-up 60 s": (SpinUp(2.8, 30.0), np.linspace(0.0, 60.0, 1501)),
    "Against the exact beam: 200 N m, 30 s": (SineTorque(200.0, 10.0, 10.0), np.linspace(0.0, 30.0, 751)),
}
"""Manoeuvres and the instants of the output."""

EXACT_SETTINGS = ((3, 1e-3), (4, 1e-5), (6, 1e-7), (8, 1e-8))
"""Polynomials and relative tolerance of the geometrically exact beam."""

EXUDYN_SETTINGS = ((4, 0.04), (4, 0.02), (8, 0.01), (8, 0.005), (16, 0.0025))
"""Elements and time step [s], from fast to exact."""

EXUDYN_ERROR = 1e-3
"""Exudyn is refined until its error is below this."""

SFOAM = "SFOAM, 5 modes"

EXUDYN_RATIO = 300.0
"""How many times faster SFOAM's spin-up is to be; the torque-driven motion is shown without a target."""


def rows(repeats: int = 3) -> list[Row]:
    """Measure run time and error in one run, the error against ten polynomials at a tolerance of 1e-9.

    The error of SFOAM and FOAM is that of the model, for they are solved ten thousand times more exactly.

    Parameters
    ----------
    repeats : int
        Rounds of which the median counts, at least 1.

    Returns
    -------
    list of Row
        SFOAM first in each scene; beside exudyn where it can be imported.

    Raises
    ------
    ValueError
        If `repeats` is less than 1.
    """
    if repeats < 1:
        raise ValueError(f"repeats = {repeats!r}: expected at least 1")
    return [row for scene in SCENES for row in _scene(scene, repeats)]


def _scene(scene: str, repeats: int) -> list[Row]:
    manoeuvre, timepts = SCENES[scene]
    true = _tip("geometrically-exact", 10, 1e-9, manoeuvre, timepts)
    runs = {SFOAM: ("sfoam", 5, 1e-7), "FOAM, 5 + 5 modes": ("foam", 5, 1e-7)}
    for modes, rtol in EXACT_SETTINGS:
        runs[f"exact, {modes} + {modes}, rtol {rtol:.0e}"] = ("geometrically-exact", modes, rtol)
    times = in_turns({job: lambda run=run: _tip(*run, manoeuvre, timepts) for job, run in runs.items()}, repeats)
    errors = {job: _error(_tip(*run, manoeuvre, timepts), true) for job, run in runs.items()}
    found = [Row(scene, job, times[job], error=errors[job]) for job in runs]
    target = f">= {EXUDYN_RATIO:g}x exudyn" if isinstance(manoeuvre, SpinUp) else ""
    found[0] = replace(found[0], target=target, note="absent")
    if exudyn_available():
        found[0] = _beside_exudyn(found[0], manoeuvre, timepts, true)
    return found


def _tip(model: str, modes: int, rtol: float, manoeuvre: SpinUp | SineTorque, timepts: Array) -> Array:
    return hub_beam(HubBeamParameters(), model, modes).simulate(manoeuvre, timepts, rtol=rtol).tip_displacement


def _error(tip: Array, true: Array) -> float:
    """Largest error over the largest displacement."""
    return float(np.max(np.abs(tip - true)) / np.max(np.abs(true)))


def _beside_exudyn(row: Row, manoeuvre: SpinUp | SineTorque, timepts: Array, true: Array) -> Row:
    """Exudyn, refined until it is as exact as is asked of it; each setting is run once."""
    for elements, step in EXUDYN_SETTINGS:
        start = time.process_time()
        tip = exudyn_tip(HubBeamParameters(), manoeuvre, timepts, elements, step)
        taken, error = time.process_time() - start, _error(tip, true)
        job = f"{SFOAM}; peer: exudyn, {elements} elements"
        fast = row.ours is not None and taken >= EXUDYN_RATIO * row.ours
        met = fast if row.target else None
        row = replace(row, job=job, peer=taken, peer_error=error, met=met, note="")
        if error <= EXUDYN_ERROR:
            break
    return row
