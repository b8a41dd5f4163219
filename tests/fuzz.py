"""Arguments of right and wrong kinds for every public function: what is tried on each, and what an answer may be.

A call starts from arguments that work; one or two of them are replaced by something else.
"""

import contextlib
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
from tests.docstrings import sections
from tests.stress.cases import raised_by_boomctl

LONGEST = 20.0  # s of processor time that a call may take: what a user waits without asking
SHORT = 5.0  # [s], of what takes a time limit
_TIMES = np.linspace(0.0, 0.5, 51)


class Hung(BaseException):
    """A call took longer than LONGEST; no clause of ours catches it."""


@cache
def boom():
    return bc.spray_boom()


@cache
def yaw():
    return bc.split_symmetric(bc.spray_boom(accelerometer_bandwidth_hz=20.0))[1]


@cache
def halves():
    return tuple(system.to_statespace() for system in bc.split_symmetric(bc.spray_boom()))


def system(A=((0.0, 1.0), (-1.0, -0.1)), B=((0.0,), (1.0,)), C=((1.0, 0.0),), D=0.0, dt=0):
    import control

    inputs, outputs = [f"u{i}" for i in range(np.shape(B)[1])], [f"y{i}" for i in range(np.shape(C)[0])]
    return control.ss(A, B, C, D, dt, inputs=inputs, outputs=outputs)


@cache
def plant():
    return system(B=((0.0, 0.0), (1.0, 1.0)))


@cache
def controller(dt=0):
    import control

    return control.ss([[-5.0]], [[1.0]], [[-0.5]], 0.0, dt, inputs=["y0"], outputs=["u0"])


@cache
def sampled():
    import control

    return control.ss([[0.5]], [[1.0]], [[-0.1]], 0.0, 0.1, inputs=["y0"], outputs=["u0"])


@cache
def hub_controller():
    import control

    return control.ss([], [], [], [[-80.0, -200.0]], 0.01, inputs=["hub_angle", "hub_speed"], outputs=["torque"])


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
def family():
    return bc.boom_family(half="yaw")


@cache
def regulator():
    import control

    return control.ss([], [], [], [[-10.0]], inputs=["stroke_anti"], outputs=["suspension_anti"])


@cache
def noise():
    return np.random.default_rng(0).standard_normal(400)


@cache
def swinging():
    mass = bs.SecondOrderModel([[1.0]], [[0.2]], [[16.0]], {"force": [1.0]}, {"place": [1.0]})
    return bc.forced_response(mass, {"force": noise()}, 0.1 * np.arange(400))["place"]


@cache
def friction():
    return bc.CoulombFriction(3.0)


@cache
def slew():
    return bc.optimal_slew(bc.hub_beam(modes=1), 0.6, 200.0, "effort", duration=4.0, intervals=20)


@cache
def tracked():
    return slew().track(sample_time=0.1, settle=0.5)


@cache
def tracked_run():
    return tracked().simulate()


@cache
def turning():
    return beam().family((0.0, 1.0))


@cache
def scheduled():
    return bc.schedule([controller(), controller()], [0.0, 1.0], "y0")


@cache
def track():
    return bc.iso_track(length=20.0)


def motion():
    return bc.boom.PlatformMotion(_TIMES, 0.01 * np.sin(_TIMES), 0.01 * np.sin(_TIMES))


def points():
    rod = bs.RigidBody("rod", bs.GROUND.at(0.0), bs.revolute(), 1.0, 1.0)
    return rod, rod.at(1.0), bs.GROUND.at(1.0)


@cache
def driven():
    return bc.spray_boom(excitation="force")


def measured(omega):
    return boom().frequency_response(np.atleast_1d(omega))


def springs(parameters):
    """Return three eigenfrequencies of two springs, at no cost."""
    soft, stiff = parameters["soft"] ** 0.5, parameters["stiff"] ** 0.5
    return [soft, soft + stiff, 3.0 * stiff]


