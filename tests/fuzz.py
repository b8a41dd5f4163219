"""Arguments of right and wrong kinds for every public function: what is tried on each, and what an answer may be.

A call starts from arguments that work, those of the example in the docstring; one or two are replaced by something else.
"""

import ast
import contextlib
import dataclasses
import doctest
import inspect
import signal
import warnings
from fractions import Fraction
from functools import cache
from pathlib import Path

import control
import numpy as np
from hypothesis import strategies as st

import boomctl as bc
import boomctl.structure as bs
from tests import handed_out as one
from tests.docstrings import sections
from tests.public import public
from tests.stress.cases import raised_by_boomctl

LONGEST = 20.0  # s of processor time that a call may take: what a user waits without asking
SHORT = 5.0  # [s], of what takes a time limit
_TIMES = np.linspace(0.0, 0.5, 51)


class Hung(BaseException):
    """A call took longer than LONGEST; no clause of ours catches it."""


@cache
def plant():
    A, B = [[0.0, 1.0], [-1.0, -0.1]], [[0.0, 0.0], [1.0, 1.0]]
    return control.ss(A, B, [[1.0, 0.0]], 0.0, inputs=["u0", "u1"], outputs="y0")


@cache
def controller(dt=0.0):
    return control.ss(-5.0, 1.0, -0.1, 0.0, dt, inputs="y0", outputs="u0")


@cache
def beam():
    return bc.hub_beam(modes=1)


def points():
    rod = bs.RigidBody("rod", bs.GROUND.at(0.0), bs.revolute(), 1.0, 1.0)
    return rod, rod.at(1.0), bs.GROUND.at(1.0)


def weights():
    return {"Q": np.eye(2), "R": [[1.0]], "output_weight": None}


def noises():
    return {"process_noise": np.eye(2), "measurement_noise": [[1.0]]}


def fields_of(record):
    """Return the arguments that make a record."""
    return {field.name: getattr(record, field.name) for field in dataclasses.fields(record) if field.init}


def file(name):
    return lambda: {"path": name}


MADE = ("hub_beam", "structure.AffineFamily", "structure.PolynomialFamily", "structure.Point")  # without an example
# arguments that replace those of the example, or stand beside them: files that are not there, and what takes less time
BESIDE = {
    **dict.fromkeys(("read_controller", "exchange.read_controller_metadata"), file("nowhere.json")),
    **dict.fromkeys(("read_frequency_response", "read_motion"), file("nowhere.csv")),
    "write_controller": lambda: {"controller": controller(0.01), "path": "/nowhere/k.json"},
    "boom.write_motion": lambda: {"path": Path("/nowhere/motion.csv"), "motion": one.motion()},
    "structure.AffineFamily": lambda: fields_of(one.family()),
    "structure.PolynomialFamily": lambda: fields_of(beam().family((0.0, 1.0))),
    "structure.Point": lambda: {"body": points()[0], "x": 0.0, "y": 0.0},
    **dict.fromkeys(("step", "impulse"), lambda: {"timepts": _TIMES}),
    "bode": lambda: {"omega": [0.5, 2.0]},
    "sigma": lambda: {"omega": [0.5, 2.0], "frequency_hz": None},
    "analysis.nyquist_stability": lambda: {"plant_poles": [-1.0], "max_nfev": 200},
    "identify": lambda: {
        **dict(zip(("inputs", "outputs", "sample_time"), one.record(), strict=True)),
        "modes": 1,
        "frequency_range_hz": (0.1, 2.5),
        "order": 10,
    },
    "fit": lambda: {"weights": [1.0], "n_starts": 1},
    "compare": lambda: {"omega": [0.5, 2.0]},
    "simulate_loop": lambda: {
        "plant": plant(),
        "controller": controller(),
        "disturbances": {"u1": np.sin(_TIMES)},
        "timepts": _TIMES,
        "sample_time": 0.01,
        "feedforward": {"u0": np.cos(_TIMES)},
        "reference": None,
    },
    "studies.FieldScenario": lambda: {"tractor": bc.boom.TractorParameters()},
    "h_infinity": lambda: {"rtol": 0.1},
    "tune": lambda: {"time_limit": SHORT},
    "hub_beam": lambda: {
        "parameters": bc.HubBeamParameters(length=80.0),  # so slow that any time is short, or refused
        "accuracy": 0.1,
        "maneuver": bc.spin_up(1e-3, 1.0),
        "timepts": 2.0,
    },
    "lqr": lambda: {**weights(), "N": np.zeros((2, 1))},
    "kalman": noises,
    **dict.fromkeys(("lqg", "synthesis.loop_transfer_recovery"), lambda: {**weights(), **noises()}),
    "simulation.TimeVaryingController": lambda: {
        **dict.fromkeys("ABCD", np.zeros((2, 1, 1))),
        "input_labels": ["y0"],
        "output_labels": ["u0"],
        "dt": 0.1,
    },
    "optimal_slew": lambda: {"angle_deg": None, "intervals": 20, "time_limit": SHORT},
    "robust_stability": lambda: {"max_cells": 3},
    "worst_case": lambda: {"rtol": 0.1, "max_cells": 3},
    "analysis.robust_stability_margin": lambda: {"rtol": 0.5, "max_cells": 2},
}

