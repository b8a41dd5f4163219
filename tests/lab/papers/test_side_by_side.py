"""Work side by side: the same answers in the same order, clear errors, and no process left behind."""

import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from boomctl.lab.papers.bai.report import jobs as hub_beam_jobs
from boomctl.lab.papers.bai.validity import tips
from boomctl.lab.papers.side_by_side import Job, side_by_side

ROOTS = [Job(f"root of {k}", math.sqrt, (k,)) for k in range(7)]
SLEEP = """
import os, time
from boomctl.lab.papers.side_by_side import Job, side_by_side
if __name__ == "__main__":
    print(os.getpid(), flush=True)
    side_by_side([Job("sleep", time.sleep, (60.0,))] * 3, 2, lambda text: print(text, flush=True))
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 20])
def test_answers_come_in_the_order_of_the_jobs(workers):
    told = []
    assert side_by_side(ROOTS, workers, told.append) == [math.sqrt(k) for k in range(7)]
    assert len(told) == len(ROOTS)
    assert all("root of" in text for text in told)
    assert any(", " in text for text in told) is (workers > 1)


@pytest.mark.parametrize("workers", [1, 2])
def test_no_jobs_have_no_answers(workers):
    assert side_by_side([], workers) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_a_job_is_raised_here(workers):
    wrong = [*ROOTS, Job("below zero", math.sqrt, (-1.0,)), *ROOTS]
    with pytest.raises(ValueError, match=r"math domain error|nonnegative") as caught:
        side_by_side(wrong, workers)
    if workers > 1:
        assert "Traceback" in caught.value.__notes__[0]


def test_a_process_that_dies_is_named():
    with pytest.raises(RuntimeError, match=r"^killed: the process that computed it has ended"):
        side_by_side([Job("killed", os._exit, (3,)), Job("sleep", time.sleep, (60.0,))], 2)


def _not_in_the_background():
    """Let interrupts through: a shell has what it starts in the background ignore them, tests included."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_of_the_terminal_leaves_no_process_behind(tmp_path):
    script = tmp_path / "sleep.py"
    script.write_text(SLEEP)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    words = [sys.executable, str(script)]
    with subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
        preexec_fn=_not_in_the_background,
    ) as started:
        assert started.stdout is not None
        group = int(started.stdout.readline())
        assert started.stdout.readline() == "sleep\n"
        assert started.stdout.readline() == "sleep, sleep\n"
        os.killpg(group, signal.SIGINT)  # as a terminal does: to the process and to all that it started
        # the pipe ends when the last process that holds it has ended, long before the minute that each would sleep
        errors = started.communicate(timeout=20.0)[1]
    assert started.returncode != 0
    assert errors.count("Traceback") == 1
    assert "KeyboardInterrupt" in errors


@pytest.mark.slow  # both processes import what draws, and compute: 12 s
def test_the_hub_beam_is_the_same_side_by_side_and_one_after_the_other():
    some = [job for job in hub_beam_jobs() if job.name in ("Table 2", "a slew")]
    some += [Job(f"validity of {model}", tips, (model, (5.0, 50.0))) for model in ("sfoam", "foam")]
    alone, together = side_by_side(some, 1), side_by_side(some, 2)
    assert alone[0]["Table 2"][0].comparisons == together[0]["Table 2"][0].comparisons
    assert alone[1] == together[1]
    for one, other in zip(alone[2:], together[2:], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
