"""Points computed elsewhere: by whatever executor the user passes, or in processes of the sweep's own.

Where an executor breaks because a process of its has died, what it has answered is kept, and the points that are left are
computed in processes of the sweep's own.  There, a process that dies is replaced; the points that were under way are tried
one at a time, and one that ends its process alone, too, is a point that failed.  None is tried in the process of the caller,
who would die with it.
"""

import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
    wait,
)
from contextlib import contextmanager
from typing import Any

from boomctl.progress import end_with_parent
from boomctl.studies.sweeps.outcome import Outcome, Task, computed, failed, here

Answer = tuple[int, Outcome]
"""Which point, and what came of it."""

_AHEAD = 2  # tasks given to a pool for each of its processes, so that none waits for the next (a choice)
_DIED = "BrokenProcessPool: the process that computed it has ended without an answer"


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers:
    """The points that are to be computed, and where.

    Parameters
    ----------
    function : callable
    arguments : sequence of dict
        Of all points.
    """

    def __init__(self, function: Callable[..., Any], arguments: Sequence[dict[str, Any]]) -> None:
        self._function, self._arguments = function, arguments
        self.path: list[str] = []

    def by(self, executor: Executor, chunks: Sequence[tuple[int, ...]]) -> Generator[Answer, None, None]:
        """Compute points by an executor; where it breaks, the rest in processes of our own."""
        self.path.append(type(executor).__name__)
        lost: list[tuple[int, ...]] = []
        under_way: dict[Future[list[Outcome]], tuple[int, ...]] = {}
        broken = False
        try:
            for chunk in chunks:
                try:
                    if not broken:
                        under_way[executor.submit(computed, self._task(chunk))] = chunk
                        continue
                except BrokenExecutor:
                    broken = True
                lost.append(chunk)
            for future in as_completed(under_way):
                found = self._answers(under_way[future], future)
                if found is None:
                    lost.append(under_way[future])
                else:
                    yield from found
        finally:
            for future in under_way:
                future.cancel()
        if lost:
            self.path.append(f"the executor broke: {sum(map(len, lost))} points anew")
            yield from self.here(getattr(executor, "_max_workers", None) or cores(), sorted(lost))

    def here(self, count: int, chunks: Sequence[tuple[int, ...]]) -> Generator[Answer, None, None]:
        """Compute points in processes on this machine that are replaced when they die."""
        self.path.append(f"{count} processes")
        waiting = deque(chunks)
        while waiting:
            suspects = yield from self._until_one_dies(waiting, count)
            if suspects:
                self.path.append(f"{len(suspects)} points one at a time, as a process died")
            yield from self._one_at_a_time(suspects)

    def _until_one_dies(self, waiting: deque[tuple[int, ...]], count: int) -> Generator[Answer, None, list[int]]:
        """Compute points, taken from those that wait; return those under way when a process died."""
        under_way: dict[Future[list[Outcome]], tuple[int, ...]] = {}
        suspects: list[int] = []
        with _pool(min(count, len(waiting))) as pool:
            while waiting or under_way:
                try:
                    while waiting and not suspects and len(under_way) < _AHEAD * count:
                        future = pool.submit(computed, self._task(waiting[0]))
                        under_way[future] = waiting.popleft()
                except BrokenExecutor:  # it died while nobody looked: those under way say so below
                    if not under_way:
                        return suspects
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    chunk = under_way.pop(future)
                    found = self._answers(chunk, future)
                    if found is None:
                        suspects += chunk
                    else:
                        yield from found
                if suspects and not under_way:
                    return sorted(suspects)
        return suspects

    def _one_at_a_time(self, points: Sequence[int]) -> Generator[Answer, None, None]:
        left = deque(points)
        while left:
            with _pool(1) as pool:
                while left:
                    found = self._answers((left[0],), pool.submit(computed, self._task((left[0],))))
                    place = left.popleft()
                    if found is None:
                        yield place, Outcome(None, 0.0, _DIED)
                        break
                    yield from found

    def _task(self, chunk: Sequence[int]) -> Task:
        return Task(self._function, tuple(self._arguments[k] for k in chunk), here())

    def _answers(self, chunk: tuple[int, ...], future: "Future[list[Outcome]]") -> list[Answer] | None:
        """Return what came of points; None where the process that computed them has died."""
        try:
            return list(zip(chunk, future.result(), strict=True))
        except BrokenExecutor:
            return None
        except Exception as error:  # it could not be sent, there or back; or the executor gave it up
            return [(place, failed(error)) for place in chunk]


@contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes; an error that leaves it ends them in the middle of what they do."""
    pool = ProcessPoolExecutor(count, initializer=_begin)
    try:
        yield pool
    except BaseException:
        processes = list((getattr(pool, "_processes", None) or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()
        raise
    pool.shutdown()


def _begin() -> None:
    """Ignore interrupts, which the process that asks answers; end when that has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
