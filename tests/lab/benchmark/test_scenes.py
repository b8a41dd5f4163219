"""Run time against error: fronts and leads on made-up points, measuring of tiny scenes, tables, growth, limits, report."""

import json
import warnings
from dataclasses import asdict, replace
from io import StringIO
from math import inf, nan
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from boomctl.lab.benchmark.compare import compared
from boomctl.lab.benchmark.diagram import Diagram, Kept, Point
from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.promise import (
    Who,
    exact,
    growth,
    number,
    seconds,
    times_as_fast,
    times_the_cost,
)
from boomctl.lab.benchmark.recommended import PAGE, recommendations
from boomctl.lab.benchmark.report import BenchmarkReport, lead_words
from boomctl.lab.benchmark.run import GROUPS, LONG, SCENES, maker, run, steps, wanted
from boomctl.lab.benchmark.scene import Scene, Setting
from boomctl.lab.benchmark.scenes.limits import Work
from boomctl.lab.benchmark.scenes.lumped_masses import DISCRETE, FINITE, lumped_masses
from tests.command import boomctl
from tests.profiles import examples

times = st.none() | st.sampled_from([1e-3, 2e-3, 1.0]) | st.floats(1e-6, 10.0)
errors = st.sampled_from([0.0, 1e-3, 1.0, inf]) | st.floats(0.0, 10.0)
points = st.lists(
    st.builds(Point, st.sampled_from("abc"), st.just("1"), st.booleans(), errors, times, times), max_size=12
)


def diagram(*found, **changes):
    given = {"key": "tiny", "title": "A tiny scene", "question": "What is one?", "measure": "Distance from one."}
    return Diagram(**(given | changes), points=tuple(found))


def dominated(point, others, way):
    """Whether another one is as fast and as exact, and better in one of them."""
    mine = point.seconds(way), point.error
    theirs = [(p.seconds(way), p.error) for p in others if p.seconds(way) is not None]
    return any(t <= mine[0] and e <= mine[1] and (t, e) != mine for t, e in theirs)


@examples(200)
@given(points, st.sampled_from(["cold", "hot"]))
def test_nothing_on_a_front_is_dominated_and_everything_else_is_or_has_an_equal(found, way):
    front = diagram(*found).front(way)
    places = [(p.seconds(way), p.error) for p in front]
    assert places == sorted(places)
    assert [e for _, e in places] == sorted((e for _, e in places), reverse=True)
    assert len(set(places)) == len(places)
    for point in found:
        if point in front:
            assert not dominated(point, found, way)
        elif point.seconds(way) is not None and point.error < inf:
            assert dominated(point, found, way) or (point.seconds(way), point.error) in places


@examples(200)
@given(points, st.sampled_from(["cold", "hot"]))
def test_a_lead_is_by_ours_that_is_as_exact_and_no_slower_one_than_any_other_of_ours(found, way):
    seen = diagram(*found)
    leads = seen.leads(way)
    assert [lead.other for lead in leads] == list(seen.front(way, ours=False))
    for lead in leads:
        able = [p for p in found if p.ours and p.error <= lead.error and p.seconds(way) is not None]
        assert (lead.ours is None) == (not able)
        if lead.ours is None:
            assert lead.ratio == 0.0
        else:
            assert lead.ours.seconds(way) == min(p.seconds(way) for p in able)
            assert lead.ratio == pytest.approx(lead.other.seconds(way) / lead.ours.seconds(way))


@examples(100)
@given(points)
def test_a_recommended_setting_is_exact_enough_and_about_as_fast_as_any(found):
    found = [replace(p, call="f()") for p in found]
    for each in recommendations([diagram(*found)], (1e-2, 1e-6)):
        able = [p for p in found if p.ours and p.error <= each.wanted and p.seconds(each.way) is not None]
        assert (each.point is None) == (not able)
        if each.point is not None:
            fastest = min(p.seconds(each.way) for p in able)
            assert each.point.seconds(each.way) <= 1.15 * fastest
            assert each.point.error <= min(p.error for p in able if p.seconds(each.way) == fastest)
        others = [p for p in found if not p.ours and p.error <= each.wanted and p.seconds(each.way) is not None]
        assert (each.other is None) == (not others)