# arguments that work, made anew for each call where they could be changed
CALLS = {
    "BoomParameters": lambda: {
        name: getattr(bc.BoomParameters(), name) for name in bc.BoomParameters.__dataclass_fields__
    },
    "BeamSensor": lambda: {"name": "gauge", "quantity": "strain", "position": 0.5, "height": 0.01},
    "HubBeamParameters": lambda: {
        name: getattr(bc.HubBeamParameters(), name) for name in bc.HubBeamParameters.__dataclass_fields__
    },
    "simulation.TimeVaryingController": lambda: {
        "A": np.zeros((2, 1, 1)),
        "B": np.zeros((2, 1, 1)),
        "C": np.zeros((2, 1, 1)),
        "D": np.zeros((2, 1, 1)),
        "inputs": ["y0"],
        "outputs": ["u0"],
        "sample_time": 0.01,
        "L": None,
    },
    "boom.TractorParameters": lambda: {
        name: getattr(bc.boom.TractorParameters(), name) for name in bc.boom.TractorParameters.__dataclass_fields__
    },
    "CoulombFriction": lambda: {
        "force": 3.0,
        "static_force": 4.0,
        "input": "cradle",
        "output": "cradle_slip",
        "substeps": 2,
    },
    "boom.Footprint": lambda: {"width": 1.0, "thickness": 0.1, "shape": "triangle"},
    "boom.PlatformMotion": lambda: {
        "time": _TIMES,
        "left": np.sin(_TIMES),
        "right": np.sin(_TIMES),
        "actuator_distance": 1.78,
    },
    "boom.Track": lambda: {"step": 0.1, "left": np.zeros(20), "right": np.zeros(20), "width": 1.8, "periodic": False},
    "synthesis.band_pass": lambda: {"gain": 1.0, "low": 0.1, "high": 3.0},
    "boom_family": lambda: {"parameters": None, "spring": (0.7, 1.3), "mass": (0.8, 1.2), "half": "yaw", "elements": 6},
    "boom.bump_track": lambda: {
        "height": 0.1,
        "bump_length": 1.0,
        "side": "left",
        "position": 2.0,
        "length": 10.0,
        "step": 0.05,
    },
    "close_loop": lambda: {"P": generalized(), "controller": system(((-1.0,),), ((1.0,),), ((-0.1,),))},
    "analysis.closed_loop_response": lambda: {
        "plant": measured,
        "controller": regulator_of_the_left(),
        "omega": [0.1, 1.0],
    },
    "discretize": lambda: {
        "controller": controller(),
        "sample_time": 0.01,
        "method": "tustin",
        "samples_per_period": 4.0,
        "prewarp_omega": None,
    },
    "exact_eigenfrequencies_hz": lambda: {"parameters": bc.BoomParameters(), "count": 3, "damped": True},
    "exact_frequency_response": lambda: {
        "parameters": bc.BoomParameters(),
        "omega": [0.5, 3.0],
        "inputs": None,
        "outputs": None,
        "excitation": "displacement",
    },
    "analysis.exact_loop_stability": lambda: {
        "plant": measured,
        "controller": regulator_of_the_left(),
        "poles": [-1.0],
        "plant_bound": None,
        "top": 50.0,
        "max_evaluations": 200,
    },
    "estimate_response": lambda: {
        "inputs": {"force": noise()},
        "outputs": {"place": np.cumsum(noise())},
        "sample_time": 0.01,
        "quantity": "displacement",
        "intersample": "bl",
        "period": None,
        "resolution_hz": 2.0,
        "band_hz": (1.0, 20.0),
    },
    "identification.uncertainty_band": lambda: {
        "measured": plant().frequency_response(np.geomspace(0.1, 10.0, 30)),
        "model": plant().frequency_response(np.geomspace(0.1, 10.0, 30)) * 1.1,
        "inputs": None,
        "outputs": None,
        "probability": 0.9,
        "order": 3,
        "fall": 1,
    },
    "identify": lambda: {
        "inputs": {"force": noise()},
        "outputs": {"place": swinging()},
        "sample_time": 0.1,
        "modes": 1,
        "band_hz": (0.1, 2.5),
        "quantity": "displacement",
        "intersample": "bl",
        "held_back": 0.3,
        "order": 10,
        "confidence": 0.95,
    },
    "feedback_loop": lambda: {"plant": plant(), "controller": controller(), "injection_points": (), "delay": 0.0},
    "fit": lambda: {
        "build": springs,
        "measured": [0.25, 0.58, 0.95],
        "free": ["soft"],
        "start": {"soft": 0.1, "stiff": 0.1},
        "modes": [1, 2, 3],
        "weights": [1.0, 1.0, 0.5],
        "errors": "relative",
        "deviation": 0.01,
        "confidence": 0.9,
        "inputs": None,
        "outputs": None,
        "starts": 1,
        "seed": 0,
    },
    "forced_response": lambda: {
        "plant": plant(),
        "signals": {"u0": np.sin(_TIMES)},
        "timepts": _TIMES,
        "outputs": None,
        "accuracy": 1e-6,
    },
    "studies.FieldScene": lambda: {
        "road_class": "E",
        "speed": 3.0,
        "duration": 60.0,
        "seed": 1,
        "elements": 20,
        "delay": 0.0,
    },
    "studies.MachineDesign": lambda: {
        "name": "mine",
        "title": "a machine",
        "plant": plant(),
        "controller": controller(),
        "inputs": None,
        "outputs": None,
        "sample_time": 0.01,
        "force_limit": 10.0,
    },
    "studies.design_names": dict,
    "studies.load_design": lambda: {"name": "passive_tuning"},
    "listening": lambda: {"listener": None},
    "structure.CrossSection": lambda: {"area": 1e-4, "second_moment": 1e-8},
    "structure.tube_section": lambda: {"width": 0.06, "depth": 0.02, "wall": (0.002, 0.003)},
    "structure.round_tube_section": lambda: {"diameter": 0.06, "wall": 0.002},
    "structure.bar_section": lambda: {"width": 0.06, "depth": 0.02},
    "structure.rod_section": lambda: {"diameter": 0.02},
    "structure.i_section": lambda: {"width": 0.06, "depth": 0.1, "web": 0.004, "flange": 0.006},
    "free": dict,
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
    "h2": lambda: {"P": generalized(), "nmeas": 1, "ncon": 1},
    "h2_norm": lambda: {"system": plant()},
    "h_infinity": lambda: {
        "P": generalized(),
        "nmeas": 1,
        "ncon": 1,
        "gamma": None,
        "tolerance": 0.1,
        "fastest_pole": None,
    },
    "tune": lambda: {
        "P": generalized(),
        "nmeas": 1,
        "ncon": 1,
        "structure": bc.tunable.gain(),
        "channels": None,
        "norm": "hinf",
        "starts": 1,
        "seed": 0,
        "fastest_pole": None,
        "gain_limit": 1e3,
        "damping": None,
        "decay": None,
        "family": None,
        "initial": None,
        "time_limit": SHORT,
    },
    "tunable.gain": dict,
    "tunable.pid": lambda: {"integral": True, "derivative": True, "low": None, "high": 100.0},
    "tunable.lead": lambda: {"low": 0.1, "high": 100.0},
    "tunable.notch": lambda: {"low": 0.1, "high": 100.0},
    "tunable.ppf": lambda: {"modes": 1, "low": 0.1, "high": 100.0},
    "tunable.state_space": lambda: {"order": 1, "strictly_proper": False},
    "tunable.decentralised": lambda: {"*": (("y0", "u0", bc.tunable.gain()),)},
    "tunable.physical": lambda: {"name": "damping", "low": 0.1, "high": 1.0},
    "tunable.objective": lambda: {"inputs": None, "outputs": "z_y0", "norm": "hinf"},
    "tunable.budget": lambda: {"inputs": None, "outputs": "z_y0", "limit": 1.0, "norm": "hinf"},
    "synthesis.high_pass": lambda: {"gain": 1.0, "corner": 2.0, "order": 2, "damping": 0.7},
    "hinf_norm": lambda: {"system": plant()},
    "hold": lambda: {"angle": 0.1},
    "hub_beam": lambda: {
        "parameters": bc.HubBeamParameters(length=80.0),  # so slow that any time is short, or refused
        "model": None,
        "modes": None,
        "accuracy": 0.1,
        "manoeuvre": bc.spin_up(1e-3, 1.0),
        "time": 2.0,
    },
    "hub_profile": lambda: {
        "angle": np.square,
        "speed": lambda t: 2 * t,
        "acceleration": lambda t: 2 + 0 * t,
        "breakpoints": (),
    },
    "scale_signals": lambda: {"system": plant(), "scales": {"u0": 2.0, "u1": 1.0, "y0": 1.0}},
    "iso_track": lambda: {
        "road_class": "C",
        "length": 20.0,
        "seed": 0,
        "width": 1.8,
        "step": 0.05,
        "band": (0.1, 3.0),
        "periodic": False,
    },
    "join_symmetric": lambda: {
        "model": boom(),
        "symmetric": half_controller("sym"),
        "antisymmetric": half_controller("anti"),
    },
    "kalman": lambda: {
        "system": plant(),
        "process_noise": 1.0,
        "measurement_noise": 0.1,
        "measurements": ["y0"],
        "disturbances": ["u1"],
    },
    "synthesis.loop_transfer_recovery": lambda: {
        "system": plant(),
        "Q": 1.0,
        "R": 1.0,
        "process_noise": 1.0,
        "measurement_noise": 1.0,
        "measurements": None,
        "controls": ["u0"],
        "strengths": [1.0],
        "band": (0.1, 1.0),
        "disturbances": None,
        "output_weight": None,
    },
    "low_pass": lambda: {"gain": 1.0, "corner": 2.0, "order": 1, "damping": 0.7},
    "lqg": lambda: {
        "system": plant(),
        "Q": 1.0,
        "R": 1.0,
        "process_noise": 1.0,
        "measurement_noise": 1.0,
        "measurements": ["y0"],
        "controls": ["u0"],
        "disturbances": None,
        "output_weight": None,
        "ltr": 0.0,
    },
    "lqr": lambda: {
        "system": plant(),
        "Q": 1.0,
        "R": 1.0,
        "output_weight": None,
        "controls": ["u0"],
        "integral": (),
        "N": None,
    },
    "bode": lambda: {"system": boom(), "omega": [0.5, 2.0], "inputs": None, "outputs": None},
    "compare": lambda: {"results": {"one": plant(), "other": system()}, "omega": [0.5, 2.0]},
    "impulse": lambda: {"system": plant(), "timepts": _TIMES, "inputs": None, "outputs": None},
    "nyquist": lambda: {"system": plant(), "controller": controller(), "delay": 0.0},
    "pzmap": lambda: {"system": plant(), "inputs": None, "outputs": None},
    "step": lambda: {"system": plant(), "timepts": _TIMES, "inputs": None, "outputs": None},
    "margins": lambda: {"plant": plant(), "controller": controller(), "delay": 0.0},
    "mixed_sensitivity": lambda: {"plant": system(), "W1": 1.0, "W2": 0.1, "W3": None},
    "mode_table": lambda: {"system": plant()},
    "nozzle_positions": lambda: {"length": 12.0, "spacing": 0.5},
    "optimal_slew": lambda: {
        "h": beam(),
        "angle": 0.6,
        "torque_limit": 200.0,
        "objective": "time",
        "duration": None,
        "torque_rate_limit": None,
        "speed_limit": None,
        "tip_limit": None,
        "moment_limit": None,
        "final_speed": 0.0,
        "initial_state": None,
        "final_state": None,
        "tip_masses": (),
        "tolerance": 1e-6,
        "intervals": 20,
        "time_limit": SHORT,
    },
    "platform_motion": lambda: {"track": track(), "tractor": None, "speed": 2.5, "duration": 1.0, "sample_time": 0.01},
    "read_measured_curve": lambda: {"path": "nowhere.csv"},
    "read_motion": lambda: {"path": "nowhere.csv", "actuator_distance": None},
    "prove": lambda: {"result": bc.hinf_norm(plant()), "max_operations": 1e9},
    "read_controller": lambda: {"path": "nowhere.json"},
    "exchange.read_controller_notes": lambda: {"path": "nowhere.json"},
    "write_controller": lambda: {"controller": controller(0.01), "path": "/nowhere/k.json"},
    "reduce": lambda: {"system": plant(), "order": 2, "method": "balanced", "error": None, "omega_range": None},
    "reduce_controller": lambda: {
        "P": generalized(),
        "controller": system(((-1.0,),), ((1.0,),), ((-0.1,),)),
        "order": None,
        "tolerance": 0.05,
        "fastest_pole": None,
    },
    "robust_stability": lambda: {
        "family": family(),
        "controller": regulator(),
        "max_cells": 3,
        "delay": 0.0,
        "unmodelled": None,
        "injection_points": (),
    },
    "schedule": lambda: {"controllers": [controller(), controller()], "values": [0.0, 1.0], "signal": "y0"},
    "synthesis.select_channels": lambda: {"system": plant(), "inputs": ["u0"], "outputs": None},
    "shelf": lambda: {"low_gain": 1.0, "high_gain": 10.0, "corner": 2.0, "order": 1},
    "compare_sigma": lambda: {"systems": {"boom": boom()}, "omega": [0.5, 2.0]},
    "sweep": lambda: {
        "function": of_two,
        "over": {"x": [1.0, 2.0], "y": 3.0},
        "n_jobs": 1,
        "backend": None,
        "combine": "grid",
        "checkpoint": None,
        "units": {"x": "m"},
    },
    "sigma": lambda: {"system": boom(), "omega": [0.5, 2.0], "inputs": None, "outputs": None},
    "simulate_loop": lambda: {
        "plant": plant(),
        "controller": controller(),
        "disturbance": {"u1": np.sin(_TIMES)},
        "timepts": _TIMES,
        "sample_time": 0.01,
        "delay": 0.0,
        "force_limit": None,
        "rate_limit": None,
        "stroke_limit": None,
        "quantization": None,
        "anti_windup": True,
        "friction": None,
        "discretization": "tustin",
        "initial": None,
        "noise": None,
        "seed": 0,
        "reference": None,
        "feedforward": {"u0": np.cos(_TIMES)},
        "sensors": (),
        "rtol": 1e-8,
        "atol": 1e-10,
    },
    "sine_sweep": lambda: {
        "start_hz": 0.1,
        "stop_hz": 2.0,
        "duration": 2.0,
        "amplitude": 0.01,
        "motion": "jolt",
        "logarithmic": True,
        "sample_time": 0.01,
    },
    "sine_torque": lambda: {"amplitude": 10.0, "period": 1.0, "duration": 1.0},
    "spin_up": lambda: {"final_speed": 1.0, "duration": 1.0},
    "synthesis.split_controller": lambda: {"model": boom(), "controller": both_controller()},
    "boom.split_motion": lambda: {"displacement": np.zeros((2, 5)), "positions": [-6.0, 6.0]},
    "split_symmetric": lambda: {"model": boom()},
    "spray_boom": lambda: {
        "parameters": None,
        "discretization": "finite",
        "elements": 6,
        "excitation": "displacement",
        "accelerometer_bandwidth_hz": None,
        "order": 6,
        "reactions": False,
        "nozzles": None,
    },
    "spray_by_motion": lambda: {**_sprayed(), "nozzles": None, "footprint": None, "cell": 0.1},
    "spray_deposit": lambda: {**_sprayed(), "nozzles": None, "footprint": None, "cell": 0.1},
    "analysis.structured_margin": lambda: {
        "family": family(),
        "controller": regulator(),
        "largest": 1.0,
        "tolerance": 0.5,
        "max_cells": 2,
    },
    "torque": lambda: {"function": np.sin, "breakpoints": ()},
    "boom.tractor_system": lambda: {"tractor": bc.boom.TractorParameters(), "speed": 2.5, "actuator_distance": 1.78},
    "analysis.sample_plant": lambda: {"plant": plant(), "sample_time": 0.1, "controls": None, "delay": 0.0},
    "analysis.sampled_norm": lambda: {
        "plant": plant(),
        "controller": sampled(),
        "inputs": None,
        "outputs": None,
        "delay": 0.0,
    },
    "with_states": lambda: {"plant": plant()},
    "worst_case": lambda: {
        "family": family(),
        "controller": regulator(),
        "inputs": None,
        "outputs": None,
        "norm": "hinf",
        "tolerance": 0.1,
        "max_cells": 3,
        "injection_points": (),
    },
    "boom.write_motion": lambda: {"path": Path("/nowhere/motion.csv"), "motion": motion()},
    "boom.yaw_family": lambda: {"parameters": None, "stiffest_hz": 0.34, "half": "yaw", "elements": 6},
    # any planar machine
    "structure.AffineFamily": lambda: {
        name: getattr(family(), name) for name in ("names", "low", "high", "centre", "slopes")
    },
    "structure.PolynomialFamily": lambda: {
        name: getattr(turning(), name) for name in ("names", "low", "high", "centre", "changes", "free")
    },
    "structure.Assembly": lambda: {"bodies": (points()[0],), "links": (), "forces": (), "outputs": (), "cuts": ()},
    "structure.Beam": lambda: {
        "name": "beam",
        "parent": bs.GROUND.at(0.0),
        "joint": bs.fixed(),
        "start": (0.0, 0.0),
        "sections": (bs.BeamSection(1.0, 1.0, 1.0),),
        "discretization": bs.FiniteElements(2),
        "angle": 0.0,
    },
    "structure.BeamSection": lambda: {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0, "damping": 0.0},
    "structure.CutJoint": lambda: {"a": points()[1], "b": points()[2], "directions": ("x", "y")},
    "structure.DiscreteElements": lambda: {"elements": 4, "mass": "hermite"},
    "structure.FiniteElements": lambda: {"elements": 3, "order": 3},
    "structure.Force": lambda: {"name": "f", "point": points()[1], "direction": "y", "reaction": None},
    "structure.Joint": lambda: {"slides": (("y", 1.0),), "turns": True},
    "structure.Output": lambda: {
        "name": "y",
        "point": points()[1],
        "direction": "y",
        "relative_to": None,
        "derivative": 0,
        "bandwidth_hz": None,
    },
    "structure.Point": lambda: {"body": points()[0], "x": 0.0, "y": 0.0},
    "structure.RigidBody": lambda: {
        "name": "rod",
        "parent": bs.GROUND.at(0.0),
        "joint": bs.revolute(),
        "mass": 1.0,
        "inertia": 1.0,
        "centre": (0.0, 0.0),
    },
    "structure.SecondOrderModel": lambda: {
        "M": np.eye(2),
        "C": 0.1 * np.eye(2),
        "K": np.eye(2),
        "force_inputs": {"f": [1.0, 0.0]},
        "outputs": {"y": [0.0, 1.0]},
        "coordinates": ("a", "b"),
    },
    "structure.SpringDamper": lambda: {
        "a": points()[1],
        "b": points()[2],
        "direction": "y",
        "stiffness": 1.0,
        "damping": 0.1,
    },
    "structure.fixed": dict,
    "structure.free": lambda: {"*": ("x", "y")},
    "structure.prescribe_displacement": lambda: {
        "model": driven(),
        "inputs": ["cradle"],
        "hold": [],
        "motion": "displacement",
        "reactions": False,
    },
    "structure.prismatic": lambda: {"angle": 0.1, "name": "slide"},
    "structure.revolute": dict,
    "structure.split_symmetric": lambda: {"model": boom()},
}

