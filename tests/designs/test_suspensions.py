"""Each suspension of designs/ is worth what the README says, and better than the boom as it is."""

import re
from functools import cache

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.analysis.box.worst_case import WorstCase
from boomctl.analysis.margins import Margins
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.studies.catalogue import load_design as loaded
from boomctl.studies.suspension import CONTROLS, STROKES, FieldScenario, evaluate_suspension, suspension_model
from boomctl.studies.suspension.scenario import FAMILY_ELEMENTS
from boomctl.studies.suspension.verification import SuspensionVerification

pytestmark = pytest.mark.early

SCENARIO = FieldScenario(duration=30.0, warmup_time=20.0)
PEAKS = {
    "passive_tuning": 9.86,
    "lqr_suspension": 3.37,
    "lqg_suspension": 13.60,
    "h_infinity_split": 9.52,
    "h_infinity_full": 10.15,
    "sampled_suspension": 9.32,
    "tuned_suspension": 7.69,
    "tuned_passive": 11.36,
    "codesign": 7.23,
}
WORST = {  # over springs and mass
    "lqg_suspension": 25.1,
    "h_infinity_full": 21.5,
    "h_infinity_split": 18.3,
    "tuned_suspension": 9.48,
    "codesign": 7.70,
    "passive_tuning": 18.04,
    "tuned_passive": 16.18,
    "sampled_suspension": 13.83,
    "lqr_suspension": 3.71,
}


FIELD = {  # deposit CV with its tolerance, force, stroke on the field of the page
    "tuned_suspension": (0.0100, 5e-5, 11.38, 0.026),
    "codesign": (0.0101, 1e-4, 11.52, 0.027),
    "sampled_suspension": (0.0106, 5e-5, 15.47, 0.027),
    "tuned_passive": (0.0152, 5e-5),
}


load_design = cache(loaded)


@cache
def evaluated(name):
    return load_design(name).evaluate(SCENARIO)


@pytest.fixture(params=[pytest.param(name, marks=pytest.mark.slow) for name in sorted(PEAKS)])
def result(request):
    return evaluated(request.param)


def test_certified_peak_is_that_of_readme_and_better(result):
    """Of a symmetric loop the largest peak is the larger one of both halves."""
    peak = result.active.sigma.peak
    assert result.better
    assert peak == pytest.approx(PEAKS[result.design.name], rel=5e-3)
    assert max(result.active.jolt.lower_bound, result.active.yaw.lower_bound) == pytest.approx(peak, rel=1e-4)
    assert result.yaw_reduction_db > 40.0
    assert result.active.stroke < SCENARIO.end_stop


def test_suspensions_are_proved_stable_over_box(result):
    """Over springs and mass, over the yaw's frequencies, and on the exact boom, whose curve is that of the mesh."""
    K = result.design.controller
    own, sampled = result.design.name == "lqr_suspension", K is not None and not K.isctime()
    assert set(result.worst) == ({"boom"} if own else {"jolt", "yaw"})
    assert result.robust
    assert (result.exact_sigma is None) == (own or sampled)
    if result.exact_sigma is not None:
        assert result.exact_sigma.peak == pytest.approx(result.active.sigma.peak, rel=5e-3)
    worst = result.worst
    assert max(each.worst_norm.lower_bound for each in worst.values()) == pytest.approx(
        WORST[result.design.name], abs=0.05
    )
    assert all(0.0 <= each.relative_gap <= 1.001e-3 for each in worst.values())  # nowhere in the box higher, proved
    for name, each in worst.items():
        stored = result.to_dict()["worst_case"][name]
        assert stored == {
            "found": each.worst_norm.lower_bound,
            "upper_bound": each.upper_bound,
            "relative_gap": each.relative_gap,
        }
    found = result.of(Margins)
    assert set(found) == (set() if own or K is None else {"jolt", "yaw"})
    if found and not sampled:
        least = 0.38 if result.design.name in ("tuned_suspension", "codesign") else 0.4
        assert found["jolt"].multiloop_input.alpha > least
        assert found["yaw"].multiloop_input.alpha > 0.4


@pytest.mark.slow
@pytest.mark.parametrize("name", FIELD)
def test_suspensions_on_field_of_page_have_its_numbers(name):
    cv, tolerance, *largest = FIELD[name]
    design = load_design(name)
    parts = design.parameters, design.controller
    whole = evaluate_suspension("on the field of the page", FieldScenario(), *parts, delay=design.delay)
    assert not whole.run.stop_contacts
    assert whole.spray.cv == pytest.approx(cv, abs=tolerance)
    if largest:
        assert (whole.force, whole.stroke) == (pytest.approx(largest[0], abs=0.1), pytest.approx(largest[1], abs=5e-4))
        assert (whole.spray.min_dose, whole.spray.max_dose) == pytest.approx((0.95, 1.05), abs=6e-3)


@pytest.mark.slow
def test_tuned_suspension_meets_its_goals():
    """Three states a half; peak, proved worst peak, and force of the goals; the yaw near its static gain everywhere."""
    result = evaluated("tuned_suspension")
    assert result.to_dict()["controller"] == {"states": 6}
    assert result.active.sigma.certificate.upper_bound < 9.3
    assert max(each.upper_bound for each in result.worst.values()) < 10.2
    assert result.active.yaw.lower_bound == pytest.approx(6.85, abs=0.01)
    assert result.worst["yaw"].worst_norm.lower_bound == pytest.approx(6.87, abs=0.01)


