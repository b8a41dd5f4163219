"""Explicit steps of a slew and their derivatives: orders, exact cases, differences."""

import casadi as ca
import numpy as np
import pytest

import boomctl as bc
from boomctl.slew.dynamics import kind_of, step_of
from boomctl.slew.end_map import Steps, end_map
from boomctl.slew.plant import plant_of
from boomctl.slew.problem import Limits, slew_problem
from boomctl.slew.torque import held

LOADED = bc.HubBeamParameters(tip_mass=0.1)


def _end(plant, steps, torque=150.0, duration=0.8):
    z, u, h = ca.SX.sym("z", plant.n), ca.SX.sym("u"), ca.SX.sym("h")
    kind, constants = kind_of(plant)
    one = ca.Function("one", [z, u, h], [step_of(kind)(z, u, h, constants)])
    widths = np.full((1, steps), duration / steps)
    return np.array(one.mapaccum("all", steps)(np.zeros(plant.n), np.full((1, steps), torque), widths))[:, -1]


def _exact(h, plant, torque=150.0, duration=0.8):
    motion = h.simulate(
        bc.maneuvers.applied_torque(lambda t: torque + 0.0 * np.asarray(t)), [0.0, duration], rtol=1e-11, atol=1e-14
    )
    return plant.from_state @ motion.states[-1]


SOFT = bc.HubBeamParameters(tip_mass=0.1, youngs_modulus=2e9)


@pytest.mark.parametrize(
    ("parameters", "model", "modes", "torque", "steps"),
    [(LOADED, "sfoam", 3, 150.0, 80), (SOFT, "sfoam-consistent", 2, 100.0, 20)],
)
def test_steps_are_of_fourth_order(parameters, model, modes, torque, steps):
    h = bc.hub_beam(parameters, model=model, modes=modes)
    plant = plant_of(h)
    exact = _exact(h, plant, torque)
    errors = [np.abs(_end(plant, count, torque) - exact).max() for count in (steps, 2 * steps)]
    assert 12.0 < errors[0] / errors[1] < 22.0


@pytest.mark.parametrize(("model", "payloads"), [("sfoam", ()), ("foam", ()), ("sfoam", (0.3,))])
def test_derivatives_are_differences(model, payloads):
    problem = slew_problem(bc.hub_beam(LOADED, model=model, modes=1), 1.0, Limits(100.0), tip_masses=payloads)
    ends = end_map(problem, held(np.array([0.0, 1.0]), np.array([10.0])))
    random = np.random.default_rng(3)
    u, h = random.uniform(-100.0, 100.0, 12), random.uniform(0.5e-3, 1.5e-3, 12)

    def steps(du=0.0, dh=0.0):
        return Steps(u + du, h + dh, np.eye(12))

    found = ends.sensitivity(steps())
    weights = random.standard_normal(found.end.size)
    bent = ends.hessian(found, weights)
    assert found.end == pytest.approx(ends.defect(steps()) + ends.target, abs=1e-12)
    for k in (0, 5, 11):
        step = np.eye(12)[k]
        for by, aside, size in (
            (found.by_torque, {"du": 1e-2 * step}, 1e-2),
            (found.by_width, {"dh": 1e-7 * step}, 1e-7),
        ):
            both = [ends.defect(steps(**{name: sign * move for name, move in aside.items()})) for sign in (1.0, -1.0)]
            assert by[:, k] == pytest.approx((both[0] - both[1]) / (2.0 * size), rel=1e-5, abs=1e-6 * np.abs(by).max())
        slopes = [weights @ ends.sensitivity(steps(dh=sign * 1e-7 * step)).by_width for sign in (1.0, -1.0)]
        assert bent[:, k] == pytest.approx((slopes[0] - slopes[1]) / 2e-7, rel=1e-4, abs=1e-6 * np.abs(bent).max())
    assert bent == pytest.approx(bent.T)
