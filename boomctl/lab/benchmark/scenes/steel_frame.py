"""Modes of a steel frame from a record of its accelerometers, and what the model predicts of the part held back."""

from contextlib import redirect_stderr
from functools import cache, partial
from importlib import import_module
from io import StringIO
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from boomctl.arrays import Array
from boomctl.identification.identify import Identification, identify
from boomctl.identification.response import estimate_response
from boomctl.lab.benchmark.peers.subspace import subspace, unexplained
from boomctl.lab.benchmark.promise import Who, exact, number, times_as_fast
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, missing, there

STEP, _SAMPLES, _FITTED = 1.0 / 1024.0, 8523, 6000  # s; of the steel subframe in DaISy, whose twin this is
BAND = (5.0, 490.0)  # Hz
_TOP = 502.0  # Hz, of the shaking: what filters of a shaker leave below half the sampling rate
_MODES, _ABOVE = 16, (600.0, 750.0)  # in the band; Hz, of those above that it feels
_ERRORS = 0.03  # of each output's RMS
_OUTPUTS: dict[Extent, int] = {"quick": 8, "whole": 28}  # accelerometers
_SUBSPACE: dict[Extent, tuple[tuple[str, int], ...]] = {  # and orders; beyond, they gain nothing (measured to 60)
    "quick": (("MOESP", 40),),
    "whole": (("MOESP", 32), ("MOESP", 40), ("MOESP", 48), ("N4SID", 40)),
}
_DENOMINATOR = 60  # highest order of LSCF's (measured: 100 finds no mode more)
_CLOSE = 1e-3  # relative, of a frequency that counts as found
_FIT, _WORST, _FOUND = "mean fit held back [%]", "least fit held back [%]", "frequencies to 0.1 %"
_SPURIOUS = "modes beyond those that are there"


@cache
def frame_record(outputs: int) -> tuple[Array, Array, Array]:
    """Return inputs of two shakers, accelerations with errors, and the poles in the band [rad/s]; two are 1 % apart."""
    rng = np.random.default_rng(0)
    hz = np.r_[np.sort(rng.uniform(20.0, 470.0, _MODES)), _ABOVE]
    hz[5] = 1.01 * hz[4]
    damping = 10.0 ** rng.uniform(-2.8, -1.7, len(hz))
    poles = 2.0 * np.pi * hz * (-damping + 1j * np.sqrt(1.0 - damping**2))
    b, c = rng.standard_normal((len(hz), 2)), rng.standard_normal((len(hz), outputs))
    s = 2j * np.pi * np.fft.rfftfreq(2 * _SAMPLES, STEP)[:, None]
    U = np.fft.rfft(rng.standard_normal((2 * _SAMPLES, 2)), axis=0) * (s.imag < 2.0 * np.pi * _TOP)
    modal = s**2 / ((s - poles) * (s - poles.conj()))
    u, y = (np.fft.irfft(each, axis=0)[_SAMPLES:] for each in (U, (modal * (U @ b.T)) @ c))
    return u, y + _ERRORS * y.std(axis=0) * rng.standard_normal(y.shape), poles[np.argsort(poles[:_MODES].imag)]