# methods of what is handed out
METHODS = {
    "SecondOrderModel.eigenfrequencies_hz": (boom, lambda: {"count": 3}),
    "SecondOrderModel.frequency_response": (boom, lambda: {"omega": [0.5, 1.0], "inputs": None, "outputs": None}),
    "SecondOrderModel.to_statespace": (boom, lambda: {"inputs": None, "outputs": None}),
    "SecondOrderModel.select": (boom, lambda: {"inputs": None, "outputs": ["tip_left"]}),
    "HubBeam.frequencies_hz": (beam, lambda: {"hub_speed": 1.0, "coupled": False}),
    "SecondOrderModel.mode_shapes": (boom, lambda: {"count": 3}),
    "HubBeam.mode_shapes": (beam, lambda: {"count": 1}),
    "HubBeam.campbell": (beam, lambda: {"speeds": [0.0, 1.0], "count": 1, "orders": [1.0], "coupled": False}),
    "HubBeam.linearize": (beam, lambda: {"hub_speed": 0.0, "sensors": None}),
    "HubBeam.simulate_loop": (
        lambda: bc,
        lambda: {
            "plant": beam(),
            "controller": hub_controller(),
            "disturbance": {"tip_force": np.sin(_TIMES)},
            "timepts": _TIMES,
            "sample_time": 0.01,
            "delay": 0.004,
            "force_limit": 10.0,
            "rate_limit": None,
            "quantization": None,
            "initial": None,
            "noise": 1e-3,
            "seed": 0,
            "reference": {"hub_angle": np.ones(51)},
            "feedforward": None,
            "sensors": [bc.BeamSensor("gauge", "strain", 0.5, 0.01)],
            "rtol": 1e-6,
            "atol": 1e-8,
        },
    ),
    "HubBeam.simulate": (
        beam,
        lambda: {
            "manoeuvre": bc.spin_up(1.0, 0.5),
            "timepts": _TIMES,
            "initial": None,
            "rtol": 1e-6,
            "atol": 1e-8,
        },
    ),
    "HubBeam.steady_state": (beam, lambda: {"hub_speed": 0.5}),
    "HubBeam.residual_energy": (beam, lambda: {"state": np.zeros(4), "hub_speed": 0.0}),
    "HubBeam.with_tip_mass": (beam, lambda: {"tip_mass": 0.1}),
    "HubBeam.with_stiffness": (beam, lambda: {"factor": 0.9}),
    "HubBeam.in_model": (beam, lambda: {"model": "tlam", "modes": 2}),
    "HubBeam.family": (beam, lambda: {"hub_speed": (0.0, 1.0), "tip_mass": (0.0, 0.1), "sensors": ()}),
    "ScheduledController.at": (scheduled, lambda: {"value": 0.5}),
    "ScheduledController.to_nlsys": (scheduled, lambda: {"references": ()}),
    "HubBeam.shape": (beam, lambda: {"states": np.zeros(4)}),
    "SlewResult.track": (
        slew,
        lambda: {
            "sample_time": 0.05,
            "torque_limit": 300.0,
            "settle": 0.2,
            "measurements": ["hub_angle"],
            "sensors": (),
            "noise": 1e-3,
            "error_weight": 1e3,
            "integral_time": 0.3,
            "disturbance": 5.0,
            "model_error": 0.1,
        },
    ),
    "TrackedSlew.monte_carlo": (
        tracked,
        lambda: {
            "runs": 2,
            "seed": 0,
            "tip_mass": 0.1,
            "stiffness": 0.1,
            "friction": 1.0,
            "disturbance_torque": 1.0,
            "feedback": True,
            "wait": 0.0,
            "creep": 0.01,
            "noise": None,
            "delay": 0.0,
            "rate_limit": None,
            "rtol": 1e-4,
            "atol": 1e-6,
            "n_jobs": 1,
        },
    ),
    "TrackedSlew.vibration": (tracked, lambda: {"run": tracked_run(), "wait": 0.0}),
    "Assembly.Beam.at": (lambda: _a_beam(), lambda: {"s": 0.5}),
    "Assembly.Beam.at_point": (lambda: _a_beam(), lambda: {"x": 0.5, "y": 0.0}),
    "Track.heights": (track, lambda: {"distance": [1.0]}),
    "AffineFamily.at": (family, lambda: {"delta": np.zeros(2)}),
    "AffineFamily.deltas": (family, lambda: {"values": {}}),
    "BoomParameters.from_toml": (bc.BoomParameters, lambda: {"path": "nowhere.toml"}),
}


