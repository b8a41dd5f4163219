"""Trade-offs: every point's numbers are those of its own controller, in order; what fails is named, and the rest kept."""

import json
import pickle
from dataclasses import replace
from math import inf

import control
import matplotlib as mpl
import numpy as np
import pytest

import boomctl as bc
from boomctl.studies.catalogue import design_file
from boomctl.studies.suspension import (
    FieldScene,
    TradeCurve,
    TradeLine,
    suspension_model,
    trade_off,
)
from boomctl.studies.suspension.assurance import MASS, SPRING
from boomctl.studies.suspension.sections import trade_off_sections
from boomctl.studies.suspension.trade_curves import HalfNumbers, TradePoint
from tests.command import boomctl

SCENE = FieldScene(run_in=0.2, duration=1.0, elements=6)
SOFT = bc.BoomParameters(spring_stiffness=550.0, hinge_damping=1000.0)
MINE = """
import control
import numpy as np
import boomctl as bc
from boomctl.studies.suspension import CONTROLS, STROKES, SuspensionDesign, TradeCurve


def damped(gain):
    if gain == 2000.0:
        raise ArithmeticError("too much of it")
    names = {"inputs": list(STROKES), "outputs": list(CONTROLS)}
    K = control.ss(-20.0 * np.eye(2), 20.0 * np.eye(2), gain * np.eye(2), -gain * np.eye(2), **names)
    return SuspensionDesign("damped", "damped", bc.BoomParameters(spring_stiffness=550.0, hinge_damping=1000.0), K)


def design():
    return damped(3000.0)


def softer(share):
    return SuspensionDesign("soft", "softer", bc.BoomParameters(spring_stiffness=1100.0 * share, hinge_damping=1000.0))


def never(value):
    raise AssertionError("the design itself is made again")


def trade_off():
    return (
        TradeCurve("gain", "the damper", "gain [N/m]", (3000.0, 2000.0, 1000.0), damped, 3000.0, "yaw", "effort"),
        TradeCurve("same", "nothing new", "gain [N/m]", (3000.0,), never, chosen=3000.0, beside=("lqr_suspension",)),
    )
"""


def damped(gain):
    """Return the controller of the file above, written down apart from it: of one half, by symmetry."""
    return control.ss(-20.0, 20.0, gain, -gain, inputs="stroke_anti", outputs="suspension_anti")


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    path = tmp_path_factory.mktemp("trade") / "mine.py"
    path.write_text(MINE)
    return str(path)


@pytest.fixture(scope="module")
def lines(mine):
    return trade_off(mine, design_file(mine).made(), SCENE)


def test_each_point_has_the_numbers_of_its_own_controller(lines):
    """Loops of the yaw alone, closed here by other functions; the worst over the box beside its corners and its bound."""
    gain, same = lines
    yaw = bc.split_symmetric(suspension_model(SOFT, 6, 20.0))[1]
    for point in gain.points:
        loop = bc.feedback_loop(yaw, damped(point.asked))
        peak, effort = (
            bc.hinf_norm(bc.select_channels(loop, ["actuator_anti"], [end])).lower
            for end in ("tip_anti", "suspension_anti")
        )
        assert (point.yaw.peak, point.yaw.effort) == (pytest.approx(peak, rel=1e-5), pytest.approx(effort, rel=1e-5))
        corners = [
            bc.hinf_norm(
                bc.select_channels(
                    bc.feedback_loop(family.at(np.array([a, b])), damped(point.asked)), ["actuator_anti"], ["tip_anti"]
                )
            ).lower
            for family in [bc.boom_family(SOFT, SPRING, MASS, half="yaw", accelerometer_bandwidth_hz=20.0)]
            for a in (-1.0, 1.0)
            for b in (-1.0, 1.0)
        ]
        assert max(corners) <= point.yaw.worst_found * (1.0 + 1e-6)
        assert point.yaw.worst_found <= point.yaw.worst_bound <= point.yaw.worst_found * 1.001001
        assert (point.states, point.of(None).peak) == (2, max(point.jolt.peak, point.yaw.peak))
    assert gain.points[0].yaw.effort < gain.points[1].yaw.effort
    assert same.points[0].yaw == gain.points[1].yaw


