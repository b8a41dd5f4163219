"""Stability of sampled loops over a box of parameters: proved where every point is stable, and nowhere else."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.box.sampled_level import SampledLoops, sampled_loops
from boomctl.arrays import balance
from boomctl.lti.system import of
from boomctl.structure import AffineFamily, SecondOrderModel
from tests.analysis.test_worst_case import chain, sampled
from tests.profiles import examples


def swing(stiffness, mass):
    """Return the family of two masses of which a stiffness and a mass are uncertain."""

    def make(values):
        k, m = values["stiffness"], values["mass"]
        M, K = np.diag([1.0, m]), np.array([[2.0 + k, -k], [-k, k]])
        C = 0.05 * np.array([[3.0, -1.0], [-1.0, 1.0]]) + 0.02 * np.eye(2)
        return SecondOrderModel(M, C, K, {"u": [1.0, 0.0], "w": [0.0, 1.0]}, {"y": [1.0, 0.0], "z": [0.0, 1.0]})

    return AffineFamily.through({"stiffness": stiffness, "mass": mass}, make)


def damper(gain, dt=0.2):
    """Return ``u = -gain s/(1 + s/10) y``, sampled."""
    rate = control.ss([[-10.0]], [[1.0]], [[100.0 * gain]], [[-10.0 * gain]], inputs="y", outputs="u")
    sampled = control.sample_system(rate, dt, "tustin")
    return control.ss(sampled.A, sampled.B, sampled.C, sampled.D, dt, inputs="y", outputs="u")


@pytest.mark.slow
@given(st.floats(0.1, 3.5), st.floats(0.0, 0.4))
@examples(20)
def test_what_is_proved_is_stable_at_every_point_and_what_is_not_is_found(gain, late):
    family, K = swing((0.9, 1.1), (0.9, 1.1)), damper(gain)
    found = bc.robust_stability(family, K, 200, delay=late)
    grid = np.linspace(-1.0, 1.0, 7)
    largest = max(np.abs(bc.feedback_loop(family.at([a, b]), K, delay=late).poles()).max() for a in grid for b in grid)
    if largest > 1.0:
        assert found.unstable_at is not None
    if found.proved:
        assert largest < 1.0
    elif found.unstable_at is None:  # given up: the box comes near to instability
        assert largest > 0.97


def test_a_well_damped_box_is_proved_and_instability_is_named():
    family = swing((0.9, 1.1), (0.9, 1.1))
    found = bc.robust_stability(family, damper(0.8), delay=0.1)
    assert found.proved
    assert found.abscissa < 0.0
    bad = bc.robust_stability(family, damper(0.8), delay=1.5)
    assert bad.unstable_at is not None
    assert not bad.proved
    poles = bc.feedback_loop(family.at(family.deltas(bad.unstable_at)), damper(0.8), delay=1.5).poles()
    assert np.abs(poles).max() >= 1.0


@pytest.mark.slow
def test_boxes_of_five_parameters_are_proved_and_hold_what_is_drawn():
    """A grid of all parameters would have a hundred thousand points; polynomials of bounded degree in all have hundreds."""
    rng = np.random.default_rng(500)
    family, K = chain(rng, 5)
    Kd, late = sampled(K, rng)
    assert bc.robust_stability(family, Kd, delay=late).proved
    worst = bc.worst_case(family, Kd, "push", "z", delay=late, tolerance=0.05)
    for delta in rng.uniform(-1.0, 1.0, (40, 5)):
        loop = bc.feedback_loop(family.at(delta), Kd, delay=late)
        norm = bc.hinf_norm(loop[[1], [loop.input_labels.index("push")]]).lower
        assert norm <= worst.upper_bound * (1.0 + 1e-9)


def test_polynomials_meet_the_loop_wherever_it_is_drawn():
    """To what they say that they may miss, at points that they have not seen."""
    family, K = chain(np.random.default_rng(4), 3)
    Kd = of(sampled(K, np.random.default_rng(4))[0], "K", any_time=True)
    raw = sampled_loops(family, Kd, ["push"], ["z"], 0.0)
    (loops,) = SampledLoops.over(family, Kd, ["push"], ["z"], 0.0)
    scale = balance(raw(np.zeros(3)).A)[1]
    for delta in np.random.default_rng(9).uniform(-1.0, 1.0, (50, 3)):
        A = raw(delta).A * scale / scale[:, None]
        found = sum(np.prod(delta[list(power)]) * X for power, X in loops.A.items())
        assert (np.abs(found - A) <= loops.missed[0]).all()


def test_what_a_sampled_box_cannot_be_is_refused():
    family = swing((0.9, 1.1), (0.9, 1.1))
    rate = control.ss([[-10.0]], [[1.0]], [[100.0]], [[-10.0]], inputs="y", outputs="u")
    with pytest.raises(ValueError, match=r"delay = 0\.1: expected 0 with a controller in continuous time"):
        bc.robust_stability(family, rate, delay=0.1)
    with pytest.raises(ValueError, match="at most 1000 samples"):
        bc.robust_stability(family, damper(1.0), delay=1e4)
    with pytest.raises(TypeError, match="family"):
        bc.robust_stability(None, damper(1.0))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"boomctl.robust_stability and boomctl.worst_case have proofs"):
        bc.analysis.structured_margin(family, damper(1.0))
