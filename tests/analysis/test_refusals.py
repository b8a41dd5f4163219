"""Combinations that make no sense are refused in words that say what to do; wrong kinds are tried by tests.fuzz."""

import re

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.analysis import (
    closed_loop_response,
    compare_sigma,
    mode_table,
    nyquist_stability,
    sample_plant,
    sampled_data_norm,
)
from boomctl.structure import AffineFamily, SecondOrderModel
from tests import handed_out as one
from tests.analysis.loop_cases import chain, velocity_feedback

STILL = velocity_feedback(0.1)


def siso(A=-1.0, B=1.0, C=1.0, D=0.0, dt=0.0, inputs="u", outputs="y"):
    return control.ss(A, B, C, D, dt, inputs=inputs, outputs=outputs)


def gain(K, inputs="y", outputs="u"):
    return control.ss([], [], [], K, inputs=inputs, outputs=outputs)


PLANT, DISCRETE = siso(), siso(0.5, dt=0.1)
K, SLOW = siso(0.5, 0.1, -1.0, 0.0, 0.1, "y", "u"), siso(-0.5, 0.1, -1.0, inputs="y", outputs="u")
UNTIMED, OTHER = (siso(0.5, 0.1, -1.0, 0.0, dt, "y", "u") for dt in (True, 0.2))


def family(forces=("u",)):
    """Return a mass on a spring, which is uncertain."""
    return AffineFamily.from_function(
        {"k": (0.9, 1.1)},
        lambda p: SecondOrderModel([[1.0]], [[0.1]], [[p["k"]]], {name: [1.0] for name in forces}, {"y": [1.0]}),
    )


def double_integrator(C, **names):
    return control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], C, 0.0, **names)


def unmodelled(bound):
    return bc.robust_stability(family(), gain([[-0.2]]), additive_uncertainty=bound)


def yaw_family(**given):
    return bc.boom_family(subsystem="yaw", **given)


NO_SAMPLING_TIME = (
    r"^controller: expected continuous time or a sampling time in seconds from 1e-30 to 1e\+30, got dt = True, which names "
    "no sampling time$"
)
PLANTS_SAMPLING_TIME = r"^controller: expected the plant's sampling time, 0\.1 s"
NO_DELAY = r"^`delay` must be 0 with a controller in continuous time, got 0\.1 s\.$"

