"""Stability of sampled loops over a box of parameters: proved where every point is stable, and nowhere else."""

import control
import numpy as np

import boomctl as bc
from boomctl.analysis.box.sampled_level import SampledLoops, sampled_loops
from boomctl.arrays import balance
from boomctl.lti.system import of
from boomctl.structure import AffineFamily, SecondOrderModel
from tests.analysis.test_worst_case import chain, sampled


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
