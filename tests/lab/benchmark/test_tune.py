"""The benchmark of tuning: every norm is checked on a loop closed here, and lies between the bound and the goal."""

from math import inf, nan

import numpy as np
import pytest

from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.references.plants import plant, plant_names
from boomctl.lab.benchmark.scenes import tuning
from boomctl.lab.benchmark.scenes.tuning import GOALS, LIMITS, WITHIN, Goal, Tuned, design_numbers
from boomctl.synthesis.plants.partition import partition
from tests.profiles import is_hunt

slycot = pytest.importorskip("slycot", reason="it comes with the extra dev")

AGREE = 2e-5  # share by which norms of two programs may differ: certificates keep 1e-5
FEW = 2  # starts in the quick profile


HIDDEN = ("CM3",)  # its best loop is nearly a constant: on some processors rounding hides that no frequency exceeds it


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
    """Tune, and check what came of it with nothing but numpy and SLICOT; more starts where these are not enough."""
    kept, tune = [], tuning.tune
    monkeypatch.setattr(tuning, "tune", lambda *args, **kwargs: kept.append(tune(*args, **kwargs)) or kept[-1])
    for count in starts:
        found, p = tuning.tuned(goal, count), plant(goal.plant)
        if goal.limit is None or kept[-1].gamma <= goal.limit:
            break
    design = kept[-1]
    assert found.certified or goal.plant in HIDDEN
    assert found.certified == design.certificate.norm.certified
    assert design.controller.nstates == goal.order
    loop = closed(p, design.controller)
    assert np.linalg.eigvals(loop[0]).real.max() < 0.0
    norm = apart_norm(*loop)
    assert norm == pytest.approx(found.norm if found.certified else design.gamma, rel=AGREE)
    assert norm == pytest.approx(design.gamma, rel=AGREE)
    assert found.bound <= norm * (1.0 + AGREE)
    if goal.limit is not None:
        assert norm <= goal.limit * (1.0 + AGREE)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["HE1", "REA2"])
def test_two_plants_reach_their_goals_certified(name, monkeypatch):
    check(next(goal for goal in GOALS if goal.plant == name and not goal.order), (FEW,), monkeypatch)


ALL = (*GOALS, *(Goal(name) for name in plant_names() if name not in {goal.plant for goal in GOALS}))
TRIED = ALL if is_hunt() else ALL[::3]  # every third in the full profile, a choice


@pytest.mark.slow
@pytest.mark.parametrize("goal", [goal for goal in TRIED if goal.plant in plant_names()], ids=lambda goal: goal.name)
def test_every_plant_reaches_its_goal_certified(goal, monkeypatch):
    check(goal, (FEW, tuning.STARTS["whole"]), monkeypatch)


def test_what_is_asked_of_whom():
    few, whole, everything = tuning.tuning("quick"), tuning.tuning("whole"), tuning.tuning_all("whole")
    names = [{setting.competitor for setting in scene.settings} for scene in (few, whole, everything)]
    assert names[0] < names[1] < names[2]
    assert {name.split(",")[0] for name in names[2]} == set(plant_names())
    assert {"HE1, a gain", "WEC1, a gain"} <= names[1]


_TIME = "run time [s], from new parameters"  # of an answer that is none there is none


@pytest.mark.slow
@pytest.mark.parametrize(
    ("norm", "certified", "goal", "missed"),
    [
        (0.1539 * (1.0 + 0.9 * WITHIN), True, Goal("HE1", 0, 0.1539), []),
        (0.1539 * (1.0 + 1.1 * WITHIN), True, Goal("HE1", 0, 0.1539), ["norm"]),
        (0.15, False, Goal("HE1", 0, 0.1539), ["stable, its norm certified anew", _TIME]),
        (0.06, True, Goal("HE1", 0, 0.1539), ["norm over the bound of all orders"]),
        (nan, True, Goal("HE1", 0, 0.1539), ["norm", "norm over the bound of all orders", _TIME]),
        (0.2, True, Goal("HE1"), []),
        (0.12, True, Goal("HE1", published=0.11), ["norm"]),
    ],
)
def test_a_goal_is_met_by_norm_and_certificate_together(norm, certified, goal, missed, monkeypatch):
    monkeypatch.setattr(tuning, "tuned", lambda goal, starts, change: Tuned(goal, norm, certified, 0.07))
    found = measured(tuning._scene("tuning", "quick", (goal,)), 1e-3, lambda text: None)
    assert [kept.text.removeprefix("HE1, a gain: ") for kept in found.kept if kept.held is False] == missed


def test_a_suspension_is_judged_by_what_its_report_says():
    found = {
        "controller": {"states": 6},
        "worst_case": {"jolt": {"found": 1.0, "upper_bound": 1.1}, "yaw": {"found": 10.0, "upper_bound": 10.1}},
        "active": {"peak_upper_bound": 9.24, "deposit_cv": 0.0113, "force": 12.3},
    }
    numbers = design_numbers(found)
    held = [value <= limit for value, limit in zip(numbers.values(), LIMITS["tuned_suspension"], strict=True)]
    assert held == [True, True, False, True]
    unproved = found | {"worst_case": {"jolt": {"found": 1.0, "upper_bound": None}, "yaw": found["worst_case"]["yaw"]}}
    assert design_numbers(unproved)["proved worst peak"] == inf


@pytest.mark.slow
def test_a_design_that_is_not_there_fails_and_breaks_its_promises(monkeypatch):
    monkeypatch.setattr(tuning, "LIMITS", {"no_such_suspension": (1.0, 1.0, 1.0, 1.0)})
    found = measured(tuning.designs("quick"), 1e-3, lambda text: None)
    assert "no_such_suspension" in found.points[0].failed
    assert [kept.held for kept in found.kept] == [False] * 4
