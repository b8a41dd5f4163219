"""Evaluations of designs: verdict, words and numbers are the same on a terminal, in a notebook, and in a report."""

import json
from dataclasses import replace
from html import escape
from types import SimpleNamespace

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.analysis import NormBounds
from boomctl.boom.tracks import GROUND_LENGTH
from boomctl.files import plain
from boomctl.structure import SecondOrderModel
from boomctl.studies.evaluation import Finding, numbers, peak_finding, table_of, words
from boomctl.studies.slew import SlewEvaluation
from boomctl.studies.suspension import (
    MASS,
    SPRING,
    FieldScenario,
    SuspensionDesign,
    SuspensionResult,
    evaluate_suspension,
    verification,
)

SPRUNG = SecondOrderModel([[1.0]], [[0.02]], [[4.0]], {"force": [1.0], "wind": [1.0]}, {"position": [1.0]})
DAMPER = control.ss(-20.0, 20.0, 40.0, -40.0, inputs="position", outputs="force")


@pytest.fixture(scope="module")
def result():
    """A damped mass on a spring, with two facts of its synthesis."""
    facts = {"gain": "40 N s/m <at most>", "made": "by hand"}
    return bc.studies.MachineDesign("mine", "A mass on a spring", SPRUNG, DAMPER, synthesis_info=facts).evaluate()


def test_evaluation_shows_same_words_everywhere(result):
    assert list(result.words) == ["gain", "made"]
    for name, text in result.words.items():
        assert f"\n  {name}: {text}" in str(result)
        assert f"<td>{escape(name)}</td><td>{escape(text)}</td>" in result._repr_html_()
    assert result.verdict in str(result)
    assert escape(result.verdict) in result._repr_html_()


@pytest.mark.slow
def test_evaluation_report_stores_numbers_and_words(result):
    report = result.report()
    assert report.results == result.to_dict()
    assert json.loads(json.dumps(plain(report.results)))["synthesis"] == result.words
    assert set(report.files) == set(result.controller_files())
    assert escape(result.verdict) in report.html
    assert "boomctl.read_controller reads the JSON file" in report.html


def test_findings_become_words_numbers_and_tables():
    found = (Finding("one", "2 m", 2.0, key="first"), Finding("other"))
    assert (words(found), numbers(found)) == ({"one": "2 m"}, {"first": 2.0})
    table = table_of([vars(each) for each in found], {"name": "what", "value": "value [m]"})
    assert (table.heads, table.lines) == (("what", "value [m]"), (("one", "2.00"), ("other", "\u2013")))


def test_peak_and_margins_without_certificate_say_so():
    """Of a suspension whose peaks, and whose disk margin, could not be shown to be as large as that."""
    norm = NormBounds(2.0, np.inf, 1.0, "not found")
    assert [peak_finding("", each, "").text for each in (norm, replace(norm, upper_bound=2.0, verified=True))] == [
        "2.000, NOT verified",
        "2.000",
    ]
    true = bc.margins(SPRUNG, DAMPER)
    doubted = replace(
        true, loops=tuple(replace(loop, disk_margin=replace(loop.disk_margin, verified=False)) for loop in true.loops)
    )
    found = [verification.margins_finding(each) for each in (true, doubted)]
    assert [each.proved for each in found] == [True, None]
    assert [each.text.rpartition("(")[2] for each in found] == ["verified)", "NOT verified)"]


@pytest.mark.parametrize("doubted", ["passive", "active", ""])
def test_suspension_verdict_is_verified_if_both_peaks_are(doubted):
    run = evaluate_suspension("", FieldScenario(warmup_time=0.0, duration=0.5, elements=2), bc.BoomParameters())
    peak = run.sigma.certificate
    assert run.yaw.lower_bound == pytest.approx(peak.lower_bound, rel=1e-4)
    assert run.jolt.lower_bound < 0.1 * run.yaw.lower_bound
    both = dict.fromkeys(("passive", "active"), run)
    if doubted:
        both[doubted] = replace(run, sigma=replace(run.sigma, _of=SimpleNamespace(norm=replace(peak, verified=False))))
    found = SuspensionResult(SuspensionDesign("", ""), FieldScenario(), both["passive"], both["active"], (), None, ())
    assert found.verdict.startswith("Peak, NOT verified, from" if doubted else "Verified peak from")
    assert not found.better  # than itself
    assert not found.robust  # nothing is proved


class _Rows(dict):
    tip_masses = np.zeros(0)


def test_slew_verdict_has_ratio_of_durations():
    lines = {name: SimpleNamespace(duration=T, residual_vibration=0.01) for name, T in (("own", 3.0), ("rigid", 2.0))}
    comparison = _Rows(lines)
    found = SlewEvaluation(SimpleNamespace(_label="own", _rigid="rigid"), comparison)
    assert found.verdict.startswith("3 s, 1.500 times a rigid body's least time; the tip vibrates by 10 mm afterwards")


def test_field_scene_ends_where_ground_ends():
    scenario = FieldScenario(duration=4000.0)
    longest = (GROUND_LENGTH - scenario.tractor.wheelbase - 1.0) / scenario.speed  # a meter beyond the front wheels
    with pytest.raises(ValueError, match=r"expected at most .* s together at speed = 3 m/s") as raised:
        scenario.motion()
    assert float(str(raised.value).split("at most ")[1].split()[0]) == pytest.approx(longest, abs=0.1)


@pytest.fixture
def families(monkeypatch):
    """The families over which stability and peaks are proved; nothing is."""
    found = []

    def proved(family, *_, **__):
        found.append(family)
        return SimpleNamespace(summary="", method="", proved=True, upper_bound=1.0)

    for name in ("robust_stability", "worst_case"):
        monkeypatch.setattr(verification, name, proved)
    return found


def test_suspension_families_span_springs_and_masses(families):
    found = list(
        verification.SuspensionVerification(bc.BoomParameters(), None, FieldScenario(elements=4)).over_the_box()
    )
    assert [each.name.partition(":")[0] for each in found] == ["jolt", "jolt", "yaw", "yaw"]
    assert all(family.ranges == {"spring_factor": SPRING, "mass_factor": MASS} for family in families)
    assert families[0].names == families[1].names == ("spring_factor", "mass_factor")


@pytest.mark.parametrize(("bound", "calls"), [(1.0, 1), (np.inf, 2)])
def test_stability_is_proved_alone_without_a_bound_of_the_peak(families, monkeypatch, bound, calls):
    worst = SimpleNamespace(summary="", method="", upper_bound=bound)
    monkeypatch.setattr(verification, "worst_case", lambda family, *_, **__: families.append(family) or worst)
    machine = verification.SuspensionVerification(bc.BoomParameters(), None, FieldScenario(elements=4))
    assert [each.proved for each in machine.over_the_box()] == 2 * [True, True if bound == 1.0 else None]
    assert len(families) == 2 * calls


def test_measured_yaw_family_ends_at_measured_frequency(families):
    parameters = bc.BoomParameters(hinge_damping=500.0)
    verification.SuspensionVerification(parameters, None, FieldScenario()).at_the_measured_yaw(None)
    booms = (bc.spray_boom(spring_stiffness=each, elements=6) for each in families[0].ranges["spring_stiffness"])
    yaw_hz = [bc.split_symmetric(boom)[1].eigenfrequencies_hz(1)[0] for boom in booms]
    assert yaw_hz == pytest.approx([0.245, verification.MEASURED_YAW_HZ], abs=1e-4)
