"""The benchmark of tuning: every norm is checked on a loop closed here, and lies between the bound and the goal."""

import json
from math import inf, nan

import numpy as np
import pytest

from boomctl.lab.benchmark.report import Sheet
from boomctl.lab.benchmark.tune import boom, run
from boomctl.lab.benchmark.tune.goals import GOALS, WITHIN, Goal
from boomctl.lab.benchmark.tune.plants import plant, plant_names
from boomctl.lab.benchmark.tune.run import Outcome
from boomctl.synthesis.plants.partition import partition

slycot = pytest.importorskip("slycot", reason="it comes with the extra dev")

AGREE = 2e-5  # share by which norms of two programs may differ: certificates keep 1e-5
FEW = 2  # starts in the quick profile


def closed(p, K):
    """Return the loop of a plant and a controller, closed by numpy: A, B, C, D."""
    part = partition(p.P, p.nmeas, p.ncon)
    assert not part.D22.any()
    Ak, Bk, Ck, Dk = (np.asarray(M, float) for M in (K.A, K.B, K.C, K.D))
    A = np.block([[part.A + part.B2 @ Dk @ part.C2, part.B2 @ Ck], [Bk @ part.C2, Ak]])
    B = np.vstack([part.B1 + part.B2 @ Dk @ part.D21, Bk @ part.D21])
    C = np.hstack([part.C1 + part.D12 @ Dk @ part.C2, part.D12 @ Ck])
    return A, B, C, part.D11 + part.D12 @ Dk @ part.D21


def apart_norm(A, B, C, D):
    """Return the H-infinity norm by SLICOT."""
    sizes = (len(A), B.shape[1], len(C))
    return float(slycot.ab13dd("C", "I", "S", "D", *sizes, A, np.eye(len(A)), B, C, D)[0])


def check(goal, starts, monkeypatch):
    """Tune, and check what came of it with nothing but numpy and SLICOT."""
    kept, tune = [], run.tune
    monkeypatch.setattr(run, "tune", lambda *args, **kwargs: kept.append(tune(*args, **kwargs)) or kept[-1])
    found = run.tuned(goal, starts)
    assert found.certified, found.said
    (design,) = kept
    assert design.controller.nstates == goal.order
    loop = closed(found.plant, design.controller)
    assert np.linalg.eigvals(loop[0]).real.max() < 0.0
    norm = apart_norm(*loop)
    assert norm == pytest.approx(found.norm, rel=AGREE)
    assert norm == pytest.approx(design.gamma, rel=AGREE)
    assert found.bound <= norm * (1.0 + AGREE)
    if goal.limit is not None:
        assert norm <= goal.limit * (1.0 + AGREE)


@pytest.mark.parametrize("name", ["HE1", "REA2"])
def test_two_plants_reach_their_goals_certified(name, monkeypatch):
    check(next(goal for goal in GOALS if goal.plant == name and not goal.order), FEW, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("goal", run.asked(full=True), ids=lambda goal: goal.name)
def test_every_plant_reaches_its_goal_certified(goal, monkeypatch):
    check(goal, run._STARTS, monkeypatch)


def test_what_is_asked_of_whom():
    quick, full = run.asked(full=False), run.asked(full=True)
    assert set(quick) < set(full)
    assert {goal.plant for goal in full} == set(plant_names())
    assert all(plant(goal.plant).states <= run._QUICK_STATES for goal in quick)
    assert {"HE1", "WEC1"} <= {goal.plant for goal in quick}


def outcome(norm, goal=None, seconds=5.0, certified=True):
    return Outcome(Goal("HE1", 0, 0.1539) if goal is None else goal, plant("HE1"), norm, 0.07, seconds, 10, certified)


@pytest.mark.parametrize(
    ("found", "met"),
    [
        (outcome(0.1539 * (1.0 + 0.9 * WITHIN)), True),
        (outcome(0.1539 * (1.0 + 1.1 * WITHIN)), False),
        (outcome(0.15, certified=False), False),
        (outcome(0.15, seconds=10.1), False),
        (outcome(nan, certified=False), False),
        (outcome(0.2, Goal("HE1")), None),
        (outcome(0.2, Goal("HE1"), seconds=10.1), False),
        (outcome(0.12, Goal("HE1", published=0.11)), False),
    ],
)
def test_a_goal_is_met_by_norm_certificate_and_time_together(found, met):
    assert found.met is met
    assert found.row().met is met


def test_rows_and_sheet_are_of_all_that_was_asked(monkeypatch):
    goals = (Goal("HE1", 0, 0.1539), Goal("AC4", 1, 0.5589, within=0.0))
    monkeypatch.setattr(run, "asked", lambda full: goals)
    monkeypatch.setattr(
        run, "tuned", lambda goal: outcome(0.16 if goal.order == 0 else nan, goal, certified=not goal.order)
    )
    told = []
    report = run.run(progress=told.append)
    assert len(told) == len(report.rows) == 2
    assert [row.met for row in report.rows] == [False, False]
    assert report.title == "boomctl benchmark tune"
    (sheet,) = report.sheets
    assert isinstance(sheet, Sheet)
    assert all(len(line) == len(sheet.columns) for line in sheet.lines)
    assert json.loads(json.dumps(report.as_dict(), allow_nan=False))["missed"] == [row.name for row in report.rows]


def test_a_suspension_is_judged_by_what_its_report_says():
    found = {
        "controller": {"states": 6},
        "worst_case": {"jolt": {"found": 1.0, "upper_bound": 1.1}, "yaw": {"found": 10.0, "upper_bound": 10.1}},
        "active": {"peak_upper_bound": 9.24, "deposit_cv": 0.0113, "force": 12.3},
    }
    rows = list(boom.design_rows("tuned_suspension", found, boom.LIMITS["tuned_suspension"]))
    assert [row.met for row in rows] == [True, True, False, True]
    assert "10.1" in rows[1].job
    unproved = found | {"worst_case": {"jolt": {"found": 1.0, "upper_bound": None}, "yaw": found["worst_case"]["yaw"]}}
    assert [row.met for row in boom.design_rows("x", unproved, (9.3, 10.2, inf, inf))] == [True, False, None, None]


def test_designs_that_are_not_there_have_no_lines(monkeypatch):
    monkeypatch.setattr(boom, "LIMITS", {"no_such_suspension": (1.0, 1.0, 1.0, 1.0)})
    assert list(boom.boom_lines(True, lambda text: None)) == []
