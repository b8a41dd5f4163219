"""Arguments of right and wrong kinds for every public function: what is tried on each, and what an answer may be.

A call starts from arguments that work; one or two of them are replaced by something else.
"""

import contextlib
import dataclasses
import inspect
import signal
import warnings
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

import boomctl as bc
import boomctl.structure as bs
from tests import handed_out as one
from tests.docstrings import sections
from tests.stress.cases import raised_by_boomctl

LONGEST = 20.0  # s of processor time that a call may take: what a user waits without asking
SHORT = 5.0  # [s], of what takes a time limit
_TIMES = np.linspace(0.0, 0.5, 51)
_NOISE = np.random.default_rng(0).standard_normal(400)


class Hung(BaseException):
    """A call took longer than LONGEST; no clause of ours catches it."""


def system(A=((0.0, 1.0), (-1.0, -0.1)), B=((0.0,), (1.0,)), C=((1.0, 0.0),), D=0.0, dt=0):
    import control

    inputs, outputs = [f"u{i}" for i in range(np.shape(B)[1])], [f"y{i}" for i in range(np.shape(C)[0])]
    return control.ss(A, B, C, D, dt, inputs=inputs, outputs=outputs)


@cache
def plant():
    return system(B=((0.0, 0.0), (1.0, 1.0)))


@cache
def gain(inputs, outputs, values=-10.0, dt=None):
    """Return a controller that is a matrix of numbers."""
    import control

    return control.ss(
        [], [], [], [values] if isinstance(values, tuple) else [[values]], dt, inputs=inputs, outputs=outputs
    )


@cache
def controller(dt=0.0, pole=-5.0):
    import control

    return control.ss([[pole]], [[1.0]], [[-0.1]], 0.0, dt, inputs=["y0"], outputs=["u0"])