def steel_frame(extent: Extent) -> Scene:
    """Return the scene of the frame."""
    u, y, poles = frame_record(_OUTPUTS[extent])
    true = poles.imag / (2.0 * np.pi)
    solvers: dict[tuple[str, str], Any] = {("identify", "order found"): _identified}
    if there("ctrlsys"):
        solvers |= {(f"SLICOT, {name}", f"order {n}"): partial(_subspace, name, n) for name, n in _SUBSPACE[extent]}
    if there("sdypy"):
        solvers["sdypy EMA, LSCF", f"order {_DENOMINATOR}"] = partial(_lscf, true)
    ours, *peers = (Who(*each) for each in solvers)

    def found(answer: Any) -> dict[str, float]:
        hz, fits = frequencies(answer), fit_percent(answer, u[_FITTED:], y[_FITTED:])
        counts = {_FOUND: float((errors(hz, true) < _CLOSE).sum()), _SPURIOUS: float(len(hz) - _MODES)}
        return counts if fits is None else counts | {_FIT: float(fits.mean()), _WORST: float(fits.min())}

    return Scene(
        key="steel-frame",
        title=f"Modes of a steel frame from a record of {y.shape[1]} accelerometers",
        question=f"From {_FITTED:,} samples of two shakers and {y.shape[1]} accelerometers with errors of {100 * _ERRORS:g} %"
        f" to {_MODES} modes up to {BAND[1]:g} Hz, and a model that predicts the {_SAMPLES - _FITTED:,} samples after.",
        measure="Largest relative error of a frequency, a pole to each mode; 1 where none is left for it.",
        settings=tuple(
            Setting(
                *each,
                ours=each[0] == ours.name,
                cold=lambda change, solve=solve: solve(u, (1.0 + change) * y),
                call='bc.identify(u, y, dt, band_hz=(5, 490), quantity="acceleration")' if each[0] == ours.name else "",
            )
            for each, solve in solvers.items()
        ),
        error=lambda answer: float(errors(frequencies(answer), true).max()),
        missing=missing(SLICOT="ctrlsys", sdypy_EMA="sdypy"),
        remarks=(
            f"Fits are within the band, from the best state at the start; errors of the record leave {100 * (1 - _ERRORS):g}"
            " %. Ours validates and gives intervals within the time shown; the others do not.",
            "Unstable poles of subspace models are left out, as they predict nothing; B and D are then those of least squares"
            " in the band. sdypy EMA is told where to look, to 0.1 Hz, and gives no model.",
            "Where others are ahead, on the short record of a quick run: MOESP takes one order that it is told; ours finds it"
            " over several, and its intervals from blocks of the record.",
        ),
        promises=(
            *(exact(ours, _CLOSE), number(ours, _FOUND, _MODES, least=True), number(ours, _SPURIOUS, 0.0)),
            *(number(ours, _FIT, 96.5, least=True), number(ours, _WORST, 94.0, least=True)),
            *(number(who, _FOUND, None, least=True) for who in peers),
            *(number(who, _FIT, None, least=True) for who in peers if who.name.startswith("SLICOT")),
            *(times_as_fast(ours, who, None, "cold") for who in peers),
        ),
        found=found,
    )


def frequencies(answer: Any) -> Array:
    """Return the damped frequencies of an answer [Hz]."""
    if isinstance(answer, Identification):
        return np.array([mode.frequency_hz for mode in answer.modes])
    if isinstance(answer, tuple):
        answer = np.log(np.linalg.eigvals(answer[0]).astype(complex)).imag / (2.0 * np.pi * STEP)
    return answer[answer > 0.0]


def errors(hz: Array, true: Array) -> Array:
    """Return the relative error of each true frequency, one to one; 1 where none is left for it."""
    apart = np.ones((len(true), max(len(true), len(hz))))
    apart[:, : len(hz)] = np.minimum(np.abs(hz / true[:, None] - 1.0), 1.0)
    return apart[linear_sum_assignment(apart)]


def fit_percent(answer: Any, u: Array, y: Array) -> Array | None:
    """Return how much of each output within the band is predicted [%]; None where there is no model."""
    if isinstance(answer, Identification):
        return np.array(list(answer.fit_percent.values()))
    if not isinstance(answer, tuple):
        return None
    Y, left = unexplained(answer, u, y, (BAND[0] * STEP, BAND[1] * STEP))
    return 100.0 * (1.0 - np.linalg.norm(left, axis=0) / np.linalg.norm(Y, axis=0))


def _identified(u: Array, y: Array) -> Identification:
    return identify(u, y, STEP, band_hz=BAND, quantity="acceleration", held_back=1.0 - _FITTED / _SAMPLES)


def _subspace(method: str, order: int, u: Array, y: Array) -> tuple[Array, ...]:
    return subspace(method, order, u[:_FITTED], y[:_FITTED], (BAND[0] * STEP, BAND[1] * STEP))


def _lscf(true: Array, u: Array, y: Array) -> Array:
    response = estimate_response(u[:_FITTED], y[:_FITTED], STEP, quantity="acceleration")
    hz = np.asarray(response.omega) / (2.0 * np.pi)
    pairs = np.asarray(response.frdata).reshape(-1, len(hz))  # of outputs and inputs, whose poles are the same
    with redirect_stderr(StringIO()):  # of progress
        ema = import_module("sdypy.EMA").Model(pairs, hz, None, *BAND, _DENOMINATOR)
        ema.get_poles(show_progress=False)
        ema.select_closest_poles(np.round(true, 1).tolist())
    return np.unique(ema.nat_freq)
