"""Problems without a solution, and signals that do not meet, are refused in words that name the mode or signal."""

import re

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.synthesis import loop_transfer_recovery, select_channels
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


def half(side, dt=0.0, force=None):
    names = {"inputs": f"stroke_{side}", "outputs": f"suspension_{force or side}"}
    return control.ss([[-5.0]], [[1.0]], [[1.0]], 0.0, dt, **names)


WEIGHT = control.ss(1.0, 1.0, 1.0, 0.0)
REFUSED = [
    # regulators and filters
    (lambda: regulated([[0.0, 1.0], [1.0, 0.0]]), "`Q` must be positive semidefinite"),
    (lambda: regulated(R=0.0), "`R` must be positive definite, got an eigenvalue of 0"),
    (lambda: regulated(R={}), "`R` must have a weight for each of force"),
    (lambda: regulated([[1.0, 2.0], [0.0, 1.0]]), "`Q` must be symmetric"),
    (lambda: regulated(np.ones(3)), "`Q` must be a number, 2 numbers or a 2 by 2 matrix, got shape"),
    (lambda: regulated(output_weight={"plac": 1.0}), "unknown signal in output_weight 'plac'; did you mean 'place'"),
    (lambda: regulated(integral_action={"place": -1.0}), "`integral_action` must be positive semidefinite"),
    (lambda: regulated(N=10.0 * np.ones((2, 1))), r"\[Q, N; N\^T, R\]` must be positive semidefinite"),
    (lambda: regulated(controls=[]), "`controls` must have at least one"),
    (lambda: regulated(None), "`Q` or `output_weight` must be given"),
    (lambda: bc.lqr(control.ss([], [], [], [[1.0]]), 1.0, 1.0), "at least one state"),
    (lambda: bc.lqr(MODES, 1.0, 1.0, N=[[1.0]]), r"`N` must have the shape .*, states by controls, got \(1, 1\)"),
    (lambda: bc.lqr(two_modes((1, 1, 1, 0), (1, 1, 1, 1)), 1.0, 1.0, controls="u"), r"3 rad/s .*uncontrollable from u"),
    (lambda: bc.lqr(MODES, None, 1.0, output_weight={"q": 0.0}), "mode at 2 rad/s .*no part in any weight"),
    (lambda: bc.lqr(STUCK, 1.0, 1.0), r"not stabilizable: the mode at .* \(unstable"),
    (lambda: bc.lqr(UNSEEN, None, 1.0, output_weight=1.0), "undamped and has no part in any weight"),
    (lambda: bc.kalman(UNSEEN, 1.0, 1.0), "not detectable: the mode at 0 rad/s"),
    (
        lambda: bc.kalman(two_modes((1, 1, 1, 1), (1, 1, 1, 0)), 1.0, 1.0, measurements="y"),
        r"3 rad/s .*unobservable from y",
    ),
    (lambda: bc.kalman(two_modes((1, 1, 0, 1), (1, 1, 1, 1)), {"d": 1.0}, 1.0), "3 rad/s .*not excited by any process"),
    (lambda: bc.kalman(MASS, -1.0, 1.0), "`process_noise` must be positive semidefinite, got an eigenvalue"),
    (
        lambda: bc.lqg(UNSEEN, 1.0, 1.0, 1.0, 1.0, ltr_intensity=0.5),
        "`ltr_intensity` must be 0 for a discrete system",
    ),
    (lambda: recovered(band=(3.0, 1.0)), "`omega_range` must be two nonnegative numbers, ascending"),
    (lambda: recovered(strengths=[]), "`noise_intensities` must be one number or more"),
    (lambda: recovered(control.ss(LAG), 0.0), "must yield a regulator with a loop to recover"),
    (lambda: recovered(MODES, measurements="y"), "`measurements` must be at least as many as the controls"),
    # generalized plants
    (lambda: yaw_plant("stroke_anti", performance={"tip_anti": WEIGHT}), "'tip_anti'.*pole"),
    (
        lambda: yaw_plant("stroke_anti", effort={"suspension_anti": control.rss(2, 2, 1)}),
        "'suspension_anti'.*one input",
    ),
    (lambda: yaw_plant("stroke_anti", noise={"tip_anti": 1.0}), "unknown noise of measurement"),
    (lambda: yaw_plant("stroke_anti", effort={"actuator_anti": 1.0}), "unknown effort of control"),
    (lambda: yaw_plant("stroke_anti", disturbances={}, noise={}), "at least one disturbance"),
    (lambda: yaw_plant("stroke_anti", performance={}, effort={}), "at least one performance"),
    (
        lambda: sampled_weight(control.ss(0.5, 1.0, 1.0, 0.0, 0.2)),
        r"'u' must .* sampling time of the plant, 0\.1 s, got 0\.2 s",
    ),
    (lambda: sampled_weight(control.ss(1.1, 1.0, 1.0, 0.0, 0.1)), "must be stable, got a pole at z"),
    (lambda: fed_through(0.5), "not well-posed"),
    (lambda: bc.lft(P, control.ss([], [], [], 1.0, inputs="z_q", outputs="u")), "'z_q' is an output of P"),
    (lambda: bc.lft(SAMPLED, LAG), "`controller` must have a sampling time of 0.1 s, as P has, got continuous"),
    (lambda: select_channels(P, []), "`inputs` must have at least one name"),
    (lambda: bc.h_infinity("P", 1, 1), "`P` must be a generalized plant.*generalized_plant"),
    (
        lambda: bc.h2(control.rss(2, 3, 3), 3, 1),
        "`nmeas` must be less than 3, so that P has at least one performance output, got 3",
    ),
    (
        lambda: bc.h2(control.rss(2, 3, 3), 1, 3),
        "`ncon` must be less than 3, so that P has at least one disturbance, got 3",
    ),
    (
        lambda: bc.tune(yaw_plant("stroke_anti"), 1, 2, bc.tunable.gain()),
        "`ncon` must be at most 1, since 'n_stroke_anti' of P is a disturbance, got 2",
    ),
    (lambda: bc.h2(control.rss(2, 3, 3)), "`nmeas` must be given unless the labels of P begin with z_"),
    (lambda: bc.tune(P, bc.tunable.gain()), "nmeas: expected a whole number, got a structure"),
    (lambda: bc.low_pass(1.0, 0.0), "corner"),
    (lambda: bc.synthesis.high_pass(1.0, 1.0, order=3), "order = 3: expected a whole number of at most 2"),
    (lambda: bc.synthesis.band_pass(1.0, 2.0, 1.0), "`low` must be less than `high`"),
    # assumptions
    (lambda: bc.h2(integrator(((3, 0, 0), (0, 0, 1), (0, 1, 0))), 1, 1), r"'w0' has a feedthrough 3 to .* 'z0'"),
    (lambda: bc.h_infinity(noiseless(), 1, 1), "D21.*measurement 'place'.*noise"),
    (lambda: bc.h_infinity(bc.mixed_sensitivity(LAG, W1=1.0), 1, 1), r"D12.*control 'u'.*effort weight"),
    (
        lambda: bc.h_infinity(dependent([[0, 0, 0, 0], [0, 0, 1, 1], [0, 1, 0, 0], [0.5, 0, 0, 0]]), 2, 2),
        "combination of the controls 'left', 'right'",
    ),
    (
        lambda: bc.h2(dependent([[0, 0, 1, 0], [0, 0, 0, 1], [0, 1, 0, 0], [0, 2, 0, 0]]), 2, 2),
        "combination of the measurements 'a', 'b'",
    ),
    (
        lambda: bc.h_infinity(
            made(
                [[-1.0, 0.0], [1.0, 0.0]],
                [[1, 0, 1], [0, 0, 0]],
                [[0, 1], [0, 0], [1, 0]],
                [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
                states=["plant", "weight"],
            ),
            1,
            1,
        ),
        "not detectable.*integrating.*'weight'",
    ),
    (
        lambda: bc.h2(
            control.ss(SAMPLED.A, SAMPLED.B, SAMPLED.C, SAMPLED.D * [[1, 1, 0], [1, 1, 0], [1, 1, 1]], 0.1), 1, 1
        ),
        "control .* has no weight .* at the sample at which it acts",
    ),
    (lambda: bc.h_infinity(SAMPLED, 1, 1, fastest_pole=10.0), "^`fastest_pole` must be None for a discrete plant"),
    # what a controller can be
    (lambda: bc.discretize(control.ss([[0.5]], [[1]], [[1]], 0, 0.1), 0.1), "sampling time of 0.1 s"),
    (lambda: bc.discretize(MODEL, 0.1), r"structure by its \.to_statespace\(dt=0\.1\)"),
    (lambda: bc.discretize(LAG, 0.1, "zoh", prewarp_omega=1.0), "`prewarp_omega` must be None unless"),
    (lambda: bc.discretize(LAG, 0.1, prewarp_omega=100.0), "`prewarp_omega` must be less than pi"),
    (lambda: bc.discretize(LAG, 0.1, samples_per_period=1.0), "`samples_per_period` must be at least 2"),
    (lambda: bc.reduce_controller(made(1.0, [[1, 1]], [[1], [1]], [[0, 0], [0, 0]]), LAG * 0.0), "real part 1 rad/s"),
    (lambda: bc.reduce_controller(P, bc.h2(P), order=99), "`order` must be at most"),
    (
        lambda: bc.reduce_controller(SAMPLED, half("a", 0.1), fastest_pole=1.0),
        "`fastest_pole` must be None for a discrete con",
    ),
    (lambda: bc.join_symmetric(MODEL, half("anti", force="sym"), half("anti")), "'stroke_anti' of the symmetric contr"),
    (lambda: bc.join_symmetric(bc.spray_boom(elements=[-6, -2, 1, 6]), half("sym"), half("anti")), "mirror symmetry"),
    (
        lambda: bc.join_symmetric(MODEL, half("sym", 0.01), half("anti")),
        r"`antisymmetric` must have the sampling time 0\.01 s, got 0",
    ),
]


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=[re.sub(r"\W+", " ", words)[:40] for _, words in REFUSED])
def test_problem_without_solution_is_refused(call, words):
    with pytest.raises((TypeError, ValueError, bc.exceptions.SynthesisError), match=words):
        call()


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
