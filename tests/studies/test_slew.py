"""The slew report: its files, and that its numbers are those of the slew."""

import json
from functools import partial

import pytest

from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import optimal_slew
from boomctl.studies.slew import SlewDesign, design
from tests.profiles import is_hunt

pytestmark = pytest.mark.early


@pytest.fixture(scope="module", autouse=True)
def short_films():
    """Films end early: the frames are what takes long."""
    with pytest.MonkeyPatch.context() as patch:
        if not is_hunt():
            patch.setattr(design, "animate_slew", partial(design.animate_slew, until=0.5))
        yield


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """The results of a plan, the folder its report was written to, and numbers and report there."""
    folder, beam = tmp_path_factory.mktemp("slew"), hub_beam(HubBeamParameters(), "sfoam", 1)
    planned = {"minimum time": optimal_slew(beam, 0.6, 120.0)}
    report = SlewDesign("quick", "A slew of a flexible beam", beam, planned).evaluate().report()
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
    assert html.count("<img") == 4
    assert "http" not in html
    for name in ("slew.png", "comparison.png", "switching.png", "slew.gif"):
        assert (folder / name).stat().st_size > 5000


@pytest.mark.slow
def test_a_report_without_switching_times():
    beam = hub_beam(HubBeamParameters(), "sfoam", 1)
    slew = optimal_slew(beam, 0.6, 120.0, "effort", 2.6, intervals=40)
    evaluation = SlewDesign("slew", "A slew", beam, {"minimum effort": slew}).evaluate()
    html = evaluation.report().html
    assert "Minimum effort" in html
    assert "The switching function" not in html
