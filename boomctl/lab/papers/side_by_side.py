"""Independent pieces of work, side by side in processes of their own, or one after the other in this one."""

from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from dataclasses import dataclass
from threading import Lock
from typing import Any

from boomctl.processes import Processes


@dataclass(frozen=True)
class Job:
    """A piece of work that waits for no other.

    Attributes
    ----------
    name : str
        For whoever waits.
    work : callable
        A function of a module, so that another process finds it.
    arguments : tuple
        What it is given; they and what it returns can be pickled.
    """

    name: str
    work: Callable[..., Any]
    arguments: tuple[Any, ...] = ()


def side_by_side(jobs: Sequence[Job], workers: int, tell: Callable[[str], None] = lambda text: None) -> list[Any]:
    """Return what each job returns, in their order.

    Parameters
    ----------
    jobs : sequence of Job
        The longest first, so that no worker is left alone with one at the end.
    workers : int
        Processes; each computes with one BLAS thread unless the environment says otherwise.  1: this process does it all.
    tell : callable
        Told, whenever a job begins, which ones are under way.

    Raises
    ------
    Exception
        What a job raises, the other jobs being ended.
    RuntimeError
        A process ended without an answer.
    """
    if min(workers, len(jobs)) <= 1:
        found = []
        for job in jobs:
            tell(job.name)
            found.append(job.work(*job.arguments))
        return found
    under_way: dict[int, str] = {}
    telling = Lock()
    with Processes(min(workers, len(jobs)), "spawn") as processes:

        def done(i: int) -> Any:
            with telling:
                under_way[i] = jobs[i].name
                tell(", ".join(under_way.values()))
            try:
                return processes.ask(jobs[i].work, *jobs[i].arguments)
            except BrokenExecutor:
                raise RuntimeError(f"{jobs[i].name}: the process that computed it has ended") from None
            finally:
                with telling:
                    del under_way[i]

        answers = [processes.submit(done, i) for i in range(len(jobs))]
        for answer in as_completed(answers):
            answer.result()  # an error ends the other jobs
    return [answer.result() for answer in answers]
