"""Run time against error: fronts and leads on made-up points, measuring of tiny scenes, tables, growth, limits, report."""

import json
import warnings
from dataclasses import asdict, replace
from io import StringIO
from math import inf, log, nan
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from boomctl.lab.benchmark.compare import compared
from boomctl.lab.benchmark.precision.claim import conclusion, verdicts
from boomctl.lab.benchmark.precision.diagram import Diagram, Point
from boomctl.lab.benchmark.precision.growth import Growth
from boomctl.lab.benchmark.precision.limits import Limit, Rates, Work
from boomctl.lab.benchmark.precision.measure import measured
from boomctl.lab.benchmark.precision.recommended import PAGE, recommendations
from boomctl.lab.benchmark.precision.report import PrecisionReport, lead_words
from boomctl.lab.benchmark.precision.run import names, run, steps
from boomctl.lab.benchmark.precision.scene import Scene, Setting
from boomctl.lab.benchmark.precision.scenes.lumped_masses import DISCRETE, FINITE
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
    return Scene("tiny", "A tiny scene", "What is one?", "Distance from one.", settings, error, ("none: not there",))


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


def test_memory_is_that_of_one_call():
    tiny = scene(Setting("mine", "a million bytes", ours=True, cold=lambda change: float(np.ones(125_000)[0])))
    (point,) = measured(tiny, 1.0, lambda text: None).points
    assert 1_000_000 <= point.memory < 1_100_000


def test_what_takes_longer_than_four_seconds_is_called_once():
    clock = iter(np.arange(0.0, 1e3, 5.0))
    calls = []
    tiny = scene(Setting("other", "slow", ours=False, cold=lambda change: calls.append(change) or 1.0))
    with mock.patch("boomctl.lab.benchmark.precision.measure._clock", side_effect=clock):
        (point,) = measured(tiny, 1.0, lambda text: None).points
    assert (point.cold, point.calls, point.memory, calls) == (5.0, 1, None, [0.0])


@examples(50)
@given(st.floats(-0.5, 3.5), st.floats(1e-6, 1e-2), st.integers(2, 9))
def test_the_exponent_of_a_power_law_is_found(power, scale, count):
    sizes = tuple(2.0**k for k in range(1, count + 1))
    grown = Growth("it", sizes, tuple(scale * size**power for size in sizes), 1.0, "")
    assert grown.exponent == pytest.approx(power, abs=1e-9)
    assert ("FASTER" in grown.verdict) == (grown.exponent > 1.25)
    assert ("slower" in grown.verdict) == (grown.exponent < 0.75)


def test_a_limit_is_the_longest_of_what_cannot_be_done_without():
    rates = Rates(operations=1e9, bytes=1e10, exponentials=1e7)
    assert Work(1e6, 1e6).seconds(rates) == pytest.approx(1e-3)
    assert Work(1e6, 1e6).bound(rates) == "arithmetic"
    assert Work(1e6, 1e9).seconds(rates) == pytest.approx(0.1)
    assert Work(1e6, 1e9).bound(rates) == "memory traffic"
    assert Work(1e6, 0.0, 1e5).seconds(rates) == pytest.approx(1.1e-2)  # exponentials and arithmetic follow each other
    assert Work(1e6, 0.0, 1e5).bound(rates) == "exponentials"
    assert Limit("it", "", 2e-3, 1e-3, "arithmetic").ratio == 2.0


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