def scene(*settings, error=lambda answer: abs(answer - 1.0)):
    return Scene("tiny", "A tiny scene", "What is one?", settings, "Distance from one.", error, ("none: not there",))


@pytest.mark.slow
def test_every_setting_is_judged_and_failures_are_points():
    changes = []

    def cold(change):
        changes.append(change)
        warnings.warn("inexact", UserWarning, stacklevel=1)
        return 1.0 + 0.25

    def refuses(change):
        raise ValueError("nothing\n  to be had")

    def later(change):
        if change:
            raise RuntimeError("only once")
        return 1.0

    tiny = scene(
        Setting(
            "mine",
            "both",
            ours=True,
            cold=cold,
            hot=lambda ready: ready + 0.5,
            prepare=lambda: 1.0,
            call="one()",
            size=3,
        ),
        Setting("other", "fails", ours=False, cold=refuses),
        Setting("other", "not a number", ours=False, hot=lambda ready: nan),
        Setting("other", "fails when changed", ours=False, cold=later),
        Setting("other", "nothing", ours=False),
    )
    told = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = measured(tiny, 0.01, told.append)
    mine, fails, number, once, nothing = found.points
    assert mine.error == 0.5  # the worse of both ways
    assert mine.cold > 0.0
    assert mine.hot > 0.0
    assert mine.calls >= 3
    assert mine.memory >= 0
    assert (mine.call, mine.size, mine.ours) == ("one()", 3, True)
    assert fails.failed == "ValueError: nothing to be had"
    assert number.failed == "its answer is not finite"
    assert once.failed == "RuntimeError: only once"
    assert "no way" in nothing.failed
    assert all(p.error == inf and p.seconds("cold") is None for p in found.points[1:])
    assert changes[0] == 0.0
    assert len(set(changes)) == len(changes)  # never the same again
    assert all(1e-9 <= change <= 1e-6 for change in changes[1:])
    assert found.front("cold") == (mine,)
    assert found.missing == tiny.missing
    assert told[0] == "tiny: mine, both"


@pytest.mark.slow
def test_memory_is_that_of_one_call():
    tiny = scene(Setting("mine", "a million bytes", ours=True, cold=lambda change: float(np.ones(125_000)[0])))
    (point,) = measured(tiny, 1.0, lambda text: None).points
    assert 1_000_000 <= point.memory < 1_100_000


def test_what_takes_longer_than_four_seconds_is_called_once():
    clock = iter(np.arange(0.0, 1e3, 5.0))
    calls = []
    tiny = scene(Setting("other", "slow", ours=False, cold=lambda change: calls.append(change) or 1.0))
    with mock.patch("boomctl.lab.benchmark.measure.processor_time", side_effect=clock):
        (point,) = measured(tiny, 1.0, lambda text: None).points
    assert (point.cold, point.calls, point.memory, calls) == (5.0, 1, None, [0.0])


@examples(50)
@given(st.floats(-0.5, 3.5), st.floats(1e-6, 1e-2), st.integers(2, 9))
def test_the_exponent_of_a_power_law_is_found(power, scale, count):
    grown = [Point("it", str(n), True, 0.0, hot=scale * n**power, size=n) for n in (2**k for k in range(1, count + 1))]
    for bound, held in ((power + 0.1, True), (power - 0.1, False)):
        kept = growth(Who("it"), bound).of(diagram(*grown))
        assert kept.value == pytest.approx(power, abs=1e-9)
        assert kept.held is held
    assert growth(Who("it"), 1.0).of(diagram(*grown[:1])).held is None


def test_a_limit_is_the_longest_of_what_cannot_be_done_without():
    rates = Work(operations=1e9, bytes=1e10, exponentials=1e7)
    assert Work(1e6, 1e6).seconds(rates) == pytest.approx(1e-3)
    assert Work(1e6, 1e6).bound(rates) == "arithmetic"
    assert Work(1e6, 1e9).seconds(rates) == pytest.approx(0.1)
    assert Work(1e6, 1e9).bound(rates) == "memory traffic"
    assert Work(1e6, 0.0, 1e5).seconds(rates) == pytest.approx(1.1e-2)  # exponentials and arithmetic follow each other
    assert Work(1e6, 0.0, 1e5).bound(rates) == "exponentials"


