"""The slew report: its files, and that its numbers are those of the slew."""

import json
import re

import pytest

from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import optimal_slew
from boomctl.studies.slew.design import SlewDesign
from boomctl.studies.slew.report import slew_report
from boomctl.studies.slew.study import _meshes, run


def test_report(tmp_path):
    beam = hub_beam(HubBeamParameters(), "sfoam", 1)
    found = run(tmp_path, beam, angle=0.6, torque_limit=120.0, meshes=(20, 40))
    stored = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert stored["duration"] == pytest.approx(found["duration"])
    assert stored["certificate"]["constraint_violation"] == 0.0
    assert [each["model"] for each in stored["replays"]] == ["sfoam", "foam", "geometrically-exact"]
    assert stored["replays"][0]["tip_swing"] < 1e-6 < stored["replays"][1]["tip_swing"]
    assert stored["switching_agreement"] == 1.0
    assert stored["hub_angle"][-1] == pytest.approx(0.6, abs=1e-6)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.count("<img") == 6
    assert "http" not in html
    for name in ("slew.png", "comparison.png", "tracking.png", "switching.png", "mesh.png", "slew.gif"):
        assert (tmp_path / name).stat().st_size > 5000
    assert stored["comparison"][0]["name"] == "minimum time"
    study = stored["mesh_study"]
    assert study["intervals"] == [20, 40]
    assert study["duration"] == pytest.approx(1.1 * found["duration"])
    assert [line["theory"] for line in study["lines"]] == [4, 6, 5, 2]
    section = html[html.index("<h2>Error against mesh size") :]
    assert section.count("<img") == 1
    for line in study["lines"]:
        order = "not seen" if line["order"] is None else f"{line['order']:.1f}"
        assert re.search(f"<td>{line['name']}</td>.*<td>{order}</td><td>{line['theory']:.0f}</td>", section)


def test_report_without_meshes_and_with_gaps():
    beam = hub_beam(HubBeamParameters(), "sfoam", 1)
    slew = optimal_slew(beam, 0.6, 120.0, "effort", 2.6, method="shooting", intervals=40)
    tracking = {"tip_mass": 0.1, "final_angle_error": 0.0, "open_final_angle_error": 0.1}
    tracking |= {"tip_swing": 1e-12, "open_tip_swing": 1.0}
    design = SlewDesign("slew", "A slew", beam, {"minimum effort": slew})
    results = {"comparison": [], "replays": [], "tracking": tracking, "mesh_study": None}
    results |= {"payloads": None, "spin_ups": []}
    pictures = dict.fromkeys(("slew", "comparison", "tracking", "mesh"), b"")
    html = slew_report(design, results, pictures, b"")
    assert "Minimum effort" in html
    assert "Error against mesh size" not in html
    line = {"name": "end state", "errors": [None, 1e-3], "order": None, "theory": 4.0}
    study = {"duration": 2.6, "intervals": [20, 40], "lines": [line]}
    html = slew_report(design, results | {"mesh_study": study}, pictures, b"")
    assert "end state (20)" in html
    assert "<td>–</td><td>1.0·10⁻³</td><td>not seen</td><td>4</td>" in html


@pytest.mark.parametrize(("modes", "duration"), [(1, 0.5), (1, 3.0), (3, 3.0), (8, 3.0)])
def test_meshes_follow_the_fastest_vibration_and_stay_cheap(modes, duration):
    beam = hub_beam(HubBeamParameters(), "sfoam", modes)
    first, second, third = _meshes(beam, duration)
    assert (second, third) == (2 * first, 4 * first)
    assert 20 <= first <= 100
    assert third >= min(400, 10 * duration * beam.frequencies_hz().max())
