"""What cannot be simulated is refused in words that name the parameter."""

import control as ct
import numpy as np

import boomctl as bc
from boomctl.simulation import CoulombFriction, TimeVaryingController, forced_response, simulate_loop
from tests.refusals import assert_refused, refusals
from tests.simulation.cases import mass_on_spring

_TIME = 0.02 * np.arange(11)
_HUB = {"inputs": ["hub_angle", "hub_speed"], "outputs": ["torque"]}


def _run(plant, law=None, disturbance=None, time=_TIME, **options):
    return simulate_loop(plant, law, time, disturbance, **{"sample_time": 0.02} | options)


def _mass(**options):
    """A mass on a spring between stops, with friction, or under some other option."""
    return _run(mass_on_spring(), **options)


def _free(**options):
    plant = ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.5]], np.eye(2), 0.0, inputs=["f"], outputs=["x", "v"])
    return _run(plant, **options)


def _read(name, **plant):
    """A controller around a mass on a spring, or another plant, that reads one signal."""
    return _run(**{"plant": mass_on_spring(), "law": ct.ss([], [], [], [[1.0]], inputs=[name], outputs=["f"])} | plant)


def _pole(rate, dt=0):
    return _run(mass_on_spring(), ct.ss([[rate]], [[1.0]], [[1.0]], 0.0, dt, inputs=["x"], outputs=["f"]))


def _beam(law=None, model="sfoam", **options):
    return _run(bc.hub_beam(model=model, modes=3), law, **options)


def _law(k=0, dt=0.02, **names):
    return ct.ss([[0.6]], [[0.4, 0.02]], [[-60.0]], [[-80.0, -240.0 - k]], dt, **_HUB | names)


def _varying(reads):
    A, B, C, D = (np.zeros((3, 1, columns)) for columns in (1, reads, 1, 2))
    return TimeVaryingController(A, B, C, D, *_HUB.values(), dt=0.02)


def _sensor(**change):
    return bc.BeamSensor(**({"name": "a", "quantity": "slope", "position": 1.0} | change))


def _slid(h):
    plant = ct.ss([[0, 1], [-4, -0.4]], [[0], [1]], [[1, 0]], 0, inputs=["cradle"], outputs=["cradle_slip"])
    time = h * np.arange(101)
    return simulate_loop(plant, None, time, {"cradle": time / 100}, sample_time=h, friction=CoulombFriction(10.0))


def _boom(signals, **options):
    return forced_response(bc.spray_boom(elements=6), **{"timepts": _TIME, "inputs": signals} | options)


def _grows(rate, run):
    plant, time = ct.ss([[rate]], [[1.0]], [[1.0]], 0.0, inputs=["d"], outputs=["y"]), 0.5 * np.arange(2000)
    with np.errstate(all="ignore"):
        return run(plant, time, {"d": np.ones(2000)})


_GAP = np.where(np.arange(11) == 7, np.nan, 0.0)
REFUSED = r"""
_mass(disturbance={"f": _GAP}) -> 'f' has a gap: nan at point 7
_mass(disturbance={"f": np.zeros(39)}) -> 'f' has shape \(39,\)
_mass(disturbance=np.zeros((2, 11))) -> shape \(2, 11\); expected \(1, 11\)
_mass(time=_TIME[::-1]) -> ascending
_mass(time=[0.0]) -> at least two
_mass(initial_state=[0.0]) -> initial_state has shape
_mass(time=np.delete(0.02 * np.arange(12), 5)) -> expected equal steps
_mass(sample_time=0.03) -> whole multiple
_read("x", control_limit={"u9": 1.0}) -> unknown signal of control_limit 'u9'
_mass(sensors=[_sensor()]) -> sensors: expected none for a linear plant
_read("z") -> 'z'
_read("mode1_x1", plant=bc.spray_boom(elements=6)) -> its state 'mode1_x1', which is no output
_pole(-250.0) -> too long for the controller's pole at -250\+0j rad/s.*fastest_pole=
_pole(0.5, dt=0.1) -> its sampling time is 0.1 s
_run(ct.ss([[0.5]], [[1.0]], [[1.0]], 0.0, 0.1)) -> continuous time
_grows(40.0, lambda P, t, d: simulate_loop(P, None, t, d, sample_time=0.5)) -> diverges
_grows(5.0, forced_response) -> overflow
_boom({}) -> to arrays, got none
_boom({"actuator": _TIME}) -> did you mean
CoulombFriction(1.0, 0.5) -> breakaway_force = 0.5
_slid(4.0) -> finer timepts
_free(end_stop={"x": (1.0,)}) -> end_stop\['x'\]
_free(end_stop={"v": (0.1, "f")}) -> no inertia
_free(end_stop=0.1) -> no outputs stroke_
_free(end_stop={"x": (0.5, "f")}, initial_state=[0.6, 0.0]) -> 'x' is 0.6 m at the first time
_beam(model="geometrically-exact") -> `plant` must be a hub-beam with assumed modes
_beam(end_stop=1.0) -> end_stop: expected None for a hub-beam
_beam(friction=CoulombFriction(1.0)) -> friction: expected None for a hub-beam
_beam(sensors=[_sensor(position=9.0)]) -> sensors\[0\]: .*9.0.*8
_beam(sensors=[_sensor(name="hub_angle")]) -> sensors.*'hub_angle'
_sensor(quantity="strain") -> height = None: expected a distance
_sensor(height=0.1) -> height = 0.1: expected None
_beam(ct.ss([], [], [], [[4000.0, 40000.0]], 0.02, **_HUB), time=0.02 * np.arange(501), disturbance={'torque': np.ones(501)})
    -> diverges|outside the model|error stays
_beam(disturbance={"torque": 100.0 * np.ones(11)}, rtol=1e-15, atol=1e-30) -> rtol = 1e-15: the error stays
_beam(time=[0.0, 1e9], sample_time=1e9) -> timepts: the motion would take
# controllers that change
bc.gain_schedule([_law()], [0.0]) -> values: expected one for each of two or more
bc.gain_schedule([_law(), _law(1)], [1.0, 0.0]) -> expected ascending ones
bc.gain_schedule([_law(), _law(dt=0.1)], [0.0, 1.0]) -> controllers\[1\]: expected the dt of the first
bc.gain_schedule([_law(), _law(inputs=["a", "b"])], [0.0, 1.0]) -> controllers\[1\]: expected the input_labels
bc.gain_schedule([_law(), ct.ss([], [], [], [[-1.0, -1.0]], 0.02, **_HUB)], [0.0, 1.0])
    -> controllers\[1\]: expected the nstates of the first, 1, got 0
_varying(1) -> B has shape \(3, 1, 1\); expected \(3, 1, 2\)
"""


@refusals(REFUSED)
def test_combination_that_is_impossible_refused(call, words):
    assert_refused(call, words, globals())
