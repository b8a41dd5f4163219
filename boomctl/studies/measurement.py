"""Modes and a model from a file of measurements, with a report, for ``boomctl identify``."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, positive
from boomctl.exceptions import BoomctlWarning
from boomctl.files import json_text, read_numbers
from boomctl.identification.files.frequency_response import read_frequency_response
from boomctl.identification.identify import IdentificationResult, identify
from boomctl.identification.response import FrequencyResponseEstimate, estimate_frequency_response
from boomctl.plotting.canvas import figure_of, picture
from boomctl.report import Report, Section, Table, number
from boomctl.studies.evaluation import word_table

_TIMES = ("t", "time", "time_s", "t_s")  # names of a column of times [s]
_FREQUENCIES = ("freq_hz", "frequency_hz")  # of the first column of a measured response
# In results.json.
_OF_MODE = ("frequency_hz", "damping_ratio", "frequency_interval_hz", "damping_ratio_interval", "energy_fraction")
_OF_RESULT = ("fit_percent", "frequency_range_hz", "confidence_level", "uncertainty_source")
_EVEN = 1e-3  # largest relative deviation of sample times from an even grid: rounding in files


def _report(path: Path, result: IdentificationResult, response: FrequencyResponseEstimate | None) -> Report:
    """Return modes with intervals, the fit of each output, figures, and the model as a file; ``response``: of a record."""
    modes = Table(("frequency", "damping", "share of energy"), tuple(map(result._row, result.modes)), align="l")
    fits = {name: number(percent, 4) for name, percent in result.fit_percent.items()}
    caption = "Stabilization diagram with the identified modes; spectra of outputs and residuals"
    pictures = [picture("identification", figure_of(result.plot), caption)]
    if response is not None:
        caption = f"Frequency response and coherence, from {response.source}"
        pictures.append(picture("response", figure_of(response.plot), caption))
    system = result.system
    matrices = {letter: np.asarray(getattr(system, letter)).tolist() for letter in "ABCD"}
    model = {"inputs": list(system.input_labels), "outputs": list(system.output_labels), **matrices}
    text = f"{result.uncertainty_source}; intervals of {100.0 * result.confidence_level:g} %."
    sections = (
        Section("Modes", (text,), (modes,)),
        Section("Share of each output that is predicted", (), (word_table(fits, ("output", "fit [%]")),)),
        Section("Pictures", (), (), tuple(pictures)),
    )
    low, high = result.frequency_range_hz
    results = {
        "file": path.name,
        "modes": [{name: getattr(mode, name) for name in _OF_MODE} for mode in result.modes],
        **{name: getattr(result, name) for name in _OF_RESULT},
    }
    lead = f"{len(result.modes)} modes from {low:.4g} to {high:.4g} Hz."
    return Report(f"Modes of {path.name}", (lead,), sections, results, {"model.json": json_text(model)})


def identified_file(
    path: Path, inputs: Sequence[str], outputs: Sequence[str], sample_time: float | None, **options: Any
) -> tuple[IdentificationResult, Report]:
    """Identify a machine from a record (CSV, .mat) or from a measured frequency response (CSV, UFF), and report it.

    Raises
    ------
    OSError, ValueError
        If the file cannot be read, names are unknown, times are not equidistant, or `identify` raises an error.
    """
    columns = _columns(path)
    if columns is None:
        curve = read_frequency_response(path)
        if curve.response is None:
            raise ValueError(f"{path}: expected a record over time or a complex frequency response, got magnitudes")
        if inputs or outputs or sample_time is not None:
            raise ValueError(f"{path}: expected no inputs, outputs or sample time for a measured frequency response")
        result = identify(curve.response, **options)
        return result, _report(path, result, None)
    time = next((name for name in columns if name.lower() in _TIMES), None)
    signals = [name for name in columns if name != time]
    if not inputs:
        raise ValueError(f"{path}: expected the names of inputs, --inputs; the file has {', '.join(signals)}")
    for name in (*inputs, *outputs):
        known("signal", name, signals)
    step = _step(path, None if time is None else columns[time], sample_time)
    driven = {name: columns[name] for name in inputs}
    moved = {name: columns[name] for name in outputs or signals if name not in inputs}
    if not moved:
        raise ValueError(f"{path}: expected outputs in addition to the inputs, got none")
    result = identify(driven, moved, step, **options)
    given: dict[str, Any] = {name: options.get(name) for name in ("frequency_range_hz", "intersample")}
    given["quantity"] = options.get("quantity") or "displacement"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BoomctlWarning)  # of the record: `identify` has issued them
        response = estimate_frequency_response(driven, moved, step, **given)
    return result, _report(path, result, response)


def _columns(path: Path) -> Mapping[str, Array] | None:
    """Return the signals of a record by name; None where the file is a response over frequency."""
    if path.suffix.lower() == ".mat":
        from scipy import io  # long to import, and few files are such

        try:
            result = io.loadmat(path, squeeze_me=True)
        except (NotImplementedError, ValueError) as error:
            raise ValueError(f"{path}: expected a MAT file up to version 7 ({error})") from None
        vectors = {name: value for name, value in result.items() if not name.startswith("__") and np.ndim(value) == 1}
        if not vectors:
            raise ValueError(f"{path}: expected vectors of numbers, one a signal, got none")
        return vectors
    if path.suffix.lower() != ".csv":
        return None
    table = read_numbers(path)
    if table.header[0].lower() in _FREQUENCIES:
        return None
    return dict(zip(table.header, table.values.T, strict=True))


def _step(path: Path, times: Array | None, sample_time: float | None) -> float:
    """Return the sample time, from the argument or the column of times."""
    if (times is None) == (sample_time is None):
        raise ValueError(f"{path}: expected a column named 'time' [s], or --sample-time, and not both")
    if times is None:
        return positive("sample_time", sample_time)
    steps = np.diff(times)
    step = float(steps.mean()) if len(steps) else 0.0
    if step <= 0.0 or np.abs(steps - step).max() > _EVEN * step:
        raise ValueError(
            f"{path}: expected times at even steps, got from {steps.min(initial=np.inf):.6g} to"
            f" {steps.max(initial=0.0):.6g} s; write the parts on both sides of a gap to separate files"
        )
    return step