OURS = Point("mine", "a", True, 1e-4, 1e-3, 5e-4, 1000, 9, "bc.mine()")
OTHER = Point("other", "b", False, 1e-3, 4e-3, 1e-3, None, 9)
EXACT = Point("other", "c", False, 1e-9, 8e-3, None, None, 9)


def lumped(ratio, finite, discrete):
    """Return a diagram of lumped masses from errors by number of unknowns."""
    both = [
        Point(name, f"{size} unknowns", True, error, 1e-3 * size, size=size)
        for name, found in ((FINITE, finite), (DISCRETE, discrete))
        for size, error in found.items()
    ]
    return diagram(*both, key=f"lumped-masses-{ratio:g}")


REPORT = BenchmarkReport(
    (
        replace(
            diagram(OURS, OTHER, Point("other", "broken", False, inf, failed="ValueError: <no>")),
            missing=("pyMOR: not here",),
            kept=(
                Kept("held", 1.0, 2.0),
                Kept("broken", 1.0, 2.0, least=True),
                Kept("told", 3.0),
                Kept("untried", None, 1.0),
            ),
        ),
        replace(lumped(100.0, {4: 1e-6, 8: 1e-7}, {2: 5e-3, 4: 2e-4}), shows="unknowns"),
        replace(diagram(OURS, key="quiet", title="Not drawn"), shows="promises"),
    ),
    {"processor": "of sand", "numpy": "2.0"},
)


def test_the_sentence_on_a_lead_says_where_not_and_by_how_much():
    assert "ahead of all others over the whole range of their errors, by 4.0 times at least" in lead_words(
        diagram(OURS, OTHER), "cold"
    )
    slow = lead_words(diagram(replace(OURS, cold=8e-3), OTHER), "cold")
    assert "NOT ahead at 1 of 1 points" in slow
    assert "2.0 times as long, 4\u00a0ms more" in slow
    beyond = lead_words(diagram(OURS, OTHER, EXACT), "cold")
    assert "none of ours is as exact as 1.0·10⁻⁹, other, c" in beyond
    assert lead_words(diagram(OURS), "cold") == ""


@pytest.mark.parametrize(
    ("ratio", "finite", "discrete", "values", "held"),
    [
        ("10", {4: 1e-4, 8: 1e-5}, {2: 5e-2, 4: 2e-3}, [1.0, inf, None], None),
        ("100", {4: 1e-6, 8: 1e-7}, {2: 5e-3, 4: 2e-4}, [0.5, 1.0, inf], True),
        ("100", {4: 1e-6, 8: 1e-7}, {2: 5e-1, 8: 2e-4}, [2.0, 2.0, inf], False),
    ],
)
def test_the_claim_is_judged_by_the_data(ratio, finite, discrete, values, held):
    found = [promise.of(lumped(float(ratio), finite, discrete)) for promise in lumped_masses(ratio, "quick").promises]
    assert [kept.value for kept in found] == values
    assert [kept.held for kept in found] == [held, None, None]


A, B = Who("a"), Who("b")


@examples(200)
@given(points, st.sampled_from(["cold", "hot"]), st.floats(1e-3, 1e3), st.sampled_from([inf, 1e-3]))
def test_a_promise_of_run_times_is_about_the_fastest_that_are_exact_enough(found, way, bound, error):
    ours, other = replace(A, error=error), replace(B, error=error)
    best = []
    for name in "ab":
        able = [p.seconds(way) for p in found if p.competitor == name and p.error <= error and p.seconds(way)]
        best.append(min(able) if able else None)
    for promise, at_least in (
        (times_as_fast(ours, other, bound, way), True),
        (times_the_cost(ours, other, bound, way), False),
    ):
        kept = promise.of(diagram(*found))
        top, bottom = best[::-1] if at_least else best
        if top is None:
            assert kept.value is kept.held is None  # nobody was asked, or nobody is so exact
        elif bottom is not None:
            assert kept.value == pytest.approx(top / bottom)
            assert kept.held is (kept.value >= bound if at_least else kept.value <= bound)
        assert promise.of_time


