"""Each slew of designs/ keeps its promise: certificate, payloads, steady rotation."""

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from boomctl.slew import switching_function
from boomctl.studies import catalogue
from designs import min_time_slew, robust_payload_slew, spin_up_slew, tracked_slew

RUNS = {
    "min_time_slew": lambda: min_time_slew.main(modes=1),
    "robust_payload_slew": lambda: robust_payload_slew.main(modes=1, intervals=60),
    "spin_up_slew": lambda: spin_up_slew.main(modes=1),
    "tracked_slew": lambda: tracked_slew.main(modes=1, runs=8),
}


@cache
def judged(name):
    return RUNS[name]()


def test_the_catalogue_lists_suspensions_and_slews():
    assert set(catalogue.design_names()) > set(RUNS)
    assert len(catalogue.design_names()) == 16
    assert "four_bar" not in catalogue.design_names()


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_the_certificate_holds(name):
    evaluation = judged(name)
    design, certificate = evaluation.design, evaluation.design.slew.certificate
    assert design.name == name
    assert certificate.terminal_error < 1e-6
    assert certificate.constraint_violation == 0.0
    assert evaluation.comparison[design._label].residual_vibration < 1e-5
    assert evaluation.comparison[design._label].duration == design.slew.duration
    assert design.title in str(evaluation)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "switches"), [("min_time_slew", 3), ("spin_up_slew", 2)])
def test_the_torque_has_the_sign_of_the_switching_function(name, switches):
    slew = judged(name).design.slew
    curve = switching_function(slew)
    assert slew.certificate.n_switches == curve.switching_times.size == switches
    assert curve.sign_agreement == 1.0
    assert np.abs(curve.values).max() == 1.0
    at_switches = np.interp(curve.switching_times, curve.time, curve.values)
    assert np.abs(at_switches).max() < 1e-2


@pytest.mark.slow
def test_minimum_time_lies_between_rigid_and_shaped():
    lines = judged("min_time_slew").comparison
    own, rigid, shaped = (lines[name] for name in ("minimum time", "bang-bang", "bang-bang, ZV"))
    assert own.duration == pytest.approx(2.909, abs=5e-3)
    assert rigid.duration < own.duration < 0.8 * shaped.duration
    assert own.residual_vibration < 1e-6 < shaped.residual_vibration < rigid.residual_vibration
    assert own.residual_vibration_low > shaped.residual_vibration_low


@pytest.mark.slow
def test_one_torque_leaves_every_payload_at_rest():
    found = judged("robust_payload_slew").comparison
    robust, plain = (
        dict(zip(found.tip_masses, found[name].vibrations, strict=True))
        for name in (robust_payload_slew.ROBUST, robust_payload_slew.PLAIN)
    )
    nominal, others = robust_payload_slew.NOMINAL, robust_payload_slew.OTHERS
    assert max(robust[mass] for mass in (nominal, *others)) < 1e-4
    assert plain[nominal] < 1e-4
    assert all(robust[mass] < 0.15 * plain[mass] for mass in plain if mass != nominal)
    assert max(robust.values()) < 0.1 * max(plain.values())


@pytest.mark.slow
def test_the_spin_up_ends_in_steady_rotation():
    evaluation = judged("spin_up_slew")
    planned, profile = evaluation.to_dict()["spin_ups"]
    assert planned["speed_error"] < 1e-6
    assert planned["vibration"] < 1e-6 < profile["vibration"]
    assert planned["peak_torque"] == spin_up_slew.LIMIT < profile["peak_torque"]
    assert profile["speed_error"] < 1e-12
    lines = evaluation.comparison
    assert lines["constant torque"].duration < planned["duration"] < profile["duration"]
    assert lines["smooth torque"].duration == pytest.approx(profile["duration"], rel=1e-3)
    assert abs(lines["minimum time"].speed_error) < 1e-6


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("x = 1\n", ValueError, r"expected a file with a function design\(\)"),
        ("def design(): return 3\n", TypeError, r"design\(\) returned int, expected .* or a SlewDesign"),
        ("def design():\n    raise NotImplementedError\n", ValueError, r"mine\.py, line 2: NotImplementedError$"),
        ("def design():\n    return 1 + 'a'\n", TypeError, "unsupported operand"),
        (
            "import boomctl\ndef design(): return boomctl.hub_beam(None, 'sfoam', 0)\n",
            ValueError,
            "^modes = 0: expected",
        ),
        ("from neighbor import x\ndef design(): return x['y']\n", ValueError, r"mine\.py, line 2: KeyError: 'y'"),
        ("import broken\n", ValueError, r"broken\.py, line 1: SyntaxError"),
    ],
)
def test_a_file_that_fails_is_told_by_file_and_line(tmp_path, text, error, message):
    path = tmp_path / "mine.py"
    path.write_text(text)
    (tmp_path / "neighbor.py").write_text("x = {}\n")
    (tmp_path / "broken.py").write_text("x = = 2\n")
    before = list(sys.path)
    with pytest.raises(error, match=message):
        catalogue.load_design(path)
    assert sys.path == before
    sys.modules.pop("neighbor", None)


@pytest.mark.slow
def test_feedback_leaves_a_twentieth_of_the_vibration():
    """The numbers of docs/reference/designs.md, of the design as it is shipped."""
    design = tracked_slew.design()
    found = design.results["feedback"]
    open_runs, held_runs = found["runs"]
    machines = {line["machine"]: line for line in found["machines"]}
    page = " ".join(
        (Path(__file__).parents[2] / "docs" / "reference" / "designs.md").read_text(encoding="utf-8").split()
    )
    softer, stiffer = (machines[f"stiffness {way}10 %"] for way in "\u2212+")
    assert found["stiffness_ratio"] == min(softer["ratio"], stiffer["ratio"]) >= 20.0
    median, most = (np.quantile(held_runs["residual_vibration"], level) for level in (0.5, 0.95))
    alone = np.quantile(open_runs["residual_vibration"], 0.95)
    for words in (
        f"{design.slew.duration:.3f} s",
        f"{1e3 * max(softer['vibration'], stiffer['vibration']):.0f} mm",
        f"{softer['open_vibration']:.2f} m",
        f"at least {int(found['stiffness_ratio'])} times less",
        f"{1e3 * machines['tip mass 0.05 kg']['vibration']:.0f} mm",
        f"{1e3 * median:.0f} mm",
        f"{1e3 * most:.0f} mm",
        f"{1e3 * alone:.0f} mm",
    ):
        assert words in page, words
