"""The slew report: its files, and that its numbers are those of the slew."""

import json
import re
from functools import partial

import numpy as np
import pytest

from boomctl.report import Report
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import MeshStudy, optimal_slew
from boomctl.slew.nlp.mesh_study import MeshLine
from boomctl.studies.slew import SlewDesign, sections
from boomctl.studies.slew.design import default_meshes, evaluated_plan
from tests.profiles import is_hunt

pytestmark = pytest.mark.early


@pytest.fixture(scope="module", autouse=True)
def short_films():
    """Films end early: the frames are what takes long."""
    with pytest.MonkeyPatch.context() as patch:
        if not is_hunt():
            patch.setattr(sections, "slew_film", partial(sections.slew_film, seconds_after=-2.0))
        yield


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """The results of a plan, the folder its report was written to, and numbers and report there."""
    folder, beam = tmp_path_factory.mktemp("slew"), hub_beam(HubBeamParameters(), "sfoam", 1)
    report = evaluated_plan(beam, angle=0.6, torque_limit=120.0, meshes=(20, 40)).report()
    report.write(folder)
    stored = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return report.results, folder, stored, (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_stored_numbers_are_those_of_the_slew(reported):
    found, _, stored, _ = reported
    assert stored["duration"] == pytest.approx(found["duration"])
    assert stored["certificate"]["constraint_violation"] == 0.0
    assert [each["model"] for each in stored["replays"]] == ["sfoam", "foam", "geometrically-exact"]
    assert stored["replays"][0]["tip_swing"] < 1e-6 < stored["replays"][1]["tip_swing"]
    assert stored["switching_agreement"] == 1.0
    assert stored["hub_angle"][-1] == pytest.approx(0.6, abs=1e-6)
    assert stored["comparison"][0]["name"] == "minimum time"


@pytest.mark.slow
def test_the_report_stands_alone_with_its_pictures_beside_it(reported):
    _, folder, _, html = reported
    assert html.count("<img") == 6
    assert "http" not in html
    for name in ("slew.png", "comparison.png", "tracking.png", "switching.png", "mesh.png", "slew.gif"):
        assert (folder / name).stat().st_size > 5000


@pytest.mark.slow
def test_the_report_shows_the_error_over_meshes(reported):
    found, _, stored, html = reported
    study = stored["mesh_study"]
    assert study["intervals"] == [20, 40]
    assert study["duration"] == pytest.approx(1.1 * found["duration"])
    assert [line["theory"] for line in study["lines"]] == [4, 6, 5, 2]
    section = html[html.index("<h2>Error against mesh size") :]
    assert section.count("<img") == 1
    for line in study["lines"]:
        order = "not seen" if line["order"] is None else f"{line['order']:.1f}"
        assert re.search(f"<td class=l>{line['name']}</td>.*<td>{order}</td><td>{line['theory']:.0f}</td>", section)


@pytest.mark.slow
def test_a_report_without_meshes_and_switching_times():
    beam = hub_beam(HubBeamParameters(), "sfoam", 1)
    slew = optimal_slew(beam, 0.6, 120.0, "effort", 2.6, method="shooting", intervals=40)
    evaluation = SlewDesign("slew", "A slew", beam, {"minimum effort": slew}).evaluate()
    html = evaluation.report().html
    assert "Minimum effort" in html
    assert "Error against mesh size" not in html


def test_a_mesh_without_solution_is_a_gap_in_the_table():
    line = MeshLine("end state", np.array([np.nan, 1e-3]), np.nan, 4.0)
    section = sections.mesh_section(MeshStudy(2.6, np.array([20, 40]), (line,)))
    html = Report("errors", (), (section,), {}).html
    assert "end state (20)" in html
    assert "<td>–</td><td>1.0·10⁻³</td><td>not seen</td><td>4</td>" in html


@pytest.mark.parametrize(("modes", "duration"), [(1, 0.5), (1, 3.0), (3, 3.0), (8, 3.0)])
def test_meshes_follow_the_fastest_vibration_and_stay_cheap(modes, duration):
    beam = hub_beam(HubBeamParameters(), "sfoam", modes)
    first, second, third = default_meshes(beam, duration)
    assert (second, third) == (2 * first, 4 * first)
    assert 20 <= first <= 100
    assert third >= min(400, 10 * duration * beam.frequencies_hz().max())