def test_promises_of_numbers_take_the_worst_of_all_settings_and_failures_break_them():
    good, worse = (Point("a", str(e), True, e, cold=1e-3, hot=5e-4, found={"norm": 1.0 + e}) for e in (1e-6, 1e-3))
    failed = Point("a", "failed", True, inf, failed="why")
    for promise, value, held in (
        (exact(A, 1e-2), 1e-3, True),
        (exact(A, 1e-4), 1e-3, False),
        (exact(replace(A, label="1e-06"), 1e-4), 1e-6, True),
        (number(A, "norm", 1.01), 1.0 + 1e-3, True),
        (number(A, "norm", 1.0, least=True), 1.0 + 1e-6, True),
        (seconds(A, 1e-4), 1e-3, False),
        (exact(B, 1.0), None, None),
    ):
        kept = promise.of(diagram(good, worse))
        assert kept.held is held, kept
        assert kept.value == (value if value is None else pytest.approx(value))
    for promise in (exact(A, 1e-2), number(A, "norm", 1.01), number(A, "norm", 1.0, least=True)):
        assert promise.of(diagram(good, failed)).held is False


@pytest.mark.slow
@pytest.mark.parametrize("key", SCENES)
def test_every_promise_is_read_off_what_a_whole_run_measures(key):
    """Its competitors and settings are there, by the names that the promise has for them."""
    scene = maker(key)("whole")
    assert scene.key == key
    found = [
        Point(
            s.competitor, s.label, s.ours, 1e-12, 1e-3 if s.cold else None, 1e-3 if s.hot else None, 1000, size=s.size
        )
        for s in scene.settings
    ]
    installed = {name for words in scene.missing for name in [words.split(":")[0]]}
    for promise in scene.promises:
        kept = promise.of(diagram(*found))
        assert kept.value is not None or any(name.split(",")[0] in kept.text for name in installed), kept.text
    assert maker(key)("quick").settings


@pytest.mark.slow
def test_a_quick_run_promises_nothing_of_run_times(monkeypatch):
    tiny = replace(
        scene(Setting("a", "1", ours=True, cold=lambda change: 1.0)), promises=(seconds(A, 1.0), exact(A, 1.0))
    )
    monkeypatch.setattr("boomctl.lab.benchmark.run.maker", lambda key: lambda extent: tiny)
    monkeypatch.setattr("boomctl.lab.benchmark.run._SECONDS", {"quick": 1e-3, "whole": 1e-3})
    (quick,), (whole,) = (run(["limits"], extent).diagrams for extent in ("quick", "whole"))
    assert [kept.held for kept in whole.kept] == [True, True]
    assert [kept.text for kept in quick.kept] == ["a: error"]


@pytest.mark.slow  # eight files of pictures
def test_the_report_has_what_to_use_first_and_everything_after(tmp_path):
    made = REPORT.report()
    html = made.html
    order = [
        "1 of 2 promises held; missed: tiny: broken",
        "What to use",
        "bc.mine()",
        "Whose front is ahead",
        "<h2>A tiny scene",
        "ValueError: &lt;no&gt;",
        "<h2>Not drawn",
        "Error over unknowns",
        "of sand",
    ]
    places = [html.index(words) for words in order]
    assert places == sorted(places)
    assert "none is so exact" in html
    assert "Missing: pyMOR: not here" in html
    assert html.count("<img") == 3
    assert "http" not in html.replace("http://www.w3.org", "")
    assert {path.name for path in made.write(tmp_path)} >= {"report.html", "results.json", "tiny.png"}


def test_json_holds_everything():
    written = json.loads(json.dumps(REPORT.as_dict(), allow_nan=False))
    for item, drawn in zip(written["diagrams"], REPORT.diagrams, strict=True):
        assert [item[name] for name in ("key", "title", "question")] == [drawn.key, drawn.title, drawn.question]
        assert [float(point["error"]) for point in item["points"]] == [point.error for point in drawn.points]
        assert [point["cold"] for point in item["points"]] == [point.cold for point in drawn.points]
    assert [row["job"] for row in written["rows"]][:3] == ["mine, a, cold", "mine, a, hot", "other, b, cold"]
    assert written["recommended"][0]["setting"] == asdict(OURS)
    assert written["missed"] == ["tiny: broken"]
    promised = {row["job"]: row["met"] for row in written["rows"] if "met" in row}
    assert promised == {"held": True, "broken": False, "told": None, "untried": None}