@pytest.mark.slow
def test_codesign_meets_its_goals():
    """Three and two states; peak and proved worst peak of the goals and of the page, at no more force than others take."""
    result = evaluated("codesign")
    dampers = result.design.parameters.cradle_damping, result.design.parameters.hinge_damping
    assert dampers == (pytest.approx(174.6, abs=2), pytest.approx(527, abs=7))
    assert result.to_dict()["controller"] == {"states": 5}
    assert result.active.sigma.certificate.upper_bound < 7.9
    assert result.worst["jolt"].upper_bound == pytest.approx(7.708, abs=1e-3)
    assert result.worst["yaw"].upper_bound < 6.85
    # margins were not asked for: that of the yaw differs a little where the goals do not (kernels of BLAS)
    found = result.of(Margins)
    assert found["jolt"].multiloop_input.alpha == pytest.approx(0.39, abs=0.01)
    assert found["yaw"].multiloop_input.alpha == pytest.approx(1.14, abs=0.02)


@pytest.mark.slow
def test_tuned_passive_is_better_over_box():
    """Than those tuned for Table 2, whose dampers go with softer and stiffer springs less well; both bounds are proved."""
    result = evaluated("tuned_passive")
    other = SuspensionVerification(load_design("passive_tuning").parameters, None, SCENARIO).over_the_box()
    bounds = [
        max(each.value.upper_bound for each in findings if isinstance(each.value, WorstCase))
        for findings in (result.findings, other)
    ]
    assert bounds == [pytest.approx(16.19, abs=0.01), pytest.approx(18.06, abs=0.01)]


@pytest.mark.slow
def test_sampled_suspension_has_numbers_of_page():
    """At the samples, between them, on other booms; beside the controller made for 2 ms, run as slowly."""
    result = evaluated("sampled_suspension")
    K = result.design.controller
    assert (K.dt, K.nstates, result.active.run.sample_time, result.active.run.delay) == (0.02, 13, 0.02, 0.01)
    assert result.yaw_reduction_db == pytest.approx(48.4, abs=0.1)
    assert any(each.name == "mesh of 60 elements" and each.value < 1.0 for each in result.findings)
    assert [each.upper_bound for each in result.worst.values()] == pytest.approx([8.082, 13.843], abs=1e-3)
    assert [each.multiloop_input.alpha for each in result.of(Margins).values()] == pytest.approx([0.42, 0.52], abs=5e-3)
    between = [text for name, text in result.design.synthesis_info.items() if "between samples" in name]
    found = [float(re.findall(r"\d\.\d+", text)[-1]) for text in between]
    assert found == pytest.approx([0.377656, 1.26685], rel=1e-5)
    split = load_design("h_infinity_split").controller
    names = {"inputs": split.input_labels, "outputs": split.output_labels}
    slow = control.sample_system(split, 0.02, "tustin")
    slow = control.ss(slow.A, slow.B, slow.C, slow.D, 0.02, **names)
    _, yaw, _ = bc.synthesis.split_controller(suspension_model(), slow)
    half = bc.boom_family(
        subsystem="yaw", elements=FAMILY_ELEMENTS, accelerometer_bandwidth_hz=SCENARIO.accelerometer_bandwidth_hz
    )
    found = bc.worst_case(half, yaw, ["actuator_anti"], ["tip_anti"], delay=0.01)
    assert found.worst_norm.lower_bound == pytest.approx(79.9, rel=5e-3)


def test_performance_discrete_controller_uses_its_sampling_time():
    names = {"inputs": list(STROKES), "outputs": list(CONTROLS)}
    damper = control.ss(0.5 * np.eye(2), np.eye(2), 500.0 * np.eye(2), -1000.0 * np.eye(2), 0.02, **names)
    scenario = FieldScenario(duration=1.0, warmup_time=0.2, elements=6)
    found = evaluate_suspension("slow damper", scenario, BoomParameters(), damper, delay=0.013)
    assert (found.run.sample_time, found.run.delay) == (0.02, 0.013)
    loop = bc.feedback_loop(suspension_model(elements=6, nozzles=True), damper, delay=0.013)
    between = bc.synthesis.select_channels(loop, list(ACTUATORS), list(TIPS))
    assert found.sigma.peak == pytest.approx(bc.hinf_norm(between).lower_bound, rel=1e-6)
    assert found.sigma.omega.max() <= np.pi / 0.02
    assert max(found.jolt.lower_bound, found.yaw.lower_bound) == pytest.approx(found.sigma.peak, rel=1e-4)


@pytest.mark.slow
def test_suspension_controller_files_have_its_limits():
    """Its C code has the limits of the field run; a passive suspension has no files."""
    files = evaluated("sampled_suspension").controller_files()
    assert {"controller.json", "controller.mat", "controller.m", "controller.c"} <= set(files)
    assert (
        f"FORCE[CONTROLLER_CONTROLS] = {{R({SCENARIO.control_limit.hex()}), R({SCENARIO.control_limit.hex()})}}"
        in files["controller.c"]
    )
    assert not evaluated("passive_tuning").controller_files()
    assert "worst peak there, proved" in evaluated("passive_tuning").report().html
