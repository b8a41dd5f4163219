"""Sweeps: a function at many points, in this process or in parallel by joblib, with failures reported."""

import inspect
import os
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing, nullcontext
from pickle import PicklingError
from typing import Any

import joblib
import numpy as np
from joblib.parallel import BACKENDS, EXTERNAL_BACKENDS, ParallelBackendBase

from boomctl.checks import function_of, instance, job_count, known, mapping, warn_user, whole
from boomctl.progress import Listener, computing
from boomctl.studies.sweeps.checkpoint import opened
from boomctl.studies.sweeps.outcome import Outcome, outcomes, outcomes_in_worker
from boomctl.studies.sweeps.points import GRID, Points
from boomctl.studies.sweeps.result import FailedPoint, SweepResult


class SweepWarning(UserWarning):
    """A function failed at some points of a sweep."""


def sweep(
    function: Callable[..., Any],
    over: Mapping[str, Any],
    *,
    combine: str = GRID,
    checkpoint: str | os.PathLike[str] | None = None,
    n_jobs: int = 1,
    backend: str | ParallelBackendBase | None = None,
    units: Mapping[str, str] | None = None,
    chunk: int | None = None,
    progress: Listener | None = None,
) -> SweepResult:
    """Call a function, or a study, at many points, and return a table of its results.

    Points at which the function fails are reported; the others are returned.

    Parameters
    ----------
    function : callable
        Called as ``function(**point)``; it returns a number, an array, or a mapping of names to numbers and arrays.  If it
        has a method ``many``, that is called with a list of points and returns a list of results, as of `SigmaStudy`.
    over : mapping of str to sequence, mapping or value
        The values of each parameter.  Objects are labeled by their ``name``, or by the keys of a mapping.  A single value,
        such as a number or a string, holds at all points.
    combine : {"grid", "zip"}, default: "grid"
        "grid": all combinations of the values.  "zip": the first values together, the second together, and so on.
    checkpoint : path, optional
        File to which each point is written as soon as it is computed, a line of JSON.  The same call resumes from it, also
        with further values; points that failed are tried again.  It answers only for the same function.  What is neither a
        number nor a string is pickled there: open no file from a source that you do not trust.
    n_jobs : int, default: 1
        Number of parallel workers, each with one BLAS thread; negative as for `joblib.Parallel`, -1: all cores.
    backend : str or joblib backend, optional
        "loky" (processes), "threading", "dask", or another backend of joblib.  If None, this process with ``n_jobs=1``, else
        joblib's default, processes unless `joblib.parallel_config` says otherwise.
    units : mapping of str to str, optional
        Units of parameters and results, for tables and plots.
    chunk : int, optional
        Number of points that a worker, or ``many``, gets at a time; by default 1, or ``function.chunk``.
    progress : callable, optional
        Called with a `Progress` at each point.

    Returns
    -------
    SweepResult
        The points with the results of the function as a table, and the points at which it failed.

    Raises
    ------
    TypeError, ValueError
        The function does not take these parameters; no values, or duplicates; unequal numbers of values with "zip"; a
        checkpoint of another function, or a function or values that cannot be hashed or sent to workers.
    OSError
        The checkpoint cannot be written.
    RuntimeError
        The function failed at every point, or a worker process died.

    Warns
    -----
    SweepWarning
        The function failed at some points.

    Examples
    --------
    >>> import boomctl as bc
    >>> def first_mode(spring_stiffness, elements):
    ...     boom = bc.spray_boom(bc.BoomParameters(spring_stiffness=spring_stiffness), elements=elements)
    ...     return {"yaw_hz": boom.eigenfrequencies_hz(1)[0]}
    >>> found = bc.sweep(first_mode, over={"spring_stiffness": [550.0, 1100.0], "elements": [6, 12]})
    >>> found["yaw_hz"].round(3)  # one row a stiffness, one column a mesh
    array([[0.178, 0.178],
           [0.245, 0.244]])
    """
    function_of("function", function, "the swept parameters")
    points = Points.of(over, combine)
    _check_call(function, points)
    labels = points.labels()
    arguments = [{name: points.axes[name][label] for name, label in point.items()} for point in labels]
    all_units = {**getattr(function, "units", {}), **mapping("units", {} if units is None else units, "names to units")}
    for name, unit in all_units.items():
        instance(f"unit of {name!r}", unit, str)
    size = whole("chunk", getattr(function, "chunk", 1) if chunk is None else chunk)
    job_count(n_jobs)
    if backend is not None:
        instance("backend", backend, (str, ParallelBackendBase), "the name of a joblib backend, or one")
    if isinstance(backend, str):
        known("backend", backend, [*BACKENDS, *EXTERNAL_BACKENDS])
    found: dict[int, Outcome] = {}
    with computing("sweep", progress) as tell, opened(checkpoint, function) as kept:
        if kept is not None:
            found |= {k: outcome for k, point in enumerate(arguments) if (outcome := kept.get(point)) is not None}
        waiting = [k for k in range(len(labels)) if k not in found]
        resumed, chunks = len(found), [waiting[k : k + size] for k in range(0, len(waiting), size)]
        with closing(_answers(function, arguments, chunks, n_jobs, backend)) as answers:
            tell("", len(found), len(labels))
            for place, outcome in answers:
                found[place] = outcome
                if kept is not None:
                    kept.add(labels[place], arguments[place], outcome)
                tell("", len(found), len(labels))
    failures = tuple(
        FailedPoint(point, found[k].error, found[k].trace) for k, point in enumerate(labels) if found[k].columns is None
    )
    _report(failures, len(labels))
    return SweepResult(
        labels={name: tuple(axis) for name, axis in points.axes.items()},
        fixed=points.fixed,
        combine=points.combine,
        points=tuple(labels),
        values=tuple(found[k].columns for k in range(len(labels))),
        failures=failures,
        seconds=np.array([found[k].seconds for k in range(len(labels))]),
        units=all_units,
        dims=dict(getattr(function, "dims", {})),
        resumed=resumed,
    )