def test_points_are_in_order_and_the_chosen_one_is_the_design_itself(lines):
    """Which is not made again; what stands beside is made once, and not bounded where it reads states."""
    gain, same = lines
    assert [point.asked for point in gain.points] == [1000.0, 3000.0]
    assert [point.label for point in same.points] == ["3000"]
    (yardstick,) = same.beside
    assert (yardstick.label, yardstick.asked, yardstick.of(None).worst) == ("lqr_suspension", None, None)
    assert yardstick.yaw.peak == pytest.approx(3.37, rel=2e-2)


def test_what_fails_is_named_and_the_rest_is_kept(lines):
    gain, same = lines
    assert gain.failures == {"gain 2000": "ArithmeticError: too much of it"}
    assert not same.failures
    section = trade_off_sections(lines)[0]
    assert "gain 2000 failed: ArithmeticError: too much of it" in section.text


def test_the_report_shows_what_results_hold(lines):
    sections = trade_off_sections(lines)
    assert [section.title for section in sections] == ["Trade-off: the damper", "Trade-off: nothing new"]
    assert [p.name for section in sections for p in section.pictures] == ["trade_off_gain", "trade_off_same"]
    (table,) = sections[0].tables
    kept = json.loads(json.dumps(lines[0].as_dict()))
    assert [row[0] for row in table.lines] == [point["name"] for point in kept["points"]]
    for row, point in zip(table.lines, kept["points"], strict=True):
        shown, numbers = [float(cell) for cell in row[2:6]], point["yaw"]
        held = [numbers[name] for name in ("peak", "worst_found", "worst_upper_bound", "effort")]
        assert shown == pytest.approx(held, rel=1e-3)
        assert shown[2] >= held[2]  # a bound is not rounded downwards
    assert not trade_off_sections(())


def test_lines_survive_pickle_and_print_briefly(lines):
    for line in lines:
        assert pickle.loads(pickle.dumps(line)).as_dict() == line.as_dict()
        assert len(repr(line).splitlines()) <= 5


def a_point(label, peak, worst=None, bound=None, effort=0.0, asked=None):
    half = HalfNumbers(peak, worst, bound, effort)
    return TradePoint(label, asked, 0, half, half, 0.01, effort / 100.0, 0.02)


@pytest.mark.parametrize(("over", "panels"), [("asked", 3), ("effort", 1), ("force", 1)])
def test_pictures_take_points_that_are_unstable_or_not_proved(over, panels):
    """And draw the others where their numbers are."""
    mpl.use("Agg")
    points = (
        a_point("1", 8.0, 9.0, 9.009, 100.0, 1.0),
        a_point("2", 7.0, inf, inf, 200.0, 2.0),
        a_point("3", 6.0, 7.5, inf, 300.0, 3.0),
        a_point("4", inf, inf, inf, inf, 4.0),
    )
    line = TradeLine("x", "of x", "x [m]", None, over, 1.0, points, (a_point("beside", 5.0),), {}, 6.74)
    figure = mpl.figure.Figure()
    line.plot(figure)
    assert len(figure.axes) == panels
    drawn = {tuple(curve.get_xydata()[0]) for curve in figure.axes[0].lines if len(curve.get_xydata())}
    place = {"asked": 0.0, "effort": 100.0, "force": 1.0}[over]
    assert {(place, 8.0), (place, 9.009)} <= drawn
    words = {text.get_text() for text in figure.axes[0].texts}
    assert ("unstable\nin the box" in words) if over == "asked" else ({"1", "2", "3", "beside"} <= words)
    assert trade_off_sections((line,))[0].tables[0].lines[1][3:5] == ("unstable", "nothing")


