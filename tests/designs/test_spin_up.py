"""The scheduled drive of designs/scheduled_spin_up.py: what its report claims, and the numbers of docs/designs.md."""

import dataclasses
import functools
import re
from pathlib import Path

import numpy as np
import pytest

import boomctl as bc
from boomctl.studies.spin_up import FIXED, OPEN, SCHEDULED
from designs import scheduled_spin_up
from tests import handed_out as one

_PAGE = Path(__file__).parents[2] / "docs" / "designs.md"
_WAYS = {"scheduled": SCHEDULED, "the controller for rest throughout": FIXED, "torque alone": OPEN}
_MASSES = {"nothing": 0.0, "0.1 kg": 0.1}


@functools.cache
def judged(modes):
    return scheduled_spin_up.main(modes)


@pytest.mark.slow
@pytest.mark.parametrize("modes", [1, 3])
def test_it_is_proved_and_the_spin_up_keeps_below_the_rate(modes):
    result = judged(modes)
    assert result.stability.proved
    assert result.ramp.proved
    assert result.ramp.slack >= 0.0
    assert result.fastest < result.ramp.rate <= result.ramp.at_most
    manoeuvre = bc.spin_up(result.design.final_speed, result.design.duration)
    time = np.linspace(0.0, result.design.duration, 301)
    assert np.max(manoeuvre.acceleration(time)) == pytest.approx(result.fastest, rel=1e-3)
    for (way, _), rates in result.decay.items():
        assert way in (SCHEDULED, FIXED)
        assert (rates > 0.0).all()
    heavy = result.design.tip_mass[1]
    assert result.numbers(SCHEDULED, heavy)["after_gust"] < 0.5 * result.numbers(FIXED, heavy)["after_gust"]
    assert (
        result.numbers(OPEN, heavy)["speed_error"] > 0.1 > 5.0 * result.numbers(SCHEDULED, heavy)["speed_error"] / 2.0
    )
    assert all(run.saturation_share.get("torque", 0.0) == 0.0 for run in result.runs.values())
    assert "Proved stable at every hub speed from 0 to 6 rad/s with 0 to 0.1 kg" in str(result)


@pytest.mark.slow
def test_the_report_can_be_written(tmp_path):
    report = judged(1).report()
    report.write(tmp_path / "report")
    assert (tmp_path / "report" / "report.html").stat().st_size > 10_000
    assert {"spin_up.svg", "decay.svg", "results.json"} <= {path.name for path in (tmp_path / "report").iterdir()}
    assert len(report.results["runs"]) == 6


@pytest.mark.slow
def test_the_page_says_what_was_found():
    text, result = _PAGE.read_text(encoding="utf-8"), judged(3)
    rows = re.findall(r"^\| ([a-z ]+) \| (nothing|0\.1 kg) \| (.*) \|$", text, flags=re.MULTILINE)
    assert len(rows) == 6
    for way, mass, cells in rows:
        found = result.numbers(_WAYS[way], _MASSES[mass])
        wanted = [float(re.match(r"[\d.]+", cell)[0]) for cell in cells.split(" | ")]
        numbers = [found["tip"], 1e3 * found["left"], 1e3 * found["after_gust"], found["torque"]]
        for said, number in zip(wanted, numbers, strict=True):
            assert said == pytest.approx(number, rel=0.02)
    assert result.ramp.rate == pytest.approx(1.37, abs=0.01)
    assert result.fastest == pytest.approx(0.67, abs=0.01)
    assert result.numbers(OPEN, 0.1)["speed_error"] == pytest.approx(0.14, abs=0.01)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"tip_mass": 0.1}, TypeError, "range of tip_mass = 0.1"),
        ({"drive": 1.0}, TypeError, "drive = 1.0: expected ScheduledController"),
        ({"gust": -1.0}, ValueError, "gust = -1.0"),
        ({"gust_time": 0.0}, ValueError, "gust_time = 0.0"),
        ({"duration": 0.0}, ValueError, "duration = 0.0"),
    ],
)
def test_bad_input_is_refused_by_name(change, error, message):
    design = one.spin_up()
    words = ("name", "title", "beam", "drive", "tip_mass", "final_speed", "duration")
    with pytest.raises(error, match=message):
        bc.studies.SpinUpDesign(**{word: getattr(design, word) for word in words} | change)


@pytest.mark.slow
def test_a_quick_spin_up_is_followed_until_its_gust_has_settled():
    """However short it is: what the gust leaves is told."""
    design = dataclasses.replace(judged(1).design, final_speed=0.5, duration=3.0)
    run = design._run(SCHEDULED, 0.1)
    assert run.time[-1] > 4.5 + design.gust_time + design.settling
    found = dataclasses.replace(judged(1), design=design, runs={(SCHEDULED, 0.1): run})
    assert 0.0 < found.numbers(SCHEDULED, 0.1)["after_gust"] < 0.1
    assert "after the gust" in str(found)


def test_a_scene_is_refused():
    with pytest.raises(ValueError, match="speed: of suspensions only; expected none for this design"):
        bc.studies.SpinUpDesign.scene(speed=3.0)
