"""Sweeps: a function at many points, in this process or in parallel by joblib, with failures reported."""

import os
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import BrokenExecutor
from contextlib import closing, nullcontext
from itertools import product
from math import prod
from pickle import PicklingError
from typing import Any

import joblib
import numpy as np
from joblib.parallel import BACKENDS, EXTERNAL_BACKENDS

from boomctl.checks import function_of, instance, job_count, known, mapping, sequence, shown, warn_user
from boomctl.exceptions import SweepWarning
from boomctl.progress import Listener, computing, silent
from boomctl.studies.sweeps.checkpoint import Checkpoint, Outcome
from boomctl.studies.sweeps.result import FailedPoint, Label, SweepResult
from boomctl.threads import one_blas_thread

_MAX_POINTS = 1_000_000  # the table of a larger sweep takes more than a gigabyte
_TRACE_CALLS = 20  # last calls of a traceback that are stored


def sweep(
    function: Callable[..., Any],
    parameters: Mapping[str, Any],
    *,
    mode: str = "grid",
    checkpoint: str | os.PathLike[str] | None = None,
    n_jobs: int = 1,
    backend: str | None = None,
    units: Mapping[str, str] | None = None,
    progress: Listener | None = None,
) -> SweepResult:
    """Call a function at many points, and return a table of its results.

    Points at which the function fails are reported; the others are returned.

    Parameters
    ----------
    function : callable
        Called as ``function(**point)``; it returns a number, an array, or a mapping of names to numbers and arrays.
    parameters : mapping of str to sequence, mapping or value
        The values of each parameter.  Objects are labeled by their ``name``, or by the keys of a mapping.  A single value,
        such as a number or a string, holds at all points.
    mode : {"grid", "zip"}, default: "grid"
        "grid": all combinations of the values.  "zip": the first values together, the second together, and so on.
    checkpoint : path, optional
        File to which each point is written as soon as it is computed, as a line of JSON. The same call resumes from it,
        also with more values; failed points are evaluated again. Another function raises an error. Results other than
        numbers and strings are pickled: do not open files from untrusted sources.
    n_jobs : int, default: 1
        Number of parallel workers, each with one BLAS thread; negative as for `joblib.Parallel`, -1: all cores.
    backend : str, optional
        "loky" (processes), "threading", "dask", or another backend that joblib knows by name.  If None, this process with
        ``n_jobs=1``, else joblib's default, processes unless `joblib.parallel_config` says otherwise.
    units : mapping of str to str, optional
        Units of parameters and results, for tables and plots.
    progress : callable, optional
        Called with a `Progress` at each point.

    Returns
    -------
    SweepResult
        The points with the results of the function as a table, and the points at which it failed.

    Raises
    ------
    TypeError, ValueError
        If `function` is not callable, values are missing or duplicate, their numbers differ with "zip", the
        checkpoint is of another function, or the function or values cannot be hashed or sent to workers.
    OSError
        If the checkpoint cannot be written.
    RuntimeError
        If the function failed at every point, or a worker process died.

    Warns
    -----
    SweepWarning
        If the function failed at some points.

    Examples
    --------
    >>> import boomctl as bc
    >>> def first_mode(spring_stiffness, elements):
    ...     boom = bc.spray_boom(bc.BoomParameters(spring_stiffness=spring_stiffness), elements=elements)
    ...     return {"yaw_hz": boom.eigenfrequencies_hz(1)[0]}
    >>> found = bc.sweep(first_mode, parameters={"spring_stiffness": [550.0, 1100.0], "elements": [6, 12]})
    >>> found["yaw_hz"].round(3)  # one row for each stiffness, one column for each mesh
    array([[0.178, 0.178],
           [0.245, 0.244]])
    """
    function_of("function", function, "the swept parameters")
    axes = _axes(parameters)
    swept = tuple(name for name, values in parameters.items() if not _is_single(values))
    shape = tuple(len(axes[name]) for name in swept)
    if known("mode", mode, ("grid", "zip")) == "grid":
        if prod(shape) > _MAX_POINTS:
            raise ValueError(f"`parameters` must have at most {_MAX_POINTS:,} points, got {prod(shape):,}.")
        rows: Iterable[tuple[Label, ...]] = product(*axes.values())
    else:
        if len(set(shape)) > 1:
            sizes = ", ".join(f"{size} of {name}" for size, name in zip(shape, swept, strict=True))
            raise ValueError(
                f"`parameters` must have as many values of each parameter with combine = 'zip', got {sizes}."
            )
        shape = shape[:1] or (1,)
        rows = zip(*(axis if name in swept else [*axis] * shape[0] for name, axis in axes.items()), strict=True)
    points = [dict(zip(axes, row, strict=True)) for row in rows]
    arguments = [{name: axes[name][label] for name, label in point.items()} for point in points]
    named = mapping("units", {} if units is None else units, "names to units")
    job_count(n_jobs)
    if backend is not None:
        known("backend", instance("backend", backend, str), [*BACKENDS, *EXTERNAL_BACKENDS])
    result: dict[int, Outcome] = {}
    with computing("sweep", progress) as tell:
        file = None if checkpoint is None else Checkpoint(checkpoint, function)
        if file is not None:
            result |= {k: outcome for k, point in enumerate(arguments) if (outcome := file.get(point)) is not None}
        resumed, waiting = len(result), {k: point for k, point in enumerate(arguments) if k not in result}
        with closing(_outcomes(function, waiting, n_jobs, backend)) as outcomes:
            tell("", len(result), len(points))
            for k, outcome in outcomes:
                result[k] = outcome
                if file is not None:
                    file.add(points[k], arguments[k], outcome)
                tell("", len(result), len(points))
    ordered = [result[k] for k in range(len(points))]
    failed = [(points[k], item) for k, item in enumerate(ordered) if item.columns is None]
    failures = tuple(FailedPoint(point, item.error, item.trace) for point, item in failed)
    _report(failures, len(points))
    labels = {name: tuple(axis) for name, axis in axes.items()}
    values, elapsed = tuple(item.columns for item in ordered), np.array([item.elapsed for item in ordered])
    return SweepResult(labels, swept, shape, tuple(points), values, failures, elapsed, dict(named), resumed)


