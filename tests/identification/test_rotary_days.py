"""A motor with a flexible beam on four days: six parameters from their responses, a sampled loop proved for their box."""

from functools import cache

import control
import numpy as np
import pytest
from scipy import stats

import boomctl as bc
from boomctl.analysis.loops import feedback_loop
from boomctl.identification.fit import fit
from boomctl.rotating_beam.factory import hub_beam
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.discretise import discretize

pytestmark = pytest.mark.slow

_RULER = bc.HubBeamParameters(0.4, 7800.0, 2e-5, 2e11, 1.667e-12, 2e-3, 0.02)  # of steel, 400 x 20 x 1 mm
_NAMES = ("gain", "friction", "youngs_modulus", "damping_ratio", "hub_inertia", "tip_mass")
# as drawn, and as it is in the middle of the days
_BEGIN = dict(zip(_NAMES, (1.0, 5e-3, 2e11, 0.01, 2e-3, 5e-3), strict=True))
_TRUE = dict(zip(_NAMES, (0.91, 8e-3, 1.86e11, 0.014, 2.2e-3, 8e-3), strict=True))  # SI units
_OMEGA = 2.0 * np.pi * np.geomspace(0.5, 40.0, 100)
_DAYS, _APART = 4, 0.01  # the last one is left out; deviation of each parameter from day to day
_ERRORS, _REPEATS = 0.03, (2, 12)  # of one measurement; of measurements a day
_STEP, _DELAY, _FASTEST = 0.004, 0.001, 300.0  # s; s, from sample to torque; rad/s, pole of the derivative
_TOLERANCE = 0.05  # of the worst case
_DRAWS = 50  # points of the box whose responses make the band
_JUDGES = 30  # machines of the box that judge what is proved of all of them


def rig(p):
    """Return motor and beam: torque asked for, with a gain, and a force on the tip; the hub's angle, and the tip's place."""
    beam = hub_beam(_RULER, model="sfoam", modes=2, **{name: p[name] for name in _NAMES[2:]})
    model = beam.structure().select(["torque", "tip_force"], ["hub_angle", "tip_displacement"])
    C, forces = np.array(model.C), model.ports.B[0] * np.array([p["gain"], 1.0])
    C[0, 0] += p["friction"]
    places = dict(zip(model.outputs, model.ports.L[0], strict=True))
    return SecondOrderModel(model.M, C, model.K, dict(zip(model.inputs, forces.T, strict=True)), places)


@cache
def days():
    """Return the mean response of each day."""
    rng, found = np.random.default_rng(0), []
    for _ in range(_DAYS):
        day = {name: value * np.exp(_APART * rng.standard_normal()) for name, value in _TRUE.items()}
        G = response(day)
        E = rng.standard_normal((int(rng.integers(*_REPEATS, endpoint=True)), 2, *G.shape))
        G = G * (1.0 + _ERRORS * (E[:, 0] + 1j * E[:, 1])).mean(axis=0)
        found.append(control.frd(G, _OMEGA, inputs=["torque"], outputs=["hub_angle"]))
    return tuple(found)


def response(p):
    """Return the response of the hub's angle to the torque, (1, 1, n)."""
    return np.asarray(rig(p).frequency_response(_OMEGA, ["torque"], ["hub_angle"]).frdata)


def _drawn(family, count):
    """Return parameters of machines within the box of a family."""
    rng = np.random.default_rng(1)
    return [{**_BEGIN, **{name: rng.uniform(*ends) for name, ends in family.ranges.items()}} for _ in range(count)]


@cache
def _box():
    """Return the family of the union of the boxes of the days."""
    first, *others = (fit(rig, day, list(_BEGIN), _BEGIN, starts=1) for day in days()[:-1])
    return first.family(union_with=others)


def _controller():
    """Return a PD with a notch at the first vibration, as it runs."""
    s = control.tf("s")
    law = -(0.3 + 0.03 * s / (s / _FASTEST + 1.0))
    notch = (s**2 + 24.0 * s + 3600.0) / (s**2 + 96.0 * s + 3600.0)  # 60 rad/s, dampings of 0.2 and 0.8
    K = control.ss(law * notch)
    return discretize(control.ss(K.A, K.B, K.C, K.D, inputs=["hub_angle"], outputs=["torque"]), _STEP)


def test_parameters_of_three_days_predict_the_fourth():
    fitted = fit(rig, list(days()[:-1]), list(_BEGIN), _BEGIN, starts=1)
    error = np.abs(response(fitted.parameters) / response(_TRUE) - 1.0)
    assert np.sqrt(np.square(error).mean()) < 0.02
    sizes = np.array([np.abs(response(p)).ravel() for p in _drawn(fitted.family(), _DRAWS)])
    size, beyond = np.abs(days()[-1].frdata).ravel(), stats.norm.ppf(0.975) * _ERRORS / np.sqrt(_REPEATS[0])
    within = (size > (1.0 - beyond) * sizes.min(axis=0)) & (size < (1.0 + beyond) * sizes.max(axis=0))
    assert within.mean() >= 0.96


def test_sampled_loop_is_proved_for_the_box_and_its_worst_case_bounded():
    assert bc.robust_stability(_box(), _controller(), delay=_DELAY).proved
    worst = bc.worst_case(_box(), _controller(), "tip_force", "hub_angle", delay=_DELAY, tolerance=_TOLERANCE)
    assert worst.upper_bound / worst.norm.value - 1.0 <= 1.001 * _TOLERANCE
    omega = np.geomspace(0.1, np.pi / _STEP, 1000)
    for p in _drawn(_box(), _JUDGES):  # machines of the box, each by its poles and its response
        loop = feedback_loop(rig(p), _controller(), delay=_DELAY)
        assert np.abs(loop.poles()).max() < 1.0
        gains = np.abs(control.frequency_response(loop["hub_angle", "tip_force"], omega).frdata)
        assert gains.max() <= worst.upper_bound
