"""Run time against error: fronts and leads of made-up points, a tiny scene measured, the report, the command."""

import json
import pickle
from dataclasses import replace
from itertools import pairwise
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.lab.benchmark import measure, report
from boomctl.lab.benchmark.diagram import Diagram, Point, exponent
from boomctl.lab.benchmark.measure import measured, scene_at
from boomctl.lab.benchmark.report import SCENES, BenchmarkReport, environment, run, wanted
from tests.command import boomctl
from tests.profiles import examples

TINY = "tests.lab.benchmark.tiny:tiny"
times = st.none() | st.sampled_from([1e-3, 2e-3, 1.0]) | st.floats(1e-6, 10.0)
errors = st.sampled_from([0.0, 1e-3, 1.0, inf]) | st.floats(0.0, 10.0)
points = st.lists(
    st.builds(Point, st.sampled_from("abc"), st.just("1"), st.booleans(), st.booleans(), errors, times, times),
    max_size=12,
)
ways = st.sampled_from(["cold", "hot"])


def diagram(*found):
    return Diagram("tiny", "A tiny scene", "What is one?", "Distance from one.", tuple(found))


@examples(200)
@given(points, ways)
def test_front_is_faster_or_as_exact_as_each_point(found, way):
    front = diagram(*found).front(way)
    assert set(front) <= set(found)
    assert all(a.elapsed(way) < b.elapsed(way) and a.error > b.error for a, b in pairwise(front))
    for point in found:
        if point.elapsed(way) is not None and point.error < inf:
            assert any(p.elapsed(way) <= point.elapsed(way) and p.error <= point.error for p in front)


@examples(200)
@given(points, ways)
def test_lead_is_over_our_fastest_point_with_no_larger_error(found, way):
    seen = diagram(*found)
    leads = seen.leads(way)
    assert {id(other) for _, other, _ in leads} == {id(other) for other in seen.front(way, ours=False)}
    assert [ratio for ratio, *_ in leads] == sorted(ratio for ratio, *_ in leads)
    for ratio, other, ours in leads:
        able = [p for p in found if p.ours and p.error <= other.error and p.elapsed(way) is not None]
        assert (ours is None) == (not able)
        if ours is None:
            assert ratio == 0.0
        else:
            assert ours.elapsed(way) == min(p.elapsed(way) for p in able)
            assert ratio == pytest.approx(other.elapsed(way) / ours.elapsed(way))


def test_run_times_are_medians_of_single_calls(monkeypatch):
    runs_of = iter(
        {"answer": 1.5, "cold": [cold, 2 * cold], "hot": [[hot, 2 * hot], [3 * hot, 6 * hot]], "memory": 1e6 * hot}
        for cold, hot in ((9.0, 1.0), (3.0, 2.0), (6.0, 4.0))
    )
    scene = replace(scene_at(TINY), methods=scene_at(TINY).settings[:1])
    monkeypatch.setattr(measure, "scene_at", lambda place: scene)
    monkeypatch.setattr(measure, "_in_new_process", lambda *given: next(runs_of))
    (point,) = measured("tiny", TINY, quick=False, time_limit=1.0, progress=lambda text: None).points
    assert (point.error, point.cold, point.cold_processor) == (0.5, 6.0, 12.0)
    assert (point.hot, point.hot_processor, point.memory) == (3.5, 7.0, 4e6)


def test_a_hot_time_is_that_of_a_single_call(monkeypatch, tmp_path):
    clock = iter(range(10**6))
    monkeypatch.setattr(measure.time, "perf_counter", lambda: float(next(clock)))
    monkeypatch.setattr(measure.time, "process_time", lambda: 0.0)
    measure.main(TINY, "0", "5.0", str(tmp_path / "found"))
    found = pickle.loads((tmp_path / "found").read_bytes())
    assert found["answer"] == 1.5
    assert found["cold"] == [1.0, 0.0]
    assert found["hot"] == [[1.0, 0.0]] * 5  # until their sum is the duration asked for