REFUSED = [
    (
        lambda: bc.sigma(DISCRETE, frequency_hz=[6.0]),
        "^frequency_hz: expected at most half the sampling rate, 5 Hz, got 6 Hz$",
    ),
    (lambda: bc.bode(DISCRETE, [40.0]), "half the sampling rate"),
    (lambda: compare_sigma({"a": PLANT, "b": DISCRETE}, [100.0]), r"systems\['b'\]: omega: expected at most half"),
    (lambda: bc.h2_norm(siso(0.5, dt=True)), "expected continuous time or a sampling time in seconds.*, got dt = True"),
    (lambda: bc.hinf_norm(siso(0.5, dt=1e-200)), r"a sampling time in seconds from 1e-30 to 1e\+30, got .* 1e-200 s"),
    (lambda: bc.hinf_norm(bc.hub_beam(model="sfoam")), r"not linear: its \.linearize\(hub_speed\) is one"),
    (lambda: bc.sigma(siso(B=1e200, C=1e200)), r"in the units chosen, got B\[0, 0\] = 1e.200"),
    (lambda: bc.sigma(bc.spray_boom(), [1.0], outputs="tip_leftt"), "did you mean 'tip_left'"),
    (lambda: bc.sigma(one.mass().frequency_response([1.0]), [1.0]), "have their own frequencies"),
    (lambda: bc.bode(one.mass().frequency_response([1.0]), [1.0]), "own frequencies"),
    (lambda: bc.bode(PLANT, [1.0])["y"], r"result\['output', 'input'\]"),
    (lambda: bc.step(PLANT, [0.0, 0.1, 0.3]), "timepts: expected"),
    (lambda: bc.step(PLANT, [0.1, 0.2]), "timepts: expected"),
    (lambda: bc.step(siso(3.0), 1e4), "overflow"),
    (lambda: bc.nyquist(double_integrator([[1.0, 0.0]])), "encirclements are not determined|boundary|pole on"),
    (lambda: bc.nyquist(control.ss(-1.0, [[1.0, 1.0]], 1.0, [[0.0, 0.0]])), "as many outputs as inputs"),
    (lambda: bc.nyquist(PLANT, delay=1.0), "without a controller"),
    (lambda: bc.compare({"run": one.loop()}).plot(kind="margins"), "unknown kind"),
    (
        lambda: bc.compare({"run": one.loop(), "margins": bc.margins(one.yaw(), one.suspension())}).plot(),
        "nothing over",
    ),
    (lambda: bc.compare({}), "at least one"),
    (lambda: bc.compare({"a": []}), "at least one"),
    (lambda: bc.compare({"a": 3}), r"results\['a'\]: .*expected"),
    (lambda: bc.feedback_loop(chain(0), gain([[1.0]], "y9", "u0")), "'y9'"),
    (lambda: bc.feedback_loop(siso(D=2.0), gain([[0.5]]), "u"), "well-posed"),
    (lambda: bc.feedback_loop(PLANT, gain([[0.1]])), "so that the loop has no inputs"),
    (lambda: bc.feedback_loop(PLANT, UNTIMED, "u"), NO_SAMPLING_TIME),
    (lambda: bc.margins(PLANT, UNTIMED), NO_SAMPLING_TIME),
    (lambda: bc.feedback_loop(DISCRETE, OTHER, "u"), rf"{PLANTS_SAMPLING_TIME}, got 0\.2 s$"),
    (lambda: bc.feedback_loop(DISCRETE, SLOW, "u"), f"{PLANTS_SAMPLING_TIME}, got continuous time; boomctl.discretize"),
    (lambda: bc.feedback_loop(PLANT, SLOW, "u", delay=0.01), r"^delay = 0.01: expected 0 with a controller in cont"),
    (lambda: bc.feedback_loop(DISCRETE, K, "u", delay=0.03), r"^delay = 0.03: expected whole samples of 0.1 s"),
    (lambda: bc.feedback_loop(PLANT, K, "u", delay=500.0), r"^delay = 500: expected at most 1000 samples of 0.1 s"),
    (lambda: closed_loop_response(chain(0).frequency_response, velocity_feedback(0.1)), "omega"),
    (lambda: bc.margins(PLANT, siso(0.5, 10.0, -1.0, 0.0, 0.1, "y", "u")), r"z = .*, of size 1\.\d+\): it"),
    (lambda: mode_table(SecondOrderModel([[1.0]], [[2.0]], [[1.0]], {"f": [1.0]}, {"y": [1.0]})), "Jordan block"),
    (lambda: nyquist_stability(chain(1).frequency_response, STILL, [1j, np.nan]), "poles: expected finite numbers"),
    (lambda: nyquist_stability(chain(1).frequency_response, STILL, [[1j]]), "poles: expected numbers in one dim"),
    (lambda: bc.analysis.robust_stability_margin(family(), SLOW, delay=0.1), NO_DELAY),
    (lambda: bc.analysis.robust_stability_margin(0, K), "^family = 0: expected AffineFamily or PolynomialFamily"),
    (lambda: bc.robust_stability(family(), SLOW, delay=0.1), NO_DELAY),
    (lambda: bc.robust_stability(family(), K, delay=1e4), "at most 1000 samples"),
    (lambda: bc.robust_stability(yaw_family(), gain(0.1, "stroke_anti", "actuator_anti")), "actuator_anti"),
    (lambda: bc.worst_case(family(), gain([[-0.2]]), injection_points="z"), r"measurement \(injection_points\) 'z'"),
    (
        lambda: bc.robust_stability(family(("u", "u_injected")), gain([[-0.2]]), injection_points="u"),
        "new names, got 'u_inj",
    ),
    (lambda: bc.worst_case(family(), gain([[-0.2]]), norm="h3"), "norm"),
    (lambda: bc.worst_case(family(), gain([[-0.2]]), rtol=2.0), "`rtol` must be at most 1, got 2"),
    (lambda: sampled_data_norm(PLANT, gain([[1.0]])), r"controller: expected a sampling time.*boomctl\.discretize"),
    (lambda: sampled_data_norm(sample_plant(PLANT, 0.1), K), "continuous time"),
    (lambda: sampled_data_norm(PLANT, K, "y"), "unknown disturbance"),
    (lambda: sample_plant(PLANT, 1e-3, delay=2.0), "at most 1000 samples"),
    (lambda: unmodelled(siso(outputs="x")), r"unknown output of additive_uncertainty \(the controller has it\) 'y'"),
    (lambda: unmodelled(siso(1.0)), "`additive_uncertainty` must be stable, got a pole"),
    (lambda: unmodelled(DISCRETE), "additive_uncertainty: expected continuous time"),
    (lambda: bc.with_state_outputs(yaw_family(accelerometer_bandwidth_hz=20.0)), "filter behind 'tip_acc"),
    (lambda: bc.with_state_outputs(yaw_family(excitation="velocity")), "got an input that is integrated"),
    (lambda: bc.with_state_outputs(double_integrator([[1.0, 0.0]], states=["a.b", "a_b"])), "'a_b' twice"),
    (lambda: bc.margins(one.yaw(), gain([[-1.0]], "mode1_x1", "suspension_anti")), r"with_state_outputs\(plant\)"),
    (lambda: bc.hinf_norm(bc.lqr(PLANT, 1.0, 1.0)), r"got LqrResult; its \.controller is one"),
]


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize(("call", "words"), REFUSED, ids=[re.sub(r"\W+", " ", words)[:40] for _, words in REFUSED])
def test_combination_without_answer_is_refused(call, words):
    with np.errstate(all="ignore"), pytest.raises((TypeError, ValueError, ArithmeticError), match=words) as refused:
        call()
    assert "\n" not in str(refused.value)
