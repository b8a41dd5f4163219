"""The slew report: its files, and that its numbers are those of the slew."""

import json

import pytest

from boomctl.hub_beam import HubBeam, HubBeamParameters
from boomctl.reproduce.slew import run


def test_report(tmp_path):
    beam = HubBeam(HubBeamParameters(), "sfoam", 1)
    found = run(tmp_path, beam, angle=0.6, torque_limit=120.0)
    stored = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert stored["duration"] == pytest.approx(found["duration"])
    assert stored["certificate"]["constraint_violation"] == 0.0
    assert [each["model"] for each in stored["replays"]] == ["foam", "geometrically-exact"]
    assert stored["hub_angle"][-1] == pytest.approx(0.6, abs=1e-6)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.count("<img") == 4
    assert "http" not in html
    for name in ("slew.png", "comparison.png", "tracking.png", "slew.gif"):
        assert (tmp_path / name).stat().st_size > 5000
