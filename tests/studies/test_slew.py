"""The slew report: its files, and that its numbers are those of the slew."""

import json
from functools import partial

import pytest

from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.slew import optimal_slew
from boomctl.studies import slew as design
from boomctl.studies.slew import SlewDesign
from tests.profiles import is_hunt

pytestmark = [pytest.mark.early, pytest.mark.slow]
BEAM = hub_beam(HubBeamParameters(), "sfoam", 1)


@pytest.fixture(scope="module", autouse=True)
def short_films():
    """Films end early: the frames are what takes long."""
    with pytest.MonkeyPatch.context() as patch:
        if not is_hunt():
            patch.setattr(design, "animate_slew", partial(design.animate_slew, until=0.5))
        yield


def test_slew_report_has_numbers_and_pictures_of_slew(tmp_path):
    planned = {"minimum time": optimal_slew(BEAM, 0.6, 120.0)}
    SlewDesign("quick", "A slew of a flexible beam", BEAM, planned).evaluate().report().write(tmp_path)
    stored, html = json.loads((tmp_path / "results.json").read_text()), (tmp_path / "report.html").read_text()
    assert stored["duration"] == pytest.approx(planned["minimum time"].duration)
    assert stored["certificate"]["constraint_violation"] == 0.0
    assert [each["model"] for each in stored["replays"]] == ["sfoam", "foam", "geometrically-exact"]
    assert stored["replays"][0]["residual_vibration"] < 1e-6 < stored["replays"][1]["residual_vibration"]
    assert stored["tracking"]["residual_vibration"] < 0.1 * stored["tracking"]["open_residual_vibration"]
    assert stored["switching_agreement"] == 1.0
    assert stored["hub_angle"][-1] == pytest.approx(0.6, abs=1e-6)
    assert stored["comparison"][0]["name"] == "minimum time"
    assert html.count("<img") == 4
    assert html.count("<table>") == 4
    assert "<td class=l>replay by another integrator</td>" in html
    assert "http" not in html
    for name in ("slew.png", "comparison.png", "switching.png", "slew.gif"):
        assert (tmp_path / name).stat().st_size > 5000


def test_slew_report_without_switching_times_omits_them():
    slew = optimal_slew(BEAM, 0.6, 120.0, "effort", 2.6, intervals=40)
    html = SlewDesign("slew", "A slew", BEAM, {"minimum effort": slew}, followed=False).evaluate().report().html
    assert "minimum effort" in html
    assert "The switching function" not in html
    assert "Followed with" not in html