def _axes(over: object) -> dict[str, dict[Label, Any]]:
    """Return the values of each parameter by label."""
    axes = {}
    for name, values in mapping("parameters", over, "parameters to values").items():
        what = f"parameters[{instance('a name in over', name, str)!r}]"
        labeled = _labeled(what, (values,) if _is_single(values) else values)
        axes[name] = dict(labeled)
        if not labeled or len(axes[name]) < len(labeled) or any(label != label for label in axes[name]):
            shows = shown([label for label, _ in labeled])
            raise ValueError(f"`{what}` must be different values, none of them NaN, got {shows}.")
    if not axes:
        raise ValueError("`parameters` must have at least one parameter, got none.")
    return axes


def _labeled(what: str, values: Any) -> list[tuple[Label, Any]]:
    """Return values with their labels: keys of a mapping, numbers and strings themselves, else names or positions."""
    if isinstance(values, Mapping):
        return [(instance(f"a name in {what}", name, str), value) for name, value in values.items()]
    result = [_plain(value) for value in sequence(what, values)]
    labels = [value if isinstance(value, (int, float, str)) else getattr(value, "name", None) for value in result]
    if not all(
        value is None or isinstance(label, (int, float, str)) for label, value in zip(labels, result, strict=True)
    ):
        labels = [*range(len(result))]
    return list(zip(labels, result, strict=True))


def _plain(value: Any) -> Any:
    """Return a scalar of NumPy as a number of Python, other values unchanged."""
    return value.item() if isinstance(value, np.generic) or getattr(value, "ndim", None) == 0 else value


def _is_single(values: object) -> bool:
    """Return whether this is one value rather than several; a system is one, although it is iterable."""
    several = isinstance(values, Iterable) and getattr(values, "ndim", 1) > 0 and not hasattr(values, "ninputs")
    return isinstance(values, str) or not several


def _outcomes(
    function: Callable[..., Any], waiting: Mapping[int, dict[str, Any]], n_jobs: int, backend: Any
) -> Generator[tuple[int, Outcome], None, None]:
    """Yield the outcomes of points by index, as they are computed."""
    with nullcontext() if backend is None else joblib.parallel_config(backend):
        parallel = joblib.Parallel(n_jobs, return_as="generator_unordered", batch_size=1)
    here = n_jobs == 1 and backend is None
    try:
        yield from parallel(joblib.delayed(_outcome)(function, k, point, here) for k, point in waiting.items())
    except BrokenExecutor as error:
        raise RuntimeError(
            "A worker process died (out of memory, killed, or crashed). Points that were computed are in the checkpoint, if"
            " there is one; the same call continues from there."
        ) from error
    except PicklingError as error:
        raise TypeError(
            f"`function` and the values in `parameters` must be picklable with n_jobs = {n_jobs}, got {error}. Use"
            " backend='threading' for others."
        ) from error


def _outcome(function: Callable[..., Any], index: int, arguments: dict[str, Any], here: bool) -> tuple[int, Outcome]:
    """Return the outcome of a point; a worker computes it with one BLAS thread."""
    start = time.perf_counter()
    try:
        with silent(), nullcontext() if here else one_blas_thread:
            value = function(**arguments)
        named = value if isinstance(value, Mapping) else {"value": value}
        columns = {instance("a name that the function returned", name, str): _plain(x) for name, x in named.items()}
        return index, Outcome(columns, time.perf_counter() - start)
    except (Exception, SystemExit) as error:  # a function that calls sys.exit fails at one point
        text = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")
        trace = "".join(traceback.format_exception(type(error), error, error.__traceback__, limit=-_TRACE_CALLS))
        return index, Outcome(None, time.perf_counter() - start, text, trace)


def _report(failures: tuple[FailedPoint, ...], count: int) -> None:
    if not failures:
        return
    first = failures[0]
    if len(failures) == count:
        error = RuntimeError(f"function: it failed at every point; at {first.text}")
        error.add_note(first.trace)
        raise error
    warn_user(f"{len(failures)} of {count} points failed, see .failures; at {first.text}", SweepWarning)