# methods of what is handed out
METHODS = {
    "SecondOrderModel.eigenfrequencies_hz": (one.boom, dict),
    "SecondOrderModel.frequency_response": (one.boom, lambda: {"omega": [0.5, 1.0]}),
    "SecondOrderModel.to_statespace": (one.boom, dict),
    "SecondOrderModel.select": (one.boom, lambda: {"outputs": ["tip_left"]}),
    "SecondOrderModel.mode_shapes": (one.boom, dict),
    "HubBeam.eigenfrequencies_hz": (beam, lambda: {"hub_speed": 1.0}),
    "HubBeam.mode_shapes": (beam, lambda: {"count": 1}),
    "HubBeam.campbell": (beam, lambda: {"speeds": [0.0, 1.0], "count": 1}),
    "HubBeam.linearize": (beam, dict),
    "HubBeam.simulate_loop": (
        lambda: bc,
        lambda: {
            "plant": beam(),
            "controller": control.ss(
                [], [], [], [[-80.0, -200.0]], 0.01, inputs=["hub_angle", "hub_speed"], outputs="torque"
            ),
            "disturbances": {"tip_force": np.sin(_TIMES)},
            "timepts": _TIMES,
            "sample_time": 0.01,
            "delay": 0.004,
            "control_limit": 10.0,
            "noise": 1e-3,
            "reference": {"hub_angle": np.ones(51)},
            "sensors": [bc.BeamSensor("gauge", "strain", 0.5, 0.01)],
        },
    ),
    "HubBeam.simulate": (beam, lambda: {"maneuver": bc.spin_up(1.0, 0.5), "timepts": _TIMES}),
    "HubBeam.steady_state": (beam, lambda: {"hub_speed": 0.5}),
    "HubBeam.residual_energy": (beam, lambda: {"state": np.zeros(4)}),
    "HubBeam.with_tip_mass": (beam, lambda: {"tip_mass": 0.1}),
    "HubBeam.with_stiffness_factor": (beam, lambda: {"factor": 0.9}),
    "HubBeam.with_model": (beam, lambda: {"model": "tlam", "modes": 2}),
    "HubBeam.family": (beam, lambda: {"hub_speed": (0.0, 1.0), "tip_mass": (0.0, 0.1)}),
    "HubBeam.deformed_shape": (beam, lambda: {"states": np.zeros(4)}),
    "ScheduledController.at": (one.drive, lambda: {"value": 0.5}),
    "ScheduledController.to_nlsys": (one.drive, dict),
    "SlewResult.track": (one.slew, lambda: {"sample_time": 0.05, "dwell_time": 0.2, "disturbance": 5.0}),
    "TrackedSlew.monte_carlo": (
        one.tracked,
        lambda: {"runs": 2, "tip_mass": 0.1, "stiffness": 0.1, "friction": 1.0, "rtol": 1e-4, "atol": 1e-6},
    ),
    "TrackedSlew.residual_vibration": (one.tracked, lambda: {"run": one.tracked().simulate()}),
    "Assembly.Beam.at": (lambda: bs.Beam(**arguments_of("structure.Beam")), lambda: {"s": 0.5}),
    "Assembly.Beam.at_point": (lambda: bs.Beam(**arguments_of("structure.Beam")), lambda: {"x": 0.5}),
    "Track.heights": (one.track, lambda: {"distance": [1.0]}),
    "AffineFamily.at": (one.family, lambda: {"delta": np.zeros(2)}),
    "AffineFamily.normalize": (one.family, lambda: {"values": {}}),
    "BoomParameters.from_toml": (bc.BoomParameters, file("nowhere.toml")),
}
WHOLE = ("structure", "studies", "tunable")  # packages of which records are tried too, beside these
RECORDS = {"boom.Footprint", "boom.PlatformMotion", "boom.Track", "boom.TractorParameters"}
RECORDS |= {"simulation.TimeVaryingController"}
# raised, handed out, or (the last two lines) records that are looked at where they are used, and what takes seconds
NOT_CALLED = {"__version__", "structure.GROUND", "structure.ModeShapes"}
NOT_CALLED |= {"structure.BodyShape", "Progress", "ScaledStateSpace", "boom.road_psd", "boom.track_coherence"}
NOT_CALLED |= {"studies.SuspensionDesign", "studies.SlewDesign", "studies.evaluate_suspension"}
NOT_CALLED |= {f"slew.{name}" for name in ("spin_up_torque", "rest_to_rest_torque", "compare_slews", "replan")}
NOT_CALLED |= {"slew.input_shaper", "slew.switching_function"}


