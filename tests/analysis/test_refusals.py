"""Combinations that make no sense are refused in words that say what to do; wrong kinds are tried by tests.fuzz."""

import control
import pytest

import boomctl as bc
from boomctl.structure import AffineFamily, SecondOrderModel
from tests.analysis.loop_cases import chain, velocity_feedback
from tests.refusals import assert_refused, refusals

CHAIN, STILL = chain(0), velocity_feedback(0.1)


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


def unmodelled(bound, controller=None):
    return bc.robust_stability(family(), controller or gain([[-0.2]]), additive_uncertainty=bound)


def yaw_family(**given):
    return bc.boom_family(subsystem="yaw", **given)


REFUSED = r"""
bc.sigma(DISCRETE, frequency_hz=[6.0]) -> ^frequency_hz: expected at most half the sampling rate, 5 Hz, got 6 Hz$
bc.bode(DISCRETE, [40.0]) -> half the sampling rate
compare_sigma({"a": PLANT, "b": DISCRETE}, [100.0]) -> systems\['b'\]: omega: expected at most half
bc.h2_norm(siso(0.5, dt=True)) -> expected continuous time or a sampling time in seconds.*, got dt = True
bc.hinf_norm(siso(0.5, dt=1e-200)) -> a sampling time in seconds from 1e-30 to 1e\+30, got .* 1e-200 s
bc.hinf_norm(bc.hub_beam(model="sfoam")) -> not linear: its \.linearize\(hub_speed\) is one
bc.sigma(siso(B=1e200, C=1e200)) -> in the units chosen, got B\[0, 0\] = 1e.200
bc.sigma(bc.spray_boom(), [1.0], outputs="tip_leftt") -> did you mean 'tip_left'
bc.sigma(one.mass().frequency_response([1.0]), [1.0]) -> have their own frequencies
bc.bode(one.mass().frequency_response([1.0]), [1.0]) -> own frequencies
bc.bode(PLANT, [1.0])["y"] -> result\['output', 'input'\]
bc.step(PLANT, [0.0, 0.1, 0.3]) -> timepts: expected
bc.step(PLANT, [0.1, 0.2]) -> timepts: expected
bc.step(siso(3.0), 1e4) -> overflow
bc.nyquist(double_integrator([[1.0, 0.0]])) -> ArithmeticError: encirclements are not determined|boundary|pole on
bc.nyquist(control.ss(-1.0, [[1.0, 1.0]], 1.0, [[0.0, 0.0]])) -> as many outputs as inputs
bc.nyquist(PLANT, delay=1.0) -> without a controller
bc.compare({"run": one.loop()}).plot(kind="margins") -> unknown kind
bc.compare({"run": one.loop(), "margins": bc.margins(one.yaw(), one.suspension())}).plot() -> nothing over
bc.compare({}) -> at least one
bc.compare({"a": []}) -> at least one
bc.compare({"a": 3}) -> results\['a'\]: .*expected
bc.feedback_loop(CHAIN, gain([[1.0]], "y9", "u0")) -> 'y9'
bc.feedback_loop(siso(D=2.0), gain([[0.5]]), "u") -> well-posed
bc.feedback_loop(PLANT, gain([[0.1]])) -> so that the loop has no inputs
bc.feedback_loop(PLANT, UNTIMED, "u")
    -> ^controller: .*time or a sampling time in seconds from 1e-30 to 1e\+30, got dt = True, which names no sampling time$
bc.margins(PLANT, UNTIMED)
    -> ^controller: .*time or a sampling time in seconds from 1e-30 to 1e\+30, got dt = True, which names no sampling time$
bc.feedback_loop(DISCRETE, OTHER, "u") -> ^controller: expected the plant's sampling time, 0\.1 s, got 0\.2 s$
bc.feedback_loop(DISCRETE, SLOW, "u")
    -> ^controller: expected the plant's sampling time, 0\.1 s, got continuous time; boomctl.discretize
bc.feedback_loop(PLANT, SLOW, "u", delay=0.01) -> ^delay = 0.01: expected 0 with a controller in cont
bc.feedback_loop(DISCRETE, K, "u", delay=0.03) -> ^delay = 0.03: expected whole samples of 0.1 s
bc.feedback_loop(PLANT, K, "u", delay=500.0) -> ^delay = 500: expected at most 1000 samples of 0.1 s
closed_loop_response(CHAIN.frequency_response, STILL) -> omega
bc.margins(PLANT, siso(0.5, 10.0, -1.0, 0.0, 0.1, "y", "u")) -> z = .*, of size 1\.\d+\): it
mode_table(SecondOrderModel([[1.0]], [[2.0]], [[1.0]], {"f": [1.0]}, {"y": [1.0]})) -> Jordan block
nyquist_stability(CHAIN.frequency_response, STILL, [1j, np.nan]) -> poles: expected finite numbers
nyquist_stability(lambda w: control.frd(np.ones((1, 1, len(w))), w, inputs="u", outputs="y"), gain(-2.0), [1j]) -> roll off
nyquist_stability(CHAIN.frequency_response, STILL, [[1j]]) -> poles: expected numbers in one dim
bc.analysis.robust_stability_margin(family(), SLOW, delay=0.1)
    -> ^`delay` must be 0 with a controller in continuous time, got 0\.1 s\.$
bc.analysis.robust_stability_margin(0, K) -> ^family = 0: expected AffineFamily or PolynomialFamily
bc.robust_stability(family(), SLOW, delay=0.1) -> ^`delay` must be 0 with a controller in continuous time, got 0\.1 s\.$
bc.robust_stability(family(), K, delay=1e4) -> at most 1000 samples
bc.robust_stability(yaw_family(), gain(0.1, "stroke_anti", "actuator_anti")) -> actuator_anti
bc.worst_case(family(), gain([[-0.2]]), injection_points="z") -> measurement \(injection_points\) 'z'
bc.robust_stability(family(("u", "u_injected")), gain([[-0.2]]), injection_points="u") -> new names, got 'u_inj
bc.worst_case(family(), gain([[-0.2]]), norm="h3") -> norm
bc.worst_case(family(), gain([[-0.2]]), rtol=2.0) -> `rtol` must be at most 1, got 2
sampled_data_norm(PLANT, gain([[1.0]])) -> controller: expected a sampling time.*boomctl\.discretize
sampled_data_norm(sample_plant(PLANT, 0.1), K) -> continuous time
sampled_data_norm(PLANT, K, "y") -> unknown disturbance
sample_plant(PLANT, 1e-3, delay=2.0) -> at most 1000 samples
unmodelled(siso(outputs="x")) -> unknown output of additive_uncertainty \(the controller has it\) 'y'
unmodelled(siso(1.0)) -> `additive_uncertainty` must be stable, got a pole
unmodelled(gain(0.01, "u", "y"), K) -> must fall with frequency from u to y, got 0\.01
unmodelled(siso(), bc.gain_schedule([gain(-0.1), gain(-0.2)], [0.9, 1.1], "k"))
    -> `additive_uncertainty` must be None for a controller that follows a parameter
unmodelled(DISCRETE) -> additive_uncertainty: expected continuous time
bc.with_state_outputs(yaw_family(accelerometer_bandwidth_hz=20.0)) -> filter behind 'tip_acc
bc.with_state_outputs(yaw_family(excitation="velocity")) -> got an input that is integrated
bc.with_state_outputs(double_integrator([[1.0, 0.0]], states=["a.b", "a_b"])) -> 'a_b' twice
bc.margins(control.ss(-1, 1, 1, 0), control.ss(-1, 1, 1, 0)) -> its signals have no names but u\[0\], y\[0\].*update_names
bc.margins(one.yaw(), gain([[-1.0]], "mode1_x1", "suspension_anti")) -> with_state_outputs\(plant\)
bc.hinf_norm(bc.lqr(PLANT, 1.0, 1.0)) -> got LqrResult; its \.controller is one
"""


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@refusals(REFUSED)
def test_combination_without_answer_is_refused(call, words):
    assert_refused(call, words, globals())