def _a_beam():
    return bs.Beam(**CALLS["structure.Beam"]())


def of_two(x, y):
    return {"sum": x + y}


def _sprayed():
    return {"time": _TIMES, "displacement": np.zeros((2, len(_TIMES))), "positions": [-6.0, 6.0], "speed": 3.0}


@cache
def regulator_of_the_left():
    import control

    return control.ss([], [], [], [[-10.0]], inputs=["stroke_left"], outputs=["suspension_left"])


@cache
def half_controller(end):
    import control

    return control.ss([[-1.0]], [[1.0]], [[-9.0]], 0.0, inputs=[f"stroke_{end}"], outputs=[f"suspension_{end}"])


@cache
def both_controller():
    return bc.join_symmetric(boom(), half_controller("sym"), half_controller("anti"))


def _systems():
    import control

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        broken = control.ss([[np.nan]], [[1.0]], [[1.0]], 0.0)
    return [
        plant(),
        controller(),
        controller(0.01),
        generalized(),
        broken,
        control.ss([], [], [], [[1.0]]),
        control.ss([[1e300]], [[1.0]], [[1.0]], 0.0),
        control.ss([[-5e-324]], [[1e-300]], [[1.0]], 0.0),
        control.ss([[0.0]], [[1.0]], [[1.0]], 0.0),
        control.ss([[1.0]], [[1.0]], [[1.0]], 0.0),
        control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.0]], [[0.0, 0.0]], 0.0),
        control.tf([1.0], [1.0, 1.0]),
        control.frd([1.0, 2.0], [1.0, 2.0]),
    ]


