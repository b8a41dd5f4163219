"""All cases, those asked for of them, and what came of them."""

import time
from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
from importlib import import_module

from boomctl.lab.stress.case import Case
from boomctl.lab.stress.pool import all_tried
from boomctl.lab.stress.report import StressReport

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
    every = [case for room in _ROOMS for case in _cases(room) if full or not case.full]
    wanted = rows.lower() if "*" in rows else f"*{rows.lower()}*"
    chosen = [case for case in every if fnmatchcase(case.name.lower(), wanted)]
    if not chosen:
        areas = ", ".join(dict.fromkeys(case.area for case in every))
        raise ValueError(f"rows = {rows!r}: expected part of a row's name; there are rows of: {areas}")
    return chosen


def _cases(room: str) -> Iterator[Case]:
    return import_module(room).cases()


def stressed(cases: list[Case], workers: int = 2, tell: Callable[[str], None] = lambda text: None) -> StressReport:
    """Try cases side by side, in processes of their own; ``tell`` is told the name of each when it begins."""
    began = time.monotonic()
    return StressReport(tuple(all_tried(cases, workers, tell)), time.monotonic() - began)
