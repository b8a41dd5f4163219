"""Slews that take long: the time limit, progress, interrupts, and what made some of them slow."""

import os
import pickle
import signal
import subprocess
import sys
import time
from contextlib import suppress
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import boomctl as bc
from boomctl import progress
from boomctl.slew import SlewProgress, TorqueProfile, replan

LONG = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
import boomctl as bc
try:
    {call}
except KeyboardInterrupt:
    print("stopped", flush=True)
    sys.exit(3)
"""
SLOW_CALLS = {
    "in IPOPT": (
        "bc.optimal_slew(bc.hub_beam(modes=3), 1000.0, 200.0, 'effort', 190.0, intervals=800, **endless)",
        "iteration 2",
    ),
    "in switching times": (
        "bc.optimal_slew(bc.hub_beam(modes=3), 1.6, 200.0, tip_masses=(3e-6,), **endless)",
        "",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("where", SLOW_CALLS)
def test_an_interrupt_stops_a_slew_within_two_seconds(where):
    call, stage = SLOW_CALLS[where]
    telling = "endless = {'progress': lambda seen: print(seen.stage, flush=True), 'time_limit': 1e5}\n    "
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", LONG.format(call=telling + call)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if stage in line:
                break
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        out, errors = child.communicate(timeout=120)
    assert child.returncode == 3, errors
    assert "stopped" in out


def sfoam(modes=3):
    return bc.hub_beam(model="sfoam", modes=modes)


@pytest.mark.parametrize("objective", ["time", "tip"])
def test_the_time_limit_is_of_every_way(objective):
    duration = None if objective == "time" else 4.5
    with pytest.raises(
        bc.exceptions.SlewError, match=r"^time_limit = 0\.001 s: exceeded .*; stage: .* Expected more time"
    ):
        bc.optimal_slew(sfoam(), np.pi / 2, 200.0, objective, duration, time_limit=1e-3)


@pytest.fixture
def late(monkeypatch):
    """Return a list: with each entry that it gets, the clock of a search goes on by a million seconds."""
    found = []
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: time.monotonic() + 1e6 * len(found)))
    return found


@pytest.mark.slow
def test_out_of_time_the_best_verified_slew_is_returned(late):
    asked = sfoam(1), 1.0, 200.0, "jerk", 4.0
    whole = bc.optimal_slew(*asked)

    def over(seen):  # the time of the search is over once a second mesh has begun
        if "100 intervals" in seen.stage:
            late.append(seen)

    found = bc.optimal_slew(*asked, time_limit=1e5, progress=over)
    assert any("out of time" in step for step in found.stages)
    assert (whole.success, found.success) == (True, False)
    assert whole.nit > 0
    assert found.terminal_error <= 1e-6
    assert found.certificate.constraint_violation <= 1e-9
    assert found.cost >= whole.cost * (1.0 - 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("objective", "limit"), [("tip", 1.0), ("tip", 6.0), ("time", 1.0), ("time", 4.0)])
def test_optimal_slew_ends_near_time_limit(objective, limit, monkeypatch):
    """In processor time, which other processes do not take; IPOPT's own limit is of wall time, which is not less."""
    beam, duration = bc.hub_beam(model="cfoam", modes=3), None if objective == "time" else 3.0
    begin = time.process_time()
    shift = time.monotonic() - begin
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: shift + time.process_time()))
    with suppress(bc.exceptions.SlewError):
        bc.optimal_slew(beam, 1.0, 200.0, objective, duration, time_limit=limit)
    assert time.process_time() - begin < limit + 0.5


def test_progress_is_told_in_small_frozen_records():
    told = []
    found = bc.optimal_slew(sfoam(1), 1.0, 200.0, "effort", 4.0, progress=told.append, intervals=60)
    assert told
    assert all(isinstance(each, SlewProgress) for each in told)
    assert all(later.elapsed >= sooner.elapsed for sooner, later in pairwise(told))
    with pytest.raises(AttributeError):
        told[0].stage = "else"
    assert pickle.loads(pickle.dumps(found)).cost == found.cost  # it keeps nothing of who was told
    count = len(told)
    again = replan(found, angle=1.1, progress=told.append)
    assert len(told) > count
    assert again.hub_angle[-1] == pytest.approx(1.1, abs=1e-6)


def test_what_progress_raises_comes_through():
    class EnoughError(Exception):
        pass

    def stop(seen):
        raise EnoughError

    with pytest.raises(EnoughError):
        bc.optimal_slew(sfoam(1), 1.0, 200.0, "effort", 4.0, progress=stop)


def test_an_interrupt_is_not_lost_to_another_exception():
    def stop(seen):
        signal.raise_signal(signal.SIGINT)
        raise ValueError

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            bc.optimal_slew(sfoam(1), 1.0, 200.0, "effort", 4.0, progress=stop)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.parametrize(("torque", "tip_mass"), [(200.0, 0.0), (100.0, 0.1)])
def test_the_end_error_is_of_all_coordinates(torque, tip_mass):
    beam = bc.hub_beam(bc.HubBeamParameters(tip_mass=tip_mass), model="foam", modes=1)
    found = bc.optimal_slew(beam, 1.0, torque)
    replay = beam.simulate(found.torque_profile, np.linspace(0.0, found.duration, 4001), rtol=1e-10, atol=1e-13)
    # the model's own axial coordinate, beside its size on the way: no change of coordinates of the planning
    axial = [k for k, name in enumerate(beam.state_labels) if "axial" in name]
    assert axial
    left = max(abs(replay.states[-1, k]) / np.abs(replay.states[:, k]).max() for k in axial)
    assert left > 1e-3
    assert found.terminal_error >= 0.3 * left
    assert found.certificate.terminal_error == found.terminal_error
    assert found.certificate.prescribed_terminal_error <= 1e-4
    assert max(found.certificate.free_terminal_errors.values()) == found.terminal_error
    c = found.certificate
    for text in (repr(found), repr(c)):  # the prescribed error first
        text_of_errors = f"error {c.prescribed_terminal_error:.1e} without, {c.terminal_error:.1e} with axial motion"
        assert text_of_errors in text


def test_switches_least_effort_or_noise_none():
    found = bc.optimal_slew(sfoam(1), 1.0, 200.0, "effort", 4.0, intervals=60)
    assert found.torque_profile.switching_times.size == 0
    assert found.certificate.n_switches is None
    values = np.concatenate([np.full(10, 5.0), 1e-6 * (-1.0) ** np.arange(20), np.full(10, -5.0)])
    noisy = TorqueProfile(np.arange(41.0), values, values)
    assert noisy.switching_times.size == 0
    bang = TorqueProfile(np.arange(4.0), np.array([5.0, -5.0, 5.0]), np.array([5.0, -5.0, 5.0]))
    assert list(bang.switching_times) == [1.0, 2.0]
