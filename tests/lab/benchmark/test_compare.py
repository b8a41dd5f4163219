"""A benchmark beside an earlier one, on made-up results: what got worse is said, noise and other machines are not."""

import json
from dataclasses import replace
from io import StringIO
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from boomctl.lab.benchmark.compare import LESS_EXACT, ROUNDING, SLOWER, compared, read_results
from boomctl.lab.benchmark.diagram import Diagram, Kept, Point
from boomctl.lab.benchmark.report import BenchmarkReport
from tests.command import boomctl
from tests.profiles import examples

SIZES = range(1, 7)
OURS = tuple(Point("ours", f"{n} elements", True, 1e-8 * n, cold=1e-3 * n) for n in SIZES)
PEERS = tuple(Point("peer", f"{n} elements", False, 1e-8, cold=4e-3 * n) for n in SIZES)
KEPT = Kept("a promise", 4.0, 3.0, least=True)


def of(ours=OURS, peers=PEERS, kept=KEPT, environment=None):
    """Return the report of a scene of some points."""
    diagram = Diagram("sigma", "Sigma", "", "", (*ours, *peers), kept=(kept,))
    return BenchmarkReport((diagram,), environment or {"numpy": "2.0", "cores": "2"})


OLD = of()


def changed(kept=KEPT, **points):
    """Return the report with points of ours changed by number."""
    return of(tuple(replace(p, **points.get(f"_{k}", {})) for k, p in enumerate(OURS, 1)), kept=kept)


def verdicts(old, new):
    found = compared(old.as_dict(), new).changes
    return {change.job.removeprefix("sigma: "): change.verdict for change in found if change.verdict}


def shown(comparison):
    console = Console(width=110, record=True, file=StringIO())
    console.print(comparison.render())
    return console.export_text()


def test_the_same_run_has_no_changes():
    found = compared(OLD.as_dict(), OLD)
    assert verdicts(OLD, OLD) == {}
    assert found.machine == 1.0
    assert "0 worse, 0 otherwise changed, 13 alike" in shown(found)


def test_what_got_worse_stands_first_and_is_named():
    new = changed(replace(KEPT, value=2.0), _1={"cold": 0.5e-3}, _3={"error": 1e-6}, _5={"cold": 6e-3})
    assert verdicts(OLD, new) == {
        "a promise": ("promise missed",),
        "ours, 3 elements, cold": ("less exact",),
        "ours, 1 elements, cold": ("faster",),
    }
    new = changed(_1={"cold": 0.5e-3}, _3={"error": 1e-6}, _5={"cold": 10e-3})
    found = compared(OLD.as_dict(), new)
    assert [change.job for change in found.worse] == ["sigma: ours, 5 elements, cold", "sigma: ours, 3 elements, cold"]
    assert found.changes[:2] == found.worse
    assert found.worse[0].slower == pytest.approx(2.0)
    assert found.worse[1].less_exact == pytest.approx(1e-6 / 3e-8)
    text = shown(found)
    assert "slower" in text
    assert "less exact" in text
    assert "2 worse, 1 otherwise changed, 10 alike" in text
    assert f"{SLOWER:g} times the time" in text
    assert f"{LESS_EXACT:g} times the error" in text


def test_what_is_new_and_what_is_gone_is_said():
    new = of((*OURS[1:], replace(OURS[0], label="100 elements")))
    gone, came = "ours, 1 elements, cold", "ours, 100 elements, cold"
    assert verdicts(OLD, new) == {gone: ("gone",), came: ("new",)}
    assert [change.job for change in compared(OLD.as_dict(), new).worse] == [f"sigma: {gone}"]


@examples(50)
@given(st.floats(0.1, 10.0), st.floats(0.01, 100.0), st.floats(1e-17, 1.0), st.floats(1e-3, 1e3))
def test_a_slower_machine_is_no_slower_job(machine, slower, error, less_exact):
    """Peers say how fast the machine was; a ratio counts beyond its threshold, an error beyond rounding."""
    ours, peers = ([replace(p, cold=machine * p.cold) for p in points] for points in (OURS, PEERS))
    before = of((replace(OURS[0], error=error), *OURS[1:]))
    ours[0] = replace(ours[0], cold=slower * ours[0].cold, error=less_exact * error)
    found = compared(before.as_dict(), of(ours, peers))
    assert found.machine == pytest.approx(machine)
    change = next(change for change in found.changes if change.job == "sigma: ours, 1 elements, cold")
    assert change.slower == pytest.approx(slower)
    errors = max(less_exact * error, ROUNDING) / max(error, ROUNDING)
    assert change.less_exact == pytest.approx(errors)
    for ratio, limit, worse, better in (
        (change.slower, SLOWER, "slower", "faster"),
        (change.less_exact, LESS_EXACT, "less exact", "more exact"),
    ):
        assert (worse in change.verdict) == (ratio >= limit)
        assert (better in change.verdict) == (ratio <= 1.0 / limit)
    assert not [other for other in found.changes if other is not change and other.verdict]


def test_without_peers_times_stand_as_they_are():
    old = of(peers=())
    found = compared(old.as_dict(), old)
    assert found.machine is None
    assert "Too few jobs of peers" in shown(found)


def test_another_environment_is_told():
    found = compared(OLD.as_dict(), of(environment={"numpy": "2.1", "cores": "2"}))
    assert found.environment == {"numpy": ("2.0", "2.1")}
    assert "numpy: 2.0 before, 2.1 now" in shown(found)


@pytest.mark.parametrize("text", ["", "[1]", "{}", '{"rows": 3}', '{"rows": [{"job": "a"}]}', "[" * 10_000])
def test_what_is_no_earlier_run_is_refused(tmp_path, text):
    path = tmp_path / "old.json"
    path.write_text(text)
    with pytest.raises(ValueError, match="expected what 'boomctl benchmark --json' printed"):
        read_results(path)


def test_the_command_compares(tmp_path):
    path = tmp_path / "old.json"
    with mock.patch("boomctl.lab.benchmark.run.run", return_value=OLD):
        path.write_text(boomctl("benchmark", "boom", "--json").stdout)
    new = changed(_2={"cold": 1.0})
    with mock.patch("boomctl.lab.benchmark.run.run", return_value=new) as run:
        done = boomctl("benchmark", "boom", "--compare", str(path))
        assert (done.returncode, done.stderr) == (0, "")
        assert "1 worse, 0 otherwise changed, 12 alike" in done.stdout
        data = json.loads(boomctl("benchmark", "boom", "--compare", str(path), "--json").stdout)
        assert data["comparison"]["worse"] == ["sigma: ours, 2 elements, cold"]
        assert len(data["rows"]) == 13
        run.reset_mock()
        missing = boomctl("benchmark", "boom", "--compare", str(tmp_path / "none.json"))
        assert missing.returncode == 2
        path.write_text("{}")
        assert boomctl("benchmark", "boom", "--compare", str(path)).returncode == 2
        run.assert_not_called()  # before minutes are spent
    with mock.patch("boomctl.lab.benchmark.run.run", return_value=new):
        path.write_text(json.dumps({"rows": [{"section": "other", "job": "job"}]}))
        done = boomctl("benchmark", "boom", "--compare", str(path))
        assert done.returncode == 2
        assert "no job in common" in done.stderr
