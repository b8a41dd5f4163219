"""Masked arrays raise at the boundary of every public function that takes arrays: a conversion would drop the mask."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.boom import PlatformMotion
from boomctl.slew import TorqueHistory
from boomctl.structure import AffineFamily, SecondOrderModel

MASS = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
GAIN = control.ss([], [], [], [[-0.1]], inputs="place", outputs="force")
SAMPLED = control.ss([], [], [], [[-0.1]], 0.05, inputs="place", outputs="force")
TIME, OMEGA, EYE = 0.05 * np.arange(50), np.geomspace(0.1, 10.0, 20), np.eye(2)
RECORD = np.random.default_rng(0).standard_normal(500)


def model(p, M=((1.0,),), force=(1.0,)):
    return SecondOrderModel(M, [[0.1]], [[p["k"]]], {"u": force}, {"y": [1.0]})


FAMILY = AffineFamily.through({"k": (0.9, 1.1)}, model)
PLANT = FAMILY.centre


def masked(value):
    array = np.array(value, dtype=float)
    return np.ma.array(array, mask=np.arange(array.size).reshape(array.shape) == 0)


def hub():
    return bc.hub_beam(modes=1)


def loop(disturbance=None, time=TIME, **more):
    return bc.simulate_loop(
        MASS, SAMPLED, {"force": TIME} if disturbance is None else disturbance, time, sample_time=0.05, **more
    )


def fit(**more):
    return bc.fit(model, PLANT.frequency_response(OMEGA), ["k"], {"k": 1.2}, **more)


CALLS = {
    "SecondOrderModel M": lambda: model({"k": 1.0}, M=masked([[1.0]])),
    "SecondOrderModel input": lambda: model({"k": 1.0}, force=masked([1.0])),
    "frequency_response": lambda: PLANT.frequency_response(masked(OMEGA)),
    "AffineFamily": lambda: AffineFamily(FAMILY.names, masked(FAMILY.low), FAMILY.high, PLANT, FAMILY.slopes),
    "AffineFamily.at": lambda: FAMILY.at(masked([0.0])),
    "sigma omega": lambda: bc.sigma(MASS, masked(OMEGA)),
    "sigma frequency_hz": lambda: bc.sigma(MASS, frequency_hz=masked(OMEGA)),
    "bode": lambda: bc.bode(MASS, masked(OMEGA)),
    "step": lambda: bc.step(MASS, masked(TIME)),
    "impulse": lambda: bc.impulse(MASS, masked(TIME)),
    "forced_response": lambda: bc.forced_response(MASS, {"force": masked(TIME)}, TIME),
    "forced_response of structure": lambda: bc.forced_response(PLANT, {"u": masked(TIME)}, TIME),
    "forced_response timepts": lambda: bc.forced_response(MASS, {"force": TIME}, masked(TIME)),
    "closed_loop_response": lambda: bc.analysis.closed_loop_response(MASS, GAIN, masked(OMEGA)),
    "simulate_loop": lambda: loop({"force": masked(TIME)}),
    "simulate_loop rows": lambda: loop(masked([TIME])),
    "simulate_loop timepts": lambda: loop(time=masked(TIME)),
    "simulate_loop initial": lambda: loop(initial=masked([1.0, 0.0])),
    "lqr Q": lambda: bc.lqr(MASS, masked(EYE), 1.0),
    "lqr R": lambda: bc.lqr(MASS, EYE, masked([[1.0]])),
    "lqr N": lambda: bc.lqr(MASS, EYE, 1.0, N=masked([[0.0], [0.0]])),
    "kalman": lambda: bc.kalman(MASS, masked(EYE), 1.0),
    "lqg": lambda: bc.lqg(MASS, EYE, 1.0, EYE, masked([1.0])),
    "identify": lambda: bc.identify(masked(RECORD), RECORD, 0.01),
    "estimate_response": lambda: bc.estimate_response(RECORD, masked(RECORD), 0.01),
    "estimate_response by name": lambda: bc.estimate_response({"a": masked(RECORD)}, {"b": RECORD}, 0.01),
    "estimate_response of list": lambda: bc.estimate_response([masked(RECORD)], [RECORD], 0.01),
    "fit weights": lambda: fit(weights=masked(np.ones(len(OMEGA)))),
    "fit measured": lambda: bc.fit(lambda p: [p["k"]], masked([2.0]), ["k"], {"k": 3.0}),
    "fit build": lambda: bc.fit(lambda p: masked([p["k"], 3.0]), [2.0, 3.0], ["k"], {"k": 3.0}),
    "schedule": lambda: bc.schedule([GAIN, GAIN], masked([0.0, 1.0])),
    "simulate timepts": lambda: hub().simulate(bc.spin_up(1.0, 2.0), masked(TIME)),
    "simulate initial": lambda: hub().simulate(bc.spin_up(1.0, 2.0), TIME, initial=masked(np.zeros(4))),
    "spin_up": lambda: bc.spin_up(1.0, 2.0).angle(masked(TIME)),
    "campbell": lambda: hub().campbell(masked([0.0, 1.0])),
    "shape": lambda: hub().shape(masked(np.zeros((1, 4)))),
    "residual_energy": lambda: hub().residual_energy(masked(np.zeros(4))),
    "optimal_slew": lambda: bc.optimal_slew(hub(), 1.0, 200.0, initial_state=masked(np.zeros(4))),
    "optimal_slew tip_masses": lambda: bc.optimal_slew(hub(), 1.0, 200.0, tip_masses=masked([0.1])),
    "TorqueHistory": lambda: TorqueHistory(np.arange(2.0), np.ones(1), np.ones(1))(masked([0.5])),
    "TorqueHistory.means": lambda: TorqueHistory(np.arange(2.0), np.ones(1), np.ones(1)).means(masked([0.2, 0.5])),
    "reduce": lambda: bc.reduce(MASS, order=1, omega_range=masked([1.0, 2.0])),
    "spray_boom elements": lambda: bc.spray_boom(elements=masked([0.0, 5.0, 10.0])),
    "spray_boom nozzles": lambda: bc.spray_boom(elements=4, nozzles=masked([1.0, 2.0])),
    "exact_frequency_response": lambda: bc.exact_frequency_response(bc.BoomParameters(), masked(OMEGA)),
    "PlatformMotion": lambda: PlatformMotion(masked(TIME), TIME, TIME),
    "sweep": lambda: bc.sweep(lambda x: x, {"x": masked([1.0, 2.0])}),
}


@pytest.mark.parametrize("name", CALLS)
def test_masked_array_raises(name):
    with pytest.raises(TypeError, match=r"must not be a masked array\. Fill or drop .*`\.filled`, `\.compressed`"):
        CALLS[name]()
