"""Problems without a solution, and signals that do not meet, are refused in words that name the mode or signal."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.synthesis import loop_transfer_recovery
from tests.refusals import assert_refused, refusals
from tests.synthesis.plants import resonators, two_modes, weighed, yaw_plant
from tests.synthesis.test_h2_discrete import random_plant

MASS = control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0, inputs="force", outputs="place")
LAG = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
STUCK = control.ss(np.diag([1.1, 0.5]), [[0.0], [1.0]], [[1.0, 1.0]], 0.0, 0.1, inputs="u", outputs="y")
UNSEEN = control.ss(np.diag([1.0, 0.5]), [[1.0], [1.0]], [[0.0, 1.0]], 0.0, 0.1, inputs="u", outputs="y")
MODES = two_modes((1, 1, 1, 1), (1, 1, 1, 1))
P = weighed(resonators(2, 0.01, 1))
SAMPLED = random_plant(1)
MODEL = bc.spray_boom(elements=6)


def made(A, B, C, D, dt=0.0, states=None):
    """Return a generalized plant of one control ``u`` and measurement ``y`` between other signals."""
    inputs, outputs = [f"w{i}" for i in range(len(D[0]) - 1)], [f"z{i}" for i in range(len(D) - 1)]
    return control.ss(A, B, C, D, dt, inputs=[*inputs, "u"], outputs=[*outputs, "y"], states=states)


def integrator(D):
    return made([[0.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], np.array(D, dtype=float))


def dependent(D):
    """Return a plant of two controls and two measurements."""
    rng = np.random.default_rng(0)
    A, B, C = -np.eye(3), rng.standard_normal((3, 4)), rng.standard_normal((4, 3))
    return control.ss(A, B, C, np.array(D), inputs=["w", "n", "left", "right"], outputs=["z", "e", "a", "b"])


def noiseless():
    return bc.generalized_plant(
        MASS,
        disturbances={"force": 1.0},
        performance={"place": 1.0},
        effort={"force": 1.0},
        measurements="place",
        controls="force",
    )


def sampled_weight(weight):
    signals = {"disturbances": {"u": weight}, "performance": {"y": 1.0}}
    return bc.generalized_plant(STUCK, **signals, measurements="y", controls="u")


def fed_through(loop_gain):
    return bc.lft(control.ss([], [], [], [[0.0, 1.0], [1.0, 2.0]]), control.ss([], [], [], loop_gain))


def recovered(system=MASS, Q=1.0, band=(0.1, 10.0), strengths=(1.0,), **options):
    return loop_transfer_recovery(system, Q, 1.0, 1.0, 1.0, noise_intensities=strengths, omega_range=band, **options)


def regulated(Q=1.0, R=1.0, **options):
    return bc.lqr(MASS, Q, R, **options)


def yaw(**changes):
    return yaw_plant("stroke_anti", **changes)


def half(side, dt=0.0, force=None):
    names = {"inputs": f"stroke_{side}", "outputs": f"suspension_{force or side}"}
    return control.ss([[-5.0]], [[1.0]], [[1.0]], 0.0, dt, **names)


WEIGHT = control.ss(1.0, 1.0, 1.0, 0.0)
REFUSED = r"""
# regulators and filters
regulated([[0.0, 1.0], [1.0, 0.0]]) -> `Q` must be positive semidefinite
regulated(R=0.0) -> `R` must be positive definite, got an eigenvalue of 0
regulated(R={}) -> `R` must have a weight for each of force
regulated([[1.0, 2.0], [0.0, 1.0]]) -> `Q` must be symmetric
regulated(np.ones(3)) -> `Q` must be a number, 2 numbers or a 2 by 2 matrix, got shape
regulated(output_weight={"plac": 1.0}) -> unknown signal in output_weight 'plac'; did you mean 'place'
regulated(integral_action={"place": -1.0}) -> `integral_action` must be positive semidefinite
regulated(N=10.0 * np.ones((2, 1))) -> \[Q, N; N\^T, R\]` must be positive semidefinite
regulated(controls=[]) -> `controls` must have at least one
regulated(None) -> `Q` or `output_weight` must be given
bc.lqr(control.ss([], [], [], [[1.0]]), 1.0, 1.0) -> at least one state
bc.lqr(MODES, 1.0, 1.0, N=[[1.0]]) -> `N` must have the shape .*, states by controls, got \(1, 1\)
bc.lqr(two_modes((1, 1, 1, 0), (1, 1, 1, 1)), 1.0, 1.0, controls="u") -> SynthesisError: 3 rad/s .*uncontrollable from u
bc.lqr(MODES, None, 1.0, output_weight={"q": 0.0}) -> SynthesisError: mode at 2 rad/s .*no part in any weight
bc.lqr(STUCK, 1.0, 1.0) -> SynthesisError: not stabilizable: the mode at .* \(unstable
bc.lqr(UNSEEN, None, 1.0, output_weight=1.0) -> SynthesisError: undamped and has no part in any weight
bc.kalman(UNSEEN, 1.0, 1.0) -> SynthesisError: not detectable: the mode at 0 rad/s
bc.kalman(two_modes((1, 1, 1, 1), (1, 1, 1, 0)), 1.0, 1.0, measurements="y") -> SynthesisError: 3 rad/s .*unobservable from y
bc.kalman(two_modes((1, 1, 0, 1), (1, 1, 1, 1)), {"d": 1.0}, 1.0) -> SynthesisError: 3 rad/s .*not excited by any process
bc.kalman(MASS, -1.0, 1.0) -> `process_noise` must be positive semidefinite, got an eigenvalue
bc.lqg(UNSEEN, 1.0, 1.0, 1.0, 1.0, ltr_intensity=0.5) -> `ltr_intensity` must be 0 for a discrete system
recovered(band=(3.0, 1.0)) -> `omega_range` must be two nonnegative numbers, ascending
recovered(strengths=[]) -> `noise_intensities` must be one number or more
recovered(control.ss(LAG), 0.0) -> must yield a regulator with a loop to recover
recovered(MODES, measurements="y") -> `measurements` must be at least as many as the controls
# generalized plants
yaw(performance={"tip_anti": WEIGHT}) -> 'tip_anti'.*pole
yaw(effort={"suspension_anti": control.rss(2, 2, 1)}) -> 'suspension_anti'.*one input
yaw(noise={"tip_anti": 1.0}) -> unknown noise of measurement
yaw(effort={"actuator_anti": 1.0}) -> unknown effort of control
yaw(disturbances={}, noise={}) -> at least one disturbance
yaw(performance={}, effort={}) -> at least one performance
sampled_weight(control.ss(0.5, 1.0, 1.0, 0.0, 0.2)) -> 'u' must .* sampling time of the plant, 0\.1 s, got 0\.2 s
sampled_weight(control.ss(1.1, 1.0, 1.0, 0.0, 0.1)) -> must be stable, got a pole at z
fed_through(0.5) -> not well-posed
bc.lft(P, control.ss([], [], [], 1.0, inputs="z_q", outputs="u")) -> 'z_q' is an output of P
bc.lft(SAMPLED, LAG) -> `controller` must have a sampling time of 0.1 s, as P has, got continuous
select_channels(P, []) -> `inputs` must have at least one name
bc.h_infinity("P", 1, 1) -> `P` must be a generalized plant.*generalized_plant
bc.h2(control.rss(2, 3, 3), 3, 1) -> `nmeas` must be less than 3, so that P has at least one performance output, got 3
bc.h2(control.rss(2, 3, 3), 1, 3) -> `ncon` must be less than 3, so that P has at least one disturbance, got 3
bc.tune(yaw(), 1, 2, bc.tunable.gain())
    -> `ncon` must be at most 1, since 'n_stroke_anti' of P is a disturbance, got 2
bc.h2(control.rss(2, 3, 3)) -> `nmeas` must be given unless the labels of P begin with z_
bc.tune(P, bc.tunable.gain()) -> nmeas: expected a whole number, got a structure
bc.low_pass(1.0, 0.0) -> corner
bc.synthesis.high_pass(1.0, 1.0, order=3) -> order = 3: expected a whole number of at most 2
bc.synthesis.band_pass(1.0, 2.0, 1.0) -> `low` must be less than `high`
# assumptions
bc.h2(integrator(((3, 0, 0), (0, 0, 1), (0, 1, 0))), 1, 1) -> SynthesisError: 'w0' has a feedthrough 3 to .* 'z0'
bc.h_infinity(noiseless(), 1, 1) -> SynthesisError: D21.*measurement 'place'.*noise
bc.h_infinity(bc.mixed_sensitivity(LAG, W1=1.0), 1, 1) -> SynthesisError: D12.*control 'u'.*effort weight
bc.h_infinity(dependent([[0, 0, 0, 0], [0, 0, 1, 1], [0, 1, 0, 0], [0.5, 0, 0, 0]]), 2, 2)
    -> SynthesisError: combination of the controls 'left', 'right'
bc.h2(dependent([[0, 0, 1, 0], [0, 0, 0, 1], [0, 1, 0, 0], [0, 2, 0, 0]]), 2, 2)
    -> SynthesisError: combination of the measurements 'a', 'b'
bc.h_infinity(made([[-1, 0], [1, 0]], [[1, 0, 1], [0, 0, 0]], [[0, 1], [0, 0], [1, 0]], np.eye(3)[[0, 2, 1]] * [[0, 1, 1]],
    states=['plant', 'weight']), 1, 1)
    -> SynthesisError: not detectable.*integrating.*'weight'
bc.h2(control.ss(SAMPLED.A, SAMPLED.B, SAMPLED.C, SAMPLED.D * [[1, 1, 0], [1, 1, 0], [1, 1, 1]], 0.1), 1, 1)
    -> SynthesisError: control .* has no weight .* at the sample at which it acts
bc.h_infinity(SAMPLED, 1, 1, fastest_pole=10.0) -> ^`fastest_pole` must be None for a discrete plant
# what a controller can be
bc.discretize(control.ss([[0.5]], [[1]], [[1]], 0, 0.1), 0.1) -> sampling time of 0.1 s
bc.discretize(MODEL, 0.1) -> structure by its \.to_statespace\(dt=0\.1\)
bc.discretize(LAG, 0.1, "zoh", prewarp_omega=1.0) -> `prewarp_omega` must be None unless
bc.discretize(LAG, 0.1, prewarp_omega=100.0) -> `prewarp_omega` must be less than pi
bc.discretize(LAG, 0.1, samples_per_period=1.0) -> `samples_per_period` must be at least 2
bc.reduce_controller(made(1.0, [[1, 1]], [[1], [1]], [[0, 0], [0, 0]]), LAG * 0.0) -> SynthesisError: real part 1 rad/s
bc.reduce_controller(made([[0, 1], [0, 0.1]], [[0, 0], [1, 1]], [[1, 0], [1, 0]], [[0, 0], [0, 0]]),
    control.ss(-10.0, 1.0, 100.0, -11.0), fastest_pole=1.0)
    -> SynthesisError: without its poles above 1 rad/s cannot be reduced: its loop has a pole with real part 0\.05
bc.reduce_controller(P, bc.h2(P), order=99) -> `order` must be at most
bc.reduce_controller(SAMPLED, half("a", 0.1), fastest_pole=1.0) -> `fastest_pole` must be None for a discrete con
bc.join_symmetric(MODEL, half("anti", force="sym"), half("anti")) -> 'stroke_anti' of the symmetric contr
bc.join_symmetric(bc.spray_boom(elements=[-6, -2, 1, 6]), half("sym"), half("anti")) -> mirror symmetry
bc.join_symmetric(MODEL, half("sym", 0.01), half("anti")) -> `antisymmetric` must have the sampling time 0\.01 s, got 0
"""


@refusals(REFUSED)
def test_problem_without_solution_is_refused(call, words):
    assert_refused(call, words, globals())


@pytest.mark.parametrize("design", [bc.h_infinity, bc.h2])
@pytest.mark.parametrize(
    ("drives", "shown", "words"),
    [
        ((1, 1, 1, 0), (1, 1, 1, 1), r"not stabilizable: the mode at 3 rad/s \(damping 0 %.*'fast.* from u"),
        ((1, 1, 1, 1), (1, 1, 1, 0), r"not detectable: the mode at 3 rad/s \(damping 0 %.*'fast.* from y"),
        ((1, 1, 1, 1), (1, 0, 1, 1), r"controls \(u\) to the performance.*zero.*at 3 rad/s.*'fast"),
        ((1, 1, 0, 1), (1, 1, 1, 1), r"disturbances \(w_d, n_y\) to the measurements \(y\).*zero.*at 3 rad/s.*'fast"),
        ((0, 1, 1, 1), (1, 1, 0, 1), r"not detectable.*at 2 rad/s.*'slow"),
    ],
)
def test_modes_and_zeros_on_the_axis_are_named(design, drives, shown, words):
    with pytest.raises(bc.exceptions.SynthesisError, match=words):
        design(weighed(two_modes(drives, shown)), 1, 1)


@pytest.mark.parametrize("damping", [0.001, -0.001])
def test_lqr_mode_out_of_reach_is_named_if_it_decays(damping):
    plant = two_modes((1, 1, 1, 0), (1, 1, 1, 1))
    A = np.array(plant.A)
    A[3, 3] = -6.0 * damping
    plant = control.ss(A, plant.B, plant.C, 0.0, inputs=["d", "u"], outputs=["q", "y"])
    if damping > 0.0:
        (unmoved,) = bc.lqr(plant, None, 1.0, output_weight=1.0, controls="u").uncontrollable_modes
        assert unmoved.omega == pytest.approx(3.0)
        assert "damping 0.1 %" in str(unmoved)
        return
    with pytest.raises(bc.exceptions.SynthesisError, match=r"unstable, damping -0\.1 %.*uncontrollable from u"):
        bc.lqr(plant, None, 1.0, output_weight=1.0, controls="u")