REPORT = PrecisionReport(
    (
        diagram(
            OURS, OTHER, Point("other", "broken", False, inf, failed="ValueError: <no>"), missing=("pyMOR: not here",)
        ),
        lumped(10.0, {4: 1e-4, 8: 1e-5}, {2: 5e-2, 4: 2e-3}),
        lumped(100.0, {4: 1e-6, 8: 1e-7}, {2: 5e-3, 4: 2e-4}),
    ),
    (Growth("what grows", (1.0, 2.0, 4.0), (1.0, 2.0, 4.0), 1.0, "a reason"),),
    Rates(1e9, 1e10, 1e7),
    (Limit("a path", "all of it", 2e-3, 1e-3, "arithmetic"),),
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


def test_the_claim_is_judged_by_the_data():
    found = verdicts(REPORT.lumped)
    assert [(v.ratio, v.wanted, v.fewer) for v in found if v.wanted > 1e-5] == [
        (10.0, 1e-2, "both alike"),
        (10.0, 1e-3, "finite"),
        (100.0, 1e-2, "discrete"),
        (100.0, 1e-3, "both alike"),
    ]
    words = " ".join(conclusion(REPORT.lumped))
    assert "need fewer unknowns in 1" in words
    assert "where the lumped masses are 100 times" in words
    assert f"to the power {-log(100) / log(10):.2f}" in words  # finite elements
    assert "to the power -1.00" in words  # discrete elements
    assert conclusion({}) == ()


@pytest.mark.slow  # eight files of pictures
def test_the_report_has_what_to_use_first_and_everything_after(tmp_path):
    made = REPORT.report()
    html = made.html
    order = [
        "What to use",
        "bc.mine()",
        "Whose front is ahead",
        "<h2>A tiny scene",
        "ValueError: &lt;no&gt;",
        "Lumped masses on light beams",
        "How cost grows",
        "Distance from the limit",
        "of sand",
    ]
    places = [html.index(words) for words in order]
    assert places == sorted(places)
    assert "none is so exact" in html
    assert "Missing: pyMOR: not here" in html
    assert html.count("<img") == 4
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
    assert written["growth"][0]["exponent"] == pytest.approx(1.0)


def test_another_run_is_compared_point_by_point():
    before = REPORT.as_dict()
    assert not compared(before, REPORT.benchmark).worse
    slower = replace(REPORT, diagrams=(diagram(replace(OURS, cold=2e-3, error=1e-2), OTHER), *REPORT.diagrams[1:]))
    worse = {change.job: change.verdict for change in compared(before, slower.benchmark).worse}
    assert worse == {"tiny: mine, a, cold": ("slower", "less exact"), "tiny: mine, a, hot": ("less exact",)}


def test_the_terminal_is_shown_the_tables_and_the_words():
    console = Console(width=160, record=True, file=StringIO())
    console.print(REPORT.render())
    text = console.export_text()
    for words in ("What to use", "bc.mine()", "0.1 %", "how cost grows".capitalize(), "a path", "Missing: pyMOR"):
        assert words in text


def test_the_page_is_written_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    mark = "<!-- what {} is written by `boomctl benchmark precision --page` -->"
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
    with pytest.raises(ValueError, match="scene"):
        run(["boom-sigmar"])
    assert steps() > steps(["growth"]) > 0
    assert set(names()) >= {"boom-sigma", "lumped-masses", "growth", "limits"}
    for words, part in (
        (["precision", "boom-sigmar"], "boom-sigma"),
        (["boom", "--quick"], "--quick"),
        (["boom", "boom-sigma"], "SCENE"),
        (["slew", "--out", "x"], "--out"),
        (["precision", "--full"], "--full"),
        (["precision", "limits", "--page", str(tmp_path)], "folder"),
    ):
        done = boomctl("benchmark", *words, cwd=tmp_path)
        assert done.returncode == 2, words
        assert part in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.slow  # a scene and the limits are measured: 8 s
def test_the_command_measures_writes_and_compares(tmp_path):
    done = boomctl(
        "benchmark", "precision", "lumped-masses", "limits", "--quick", "--json", "--out", "out", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [d["key"] for d in found["diagrams"]] == ["lumped-masses-0", "lumped-masses-100"]
    assert all(limit["ratio"] > 1.0 for limit in found["limits"])  # nothing is faster than its limit
    assert (tmp_path / "out" / "report.html").is_file()
    (tmp_path / "old.json").write_text(done.stdout, encoding="utf-8")
    done = boomctl("benchmark", "precision", "lumped-masses", "--quick", "--compare", "old.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "beside the earlier run" in done.stdout
