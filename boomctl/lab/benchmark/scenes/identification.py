"""The scene of identification: modes of a simulated steel frame from a record of its accelerometers.

Other programs: SLICOT's subspace methods MOESP and N4SID, by ``ctrlsys``.
"""

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from boomctl.arrays import Array
from boomctl.identification.identify import identify
from boomctl.lab.benchmark.scene import Scene, settings, sized

STEP, _SAMPLES, _FITTED = 1.0 / 1024.0, 8523, 6000  # s; of the steel subframe in DaISy, whose twin this is
BAND = (5.0, 490.0)  # Hz
_TOP = 502.0  # Hz, of the shaking: what filters of a shaker leave below half the sampling rate
_INSIDE, _BEYOND = 16, (600.0, 750.0)  # In the band; frequencies of modes above it [Hz].
_ERRORS, _OUTPUTS = 0.03, 28  # of each output's RMS; accelerometers
_RECORDS = 5  # With errors of their own: the largest error of a frequency in one of them is chance.


@cache
def frame_records(outputs: int) -> tuple[Array, list[Array], Array]:
    """Return inputs of two shakers, accelerations with errors of each record, and the poles in the band [rad/s].

    Two frequencies differ by 1 %.
    """
    rng = np.random.default_rng(0)
    hz = np.r_[np.sort(rng.uniform(20.0, 470.0, _INSIDE)), _BEYOND]
    hz[5] = 1.01 * hz[4]
    damping = 10.0 ** rng.uniform(-2.8, -1.7, len(hz))
    poles = 2.0 * np.pi * hz * (-damping + 1j * np.sqrt(1.0 - damping**2))
    b, c = rng.standard_normal((len(hz), 2)), rng.standard_normal((len(hz), outputs))
    s = 2j * np.pi * np.fft.rfftfreq(2 * _SAMPLES, STEP)[:, None]
    U = np.fft.rfft(rng.standard_normal((2 * _SAMPLES, 2)), axis=0) * (s.imag < 2.0 * np.pi * _TOP)
    modal = s**2 / ((s - poles) * (s - poles.conj()))
    u, y = (np.fft.irfft(item, axis=0)[_SAMPLES:] for item in (U, (modal * (U @ b.T)) @ c))
    records = [y + _ERRORS * y.std(axis=0) * rng.standard_normal(y.shape) for _ in range(_RECORDS)]
    return u, records, poles[np.argsort(poles[:_INSIDE].imag)]


def frequency_errors(hz: Array, true: Array) -> Array:
    """Return the relative error of each true frequency, one to one; 1 where none is left for it."""
    errors = np.ones((len(true), max(len(true), len(hz))))
    errors[:, : len(hz)] = np.minimum(np.abs(hz / true[:, None] - 1.0), 1.0)
    return errors[linear_sum_assignment(errors)]


Problem = tuple[Array, list[Array], Array]  # inputs, accelerations of several records, and poles


def identification() -> Scene:
    """Return the scene of the frame."""

    def ours(held_back: float, problem: Problem, change: float) -> list[Array]:
        u, records, _ = problem
        options: dict[str, Any] = {"frequency_range_hz": BAND, "quantity": "acceleration", "intersample": "bl"}
        fits = [identify(u, (1.0 + change) * y, STEP, validation_fraction=held_back, **options) for y in records]
        return [np.array([mode.frequency_hz for mode in fit.modes]) for fit in fits]

    def theirs(method: str, order: int, problem: Problem, change: float) -> list[Array]:
        u, records, _ = problem
        return [subspace_frequencies(method, order, u[:_FITTED], (1.0 + change) * y[:_FITTED], STEP) for y in records]

    def one(outputs: int) -> Problem:
        u, records, poles = frame_records(outputs)
        return u, records[:1], poles

    def sized_ours(outputs: int, problem: Problem, change: float) -> list[Array]:
        return ours(1.0 - _FITTED / _SAMPLES, one(outputs), change)

    def sized_theirs(outputs: int, problem: Problem, change: float) -> list[Array]:
        return theirs("MOESP", 32, one(outputs), change)

    def error(problem: Problem, true: Array, answer: list[Array]) -> float:
        return float(np.mean([frequency_errors(hz, true).max() for hz in answer]))

    options: dict[str, Any] = {"modules": ("ctrlsys",)}
    fractions = (0.8, 0.5, 1.0 - _FITTED / _SAMPLES)
    call = (
        'bc.identify(u, y, dt, frequency_range_hz=(5, 490), quantity="acceleration", intersample="bl",'
        " validation_fraction={:.2g})"
    )
    return Scene(
        title=f"Modes of a steel frame from {_OUTPUTS} accelerometers, {_RECORDS} records",
        question=f"From {_RECORDS} times {_SAMPLES:,} simulated samples, errors of {100 * _ERRORS:g} % to {_INSIDE} modes to"
        f" {BAND[1]:g} Hz.",
        measure="Largest relative error of a frequency, one pole for each mode, 1 where none is left for it; mean of the"
        " records, which differ in their errors.",
        problem=lambda: frame_records(_OUTPUTS),
        reference=lambda problem: problem[2].imag / (2.0 * np.pi),
        error=error,
        methods=(
            *settings("identify", "{:.0%} held back", fractions, ours, verified=True, ours=True, call=call),
            *settings("SLICOT, MOESP", "order {1}", [("MOESP", n) for n in (32, 40, 48)], theirs, **options),
            *settings("SLICOT, N4SID", "order {1}", [("N4SID", n) for n in (32, 40)], theirs, **options),
            *sized(
                settings("identify", "{} outputs", (7, 14, 28), sized_ours, verified=True, ours=True),
                settings("SLICOT, MOESP", "{} outputs", (7, 14, 28), sized_theirs, **options),
            ),
        ),
        remarks=(
            "Ours finds the number of modes, gives intervals, and is validated on the part held back.",
            f"SLICOT uses a given order and {_FITTED:,} samples, and is timed for A and C alone.",
        ),
    )


def subspace_frequencies(method: str, order: int, u: Array, y: Array, step: float) -> Array:
    """Return the damped frequencies [Hz] of the stable poles of a model of a record, by "MOESP" or "N4SID".

    Parameters
    ----------
    method : str
    order : int
        Of the model; the block rows are the fewest.
    u, y : ndarray
        Inputs (samples, inputs) and outputs (samples, outputs).
    step : float
        Between samples [s].
    """
    slicot, rows, (m, p) = import_module("ctrlsys"), order + 1, (u.shape[1], y.shape[1])
    copies = (np.array(x, order="F") for x in (u, y))  # which are written over
    _, R, *_ = slicot.ib01ad(method[0], "C", "N", "O", "N", "N", rows, m, p, *copies, 0.0, -1.0)
    poles = np.linalg.eigvals(slicot.ib01bd(method[0], "C", "N", rows, order, m, p, len(u), R, 0.0)[0]).astype(complex)
    hz = np.log(poles[np.abs(poles) < 1.0]).imag / (2.0 * np.pi * step)
    return hz[hz > 0.0]
