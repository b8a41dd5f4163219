"""What long computations say of themselves: to a function, on a terminal, and nowhere else."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

import boomctl as bc
from boomctl.progress import _Computation, computing
from tests import handed_out as one

CALLS = {
    "reduction": lambda **given: bc.reduce(one.yaw().select("actuator_anti", "tip_anti"), order=4, **given),
    "H-infinity synthesis": lambda **given: bc.h_infinity(one.generalized(), 1, 1, **given),
    "tuning": lambda **given: bc.tune(one.generalized(), 1, 1, bc.tunable.gain(), n_starts=1, **given),
    "robust stability": lambda **given: bc.robust_stability(one.family(), one.suspension(), **given),
    "structured margin": lambda **given: bc.analysis.robust_stability_margin(
        one.family(), one.suspension(), 1.2, **given
    ),
    "worst case": lambda **given: bc.worst_case(
        one.family(), one.suspension(), ["actuator_anti"], ["tip_anti"], **given
    ),
    "fit": lambda **given: bc.fit(
        bc.spray_boom, [0.25, 0.59], ["spring_distance"], bc.BoomParameters(), n_starts=2, **given
    ),
}


OTHERS = {
    "singular values": lambda: bc.sigma(one.boom()),
    "optimal slew": lambda: bc.optimal_slew(one.hub_beam(), 1.0, 200.0, "effort", 4.0),
    "motion": lambda: bc.hub_beam(model="foam", modes=1).simulate(bc.spin_up(2.8, 3.0), [3.0]),
    "exact motion": lambda: bc.hub_beam(model="geometrically-exact", modes=2).simulate(bc.spin_up(2.8, 1.0), [0.2]),
    "closed loop": lambda: bc.simulate_loop(
        one.hub_beam(), None, np.linspace(0.0, 0.1, 11), {"torque": np.ones(11)}, sample_time=0.01
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("task", [*CALLS, *OTHERS])
def test_listener_receives_task_and_stages(task):
    heard, given = [], []
    with bc.progress_callback(heard.append):
        (CALLS | OTHERS)[task]()
    if task in CALLS:  # an argument is a listener as well
        CALLS[task](progress=given.append)
        assert [(told.stage, told.completed, told.total) for told in given] == [
            (t.stage, t.completed, t.total) for t in heard
        ]
    task = task.removeprefix("exact ")
    assert task in {told.task for told in heard}
    assert all(told.stage for told in heard)
    assert all(0 <= told.completed <= told.total for told in heard if None not in (told.completed, told.total))
    own = [told.elapsed for told in heard if told.task == task]
    assert own == sorted(own)


def test_what_a_listener_raises_ends_the_computation():
    def enough(told):
        raise InterruptedError(told.stage)

    with pytest.raises(InterruptedError):
        CALLS["robust stability"](progress=enough)
    CALLS["robust stability"]()  # and leaves nothing behind


def test_nested_computation_reports_to_outer():
    heard = []
    with computing("outer", heard.append), computing("inner") as tell:
        tell("a stage", 1, 2)
    assert [(told.task, told.stage, told.completed, told.total) for told in heard] == [("outer", "a stage", 1, 2)]
    assert str(heard[0]).startswith("outer: a stage 1 of 2 (0 s)")
    assert pickle.loads(pickle.dumps(heard[0])) == heard[0]
    assert str(_Computation("outer", None).now()) == "outer (0 s)"  # before its first stage


SCRIPT = """
import sys, time
import boomctl.progress as p
p._QUIET_FOR = {wait}
with p.{around}, p.computing("a long one") as tell:
    tell("its stage", 3, 7)
    {until}
print("done")
"""


def shown(wait, around="computing('outermost')", until="time.sleep(0.9)", **environment):
    """Return what a script shows on a terminal of its own; a line is typed there once it shows the stage."""
    import pty

    here, there = pty.openpty()
    given = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "TERM": "xterm", **environment}
    given.pop("NO_COLOR", None)
    words = [sys.executable, "-c", SCRIPT.format(wait=wait, around=around, until=until)]
    with subprocess.Popen(words, stdout=there, stderr=there, stdin=there, env=given) as process:
        os.close(there)
        seen = b""
        while True:
            try:
                piece = os.read(here, 4096)
            except OSError:  # its other end is closed
                break
            if not piece:
                break
            if b"its stage" in seen + piece and b"its stage" not in seen:
                os.write(here, b"\n")
            seen += piece
        assert process.wait() == 0
    os.close(here)
    return seen.decode()


@pytest.mark.skipif(os.name != "posix", reason="terminals of their own are a thing of POSIX")
def test_progress_line_on_terminal():
    seen = shown(0.05, until="sys.stdin.readline()")
    assert "outermost: its stage 3 of 7" in seen
    assert seen.rstrip().endswith("done")
    assert "\x1b[2K" in seen  # the line is erased


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="terminals of their own are a thing of POSIX")
@pytest.mark.parametrize(
    ("wait", "around", "environment"),
    [
        (3.0, "computing('outer')", {}),
        (0.05, "progress_callback(None)", {}),
        (0.05, "computing('outer')", {"TERM": "dumb"}),
    ],
    ids=["short", "nobody", "dumb"],
)
def test_a_terminal_shows_nothing(wait, around, environment):
    assert shown(wait, around, **environment).strip() == "done"


@pytest.mark.slow
def test_a_pipe_shows_nothing():
    words = [sys.executable, "-c", SCRIPT.format(wait=0.0, around="computing('outer')", until="time.sleep(0.9)")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    assert (done.stdout, done.stderr) == ("done\n", "")