@cache
def generalized():
    return system(
        B=((0.0, 0.0, 0.0), (1.0, 0.0, 1.0)),
        C=((1.0, 0.0), (0.0, 0.0), (1.0, 0.0)),
        D=((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    )


@cache
def beam():
    return bc.hub_beam(modes=1)


@cache
def swinging():
    mass = bs.SecondOrderModel([[1.0]], [[0.2]], [[16.0]], {"force": [1.0]}, {"place": [1.0]})
    return bc.forced_response(mass, {"force": _NOISE}, 0.1 * np.arange(400))["place"]


@cache
def tracked_run():
    return one.tracked().simulate()


@cache
def turning():
    return beam().family((0.0, 1.0))


@cache
def scheduled():
    return bc.schedule([controller(), controller()], [0.0, 1.0], "y0")


@cache
def half_controller(end):
    return gain(f"stroke_{end}", f"suspension_{end}")


def points():
    rod = bs.RigidBody("rod", bs.GROUND.at(0.0), bs.revolute(), 1.0, 1.0)
    return rod, rod.at(1.0), bs.GROUND.at(1.0)


def measured(omega):
    return one.boom().frequency_response(np.atleast_1d(omega))


def springs(parameters):
    """Return three eigenfrequencies of two springs, at no cost."""
    soft, stiff = parameters["soft"] ** 0.5, parameters["stiff"] ** 0.5
    return [soft, soft + stiff, 3.0 * stiff]


def of_two(x, y):
    return {"sum": x + y}


def spray():
    return {"time": _TIMES, "displacement": np.zeros((2, len(_TIMES))), "positions": [-6.0, 6.0], "speed": 3.0}


def of_plant():
    return {"system": plant()}


def of_generalized():
    return {"P": generalized(), "nmeas": 1, "ncon": 1}


def of_family():
    return {"family": one.family(), "controller": half_controller("anti")}


def of_loop():
    return {"plant": plant(), "controller": controller()}


def weights():
    return {"Q": np.eye(2), "R": [[1.0]]}


def noises():
    return {"process_noise": np.eye(2), "measurement_noise": [[1.0]], "measurements": ["y0"]}


def section():
    return {"width": 0.06, "depth": 0.02}


def between():
    return {"low": 0.1, "high": 100.0}


def fields_of(record):
    """Return the arguments that make a record."""
    return {field.name: getattr(record, field.name) for field in dataclasses.fields(record) if field.init}


def file(name):
    return lambda: {"path": name}


# arguments that work beside the defaults of the others, made anew for each call where they could be changed
CALLS = {
    **dict.fromkeys(("BoomParameters", "HubBeamParameters", "boom.TractorParameters", "boom.Footprint"), dict),
    **dict.fromkeys(("free", "hold", "nozzle_positions", "spray_boom", "studies.design_names", "tunable.gain"), dict),
    **dict.fromkeys(("structure.fixed", "structure.prismatic", "structure.revolute"), dict),
    **dict.fromkeys(("hinf_norm", "h2_norm", "mode_table", "pzmap"), of_plant),
    **dict.fromkeys(("step", "impulse"), lambda: {**of_plant(), "timepts": _TIMES}),
    **dict.fromkeys(("bode", "sigma"), lambda: {"system": one.boom(), "omega": [0.5, 2.0]}),
    **dict.fromkeys(("margins", "feedback_loop"), of_loop),
    **dict.fromkeys(("spray_by_motion", "spray_deposit"), spray),
    **dict.fromkeys(("tunable.lead", "tunable.notch", "tunable.ppf"), between),
    **dict.fromkeys(("split_symmetric", "structure.split_symmetric"), lambda: {"model": one.boom()}),
    **dict.fromkeys(("read_controller", "exchange.read_controller_notes"), file("nowhere.json")),
    **dict.fromkeys(("read_measured_curve", "read_motion"), file("nowhere.csv")),
    "BeamSensor": lambda: {"name": "gauge", "quantity": "strain", "position": 0.5, "height": 0.01},
    "simulation.TimeVaryingController": lambda: {
        **dict.fromkeys("ABCD", np.zeros((2, 1, 1))),
        "inputs": ["y0"],
        "outputs": ["u0"],
        "sample_time": 0.01,
    },
    "CoulombFriction": lambda: {"force": 3.0, "static_force": 4.0},
    "boom.PlatformMotion": lambda: {"time": _TIMES, "left": np.sin(_TIMES), "right": np.sin(_TIMES)},
    "boom.Track": lambda: {"step": 0.1, "left": np.zeros(20), "right": np.zeros(20), "width": 1.8},
    "synthesis.band_pass": lambda: {"gain": 1.0, "low": 0.1, "high": 3.0},
    "boom_family": lambda: {"half": "yaw"},
    "boom.bump_track": lambda: {"height": 0.1, "bump_length": 1.0},
    "close_loop": lambda: {"P": generalized(), "controller": system(((-1.0,),), ((1.0,),), ((-0.1,),))},
    "analysis.closed_loop_response": lambda: {
        "plant": measured,
        "controller": half_controller("left"),
        "omega": [0.1, 1.0],
    },
    "discretize": lambda: {"controller": controller(), "sample_time": 0.01},
    "exact_eigenfrequencies_hz": lambda: {"parameters": bc.BoomParameters(), "count": 3},
    "exact_frequency_response": lambda: {"parameters": bc.BoomParameters(), "omega": [0.5, 3.0]},
    "analysis.exact_loop_stability": lambda: {
        "plant": measured,
        "controller": half_controller("left"),
        "poles": [-1.0],
        "top": 50.0,
        "max_evaluations": 200,
    },
    "estimate_response": lambda: {
        "inputs": {"force": _NOISE},
        "outputs": {"place": np.cumsum(_NOISE)},
        "sample_time": 0.01,
    },
    "identification.uncertainty_band": lambda: {
        "measured": plant().frequency_response(np.geomspace(0.1, 10.0, 30)),
        "model": plant().frequency_response(np.geomspace(0.1, 10.0, 30)) * 1.1,
    },
    "identify": lambda: {
        "inputs": {"force": _NOISE},
        "outputs": {"place": swinging()},
        "sample_time": 0.1,
        "modes": 1,
        "band_hz": (0.1, 2.5),
        "order": 10,
    },
    "fit": lambda: {
        "build": springs,
        "measured": [0.25, 0.58, 0.95],
        "free": ["soft"],
        "start": {"soft": 0.1, "stiff": 0.1},
        "weights": [1.0, 1.0, 0.5],
        "starts": 1,
    },
    "forced_response": lambda: {"plant": plant(), "signals": {"u0": np.sin(_TIMES)}, "timepts": _TIMES},
    "studies.FieldScene": lambda: {"tractor": bc.boom.TractorParameters()},
    "studies.MachineDesign": lambda: {"name": "mine", "title": "a machine", **of_loop()},
    "studies.load_design": lambda: {"name": "passive_tuning"},
    "listening": lambda: {"listener": None},
    "structure.CrossSection": lambda: {"area": 1e-4, "second_moment": 1e-8},
    "structure.tube_section": lambda: {**section(), "wall": (0.002, 0.003)},
    "structure.round_tube_section": lambda: {"diameter": 0.06, "wall": 0.002},
    "structure.bar_section": section,
    "structure.rod_section": lambda: {"diameter": 0.02},
    "structure.i_section": lambda: {**section(), "web": 0.004, "flange": 0.006},
    "unscale_controller": lambda: {"controller": controller(), "scales": {"y0": 0.1, "u0": 10.0}},
    "generalized_plant": lambda: {
        "plant": plant(),
        "disturbances": {"u1": 1.0},
        "performance": {"y0": 1.0},
        "effort": {"u0": 0.1},
        "noises": {"y0": 0.01},
        "measurements": ["y0"],
        "controls": ["u0"],
    },
    "h2": of_generalized,
    "h_infinity": lambda: {**of_generalized(), "tolerance": 0.1},
    "tune": lambda: {**of_generalized(), "structure": bc.tunable.gain(), "starts": 1, "time_limit": SHORT},
    "tunable.pid": lambda: {"high": 100.0},
    "tunable.state_space": lambda: {"order": 1},
    "tunable.decentralised": lambda: {"*": (("y0", "u0", bc.tunable.gain()),)},
    "tunable.physical": lambda: {"name": "damping", "low": 0.1, "high": 1.0},
    "tunable.objective": lambda: {"outputs": "z_y0"},
    "tunable.budget": lambda: {"inputs": None, "outputs": "z_y0", "limit": 1.0},
    "hub_beam": lambda: {
        "parameters": bc.HubBeamParameters(length=80.0),  # so slow that any time is short, or refused
        "accuracy": 0.1,
        "manoeuvre": bc.spin_up(1e-3, 1.0),
        "time": 2.0,
    },
    "hub_profile": lambda: {"angle": np.square, "speed": lambda t: 2 * t, "acceleration": lambda t: 2 + 0 * t},
    "scale_signals": lambda: {"system": plant(), "scales": {"u0": 2.0, "u1": 1.0, "y0": 1.0}},
    "iso_track": lambda: {"length": 20.0},
    "join_symmetric": lambda: {
        "model": one.boom(),
        "symmetric": half_controller("sym"),
        "antisymmetric": half_controller("anti"),
    },
    "kalman": lambda: {"system": plant(), **noises()},
    "lqg": lambda: {"system": plant(), **weights(), **noises(), "controls": ["u0"]},
    "lqr": lambda: {"system": plant(), **weights(), "controls": ["u0"], "N": np.zeros((2, 1))},
    "synthesis.loop_transfer_recovery": lambda: {
        "system": plant(),
        **weights(),
        **noises(),
        "controls": ["u0"],
        "strengths": [1.0],
        "band": (0.1, 1.0),
    },
    **dict.fromkeys(("low_pass", "synthesis.high_pass"), lambda: {"gain": 1.0, "corner": 2.0}),
    "shelf": lambda: {"low_gain": 1.0, "high_gain": 10.0, "corner": 2.0},
    "compare": lambda: {"results": {"one": plant(), "other": system()}, "omega": [0.5, 2.0]},
    "compare_sigma": lambda: {"systems": {"boom": one.boom()}, "omega": [0.5, 2.0]},
    "nyquist": lambda: {"system": plant(), "controller": controller()},
    "mixed_sensitivity": lambda: {"plant": system(), "W1": 1.0, "W2": 0.1},
    "optimal_slew": lambda: {
        "h": beam(),
        "angle": 0.6,
        "angle_deg": None,
        "torque_limit": 200.0,
        "intervals": 20,
        "time_limit": SHORT,
    },
    "platform_motion": lambda: {"track": bc.iso_track(length=20.0), "duration": 1.0, "sample_time": 0.01},
    "prove": lambda: {"result": bc.hinf_norm(plant()), "max_operations": 1e9},
    "write_controller": lambda: {"controller": controller(0.01), "path": "/nowhere/k.json"},
    "reduce": lambda: {"system": plant(), "order": 2},
    "reduce_controller": lambda: {
        "P": generalized(),
        "controller": system(((-1.0,),), ((1.0,),), ((-0.1,),)),
        "order": None,
    },
    "robust_stability": lambda: {**of_family(), "max_cells": 3},
    "analysis.structured_margin": lambda: {**of_family(), "largest": 1.0, "tolerance": 0.5, "max_cells": 2},
    "worst_case": lambda: {**of_family(), "tolerance": 0.1, "max_cells": 3},
    "schedule": lambda: {"controllers": [controller(), controller()], "values": [0.0, 1.0], "signal": "y0"},
    "synthesis.select_channels": lambda: {"system": plant(), "inputs": ["u0"]},
    "sweep": lambda: {"function": of_two, "over": {"x": [1.0, 2.0], "y": 3.0}, "units": {"x": "m"}},
    "simulate_loop": lambda: {
        **of_loop(),
        "disturbance": {"u1": np.sin(_TIMES)},
        "timepts": _TIMES,
        "sample_time": 0.01,
        "feedforward": {"u0": np.cos(_TIMES)},
    },
    "sine_sweep": lambda: {"start_hz": 0.1, "stop_hz": 2.0, "duration": 2.0, "amplitude": 0.01},
    "sine_torque": lambda: {"amplitude": 10.0, "period": 1.0, "duration": 1.0},
    "spin_up": lambda: {"final_speed": 1.0, "duration": 1.0},
    "synthesis.split_controller": lambda: {
        "model": one.boom(),
        "controller": bc.join_symmetric(one.boom(), half_controller("sym"), half_controller("anti")),
    },
    "boom.split_motion": lambda: {"displacement": np.zeros((2, 5)), "positions": [-6.0, 6.0]},
    "torque": lambda: {"function": np.sin},
    "boom.tractor_system": lambda: {"tractor": bc.boom.TractorParameters(), "speed": 2.5},
    "analysis.sample_plant": lambda: {"plant": plant(), "sample_time": 0.1},
    "analysis.sampled_norm": lambda: {"plant": plant(), "controller": controller(0.1, 0.5)},
    "with_states": lambda: {"plant": plant()},
    "boom.write_motion": lambda: {"path": Path("/nowhere/motion.csv"), "motion": one.motion()},
    "boom.yaw_family": lambda: {"half": "yaw"},
    # any planar machine
    "structure.AffineFamily": lambda: fields_of(one.family()),
    "structure.PolynomialFamily": lambda: fields_of(turning()),
    "structure.Assembly": lambda: {"bodies": (points()[0],)},
    "structure.Beam": lambda: {
        "name": "beam",
        "parent": bs.GROUND.at(0.0),
        "joint": bs.fixed(),
        "start": (0.0, 0.0),
        "sections": (bs.BeamSection(1.0, 1.0, 1.0),),
        "discretization": bs.FiniteElements(2),
    },
    "structure.BeamSection": lambda: {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0},
    "structure.CutJoint": lambda: {"a": points()[1], "b": points()[2]},
    "structure.DiscreteElements": lambda: {"elements": 4},
    "structure.FiniteElements": lambda: {"elements": 3},
    "structure.Force": lambda: {"name": "f", "point": points()[1]},
    "structure.Joint": lambda: {"slides": (("y", 1.0),), "turns": True},
    "structure.Output": lambda: {"name": "y", "point": points()[1]},
    "structure.Point": lambda: {"body": points()[0], "x": 0.0, "y": 0.0},
    "structure.RigidBody": lambda: {"name": "rod", "parent": bs.GROUND.at(0.0), "joint": bs.revolute(), "mass": 1.0},
    "structure.SecondOrderModel": lambda: {
        "M": np.eye(2),
        "C": 0.1 * np.eye(2),
        "K": np.eye(2),
        "force_inputs": {"f": [1.0, 0.0]},
        "outputs": {"y": [0.0, 1.0]},
        "coordinates": ("a", "b"),
    },
    "structure.SpringDamper": lambda: {"a": points()[1], "b": points()[2], "direction": "y", "stiffness": 1.0},
    "structure.free": lambda: {"*": ("x", "y")},
    "structure.prescribe_displacement": lambda: {
        "model": bc.spray_boom(excitation="force"),
        "inputs": ["cradle"],
    },
}

# methods of what is handed out
METHODS = {
    "SecondOrderModel.eigenfrequencies_hz": (one.boom, dict),
    "SecondOrderModel.frequency_response": (one.boom, lambda: {"omega": [0.5, 1.0]}),
    "SecondOrderModel.to_statespace": (one.boom, dict),
    "SecondOrderModel.select": (one.boom, lambda: {"outputs": ["tip_left"]}),
    "SecondOrderModel.mode_shapes": (one.boom, dict),
    "HubBeam.frequencies_hz": (beam, lambda: {"hub_speed": 1.0}),
    "HubBeam.mode_shapes": (beam, lambda: {"count": 1}),
    "HubBeam.campbell": (beam, lambda: {"speeds": [0.0, 1.0], "count": 1}),
    "HubBeam.linearize": (beam, dict),
    "HubBeam.simulate_loop": (
        lambda: bc,
        lambda: {
            "plant": beam(),
            "controller": gain(("hub_angle", "hub_speed"), "torque", (-80.0, -200.0), 0.01),
            "disturbance": {"tip_force": np.sin(_TIMES)},
            "timepts": _TIMES,
            "sample_time": 0.01,
            "delay": 0.004,
            "force_limit": 10.0,
            "noise": 1e-3,
            "reference": {"hub_angle": np.ones(51)},
            "sensors": [bc.BeamSensor("gauge", "strain", 0.5, 0.01)],
        },
    ),
    "HubBeam.simulate": (beam, lambda: {"manoeuvre": bc.spin_up(1.0, 0.5), "timepts": _TIMES}),
    "HubBeam.steady_state": (beam, lambda: {"hub_speed": 0.5}),
    "HubBeam.residual_energy": (beam, lambda: {"state": np.zeros(4)}),
    "HubBeam.with_tip_mass": (beam, lambda: {"tip_mass": 0.1}),
    "HubBeam.with_stiffness": (beam, lambda: {"factor": 0.9}),
    "HubBeam.in_model": (beam, lambda: {"model": "tlam", "modes": 2}),
    "HubBeam.family": (beam, lambda: {"hub_speed": (0.0, 1.0), "tip_mass": (0.0, 0.1)}),
    "HubBeam.shape": (beam, lambda: {"states": np.zeros(4)}),
    "ScheduledController.at": (scheduled, lambda: {"value": 0.5}),
    "ScheduledController.to_nlsys": (scheduled, dict),
    "SlewResult.track": (one.slew, lambda: {"sample_time": 0.05, "settle": 0.2, "disturbance": 5.0}),
    "TrackedSlew.monte_carlo": (
        one.tracked,
        lambda: {"runs": 2, "tip_mass": 0.1, "stiffness": 0.1, "friction": 1.0, "rtol": 1e-4, "atol": 1e-6},
    ),
    "TrackedSlew.vibration": (one.tracked, lambda: {"run": tracked_run()}),
    "Assembly.Beam.at": (lambda: bs.Beam(**CALLS["structure.Beam"]()), lambda: {"s": 0.5}),
    "Assembly.Beam.at_point": (lambda: bs.Beam(**CALLS["structure.Beam"]()), lambda: {"x": 0.5}),
    "Track.heights": (one.track, lambda: {"distance": [1.0]}),
    "AffineFamily.at": (one.family, lambda: {"delta": np.zeros(2)}),
    "AffineFamily.deltas": (one.family, lambda: {"values": {}}),
    "BoomParameters.from_toml": (bc.BoomParameters, file("nowhere.toml")),
}
# what Ctrl-C or an error of the user's own function would end is not tried: what it raises is raised
NOT_REPLACED = ("progress",)


def arguments_of(name):
    """Return arguments that work: those that are written down, and the defaults of the others."""
    found = {
        key: parameter.default
        for key, parameter in inspect.signature(function_of(name)).parameters.items()
        if parameter.default is not parameter.empty and key not in NOT_REPLACED
    }
    return found | (METHODS[name][1] if name in METHODS else CALLS[name])()


@cache
def _systems():
    import control

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        broken = control.ss([[np.nan]], [[1.0]], [[1.0]], 0.0)
    scalar = [
        control.ss([[a]], [[b]], [[1.0]], 0.0) for a, b in ((1e300, 1.0), (-5e-324, 1e-300), (0.0, 1.0), (1.0, 1.0))
    ]
    unmoved = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.0]], [[0.0, 0.0]], 0.0)
    others = [broken, unmoved, control.tf([1.0], [1.0, 1.0]), control.frd([1.0, 2.0], [1.0, 2.0])]
    return [plant(), controller(), controller(0.01), generalized(), gain("u", "y", 1.0), *scalar, *others]


@cache
def _objects():
    masses = [
        bs.SecondOrderModel([[m]], [[0.0]], [[k]], {"f": [1.0]}, {"y": [1.0]}) for m, k in ((1.0, 0.0), (0.0, 1.0))
    ]
    plants = [one.boom(), one.yaw(), *masses, bs.SecondOrderModel([[1.0]], [[0.0]], [[1.0]]), beam(), one.family()]
    parameters = [bc.BoomParameters(), bc.HubBeamParameters(), bc.boom.TractorParameters(), bc.boom.Footprint()]
    parts = [bs.GROUND, *points(), bs.fixed(), bs.FiniteElements(2)]
    motions = [one.track(), one.motion(), bc.CoulombFriction(3.0), bc.spin_up(1.0, 1.0), bc.free()]
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
            if value is np.sin and key == "build":  # it raises itself what is raised
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