GIVEN = {"name": "a", "title": "b", "asked": "c", "values": (1.0, 2.0), "make": abs}


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"name": "a b/c"}, ValueError, "name = 'a b/c': expected a word"),
        ({"values": ()}, ValueError, "expected at least one"),
        ({"values": (1.0, 1.0)}, ValueError, "each of them once"),
        ({"values": (1.0, np.nan)}, ValueError, "value"),
        ({"values": 3.0}, TypeError, "values = 3.0: expected a sequence"),
        ({"make": 3}, TypeError, "make = 3: expected a function"),
        ({"chosen": 4.0}, ValueError, "chosen = 4.0"),
        ({"half": "left"}, ValueError, "left"),
        ({"over": "peak"}, ValueError, "peak"),
        ({"beside": "lqr"}, TypeError, "beside"),
    ],
)
def test_a_curve_that_cannot_be_is_refused(change, error, message):
    with pytest.raises(error, match=message):
        TradeCurve(**GIVEN | change)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a file with a function trade_off() too; it has none"),
        ("def trade_off(): return 3", "trade_off() returned 3, expected a tuple of TradeCurve"),
        ("def trade_off(): return (CURVE, CURVE)", "curves called a, a; expected one each"),
        ("def trade_off(): return 1 / 0", "mine.py, line 4: ZeroDivisionError"),
    ],
)
def test_a_file_without_a_trade_off_is_refused_before_any_work(text, message, tmp_path):
    lines = ["from boomctl.studies.suspension import TradeCurve", "CURVE = TradeCurve('a', 'b', 'c', (1.0,), abs)"]
    (tmp_path / "mine.py").write_text("\n".join([*lines, "def design(): raise AssertionError('begun')", text]))
    done = boomctl("design", "mine.py", "--trade-off", cwd=tmp_path)
    assert done.returncode in (1, 2)
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("min_time_slew", "--trade-off"), "--trade-off: of suspensions only"),
        (("lqr_suspension", "--trade-off"), "it has none"),
        (("tuned_suspension", "--workers", "2"), "--workers 2: of --trade-off only"),
        (("tuned_suspension", "--trade-off", "--workers", "0"), "--workers = 0"),
    ],
)
def test_what_has_no_trade_off_is_refused(words, message, tmp_path):
    done = boomctl("design", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr


@pytest.mark.slow
def test_processes_find_the_same_as_one(mine, lines):
    found = trade_off(mine, design_file(mine).made(), SCENE, workers=2)
    assert [line.as_dict() for line in found] == [line.as_dict() for line in lines]


@pytest.mark.slow
def test_the_command_writes_it(mine, tmp_path):
    done = boomctl("design", mine, "--trade-off", "--workers", "1", "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    kept = json.loads((tmp_path / "out" / "results.json").read_text())["trade_off"]
    assert json.loads(done.stdout)["trade_off"] == kept
    assert [point["asked"] for point in kept["gain"]["points"]] == [1000.0, 3000.0]
    assert "trade_off_gain.svg" in {path.name for path in (tmp_path / "out").iterdir()}
    assert "Trade-off: the damper" in (tmp_path / "out" / "report.html").read_text()


TUNED = """
import control
import boomctl as bc
from boomctl.studies.suspension import SuspensionDesign, TradeCurve, suspension_model
from designs.tuned_suspension import tuned_yaw


def with_yaw(order):
    names = {"inputs": ["stroke_sym", "tip_acceleration_sym"], "outputs": ["suspension_sym"]}
    nothing = control.ss([], [], [], [[0.0, 0.0]], **names)
    K = bc.join_symmetric(suspension_model(), nothing, tuned_yaw(int(order)).controller)
    return SuspensionDesign("yaw", "yaw alone", controller=K)


def design():
    return SuspensionDesign("passive", "as it is")


def trade_off():
    return (TradeCurve("order", "order of the yaw", "order", (2, 1), with_yaw, half="yaw", over="effort"),)
"""


@pytest.mark.slow
def test_a_second_state_for_the_yaw_is_worth_its_force(tmp_path):
    """Tuned for orders one and two: the goal holds platform to tip over the box, and the force by its weight."""
    from designs.tuned_suspension import FORCE, PEAK, tuned_yaw

    (tmp_path / "mine.py").write_text(TUNED)
    path = str(tmp_path / "mine.py")
    (line,) = trade_off(path, design_file(path).made(), replace(SCENE, elements=20))
    one, two = line.points
    assert (one.states, two.states) == (1, 2)
    gamma = tuned_yaw(2).gamma
    assert two.yaw.worst_found <= gamma * 1.002
    assert two.yaw.effort <= gamma * FORCE / PEAK * 1.002
    assert two.yaw.worst_bound < one.yaw.worst_found
    for point in line.points:
        assert point.yaw.worst_found <= point.yaw.worst_bound <= point.yaw.worst_found * 1.001001
