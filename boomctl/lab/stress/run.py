"""All cases, those asked for of them, and what came of them."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from importlib import import_module

from boomctl.lab.stress.case import Case, Line, Outcome, tried
from boomctl.lab.stress.report import StressReport
from boomctl.processes import Processes

_MEMORY = (
    8 * 2**30
)  # bytes that a case may ask for: what a small machine has, libraries of some 3 GB of addresses included

# in the order of the table; imported when they are tried
_ROOMS = (
    "boomctl.lab.stress.structures",
    "boomctl.lab.stress.hub_beams",
    "boomctl.lab.stress.systems",
    "boomctl.lab.stress.loops",
    "boomctl.lab.stress.motions",
    "boomctl.lab.stress.inputs",
)


def all_cases(full: bool = False, rows: str = "") -> list[Case]:
    """Return the cases to try.

    Parameters
    ----------
    full : bool
        Also those that take long.
    rows : str
        Part of the name of a case, or a pattern with ``*``; letters may be small or capital.  Empty: all.

    Raises
    ------
    ValueError
        There is no such case.
    """
    every = [case for room in _ROOMS for case in import_module(room).cases() if full or not case.full]
    wanted = rows.lower() if "*" in rows else f"*{rows.lower()}*"
    chosen = [case for case in every if fnmatchcase(case.name.lower(), wanted)]
    if not chosen:
        areas = ", ".join(dict.fromkeys(case.area for case in every))
        raise ValueError(f"rows = {rows!r}: expected part of a row's name; there are rows of: {areas}")
    return chosen


def stressed(cases: list[Case], workers: int = 2, tell: Callable[[str], None] = lambda text: None) -> StressReport:
    """Try cases side by side, in processes of their own; ``tell`` is told the name of each when it begins."""
    began = time.monotonic()
    return StressReport(tuple(all_tried(cases, workers, tell)), time.monotonic() - began)


def all_tried(cases: Sequence[Case], workers: int, tell: Callable[[str], None]) -> list[Line]:
    """Return what came of each case, in their order: one that hangs, dies or eats the memory costs its own line alone."""
    with Processes(min(workers, len(cases)), "spawn") as processes:

        def line(case: Case) -> Line:
            tell(case.name)
            began = time.monotonic()
            try:
                processes.ask(_prepared, case)
                found = processes.ask(tried, case, seconds=case.seconds)
            except TimeoutError:
                found = Line(case, Outcome.BROKEN, None, f"no answer in {case.seconds:g} s")
            except MemoryError:
                found = Line(case, Outcome.BROKEN, None, f"more memory than {_MEMORY / 2**30:g} GB")
            except BrokenExecutor:
                said = f"the process that computed it has ended, after {time.monotonic() - began:.1f} s"
                found = Line(case, Outcome.BROKEN, None, said)
            return replace(found, seconds=time.monotonic() - began)

        return list(processes.map(line, cases))


def _prepared(case: Case) -> None:
    """Limit the memory of a process; that it understands this says that it has begun, and loaded what the case needs."""
    with suppress(ImportError):
        import resource  # there is none on Windows

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
