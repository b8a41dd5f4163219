"""What no answer can be given to: numbers that are none, at every door; and numbers next to zero."""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from math import inf, nan
from typing import Any

import numpy as np

from boomctl.analysis.h2 import h2_norm
from boomctl.analysis.margins import margins
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.sigma import sigma
from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.stress.case import Case, Seen, relative, rows, said_by_us
from boomctl.lti.system import Lti
from boomctl.reduction.reduce import reduce
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import hub_profile, sine_torque, spin_up, torque
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.simulation.forced_response import forced_response
from boomctl.simulation.loop import simulate_loop
from boomctl.slew.optimal import optimal_slew
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.parts import BeamSection
from boomctl.synthesis.hinf.h_infinity import h_infinity
from boomctl.synthesis.lq.lqg import lqg
from boomctl.synthesis.lq.lqr import lqr

_DOORS, _NEXT_TO_ZERO = "No numbers", "Numbers next to zero"
_DENORMAL = 5e-324  # the smallest positive number there is
_BAD = (nan, inf, -inf)


def _system(value: float) -> Any:
    """Return a system with one entry that is no number: python-control lets them through."""
    A = np.array([[value, 1.0], [-1.0, -0.1]])
    lti = Lti(A, np.array([[0.0], [1.0]]), np.eye(2)[:1], np.zeros((1, 1)), ("u",), ("y",), ("x1", "x2"))
    return lti.statespace("plant")


def _model(value: float) -> SecondOrderModel:
    return SecondOrderModel([[1.0]], [[0.1]], [[value]], {"f": [1.0]}, {"y": [1.0]})


_ELASTIC_HZ = 0.1  # below the first bending mode, 0.69 Hz, and far above what springs next to nothing do
_TIMES = np.linspace(0.0, 1.0, 11)  # s, of short simulations


def _signal(value: float) -> Any:
    return np.where(_TIMES[5] == _TIMES, value, 0.0)


def _profile(value: float) -> Any:
    return 3 * [lambda t: value + 0.0 * np.asarray(t)]


# every door, and how a value is handed in there
_CALLS: dict[str, Callable[[float], object]] = {
    "a parameter of the boom": lambda v: _each_field(spray_boom, BoomParameters(), v),
    "a parameter of the hub-beam": lambda v: _each_field(hub_beam, HubBeamParameters(), v),
    "a stiffness matrix": _model,
    "a section of a beam": lambda v: BeamSection(1.0, v, 1.0),
    "places of nodes": lambda v: spray_boom(elements=[-6.0, v, 6.0]),
    "frequencies of a response": lambda v: spray_boom().frequency_response([1.0, v]),
    "frequencies of the exact boom": lambda v: exact_frequency_response(BoomParameters(), [1.0, v]),
    "frequencies of singular values": lambda v: sigma(spray_boom(), [1.0, v]),
    "hinf_norm": lambda v: hinf_norm(_system(v)),
    "h2_norm": lambda v: h2_norm(_system(v)),
    "reduce, the system": lambda v: reduce(_system(v), order=1),
    "reduce, the error": lambda v: reduce(_system(-0.1), error=v),
    "lqr, the system": lambda v: lqr(_system(v), np.eye(2), 1.0),
    "lqr, a weight": lambda v: lqr(_system(-0.1), np.eye(2), v),
    "lqg, an intensity": lambda v: lqg(_system(-0.1), np.eye(2), 1.0, v, 1.0),
    "h_infinity, the plant": lambda v: h_infinity(_system(v), 1, 1),
    "margins, the plant": lambda v: margins(_system(v), _system(-0.1)),
    "forced_response, a signal": lambda v: forced_response(_system(-0.1), {"u": _signal(v)}, _TIMES),
    "simulate_loop, a signal": lambda v: simulate_loop(_system(-0.1), None, {"u": _signal(v)}, _TIMES, sample_time=0.1),
    "simulate_loop, the delay": lambda v: simulate_loop(
        _system(-0.1), None, {"u": _signal(0.0)}, _TIMES, sample_time=0.1, delay=v
    ),
    "a manoeuvre's speed": lambda v: spin_up(v, 1.0),
    "a manoeuvre's torque": lambda v: sine_torque(v, 1.0, 1.0),
    "a torque over time": lambda v: hub_beam(modes=1).simulate(torque(lambda t: v + 0.0 * np.asarray(t)), _TIMES),
    "a motion over time": lambda v: hub_beam(modes=1).simulate(hub_profile(*_profile(v)), _TIMES),
    "times of a simulation": lambda v: hub_beam(modes=1).simulate(spin_up(1.0, 1.0), [0.0, v]),
    "a hub's speed": lambda v: hub_beam(modes=1).frequencies_hz(v),
    "a slew's angle": lambda v: optimal_slew(hub_beam(modes=1), v, 200.0),
    "a slew's torque": lambda v: optimal_slew(hub_beam(modes=1), 0.6, v),
}