def _check_call(function: Callable[..., Any], points: Points) -> None:
    """Raise an error for a function that does not take the parameters."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # a function of C without a signature
        return
    try:
        signature.bind(**points.axes)
    except TypeError as error:
        raise TypeError(f"function: expected one that is called with {', '.join(points.axes)}: {error}") from None


def _answers(
    function: Callable[..., Any],
    arguments: Sequence[dict[str, Any]],
    chunks: Sequence[Sequence[int]],
    n_jobs: int,
    backend: Any,
) -> Generator[tuple[int, Outcome], None, None]:
    """Yield the outcomes of points by place, as they are computed."""
    with nullcontext() if backend is None else joblib.parallel_config(backend):
        parallel = joblib.Parallel(n_jobs, return_as="generator_unordered", batch_size=1)
    task = joblib.delayed(outcomes if n_jobs == 1 and backend is None else outcomes_in_worker)
    try:
        for found in parallel(task(function, {k: arguments[k] for k in places}) for places in chunks):
            yield from found.items()
    except BrokenExecutor as error:
        raise RuntimeError(
            "A worker process died (out of memory, killed, or crashed). Points that were computed are in the checkpoint, if"
            " there is one; the same call continues from there."
        ) from error
    except PicklingError as error:
        raise TypeError(
            f"`function` and the values in `over` must be picklable with n_jobs = {n_jobs}, got {error}. Use"
            " backend='threading' for others."
        ) from error


def _report(failures: Sequence[FailedPoint], count: int) -> None:
    if not failures:
        return
    first = failures[0]
    if len(failures) == count:
        error = RuntimeError(f"function: it failed at every point; at {first.text}")
        error.add_note(first.trace)
        raise error
    warn_user(f"{len(failures)} of {count} points failed, see .failures; at {first.text}", SweepWarning)