def called():
    """Return the names of public functions and records that are called."""
    found = {
        name
        for name, value in public().items()
        if "." not in name or inspect.isfunction(value) or name.partition(".")[0] in WHOLE
    }
    return sorted((found | RECORDS) - NOT_CALLED)


# what Ctrl-C or an error of the user's own function would end is not tried: what it raises is raised
NOT_REPLACED = ("progress",)


@cache
def _example(name):
    """Return the call in a function's docstring, compiled, and the names that the lines before it leave."""
    names = {"call": lambda *given, **named: inspect.signature(function_of(name)).bind(*given, **named)}
    for example in doctest.DocTestParser().get_examples(function_of(name).__doc__):
        for node in ast.walk(ast.parse(example.source)):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == name.rpartition(".")[2]:
                node.func = ast.copy_location(ast.Name("call", ast.Load()), node.func)
                return compile(ast.Expression(node), name, "eval"), names
        exec(example.source, names)
    raise LookupError(f"{name}: expected an example in its docstring")


def _of_example(name):
    """Return the arguments of the example, those of ``*names`` as ``"*"``."""
    code, names = _example(name)
    found = {}
    for key, value in eval(code, names).arguments.items():
        kind = inspect.signature(function_of(name)).parameters[key].kind
        entry = {"*" if kind is inspect.Parameter.VAR_POSITIONAL else key: value}
        found |= value if kind is inspect.Parameter.VAR_KEYWORD else entry
    return found


def arguments_of(name):
    """Return arguments that work: those of the example, those beside it, and the defaults of the others."""
    found = {
        key: parameter.default
        for key, parameter in inspect.signature(function_of(name)).parameters.items()
        if parameter.default is not parameter.empty and key not in NOT_REPLACED
    }
    if name in METHODS:
        return found | METHODS[name][1]()
    beside = BESIDE.get(name, dict)()
    return found | ({} if "path" in beside or name in MADE else _of_example(name)) | beside


@cache
def _systems():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        broken = control.ss([[np.nan]], [[1.0]], [[1.0]], 0.0)
    scalar = [
        control.ss([[a]], [[b]], [[1.0]], 0.0) for a, b in ((1e300, 1.0), (-5e-324, 1e-300), (0.0, 1.0), (1.0, 1.0))
    ]
    unmoved = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.0]], [[0.0, 0.0]], 0.0)
    others = [broken, unmoved, control.tf([1.0], [1.0, 1.0]), control.frd([1.0, 2.0], [1.0, 2.0])]
    unread = control.ss([], [], [], 1.0, inputs="u", outputs="y")
    return [plant(), controller(), controller(0.01), one.generalized(), unread, *scalar, *others]