def _each_field(make: Callable[[Any], object], plain: Any, value: float) -> None:
    """Try a value in every field in turn; the last refusal stands for all, and an answer to any is one too many."""
    last = None
    for field in fields(plain):
        try:
            make(replace(plain, **{field.name: value}))
        except (ValueError, TypeError) as error:
            if not said_by_us(error):
                raise
            last = error
        else:
            return
    if last is not None:
        raise last


def cases() -> Iterator[Case]:
    """Return the cases of numbers that are none."""
    for door in _CALLS:
        yield from rows(_DOORS, door, "a refusal", partial(_refused, door), _BAD, promise=None)
    for name in ("spring_stiffness", "cradle_damping", "hinge_damping", "structural_damping", "platform_mass"):
        what, measure = (
            f"the boom with a {name.replace('_', ' ')}",
            "tips against those of no such part, of the largest",
        )
        tiny, work = (_DENORMAL, 1e-310), partial(_boom_beside_zero, name)
        yield from rows(_NEXT_TO_ZERO, what, measure, work, tiny, amount="of {:g}", promise=1e-9)
    tiny = (_DENORMAL, 1e-310, 1e-300)
    what, measure = "exact frequencies, spring stiffness", "relative, a spring of 1e-20 N/m"
    yield from rows(_NEXT_TO_ZERO, what, measure, _exact_beside_zero, tiny, amount="of {:g}", promise=1e-9)
    what = "response of a mass on a spring of stiffness"
    yield from rows(_NEXT_TO_ZERO, what, "relative, -1/w^2", _mass_beside_zero, tiny, promise=1e-9)


def _refused(door: str, value: float) -> Seen:
    _CALLS[door](value)
    return Seen(inf)


def _tips(p: BoomParameters) -> Any:
    return spray_boom(p).frequency_response([0.1, 1.0, 10.0], ACTUATORS, TIPS).frdata


def _boom_beside_zero(name: str, value: float) -> Seen:
    """What is next to zero does what is a billionth of a billionth of its usual value does: nothing that shows."""
    p = BoomParameters()
    return Seen(relative(_tips(replace(p, **{name: value})), _tips(replace(p, **{name: 1e-18 * getattr(p, name)}))))


def _exact_beside_zero(value: float) -> Seen:
    found, true = (
        exact_eigenfrequencies_hz(BoomParameters(spring_stiffness=k), 8, damped=False) for k in (value, 1e-20)
    )
    # springs next to nothing leave two motions next to rigid: they may be listed, with next to no frequency, or not
    return Seen(relative(found[found > _ELASTIC_HZ][:5], true[true > _ELASTIC_HZ][:5]))


def _mass_beside_zero(value: float) -> Seen:
    found = np.asarray(_model(value).frequency_response([1.0]).frdata)[0, 0]
    return Seen(relative(found, [1.0 / (0.1j - 1.0)]))
