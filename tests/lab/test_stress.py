"""`boomctl stress`: what counts as held, refused, uncertain or broken; hangs and deaths; a few rows; page and report."""

import json
import os
import subprocess
import sys
import time
import warnings
from dataclasses import replace

import numpy as np
import pytest

from boomctl.checks import positive
from boomctl.lab.stress.case import Case, Outcome, Seen, said_by_us, tried
from boomctl.lab.stress.report import PAGE, StressReport
from boomctl.lab.stress.run import all_cases, all_tried
from boomctl.structure.response.rounding import AccuracyWarning
from tests.command import boomctl


def case(work, *arguments, promise=1e-3, **more):
    return Case("Tests", "something", "some of it", promise, "error", work, arguments, **more)


def saw(error, certified=True):
    return Seen(error, certified)


def doubted():
    warnings.warn("off by a lot", AccuracyWarning, stacklevel=1)
    return Seen(1.0)


def overflowed():
    return Seen(float(np.square(np.float64(1e300)) * 0.0))


def solved():
    np.linalg.solve(np.zeros((2, 2)), np.ones(2))


def misshapen():
    np.ones(2) + np.ones(3)  # an error of compiled code: its innermost line is ours, and raises nothing


def asleep():
    time.sleep(60.0)


def died():
    os._exit(3)


def greedy():
    return saw(float(np.zeros(2 * 10**9).sum()))  # 16 GB


@pytest.mark.parametrize(
    ("work", "promise", "outcome"),
    [
        (lambda: saw(1e-4), 1e-3, Outcome.HELD),
        (lambda: saw(1e-2), 1e-3, Outcome.BROKEN),
        (lambda: saw(float("nan")), 1e-3, Outcome.BROKEN),
        (lambda: saw(float("inf")), 1e-3, Outcome.BROKEN),
        (lambda: saw(1e-2, certified=False), 1e-3, Outcome.UNCERTIFIED),
        (lambda: saw(0.0), None, Outcome.BROKEN),
        (doubted, 1e-3, Outcome.UNCERTIFIED),
        (overflowed, 1e-3, Outcome.BROKEN),
        (lambda: positive("mass", -1.0), 1e-3, Outcome.REFUSED),
        (lambda: positive("mass", -1.0), None, Outcome.REFUSED),
        (solved, 1e-3, Outcome.BROKEN),
        (misshapen, 1e-3, Outcome.BROKEN),
        (lambda: {}["mass"], 1e-3, Outcome.BROKEN),
    ],
)
def test_there_is_no_fourth_way_to_be_right(work, promise, outcome):
    assert tried(case(work, promise=promise)).outcome is outcome


def test_what_everybody_may_ask_for_must_not_be_refused():
    assert tried(case(lambda: positive("mass", -1.0), answered=True)).outcome is Outcome.BROKEN


def test_an_error_of_ours_is_told_from_one_of_a_library():
    for work, ours in ((lambda: positive("mass", -1.0), True), (solved, False), (misshapen, False)):
        with pytest.raises(ValueError) as caught:  # noqa: PT011 - any: this is what is asked about
            work()
        assert said_by_us(caught.value) == ours


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is limited there")
def test_a_case_that_eats_the_memory_costs_its_own_row_alone():
    lines = all_tried([case(greedy), case(saw, 0.0)], 1, lambda name: None)
    assert [line.said for line in lines] == ["more memory than 8 GB", ""]
    assert lines[1].outcome is Outcome.HELD


@pytest.mark.slow
def test_a_hang_and_a_death_cost_their_own_rows_alone():
    cases = [case(saw, 0.0), case(asleep, seconds=0.1), case(died), *(case(saw, 0.1 * k) for k in range(3))]
    begun = []
    lines = all_tried([replace(c, amount=str(k)) for k, c in enumerate(cases)], 1, begun.append)
    assert [str(line.outcome) for line in lines] == ["held", "BROKEN", "BROKEN", "held", "BROKEN", "BROKEN"]
    assert "no answer in 0.1 s" in lines[1].said
    assert "has ended" in lines[2].said
    assert len(begun) == len(cases)


def test_rows_have_names_of_their_own_and_all_that_is_asked_for():
    cases = all_cases(full=True)
    assert len({c.name for c in cases}) == len(cases)
    assert {c.promise is None or c.promise > 0.0 for c in cases} == {True}
    assert {c.area for c in all_cases(rows="sLeWs")} == {"Slews"}
    with pytest.raises(ValueError, match=r"rows = 'nothing': .*Spray boom"):
        all_cases(rows="nothing")


@pytest.mark.parametrize("rows", ["oscillator, ratio 0.5", "LQR*double integrator*", "critical speed", "two hinges"])
def test_some_rows_hold(rows):
    for chosen in all_cases(rows=rows):
        line = tried(chosen)
        assert line.outcome in (Outcome.HELD, Outcome.REFUSED), (chosen.name, line)


def test_the_page_keeps_what_is_written_by_hand(tmp_path):
    page = tmp_path / "limits.md"
    marks = [f"<!-- what {word} is written by `boomctl stress --page` -->" for word in ("follows", "precedes")]
    page.write_text(f"# Limits\n\nby hand\n\n{marks[0]}\nold\n{marks[1]}\n\nmore by hand\n")
    lines = tuple(tried(c) for c in all_cases(rows="two hinges"))
    PAGE.write(page, StressReport(lines, 1.0).page())
    text = page.read_text()
    assert text.startswith("# Limits\n\nby hand\n")
    assert text.endswith("\nmore by hand\n")
    assert "| a bar on two hinges | " in text
    assert "old" not in text


@pytest.mark.slow
def test_the_command_reports_and_ends_with_one_if_a_row_is_broken(tmp_path, monkeypatch):
    from boomctl.lab.stress import run

    words = ("stress", "--workers", "1", "--json", "--out", "out")
    monkeypatch.setattr(run, "all_cases", lambda full, rows: [case(saw, 0.0), case(saw, 1.0)])
    done = boomctl(*words, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (1, "")
    found = json.loads(done.stdout)
    assert found["outcomes"] == {"held": 1, "refused": 0, "uncertified": 0, "BROKEN": 1}
    assert json.loads((tmp_path / "out" / "results.json").read_text()) == found
    assert "BROKEN" in (tmp_path / "out" / "report.html").read_text()
    monkeypatch.setattr(run, "all_cases", lambda full, rows: [case(saw, 0.0)])
    assert boomctl("stress", "--workers", "1", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rows", "nothing"), "rows = 'nothing'"),
        (("--workers", "0"), "--workers = 0"),
        (("--page", "."), "expected a file, got a folder"),
        (("--page", "none.md"), "none.md"),
    ],
)
def test_bad_use_is_refused_before_any_work(words, message, tmp_path):
    done = boomctl("stress", *words, cwd=tmp_path)
    assert done.returncode in (1, 2)
    assert message in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_command_is_a_process_that_runs_rows():
    words = [sys.executable, "-m", "boomctl.cli", "stress", "--rows", "two hinges", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["broken"] == []
