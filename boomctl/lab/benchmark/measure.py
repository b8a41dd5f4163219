"""A scene measured: who answers, how wrong, how fast from new parameters and with the model ready, and with how much memory.

Each setting answers once in either way and is judged by the worse of the two.  Then all take turns, so that a machine that
is slow for a while is slow for everyone.  What is measured is the processor time of this process, all its threads, and of
the processes that it waited for; BLAS has its default threads.  A call that is short is repeated in its turn, as it is in
use, the first one untimed.
"""

import gc
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count
from math import ceil, inf, isfinite, sqrt
from statistics import median
from timeit import Timer
from typing import Any

from boomctl.lab.benchmark.diagram import Diagram, Point, Way
from boomctl.lab.benchmark.scene import Scene, Setting, Tell
from boomctl.lab.benchmark.timing import peak_memory, processor_time

_TURN = 0.02  # least duration of a turn [s]: twenty thousand times the resolution of the processor's clock (a choice)
_MOST_CALLS = 1000  # in a turn (a choice): of what takes 20 us and more a whole turn's worth
_LONG = 2.0  # s from which on one call is enough: noise of a few per cent is nothing on a log axis (a choice)
_MOST_TURNS = 15  # of one way (a choice): the median of so many lies within a few per cent
_FEWEST_TURNS = 3  # of what is short, also where the time is up: the fewest that have a median (a choice)
_SHORT = 0.3  # s up to which noise shows, so that one turn is not enough (a choice)
_CHANGES = (
    1e-9,
    1e-6,
)  # least and largest relative change of a parameter in a cold call: new to every cache, the same problem
_GOLDEN = (sqrt(5.0) - 1.0) / 2.0  # its multiples modulo one never meet again and spread evenly
_TRACED = 0.05  # share of the seconds given up to which a call is traced for its memory: that takes ten times as long
_WORDS = 160  # characters of a failure that are kept: the first line of most (a choice)


@dataclass
class _Run:
    """One way of one setting: what is called, and what was measured so far."""

    call: Callable[[], object]
    first: float
    clock: Callable[[], float]
    failed: str = ""
    once: float = 0.0
    calls: int = 1
    turns: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        return self.once * self.calls

    def taken(self, times: int) -> float:
        """Return the processor time of so many calls [s]; what fails with changed parameters takes no further turns."""
        try:
            return Timer(self.call, timer=self.clock).timeit(times)  # garbage is not collected meanwhile
        except Exception as raised:
            self.failed = _in_words(raised)
            return 0.0


def measured(scene: Scene, seconds: float, tell: Tell) -> Diagram:
    """Return the diagram of a scene.

    Parameters
    ----------
    scene : Scene
    seconds : float
        What the turns of a whole share may take together; first answers, and calls traced for memory, come on top.
    tell : callable
        Told in words what comes next.

    Notes
    -----
    A setting that raises, or whose answer is not finite, is a point with ``failed``.  Warnings are silent here: that a
    setting is inexact is what its error says.  Memory is what Python and NumPy allocate in a cold call (a hot one if there is
    no other), by :mod:`tracemalloc`: work space within compiled solvers and in other processes is not in it.  It is not
    measured for calls longer than 2 s, or than a twentieth of ``seconds``.
    """
    changes, seconds = _changes(), scene.share * seconds
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        answered: list[tuple[Point, dict[Way, _Run]]] = []
        for setting in scene.settings:
            tell(f"{scene.key}: {setting.competitor}, {setting.label}")
            answered.append(_answer(setting, scene, changes))
        runs = [run for point, ways in answered if not point.failed for run in ways.values()]
        tell(f"{scene.key}: {len(runs)} runs take turns")
        _take_turns(runs, seconds)
        tell(f"{scene.key}: memory")
        points = tuple(_timed(*found, min(_LONG, _TRACED * seconds)) for found in answered)
    said = scene.title, scene.question, scene.measure
    found = Diagram(scene.key, *said, points, scene.missing, scene.remarks, shows=scene.shows)
    return replace(found, kept=tuple(promise.of(found) for promise in scene.promises))


def _changes() -> Iterator[float]:
    low, high = _CHANGES
    return (low + (high - low) * (k * _GOLDEN % 1.0) for k in count(1))


def _answer(setting: Setting, scene: Scene, changes: Iterator[float]) -> tuple[Point, dict[Way, _Run]]:
    """Ask a setting once in either way, unchanged, and judge what it says."""

    def clock() -> float:
        return processor_time() + scene.elsewhere()

    runs: dict[Way, _Run] = {}
    worst, answer = 0.0, None
    silent = Point(setting.competitor, setting.label, setting.ours, inf, call=setting.call, size=setting.size)
    try:
        cold, hot = setting.cold, setting.hot
        if cold is not None:
            start = clock()
            answer = cold(0.0)
            runs["cold"] = _Run(lambda: cold(next(changes)), clock() - start, clock)
            worst = max(worst, _judged(scene.error, answer))
        if hot is not None:
            ready = setting.prepare()
            start = clock()
            answer = hot(ready)
            runs["hot"] = _Run(lambda: hot(ready), clock() - start, clock)
            worst = max(worst, _judged(scene.error, answer))
        numbers = scene.found(answer) if runs else {}
    except Exception as raised:  # whatever a competitor raises is a point that failed, and said to be one
        return replace(silent, failed=_in_words(raised)), {}
    failed = "" if runs and isfinite(worst) else "its answer is not finite" if runs else "it has no way to answer"
    return replace(silent, error=worst if runs else inf, failed=failed, found=numbers), runs


def _in_words(raised: Exception) -> str:
    return f"{type(raised).__name__}: {' '.join(str(raised).split())}"[:_WORDS]


def _judged(error: Callable[[Any], float], answer: Any) -> float:
    found = float(error(answer))
    return found if isfinite(found) else inf


def _take_turns(runs: list[_Run], seconds: float) -> None:
    for run in runs:
        if run.first > _LONG:
            run.turns.append(run.first)  # the first call is the one
            continue
        # what an import costs is a share of what is long; above zero: a tick of the clock may be 1e-7 s
        run.once = run.first if run.first > _SHORT else max(run.taken(1), 1e-7)
        run.calls = min(_MOST_CALLS, ceil(_TURN / run.once))
    asked = [run for run in runs if not run.turns]
    share = seconds / max(len(asked), 1)
    wanted = [min(_MOST_TURNS, max(_FEWEST_TURNS if run.cost < _SHORT else 1, int(share / run.cost))) for run in asked]
    gc.collect()
    for k in range(max(wanted, default=0)):
        for run, turns in zip(asked, wanted, strict=True):
            if k < turns and not run.failed:
                if run.calls > 1:  # in use a call follows one of its own kind, not another program's
                    run.taken(1)
                run.turns.append(run.taken(run.calls) / run.calls)


def _timed(point: Point, runs: dict[Way, _Run], traced: float) -> Point:
    """Return a point with what was measured, its memory included where a call takes no longer than ``traced``."""
    failed = point.failed or next((run.failed for run in runs.values() if run.failed), "")
    if failed:
        return replace(point, error=inf, failed=failed)
    memory = None
    from_new = runs.get("cold") or runs["hot"]
    if median(from_new.turns) <= traced:
        memory = peak_memory(from_new.call)
    times = {way: median(run.turns) for way, run in runs.items()}
    again = runs.get("hot") or runs["cold"]
    return replace(
        point,
        cold=times.get("cold"),
        hot=times.get("hot"),
        memory=memory,
        calls=len(again.turns) * again.calls,
    )
