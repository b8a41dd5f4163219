"""The scheduled drive of designs/scheduled_spin_up.py: proof, simulated spin-ups, and the numbers on the page of designs."""

import functools
import re
from pathlib import Path

import pytest

from designs import scheduled_spin_up
from designs.scheduled_spin_up import FIXED, OPEN, SCHEDULED

_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "designs.md"
_WAYS = {"scheduled": SCHEDULED, "LQG at zero speed": FIXED, "open loop": OPEN}
_MASSES = {"0": 0.0, "0.1 kg": 0.1}


@functools.cache
def judged(modes):
    return scheduled_spin_up.main(modes)


def numbers(modes, key="runs"):
    return {(row["way"], row["tip_mass"]): row for row in judged(modes).to_dict()[key]}


@pytest.mark.slow
@pytest.mark.parametrize("modes", [1, 3])
def test_scheduled_drive_is_proved_and_holds_the_speed(modes):
    result, runs = judged(modes), numbers(modes)
    assert result.robust.proved
    assert result.to_dict()["proved"]
    assert runs[SCHEDULED, 0.1]["after_gust"] < 0.5 * runs[FIXED, 0.1]["after_gust"]
    assert runs[OPEN, 0.1]["speed_error"] > 0.1 > 2.5 * runs[SCHEDULED, 0.1]["speed_error"]
    assert all(row["torque"] < scheduled_spin_up.LIMIT for row in runs.values())
    assert "Proved stable at every hub_speed 0 to 6 and tip_mass 0 to 0.1." in str(result)


@pytest.mark.slow
def test_scheduled_drive_numbers_are_those_of_the_page():
    text, runs = _PAGE.read_text(encoding="utf-8"), numbers(3)
    rows = re.findall(r"^\| ([A-Za-z ]+) \| (0|0\.1 kg) \| (.*) \|$", text, flags=re.MULTILINE)
    assert len(rows) == 6
    for way, mass, cells in rows:
        found = runs[_WAYS[way], _MASSES[mass]]
        wanted = [float(re.match(r"[\d.]+", cell)[0]) for cell in cells.split(" | ")]
        expected = [found["tip"], 1e3 * found["left"], 1e3 * found["after_gust"], found["torque"]]
        assert wanted == pytest.approx(expected, rel=0.02)
    assert judged(3).to_dict()["rate_asked"] == pytest.approx(0.67, abs=0.01)
    assert runs[OPEN, 0.1]["speed_error"] == pytest.approx(0.14, abs=0.01)
    faster = numbers(3, "faster_runs")
    assert faster[SCHEDULED, 0.1]["torque"] == scheduled_spin_up.LIMIT
    assert faster[SCHEDULED, 0.1]["speed_error"] == pytest.approx(1.57, abs=0.01)
    assert 1e3 * faster[SCHEDULED, 0.1]["after_gust"] == pytest.approx(174.0, abs=1.0)
