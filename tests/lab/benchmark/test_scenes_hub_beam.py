"""Scenes of the hub-beam: references agree with others, ours converges to them, and everybody's error is a number."""

import casadi as ca
import numpy as np
import pytest

from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.peers.exudyn import exudyn_tip
from boomctl.lab.benchmark.peers.hub_beam import Drive, judge, machine, until
from boomctl.lab.benchmark.peers.integrators import SPIN_UP, TORQUE, Ode
from boomctl.lab.benchmark.references.extrapolation import extrapolated
from boomctl.lab.benchmark.run import maker
from boomctl.lab.benchmark.scene import there
from boomctl.lab.benchmark.scenes.hub_beam_many import followers, many_torques
from boomctl.lab.benchmark.scenes.hub_beam_modes import hub_beam_modes, hub_beam_stiff_modes
from boomctl.rotating_beam import AssumedModesBeam, hub_beam
from boomctl.rotating_beam.modal.energy import state_function

SCENES = ("hub-beam-motion", "hub-beam-models", "hub-beam-torque", "hub-beam-torque-models")


def errors(scene, ours):
    """Return the errors of the cold answers, by competitor."""
    found = {}
    for setting in scene.settings:
        if setting.ours is ours:
            found.setdefault(setting.competitor, []).append(scene.error(setting.cold(0.0)))
    return found


def test_extrapolation_is_exact_for_a_forced_oscillator():
    x, t = ca.SX.sym("x", 2), ca.SX.sym("t")
    equations = Ode(x, t, ca.vertcat(x[1], ca.sin(2.0 * t) - 9.0 * x[0]), np.array([1.0, 0.0]))
    time = np.linspace(0.0, 10.0, 101)
    exact = (np.sin(2.0 * time) - 2.0 / 3.0 * np.sin(3.0 * time)) / 5.0
    assert extrapolated(equations, time, 1) == pytest.approx(exact, abs=1e-13)


def test_extrapolation_has_the_order_of_its_columns():
    drive, ode = until(2.0), Ode.of(AssumedModesBeam(machine(), "sfoam", 2), SPIN_UP)
    exact = extrapolated(ode, drive, 8)
    coarse, fine = (np.abs(extrapolated(ode, drive, n, columns=2) - exact).max() for n in (2, 4))
    assert coarse / fine == pytest.approx(2.0**4, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("manoeuvre", [SPIN_UP, TORQUE], ids=["spin-up", "torque"])
def test_the_reference_agrees_with_ours_at_its_tightest(manoeuvre):
    beam = AssumedModesBeam(machine(), "sfoam", 5)
    ode = Ode.of(beam, manoeuvre)
    drive = Drive(manoeuvre, until(12.0), "")
    exact = extrapolated(ode, drive.timepts, 10)
    finer = extrapolated(ode, drive.timepts, 20)
    assert judge(exact)(finer) < 2e-12
    assert judge(exact)(drive.tip(beam, 1e-12)) < 5e-12


@pytest.mark.slow
@pytest.mark.parametrize("key", SCENES)
def test_everybody_answers_and_ours_is_most_exact(key):
    scene = maker(key)("quick")
    mine, theirs = errors(scene, ours=True), errors(scene, ours=False)
    assert all(np.isfinite(each).all() for each in (*mine.values(), *theirs.values()))
    assert min(map(min, mine.values())) < min(map(min, theirs.values()))
    for name, found in mine.items():
        assert found == sorted(found, reverse=True) or max(found) < 2.0 * min(found), name


@pytest.mark.slow
@pytest.mark.parametrize("key", SCENES)
def test_hot_answers_are_the_cold_ones(key):
    scene = maker(key)("quick")
    for setting in scene.settings:
        if setting.hot is not None:
            hot, cold = setting.hot(setting.prepare()), setting.cold(0.0)
            np.testing.assert_allclose(hot, cold, atol=1e-9 * np.abs(cold).max())


@pytest.mark.slow
@pytest.mark.parametrize("key", SCENES)
def test_the_reference_of_a_whole_run_is_reached(key):
    scene = maker(key)("whole")
    assert scene.error(next(each for each in scene.settings if each.competitor == "SFOAM").cold(0.0)) < 0.1


def test_a_changed_machine_moves_the_tip_by_as_little():
    drive = Drive(SPIN_UP, until(5.0), "")
    before, after = (drive.tip(hub_beam(machine(change), "sfoam", 2), 1e-9) for change in (0.0, 1e-6))
    assert 0.0 < judge(before)(after) < 1e-4


@pytest.mark.slow
def test_the_exact_beam_agrees_with_its_lagrangian_in_another_integrator():
    """Its motion under a torque against CasADi's integration of the equations derived from the energies of all strains."""
    beam, drive = hub_beam(machine(), "geometrically-exact", 2), Drive(TORQUE, until(3.0), "")
    function = state_function(beam._lagrangian(), "exact")
    size = len(beam.state_names)
    x, t = ca.SX.sym("x", size), ca.SX.sym("t")
    rate, _ = function(x, TORQUE.amplitude * ca.sin(2.0 * np.pi * t / TORQUE.period), ca.SX(0, 1))  # no constants
    options = {"reltol": 1e-8, "abstol": 1e-11, "max_num_steps": 10_000_000}
    system = {"x": x, "t": t, "ode": rate}
    states = np.array(ca.integrator("flow", "cvodes", system, 0.0, drive.timepts[1:], options)(x0=0.0)["xf"])
    found = np.imag(beam.dynamics.tip(states[: size // 2].T))
    assert judge(drive.tip(beam, 1e-9)[1:])(found) < 1e-5


@pytest.mark.slow
@pytest.mark.skipif(not there("exudyn"), reason="exudyn is not installed")
def test_exudyn_tends_to_the_exact_beam():
    drive = Drive(SPIN_UP, until(10.0), "")
    error = judge(drive.tip(hub_beam(machine(), "geometrically-exact", 8), 1e-8))
    coarse, fine = (error(exudyn_tip(machine(), SPIN_UP, drive.timepts, n, h)) for n, h in ((4, 0.02), (16, 0.005)))
    assert fine < 0.2 * coarse
    assert fine < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    "made", [hub_beam_modes, hub_beam_stiff_modes, many_torques, followers], ids=lambda m: m.__name__
)
def test_ours_keeps_its_errors_with_many_modes_torques_and_machines(made):
    """What is promised of errors holds at a small size; others answer the same questions."""
    found = measured(made("quick"), 1e-3, lambda text: None)
    assert all(p.error < 1e-2 for p in found.points), [p for p in found.points if p.failed]
    errors = [kept for kept in found.kept if kept.text.endswith("error")]
    assert errors
    assert all(kept.held for kept in errors), errors