@cache
def _objects():
    return [
        *_systems(),
        boom(),
        yaw(),
        bs.SecondOrderModel([[1.0]], [[0.0]], [[0.0]], {"f": [1.0]}, {"y": [1.0]}),
        bs.SecondOrderModel([[0.0]], [[0.0]], [[1.0]], {"f": [1.0]}, {"y": [1.0]}),
        bs.SecondOrderModel([[1.0]], [[0.0]], [[1.0]]),
        beam(),
        bc.hub_beam(model="tlam", modes=1),
        family(),
        friction(),
        track(),
        motion(),
        bc.BoomParameters(),
        bc.BoomParameters,
        bc.HubBeamParameters(),
        bc.boom.TractorParameters(),
        bc.boom.Footprint(),
        bs.GROUND,
        bs.GROUND.at(1.0),
        points()[0],
        points()[1],
        bs.fixed(),
        bs.FiniteElements(2),
        bc.spin_up(1.0, 1.0),
        bc.free(),
        object(),
        np.sin,
        lambda *a: None,
        lambda t: "text",
        lambda t: np.nan,
        lambda t: np.zeros(7),
    ]


_NUMBERS = [
    *(0, 1, -1, 2, 7, 10**9, -(10**9), 10**400),
    *(0.0, -0.0, 0.5, 1.0, -1.0, 1e-3, 1e3, 1e6, 1e-12, 1e12, 1e-300, 1e300, -1e300, 5e-324, 1.7e308),
    *(float("nan"), float("inf"), -float("inf"), 1j, True, False, Fraction(1, 3)),
    *(np.float32(0.1), np.float64(2.0), np.int8(3), np.bool_(True), np.float64("nan"), np.float16(1.0)),
]
_WORDS = [
    "",
    "x",
    "tip_left",
    "actuator_left",
    "u0",
    "y0",
    "nothing",
    "finite",
    "exact",
    "time",
    "C",
    "\u03c9",
    "a.b",
    "1",
    b"y0",
]
_WORDS += [Path("nowhere"), Path(".")]
_ARRAYS = [
    *(
        [],
        (),
        [[]],
        [0.0],
        [1.0],
        [1.0, 2.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [[1.0, 2.0], [3.0]],
        [None],
        ["y0"],
        ["y0", "y0"],
        [b"a"],
    ),
    *(
        [float("nan")],
        [1.0, float("inf")],
        [1e300, 1e300],
        [5e-324, 1.0],
        [0.0, -1.0],
        ["nothing"],
        [1j],
        [True, False],
    ),
    *(
        np.zeros(0),
        np.zeros((0, 3)),
        np.zeros((2, 2)),
        np.eye(2),
        -np.eye(2),
        np.eye(3),
        np.zeros((1, 1, 1)),
        np.array(1.0),
    ),
    *(np.arange(4), np.ones(3, dtype=np.float32), np.array(["a", "b"]), np.array([None, 1.0]), np.full((2, 2), np.nan)),
    *(
        np.full(3, 1e300),
        np.full((1, 1), 1e-300),
        _TIMES,
        -_TIMES,
        _TIMES[::-1],
        1e-320 * _TIMES,
        np.linspace(0.0, 0.5, 7),
    ),
    *(
        {},
        {"u0": 1.0},
        {"y0": float("nan")},
        {"y0": None},
        {"nothing": 1.0},
        {1: 2.0},
        {"u0": np.sin(_TIMES)},
        {"k": [1.0]},
    ),
    *(
        {"u0": []},
        {"u1": [np.nan] * len(_TIMES)},
        {"y0": "x"},
        {"u0": -1.0},
        {"y0": 0.0},
        set(),
        {"y0"},
        range(3),
        None,
        ...,
    ),
]


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
    make = METHODS[name][1] if name in METHODS else CALLS[name]
    for key in make():
        for value in (*_NUMBERS, *_WORDS, *_ARRAYS, *_objects()):
            if value is np.sin and key == "build":  # it raises itself what is raised
                continue
            if found := fault(name, make() | {key: value}):
                yield key, value, found


@st.composite
def calls(draw, names):
    """Return the name of a function, and arguments of which one or two are something else."""
    name = draw(st.sampled_from(names))
    arguments = dict(METHODS[name][1]() if name in METHODS else CALLS[name]())
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