def test_another_run_is_compared_point_by_point():
    before = REPORT.as_dict()
    assert not compared(before, REPORT).worse
    slower = replace(
        REPORT,
        diagrams=(
            replace(REPORT.diagrams[0], points=(replace(OURS, cold=2e-3, error=1e-2), OTHER)),
            *REPORT.diagrams[1:],
        ),
    )
    worse = {change.job: change.verdict for change in compared(before, slower).worse}
    assert worse == {"tiny: mine, a, cold": ("slower", "less exact"), "tiny: mine, a, hot": ("less exact",)}


def test_the_terminal_is_shown_the_tables_and_the_words():
    console = Console(width=160, record=True, file=StringIO())
    console.print(REPORT.render())
    text = console.export_text()
    for words in ("What to use", "bc.mine()", "0.1 %", "NO", "at least 2", "not measured", "Missing: pyMOR"):
        assert words in text


def test_the_page_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    mark = "<!-- what {} is written by `boomctl benchmark all --page` -->"
    page.write_text(f"# Head\n{mark.format('follows')}\nold\n{mark.format('precedes')}\nfoot\n", encoding="utf-8")
    PAGE.write(page, REPORT.page())
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert text.startswith("# Head\n")
    assert text.endswith("foot\n")
    assert "| 0.1 % | `bc.mine()` | 1.0·10⁻⁴ | 1\u00a0ms | 500\u00a0µs | 0.001\u00a0MB | other, b: 4.0 times |" in text
    assert "Lumped" not in text  # a study, which recommends nothing
    with pytest.raises(ValueError, match="there is no such file"):
        PAGE.text(tmp_path / "none.md")
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match="expected one line"):
        PAGE.text(page)
    with pytest.raises(ValueError, match="got a folder"):
        PAGE.text(tmp_path)


def test_unknown_scenes_and_options_out_of_place_are_refused(tmp_path):
    with pytest.raises(ValueError, match="benchmark"):
        run(["boom-sigmar"])
    assert steps(["all"], "quick") > steps(["growth"], "quick") > 0
    for words, part in (
        (["boom-sigmar"], "boom-sigma"),
        (["limits", "--full", "--quick"], "--full"),
        (["limits", "--page", str(tmp_path)], "folder"),
    ):
        done = boomctl("benchmark", *words, cwd=tmp_path)
        assert done.returncode == 2, words
        assert part in done.stderr
        assert done.stderr.count("\n") == 1


def test_groups_are_of_scenes_and_the_command_names_all_groups():
    from boomctl.cli import _BENCHMARKS

    assert set(_BENCHMARKS) <= {*GROUPS, *SCENES}
    assert set(GROUPS) <= set(_BENCHMARKS)
    assert wanted(["all"], full=True) == tuple(SCENES)
    assert set(wanted(["all"])) == {*SCENES} - {*LONG}
    assert wanted(["limits", "designs"]) == (
        "designs",
        "limits",
    )  # what is named is measured, in the order of the table
    assert {*SCENES} == {key for name, keys in GROUPS.items() if name != "all" for key in keys} | {"limits"}


@pytest.mark.slow  # a scene is measured by the command, twice
def test_the_command_measures_writes_and_compares(tmp_path):
    done = boomctl("benchmark", "precision", "lumped-masses-100", "--quick", "--json", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "'precision' is gone: 'boomctl benchmark lumped-masses-100' does it" in done.stderr
    found = json.loads(done.stdout)
    assert [d["key"] for d in found["diagrams"]] == ["lumped-masses-100"]
    assert found["diagrams"][0]["kept"][0]["value"] <= 1.0
    assert (tmp_path / "out" / "report.html").is_file()
    (tmp_path / "old.json").write_text(done.stdout, encoding="utf-8")
    done = boomctl("benchmark", "lumped-masses-100", "--quick", "--compare", "old.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "otherwise changed" in done.stdout
