"""A function at many points: grids of parameters, seeds, speeds and payloads, on one machine or many."""

from __future__ import annotations

import inspect
import os
import pickle
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import closing, nullcontext
from functools import partial
from typing import Any

import numpy as np

from boomctl.checks import function_of, instance, mapping, shown, warn_user, whole
from boomctl.processes import Processes, cores
from boomctl.progress import Listener, computing, counted
from boomctl.studies.sweeps.kept import kept_sweep
from boomctl.studies.sweeps.outcome import Outcome, computed, failed, here, outcomes
from boomctl.studies.sweeps.plan import GRID, Plan
from boomctl.studies.sweeps.result import FailedPoint, SweepResult
from boomctl.threads import one_blas_thread

Answer = tuple[int, Outcome]
"""Which point, and what came of it."""

_MOST_WORKERS = 1000  # processes that a sweep begins on one machine (a choice)
_DIED = "BrokenProcessPool: the process that computed it has ended without an answer"


class SweepWarning(UserWarning):
    """Points of a sweep failed, or were computed by what may be another function."""


class _Ended(BaseException):
    """A listener's error, on its way through a function that is swept."""

    def __init__(self, error: Exception) -> None:
        self.error = error


def sweep(
    function: Callable[..., Any],
    over: Mapping[str, Any],
    executor: Executor | int | None = None,
    *,
    combine: str = GRID,
    file: str | os.PathLike[str] | None = None,
    units: Mapping[str, str] | None = None,
    chunk: int | None = None,
    progress: Listener | None = None,
) -> SweepResult:
    """Call a function, or a study, at many points, and return a table of what it answered.

    A point at which it fails is reported, and the others are kept.

    Parameters
    ----------
    function : callable
        Called as ``function(**point)``; it returns a number, an array, or a mapping of names to numbers and arrays.  A study
        is an object that can be called so; if it has a method ``many``, that is given a list of points and returns a list of
        answers: it computes many at once, as `SigmaStudy` does.  For other processes it must be one that pickles, such as a
        function of a module.
    over : mapping of str to sequence, mapping or value
        The values of each parameter.  Objects are called by their ``name``, or by what a mapping calls them.  A single value,
        such as a number or a word, is that of all points.
    executor : concurrent.futures.Executor or int, optional
        Where points are computed: a process pool, Dask's ``client.get_executor()``, one of ``mpi4py.futures``; or how many
        processes of its own the sweep begins.  By default in this process.  Others compute with one BLAS thread each.
    combine : "grid" or "zip"
        "grid": every value with every other.  "zip": the first values together, the second together, and so on.
    file : path, optional
        Where points are kept, each as soon as it is done.  The same sweep with the same file goes on where it was, also with
        further values; points that had failed are tried again.  What is neither a number, a word nor an array is pickled
        there: open no file of somebody you do not trust.
    units : mapping of str to str, optional
        Units of parameters and answers, for tables and pictures.
    chunk : int, optional
        How many points are given to an executor, or to ``many``, at a time; by default one, and those of a study's ``chunk``.
    progress : callable, optional
        Is told what is being done, as a `Progress`.

    Returns
    -------
    SweepResult
        The points and what the function answered, as a table; the points that failed.

    Raises
    ------
    TypeError, ValueError
        Not a function of these parameters; no values, or values that are there twice; with "zip", unlike many; with ``file``,
        objects without names; a file of another sweep; for processes, a function that is not defined in a module.
    OSError
        The file cannot be written to, or another sweep writes to it.
    RuntimeError
        The function failed at every point, or the executor takes no work any more.

    Warns
    -----
    SweepWarning
        Points failed; the function is no longer written as it was when the points of the file were computed.

    Notes
    -----
    A process that dies (out of memory, killed) breaks a process pool.  What was done is kept; the rest is computed in new
    processes of the sweep's own, and a point that ends its process alone, too, is one that failed.

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
    plan = Plan.of(over, combine)
    _check_call(function, plan)
    points, arguments = plan.points(), plan.arguments()
    told = {**getattr(function, "units", {}), **mapping("units", {} if units is None else units, "names to units")}
    for name, unit in told.items():
        instance(f"unit of {name!r}", unit, str)
    size = whole("chunk", getattr(function, "chunk", 1) if chunk is None else chunk)
    where = executor if executor is None or isinstance(executor, Executor) else _processes(executor)
    if isinstance(where, (int, ProcessPoolExecutor)):
        _check_sent(function)
    with computing("sweep", progress) as tell, kept_sweep(file, function, plan.axes) as kept:
        if kept and kept.changed:
            warn_user(
                f"{kept.path}: its points were computed when the function was written otherwise, or held other values; delete"
                " the file to compute them anew",
                SweepWarning,
            )
        found = {
            k: known for k, point in enumerate(points) if kept and (known := kept.get(point, arguments[k])) is not None
        }
        resumed = len(found)
        waiting = [k for k in range(len(points)) if k not in found]
        chunks = [tuple(waiting[k : k + size]) for k in range(0, len(waiting), size)]
        path = [f"{resumed} points of {file}"] if resumed else []
        answers: Generator[Answer, None, None]
        if where is None or not chunks:
            path += ["this process"] * bool(chunks)
            answers = _in_turn(
                function, arguments, chunks, lambda stage, more: tell(stage, resumed + more, len(points))
            )
        else:
            answers = _elsewhere(function, arguments, chunks, where, path)
        with closing(answers), nullcontext() if where is None else one_blas_thread:
            tell("", resumed, len(points))
            for place, outcome in answers:
                found[place] = outcome
                if kept is not None:
                    kept.keep(points[place], arguments[place], outcome)
                tell("", len(found), len(points))
    failures = tuple(
        FailedPoint(point, found[k].error, found[k].trace) for k, point in enumerate(points) if found[k].columns is None
    )
    _report(failures, len(points))
    return SweepResult(
        labels={axis.name: axis.labels for axis in plan.axes},
        fixed=tuple(axis.name for axis in plan.axes if axis.single),
        combine=plan.combine,
        points=tuple(points),
        values=tuple(found[k].columns for k in range(len(points))),
        failures=failures,
        seconds=np.array([found[k].seconds for k in range(len(points))]),
        units=told,
        dims=dict(getattr(function, "dims", {})),
        path=tuple(path),
    )


def _check_call(function: Callable[..., Any], plan: Plan) -> None:
    """Refuse a function that does not take the parameters."""
    names = [axis.name for axis in plan.axes]
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # one of C's, which does not say what it takes
        return
    try:
        signature.bind(**dict.fromkeys(names))
    except TypeError as error:
        raise TypeError(f"function: expected one that is called with {', '.join(names)}: {error}") from None


def _check_sent(function: Callable[..., Any]) -> None:
    """Refuse what other processes cannot find."""
    try:
        pickle.dumps(function)
    except Exception as error:  # pickle raises anything
        name = getattr(function, "__qualname__", type(function).__name__)
        raise TypeError(
            f"function: {name} cannot be sent to other processes ({type(error).__name__}); expected one that is defined with"
            " a name in a module, no lambda and none within another function, or no executor"
        ) from None


def _processes(executor: object) -> int:
    if isinstance(executor, (int, np.integer)) and not isinstance(executor, bool):
        return whole("executor", executor, most=_MOST_WORKERS)
    raise TypeError(
        f"executor = {shown(executor)}: expected a concurrent.futures.Executor, a number of processes, or None; of a Dask"
        " client, client.get_executor()"
    )


def _in_turn(
    function: Callable[..., Any],
    arguments: Sequence[dict[str, Any]],
    chunks: Sequence[tuple[int, ...]],
    tell: Callable[[str, int], None],
) -> Generator[Answer, None, None]:
    """Compute points in this process; what they tell of themselves stands beside the count."""
    done = 0

    def heard(stage: str) -> None:
        try:
            tell(stage, done)
        except Exception as error:
            raise _Ended(error) from None

    for chunk in chunks:
        try:
            with counted(heard):
                answers = outcomes(function, [arguments[k] for k in chunk])
        except _Ended as ended:
            raise ended.error from None
        done += len(chunk)
        yield from zip(chunk, answers, strict=True)


def _elsewhere(
    function: Callable[..., Any],
    arguments: Sequence[dict[str, Any]],
    chunks: Sequence[tuple[int, ...]],
    where: Executor | int,
    path: list[str],
) -> Generator[Answer, None, None]:
    """Compute points by an executor, or in a number of processes of the sweep's own; say in ``path`` where.

    Where the executor breaks because a process of its has died, what is left is computed in processes of the sweep's own.
    The points that a process had when it died are tried one at a time at the end; one that ends its process alone, too, has
    failed.  None is tried in the process of the caller, who would die with it.
    """
    task = partial(computed, function, asked_by=here())
    if isinstance(where, Executor):
        path.append(type(where).__name__)
        chunks = yield from _asked(where.submit, task, arguments, chunks)
        if not chunks:
            return
        path.append(f"the executor broke: {sum(map(len, chunks))} points anew")
    count: int = getattr(where, "_max_workers", None) or cores() if isinstance(where, Executor) else where
    path.append(f"{count} processes")
    with Processes(min(count, len(chunks))) as own:
        chunks = yield from _asked(partial(own.submit, own.ask), task, arguments, chunks)
    suspects = [(place,) for chunk in chunks for place in chunk]
    if suspects:
        path.append(f"{len(suspects)} points one at a time, as a process died")
        with Processes(1) as own:
            for (place,) in (yield from _asked(partial(own.submit, own.ask), task, arguments, suspects)):
                yield place, Outcome(None, 0.0, _DIED)


def _asked(
    submit: Callable[..., Any],
    task: Callable[..., list[Outcome]],
    arguments: Sequence[dict[str, Any]],
    chunks: Sequence[tuple[int, ...]],
) -> Generator[Answer, None, list[tuple[int, ...]]]:
    """Compute points; return those whose process has died."""
    under_way: dict[Future[list[Outcome]], tuple[int, ...]] = {}
    lost: list[tuple[int, ...]] = []
    try:
        for chunk in chunks:
            try:
                under_way[submit(task, tuple(arguments[k] for k in chunk))] = chunk
            except BrokenExecutor:
                lost.append(chunk)
        for future in as_completed(under_way):
            chunk = under_way[future]
            try:
                found = future.result()
            except BrokenExecutor:
                lost.append(chunk)
                continue
            except Exception as error:  # it could not be sent, there or back; or the executor gave it up
                found = [failed(error)] * len(chunk)
            yield from zip(chunk, found, strict=True)
    finally:
        for future in under_way:
            future.cancel()
    return sorted(lost)


def _report(failures: Sequence[FailedPoint], count: int) -> None:
    if not failures:
        return
    first = failures[0]
    if len(failures) == count:
        error = RuntimeError(f"function: it failed at every point; at {first.text}")
        error.add_note(first.trace)
        raise error
    warn_user(f"{len(failures)} of {count} points failed, as told by .failures; at {first.text}", SweepWarning)