@cache
def _objects():
    masses = [
        bs.SecondOrderModel([[m]], [[0.0]], [[k]], {"f": [1.0]}, {"y": [1.0]}) for m, k in ((1.0, 0.0), (0.0, 1.0))
    ]
    plants = [one.boom(), one.yaw(), *masses, bs.SecondOrderModel([[1.0]], [[0.0]], [[1.0]]), beam(), one.family()]
    parameters = [bc.BoomParameters(), bc.HubBeamParameters(), bc.boom.TractorParameters(), bc.boom.Footprint()]
    parts = [bs.GROUND, *points(), bs.fixed(), bs.FiniteElements(2)]
    motions = [one.track(), one.motion(), bc.CoulombFriction(3.0), bc.spin_up(1.0, 1.0), bc.maneuvers.free_hub()]
    functions = [bc.BoomParameters, np.sin, lambda *a: None, lambda t: "text", lambda t: np.nan, lambda t: np.zeros(7)]
    return [*_systems(), *plants, *parameters, *parts, *motions, object(), *functions]


_NUMBERS = [0, 1, -1, 2, 7, 10**9, -(10**9), 10**400, True, False, Fraction(1, 3), 1j]
_NUMBERS += [0.0, -0.0, 0.5, 1.0, -1.0, 1e-3, 1e3, 1e6, 1e-12, 1e12, 1e-300, 1e300, -1e300, 5e-324, 1.7e308]
_NUMBERS += [float("nan"), float("inf"), -float("inf"), np.float32(0.1), np.int8(3), np.bool_(True), np.float64("nan")]
_WORDS = ["", "x", "tip_left", "actuator_left", "u0", "y0", "nothing", "finite", "exact", "time", "C", "\u03c9", "a.b"]
_WORDS += ["1", b"y0", Path("nowhere"), Path(".")]
_ARRAYS = [[], (), [[]], [0.0], [1.0], [1.0, 2.0], [2.0, 1.0], [1.0, 1.0], [[1.0, 2.0], [3.0]], [0.0, -1.0], [1j]]
_ARRAYS += [[None], ["y0"], ["y0", "y0"], [b"a"], ["nothing"], [True, False], set(), {"y0"}, range(3), None, ...]
_ARRAYS += [
    [float("nan")],
    [1.0, float("inf")],
    [1e300, 1e300],
    [5e-324, 1.0],
    np.full(3, 1e300),
    np.full((1, 1), 1e-300),
]
_ARRAYS += [np.zeros(0), np.zeros((0, 3)), np.zeros((2, 2)), np.eye(2), -np.eye(2), np.zeros((1, 1, 1)), np.array(1.0)]
_ARRAYS += [
    np.arange(4),
    np.ones(3, dtype=np.float32),
    np.array(["a", "b"]),
    np.array([None, 1.0]),
    np.full((2, 2), np.nan),
]
_ARRAYS += [_TIMES, -_TIMES, _TIMES[::-1], 1e-320 * _TIMES, np.linspace(0.0, 0.5, 7)]
_ARRAYS += [{}, {"nothing": 1.0}, {1: 2.0}, {"k": [1.0]}, {"y0": float("nan")}, {"y0": None}, {"y0": "x"}, {"y0": 0.0}]
_ARRAYS += [{"u0": 1.0}, {"u0": -1.0}, {"u0": []}, {"u0": np.sin(_TIMES)}, {"u1": [np.nan] * len(_TIMES)}]


def values():
    """Return a strategy of things that an argument may be, right ones and wrong ones."""
    return st.one_of(
        st.sampled_from(_NUMBERS),
        st.sampled_from(_WORDS),
        st.sampled_from(range(len(_ARRAYS))).map(_ARRAYS.__getitem__),
        st.sampled_from(range(len(_objects()))).map(lambda k: _objects()[k]),
        st.floats(),
        st.integers(-3, 40),
        st.lists(st.floats(), max_size=3),
    )


