"""The reproduction of Bai et al. (2009): verdicts, files, and the parts that compute."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.files import json_text
from boomctl.lab.papers.bai import frequencies as hub_beam_frequencies
from boomctl.lab.papers.bai import spin_up as hub_beam_spin_up
from boomctl.lab.papers.bai import torque as hub_beam_torque
from boomctl.lab.papers.bai.comparison import (
    CORRECTED,
    MET,
    MODELS,
    NOT_REPRODUCIBLE,
    Claim,
    Line,
    Panel,
    Part,
    check_statement,
    compare,
)
from boomctl.lab.papers.bai.report import jobs, report, results
from boomctl.lab.papers.bai.validity import TIME, leaves, tip_errors, tips
from boomctl.lab.papers.jobs import run_jobs
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from tests.profiles import examples

# -- verdicts ---------------------------------------------------------------------------------------------------------


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(1e-6, 10))
def test_met_means_within_the_tolerance(published, computed, tolerance):
    verdict = compare("", "", "", published, computed, tolerance=tolerance).verdict
    assert verdict == (MET if abs(published - computed) <= tolerance else NOT_REPRODUCIBLE)


def test_misprint_correction_must_explain_number():
    close, far = (compare("", "", "", 3.72e-2, ours, "why", corrected=3.72e-1) for ours in (3.5e-1, 2.5e-1))
    assert (close.verdict, far.verdict) == (CORRECTED, NOT_REPRODUCIBLE)
    assert (close.tolerance, close.why) == (pytest.approx(3.72e-2), "why; differs by 5.9 %")
    assert compare("", "", "", 1.0, 2.0, slipped=1.05).verdict == CORRECTED
    assert compare("", "", "", 1.0, 2.0, slipped=1.2).verdict == NOT_REPRODUCIBLE
    assert compare("", "", "", 1.0, 1.05, slipped=7.0).verdict == MET
    assert [check_statement("", "", "", holds, "").verdict for holds in (True, False)] == [MET, NOT_REPRODUCIBLE]


# -- the paper's numbers ----------------------------------------------------------------------------------------------


def test_table_2_frequencies_need_printed_factor():
    section = hub_beam_frequencies.table_2()
    assert len(section.comparisons) == 15
    assert {each.verdict for each in section.comparisons} == {CORRECTED}
    for each in section.comparisons:
        assert each.published / each.computed == pytest.approx(2 * math.pi / 6.28, abs=1.2e-4)


def test_neglected_terms_are_what_cfoam_has_beyond_foam():
    """Eq. (35) corrected, by quadrature of the mode shape: ``int rhoA [(q^T S q)^2/4 - f1 q1 q^T S q]``."""
    section = hub_beam_spin_up.neglected_terms()
    shown = section.panels[0].lines[0]
    k = int(np.argmax(shown.y))
    result = hub_beam(HubBeamParameters(), "cfoam", 1).simulate(hub_beam_spin_up.spin_up(3.0, 30.0), [0.0, shown.x[k]])
    q1, q2 = result.states[1, 1:3]
    x, w = np.polynomial.legendre.leggauss(60)
    x, w = 4 * (x + 1), 4 * w
    beta = 1.875104068711961 / 8
    s = (math.sinh(beta * 8) - math.sin(beta * 8)) / (math.cosh(beta * 8) + math.cos(beta * 8))
    shape = lambda x: np.cosh(beta * x) - np.cos(beta * x) - s * (np.sinh(beta * x) - np.sin(beta * x))  # noqa: E731
    slope = lambda x: beta * (np.sinh(beta * x) + np.sin(beta * x) - s * (np.cosh(beta * x) - np.cos(beta * x)))  # noqa: E731
    v = result.tip_displacement[1] / shape(8.0)
    u = result.tip_extension[1]
    square = np.array([np.sum(slope(at * x / 8) ** 2 * w * at / 8) for at in x]) * v**2
    integrand = 0.25 * square**2 - u * np.sin(math.pi * x / 16) * square
    expected = 2.7667e3 * 7.2968e-5 * np.sum(w * integrand)
    assert q1 != 0.0 != q2
    assert shown.y[k] * 1e-6 == pytest.approx(expected, rel=1e-6)
    assert section.claims[0].verdict == CORRECTED


VERDICTS = {
    hub_beam_frequencies.critical_speeds: [MET, MET, NOT_REPRODUCIBLE, MET],
    hub_beam_spin_up.cfoam_and_foam: [MET],
    hub_beam_spin_up.foam_and_tlam: [MET, MET, NOT_REPRODUCIBLE, MET],
    hub_beam_spin_up.mode_by_mode: [NOT_REPRODUCIBLE, MET],
    hub_beam_spin_up.tip_mass: [MET, NOT_REPRODUCIBLE, NOT_REPRODUCIBLE],
    hub_beam_torque.inertia_torque: [MET, MET, CORRECTED, NOT_REPRODUCIBLE, NOT_REPRODUCIBLE],
}


@pytest.mark.slow
@pytest.mark.parametrize("part", VERDICTS, ids=lambda part: part.__name__)
def test_verdicts_on_the_paper(part):
    found = part()
    verdicts = [each.verdict for each in (*found.comparisons, *found.claims)]
    assert verdicts[: len(VERDICTS[part])] == VERDICTS[part]


@pytest.mark.slow
def test_the_phase_lead_of_sfoam_is_not_there():
    section = hub_beam_torque.foam_and_sfoam()
    lead, smaller = section.comparisons
    assert abs(lead.computed) < 0.01
    assert abs(smaller.computed) < 1.0
    assert {lead.verdict, smaller.verdict} == {NOT_REPRODUCIBLE}
    assert {claim.verdict for claim in section.claims} == {MET}


@examples(10)
@given(st.floats(0.1, 2), st.floats(3.0, 3.5), st.floats(-3, 3))
def test_residual_vibration_is_recovered(amplitude, omega, phase):
    time = np.linspace(0, 30, 601)
    fit = hub_beam_torque.residual_vibration(time, amplitude * np.cos(omega * (time - 10) + phase), 10.0, 3.2)
    assert fit.amplitude == pytest.approx(amplitude, rel=1e-3)
    assert fit.omega == pytest.approx(omega, abs=1.5e-3)
    assert abs(np.angle(np.exp(1j * (fit.phase - phase)))) < 0.02


# -- where models stop being true -------------------------------------------------------------------------------------


def test_leaves_interpolates_in_logarithms():
    torques = np.array([10.0, 100.0, 1000.0])
    assert leaves(torques, 1e-4 * torques, 0.03) == pytest.approx(300.0)
    assert leaves(torques, 1e-4 * torques, 0.2) == math.inf
    assert leaves(torques, 1e-4 * torques, 1e-4) == 10.0
    assert leaves(torques, np.array([1e-3, 1e-2, math.inf]), 0.2) == 1000.0


def test_residual_tip_errors_are_of_time_after_the_torque():
    true = np.where(TIME > 10.0, 2.0, 1.0)
    found = tip_errors({label: [np.where(TIME > 10.0, 2.5, 1.5)] for label in MODELS} | {"exact": [true]})
    late = tip_errors({label: [true + (TIME > 10.0)] for label in MODELS} | {"exact": [true]})
    assert found["whole motion"]["FOAM"] == found["residual vibration"]["FOAM"] == 0.25
    assert late["residual vibration"]["FOAM"] == 0.5
    early = tip_errors({label: [true + (TIME <= 10.0)] for label in MODELS} | {"exact": [true]})
    assert (early["whole motion"]["TLAM"], early["residual vibration"]["TLAM"]) == (0.5, 0.0)


@pytest.mark.slow
def test_models_match_exact_beam_at_small_torque():
    torques = (5.0, 50.0)
    found = tip_errors({label: tips(model, torques) for label, model in MODELS.items()})["whole motion"]
    for errors in found.values():
        assert errors[0] < 2e-3
        assert errors[1] / errors[0] == pytest.approx(100.0, rel=0.2)  # neglected terms are quadratic in the motion
    at_50 = {label: errors[1] for label, errors in found.items()}
    assert at_50["TLAM"] > at_50["CFOAM"] > at_50["SFOAM"] > at_50["FOAM"]


# -- files ------------------------------------------------------------------------------------------------------------


def test_results_of_paper_in_json_have_no_infinite_numbers():
    panel = Panel("", "", (Line("", np.array([0.0, 1.0]), np.array([math.inf, math.nan])),))
    part = Part("s", "p", "", (panel,), (compare("", "", "", 1.0, math.inf),), (Claim("", "", "", MET, ""),))
    data = json.loads(json_text(results([part])), parse_constant=lambda name: pytest.fail(name))
    assert data["sections"][0]["figures"][0]["panels"][0]["lines"][0]["y"] == ["inf", "nan"]
    assert data["summary"] == {MET: 1, CORRECTED: 0, NOT_REPRODUCIBLE: 1}


@pytest.mark.slow
def test_the_whole_reproduction(tmp_path):
    result = report(run_jobs(jobs((5.0, 50.0)), 1), (5.0, 50.0))
    names = {path.name for path in result.write(tmp_path / "out")}
    figures = {f"fig-{n:02d}.{ending}" for n in range(3, 11) for ending in ("png", "svg")}
    assert names == figures | {"validity.png", "validity.svg", "slew.gif", "results.json", "report.html"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == 9
    assert page.count("data:image/gif;base64,") == 1
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert (
        json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))["summary"]
        == result.results["summary"]
    )
    assert result.results["summary"] == {MET: 14, CORRECTED: 17, NOT_REPRODUCIBLE: 9}
