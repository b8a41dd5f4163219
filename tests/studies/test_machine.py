"""A controller for a machine of one's own: peaks, margins, stability over a family, and files of the controller."""

import json
from dataclasses import replace

import control
import pytest

import boomctl as bc
from boomctl.structure import AffineFamily, SecondOrderModel
from tests.refusals import assert_refused, refusals

SPRUNG = SecondOrderModel([[1.0]], [[0.02]], [[4.0]], {"force": [1.0], "wind": [1.0]}, {"position": [1.0]})
DAMPER = control.ss(-20.0, 20.0, 40.0, -40.0, inputs="position", outputs="force", name="damper")  # -40 s/(s + 20)


def test_peaks_margins_and_stability_are_those_of_the_loop():
    sampled = {"sample_time": 0.001, "control_limit": 5.0}
    result = bc.studies.MachineDesign("mine", "A mass on a spring", SPRUNG, DAMPER, **sampled).evaluate()
    s = control.tf("s")
    damped = 1 / (s**2 + 0.02 * s + 4 + 40 * s / (s + 20))
    assert result.stable
    assert result.after.peak == pytest.approx(control.norm(damped, "inf"), rel=1e-5)
    assert result.before.peak == pytest.approx(25.0, rel=1e-3)
    assert result.margins.multiloop_io.alpha > 0.0
    assert result.to_dict()["after"]["peak"] == result.after.peak
    assert "The loop is stable" in str(result)
    files = result.controller_files()
    assert set(files) >= {"controller.json", "controller.mat", "controller.c"}
    assert f"FORCE[CONTROLLER_CONTROLS] = {{R({(5.0).hex()})}}" in files["controller.c"]


@pytest.mark.slow
def test_a_loop_that_is_not_stable_is_said_to_be():
    worse = control.ss(-20.0, 20.0, -40.0, 40.0, inputs="position", outputs="force")
    result = bc.studies.MachineDesign("worse", "The wrong sign", SPRUNG, worse).evaluate()
    assert not result.stable
    assert result.margins is None
    assert "NOT stable" in result.verdict
    written = json.loads(json.dumps(result.to_dict()))
    assert written["after"]["peak"] is None
    assert "controller.json" in result.report().files


def test_peak_that_is_not_verified_is_said_to_be(monkeypatch):
    result = made().evaluate()
    unsure = replace(result.after.certificate, verified=False)
    monkeypatch.setattr(type(result.after), "certificate", unsure)
    assert result.report().html.count("0.2783, NOT verified</td>") == 2


SPRINGS = AffineFamily.from_function(
    {"stiffness": (3.0, 5.0)},
    lambda p: SecondOrderModel(
        [[1.0]], [[0.02]], [[p["stiffness"]]], {"force": [1.0], "wind": [1.0]}, {"position": [1.0]}
    ),
)


def test_machine_design_over_family_proves_stability():
    result = bc.studies.MachineDesign("mine", "A mass on a spring", SPRINGS, DAMPER, results={"made": 2}).evaluate()
    assert result.robust.proved
    assert result.before.peak == pytest.approx(25.0, rel=1e-3)  # of the center
    found = result.to_dict()
    assert found["proved"]
    assert found["spectral_abscissa"] == result.robust.spectral_abscissa < 0.0
    assert found["made"] == 2
    assert result.verdict.endswith("Proved stable at every stiffness 3 to 5.")
    assert "controller.json" in result.controller_files()


def made(plant=SPRUNG, controller=DAMPER, **options):
    return bc.studies.MachineDesign("mine", "", plant, controller, **options)


SCHEDULED = bc.gain_schedule([DAMPER, DAMPER], [0.0, 1.0], "position")
REFUSED = r"""
made(controller=control.ss(-1.0, 1.0, 1.0, 0.0, inputs="speed", outputs="force")) -> speed
made(controller=SCHEDULED) -> plant = .*: expected Family
made(SPRINGS, SCHEDULED) -> unknown parameter of plant 'position'
made(inputs="force") -> force
made(outputs="nowhere") -> nowhere
made(np.eye(2)) -> plant: expected SecondOrderModel or StateSpace
made(sample_time=-1.0) -> sample_time = -1\.0
"""


@refusals(REFUSED)
def test_machine_design_that_does_not_fit_raises(call, words):
    assert_refused(call, words, globals())