def faults(name):
    """Yield argument, value and fault wherever one value in place of one argument is answered wrongly."""
    for key in arguments_of(name):
        for value in (*_NUMBERS, *_WORDS, *_ARRAYS, *_objects()):
            if value is np.sin and key == "model":  # it raises itself what is raised
                continue
            if found := fault(name, arguments_of(name) | {key: value}):
                yield key, value, found


def masked(value):
    """Return numbers with the first of them masked, and whether they are numbers; of a mapping each entry."""
    if isinstance(value, dict):
        changed = {key: masked(entry) for key, entry in value.items()}
        return {key: entry for key, (entry, _) in changed.items()}, any(numbers for _, numbers in changed.values())
    array = np.array(value) if isinstance(value, np.ndarray) or _plain(value) else np.empty(0)
    if not array.size or array.dtype.kind not in "if":
        return value, False
    return np.ma.array(array, mask=np.arange(array.size).reshape(array.shape) == 0), True


def _plain(value):
    """Return whether a sequence holds numbers, or sequences of numbers."""
    return isinstance(value, (list, tuple)) and all(isinstance(entry, (float, int)) or _plain(entry) for entry in value)


@st.composite
def calls(draw, names):
    """Return the name of a function, and arguments of which one or two are something else."""
    name = draw(st.sampled_from(names))
    arguments = arguments_of(name)
    if arguments:
        changed = draw(st.lists(st.sampled_from(sorted(arguments)), min_size=1, max_size=2, unique=True))
        arguments |= {key: draw(values()) for key in changed}
    return name, arguments


def function_of(name):
    """Return what a name stands for: a public function, or a method of something handed out."""
    if name in METHODS:
        return getattr(METHODS[name][0](), name.rsplit(".", 1)[1])
    package, _, last = name.rpartition(".")
    return getattr(getattr(bc, package) if package else bc, last)


@contextlib.contextmanager
def in_time(seconds=LONGEST):
    """Raise Hung if what is done takes longer; there is no such alarm on Windows."""

    def ring(*_):
        raise Hung

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def fault(name, arguments):
    """Return what is wrong with what a call does, in words; nothing if it answers or refuses as it should."""
    positional = arguments.pop("*", None)
    function = function_of(name)
    longer = arguments.get("time_limit")
    if (
        isinstance(longer, (int, float)) and longer > SHORT
    ):  # what takes longer is allowed to, and is not what is tried here
        arguments["time_limit"] = SHORT
    try:
        with warnings.catch_warnings(), in_time():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            if positional is not None:
                answer = function(*(positional if isinstance(positional, (list, tuple)) else (positional,)))
            else:
                answer = function(**arguments)
    except Hung:
        return f"no answer in {LONGEST:g} s"
    except Exception as error:
        return _refusal(name, function, error)
    if isinstance(answer, (float, complex, np.ndarray)) and np.isnan(answer).any():
        return "the answer is NaN"
    try:
        repr(answer)
    except Exception as error:
        return f"the answer cannot be printed: {error!r}"
    return None


def _refusal(name, function, error):
    listed = {kind.strip() for kinds, _ in sections(function).get("Raises", []) for kind in kinds.split(",")}
    if not listed & {base.__name__ for base in type(error).__mro__} and not isinstance(error, ImportError):
        return f"not under Raises: {type(error).__name__}: {error}"
    if isinstance(error, (FileNotFoundError, IsADirectoryError, PermissionError)):
        return None
    if isinstance(error, ImportError) and "pip install" in str(error):  # what is not installed is named
        return None
    if not raised_by_boomctl(error):
        return f"{type(error).__name__}: {error}"
    said = str(error)
    words = set(inspect.signature(function).parameters) | set(_fields(function))
    named = any(word.replace("_", " ") in said.replace("_", " ") for word in words)
    return None if named or "=" in said or ":" in said or "'" in said else f"names no parameter: {said}"


def _fields(function):
    return getattr(function, "__dataclass_fields__", ())