@pytest.mark.slow
def test_measured_tiny_scene_has_times_errors_and_failures():
    told, ours = [], np.ones(5 * 10**7)  # memory of this process, which is not that of the one measured
    found = measured("tiny", TINY, quick=False, time_limit=10.0, progress=told.append)
    first, second, other, raises, number, sleeps, dies, absent = found.points
    assert [p.error for p in (first, second, other)] == [0.5, 0.25, 0.125]
    for p in (first, second, other):
        assert min(p.cold, p.hot) > 0.0
        assert min(p.cold_processor, p.hot_processor) >= 0.0
        assert 1e6 < p.memory < ours.nbytes
        assert p.failed == ""
    assert (first.ours, first.verified) == (True, True)
    assert (other.ours, other.verified) == (False, False)
    assert raises.failed == "ValueError: no answer"
    assert number.failed == "the error of its answer is not finite"
    assert sleeps.failed == "no answer within 10 s"
    assert dies.failed == "exit code 1: gone"
    assert absent.failed == "no_such_module is not installed"
    assert all(p.error == inf and p.cold is None for p in (raises, number, sleeps, dies, absent))
    assert [p.size for p in found.sized] == [1, 2, 4]
    assert all(p.hot > 0.0 and p.error == inf and p.failed == "" for p in found.sized)
    assert told[0] == "tiny: mine, plus 0.5"
    assert told[-1] == "tiny: reference solution"


def test_few_settings_are_every_third_of_each_method():
    few = scene_at(TINY).few
    assert {k: s.label for k, s in few.items()} == {0: "plus 0.5", 2: "0.125", 5: "sleeps", 7: "0.0"}


OURS = Point("mine", "a", True, True, 1e-4, 1e-3, 5e-4, 1e-3, 5e-4, call="mine(1)")
OTHER = Point("other", "b", False, False, 1e-3, 4e-3, 2.5e-4, 4e-3, 1e-3)
FAILED = Point("other", "c", False, False, failed="ValueError: <no>")
SIZED = tuple(Point("mine", f"{n} parts", True, True, hot=1e-3 * n**1.5, size=n) for n in (4, 1, 2))
MACHINE = {"processor": "of sand", "cores": "2", "python": "3", "numpy": "2", "scipy": "1"}
REPORT = BenchmarkReport((replace(diagram(OURS, OTHER, FAILED), sized=SIZED),), MACHINE)


def test_exponent_of_run_time_is_that_of_the_power():
    assert exponent(SIZED) == pytest.approx(1.5)
    assert exponent(replace(p, hot=None) for p in SIZED) is None


def test_page_has_the_fastest_settings():
    lines = [line.split("|") for line in REPORT.page().splitlines() if line.startswith("| A tiny scene")]
    ((_, _, *cells, _),) = [[cell.strip() for cell in line] for line in lines]
    assert cells[:2] == ["`mine(1)`", "1.0·10⁻⁴"]
    assert cells[-2:] == ["other, b: 250\u00a0µs", "4, 0.5"]


@pytest.mark.slow  # pictures
def test_report_has_leads_scenes_and_machine(tmp_path):
    made = REPORT.report()
    order = ["Whose front leads", "<h2>A tiny scene", "ValueError: &lt;no&gt;", "of sand"]
    places = [made.html.index(words) for words in order]
    assert places == sorted(places)
    assert made.html.count("<img") == 1
    assert "http" not in made.html.replace("http://www.w3.org", "")
    assert {path.name for path in made.write(tmp_path)} == {
        *("report.html", "results.json", "tiny.png", "tiny.svg"),
        "accuracy.md",
    }
    written = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    (scene,) = written["scenes"]
    assert [p["verified"] for p in scene["points"]] == [True, False, False]


def test_text_says_where_our_front_does_not_lead():
    lines = [line.split() for line in str(REPORT).splitlines()]
    assert ["tiny", "cold", "yes", "4", "4"] in lines
    assert ["tiny", "hot", "NO", "0.5", "0.5"] in lines


def test_scenes_are_thirteen_and_named_by_first_words():
    assert len(SCENES) == 13
    assert not any(each.verified for place in SCENES.values() for each in scene_at(place).settings if not each.ours)
    assert wanted([]) == tuple(SCENES)
    assert wanted(["slew-effort", "hub"]) == ("hub-spin-up", "hub-torque", "slew-effort")
    with pytest.raises(ValueError, match="did you mean 'boom-sigma'"):
        run(["boom-sigmar"])
    assert {"processor", "numpy", "python", "cores", "BLAS"} <= environment().keys()


@pytest.mark.slow
def test_command_measures_and_writes(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "SCENES", {"boom-tiny": TINY})
    monkeypatch.setattr(report, "_TIME_LIMIT", 5.0)
    done = boomctl("benchmark", "boom", "--quick", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [scene["key"] for scene in found["scenes"]] == ["boom-tiny"]
    assert found["command"] == "boomctl benchmark boom --quick"
    assert (tmp_path / "out" / "report.html").is_file()
