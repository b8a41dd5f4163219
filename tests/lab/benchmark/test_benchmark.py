"""The benchmark runs, shows what it found, and hides nothing; run times themselves are not tested."""

import json
import math
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from boomctl.lab.benchmark.boom.run import run_settings
from boomctl.lab.benchmark.boom.scene import Settings, resonance_grid, scene
from boomctl.lab.benchmark.report import BenchmarkReport, Row
from boomctl.lab.benchmark.timing import Job, interleaved, one_thread, peak_memory

TINY = Settings(
    points=12,
    cluster=3,
    peers=(6,),
    skipped=(8,),
    rounds=1,
    judged=5,
    rounding=(6,),
    memory=(20, 40),
    orders=(4, 12),
    finite=(6,),
    discrete=(6,),
    processes=1,
)


@pytest.fixture(scope="module")
def report():
    told = []
    found = run_settings(TINY, told.append)
    assert told
    return found


@pytest.mark.slow
def test_errors_are_finite(report):
    errors = [e for row in report.rows for e in (row.error, row.peer_error) if e is not None]
    assert len(errors) >= 10
    assert all(math.isfinite(e) and e >= 0.0 for e in errors)


@pytest.mark.slow
def test_every_line_is_there(report):
    assert len({row.section for row in report.rows}) == 10
    cold = [row for row in report.rows if row.job.startswith("cold: ")]
    assert len(cold) == 6
    assert all(row.ours > 0.0 and row.peer > 0.0 and row.met is not None for row in cold)
    assert any(row.job.startswith("8 elements") and row.peer is None for row in report.rows)


@pytest.mark.slow
def test_exact_beam_is_exact(report):
    exact = [row for row in report.rows if row.section.startswith("Exact")]
    assert exact
    assert all(row.error < 1e-9 for row in exact)


@pytest.mark.slow
def test_json(report):
    data = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert len(data["rows"]) == len(report.rows)
    assert {"numpy", "python", "cores", "threads while timing"} <= data["environment"].keys()
    assert all(
        {"job", "ours", "peer", "ratio", "target", "error", "peer_error", "met"} <= row.keys() for row in data["rows"]
    )


@pytest.mark.slow
def test_rendering_fits_a_hundred_columns(report):
    console = Console(width=100, record=True, file=StringIO())
    console.print(report.render())
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= 100
    for head in ("job", "ours", "peer", "[ms]", "ratio", "target", "met"):
        assert head in text


def test_missed_lines_are_shown():
    row = Row("section", "job", 1.0, 2.0, ">= 4x", 1e-3, 1e-3, met=False)
    report = BenchmarkReport((row, replace(row, job="other", met=True)))
    assert report.missed == (row,)
    assert report.as_dict()["missed"] == ["section: job"]
    console = Console(width=100, record=True, file=StringIO())
    console.print(report.render())
    text = console.export_text()
    assert "NO" in text
    assert "1 of 2 targets met; missed: section: job" in text


def test_full_run_adds_and_drops_nothing():
    quick, full = Settings.of(False), Settings.of(True)
    assert set(full.peers) == set(quick.peers) | set(quick.skipped)
    assert full.judged == 1


def test_jobs_take_turns_on_fresh_things():
    log = []
    fresh = iter(range(100))
    jobs = {
        "a": Job(lambda ready: log.append(("a", ready)), lambda: next(fresh)),
        "b": Job(lambda ready: log.append(("b", ready))),
    }
    times = interleaved(jobs, 3)
    assert [name for name, _ in log] == ["a", "b"] * 4
    assert [ready for name, ready in log if name == "a"] == [0, 1, 2, 3]
    assert set(times) == {"a", "b"}


def test_threads_are_restored():
    from threadpoolctl import threadpool_info, threadpool_limits

    with threadpool_limits(limits=2):
        before = [pool["num_threads"] for pool in threadpool_info()]
        with one_thread():
            assert {pool["num_threads"] for pool in threadpool_info()} == {1}
        assert [pool["num_threads"] for pool in threadpool_info()] == before


def test_peak_memory_counts_what_a_job_holds():
    assert peak_memory(Job(lambda _: np.zeros(10**6))) == pytest.approx(8e6, rel=0.01)


def test_grid_holds_the_resonances():
    grid = resonance_grid(np.array([-0.5 + 10.0j]), 50, 21)
    assert len(grid) == 71
    assert np.isclose(grid, 10.0).any()
    assert np.isclose(grid, 13.0).any()
    assert (np.diff(grid) > 0.0).all()


def test_scene_judges():
    ground = scene(TINY)
    assert ground.exact.shape == (2, len(ground.omega))
    assert ground.error(ground.exact * 1.5) == pytest.approx(0.5)
