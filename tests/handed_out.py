"""One of every kind of object that users are handed: small ones, made in a moment."""

import functools

import control
import numpy as np

import boomctl as bc
from boomctl.analysis import MeasuredCurve
from boomctl.slew import compare_slews
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSection,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    SpringDamper,
    free,
    revolute,
)

OMEGA = np.array([1.0, 2.0, 5.0])
UNITS = {"actuator_anti": 0.03, "suspension_anti": 150.0, "tip_anti": 0.2, "stroke_anti": 0.05}


@functools.cache
def boom():
    return bc.spray_boom(elements=6, accelerometer_bandwidth_hz=20.0)


@functools.cache
def yaw():
    return bc.split_symmetric(boom())[1]


@functools.cache
def mass():
    """Return a mass on a spring: the smallest plant that every method takes."""
    return SecondOrderModel([[1.0]], [[0.1]], [[4.0]], {"force": [1.0]}, {"position": [1.0]})


def weighed(plant):
    return bc.generalized_plant(
        plant,
        disturbances={"force": 1.0},
        performance={"position": 1.0},
        effort={"force": 0.1},
        noises={"position": 0.1},
        measurements=["position"],
        controls=["force"],
    )


@functools.cache
def generalized():
    return weighed(mass())


@functools.cache
def h_infinity():
    return bc.h_infinity(generalized(), 1, 1)


@functools.cache
def tuned():
    """Return gains tuned for two models with a budget, and a physical parameter beside them."""
    parts = bc.tunable.pid(integral=False) + bc.tunable.physical("damping", 0.05, 0.5)

    def plant(stiffness):
        def make(values):
            mass = SecondOrderModel(
                [[1.0]], [[values["damping"]]], [[stiffness]], {"force": [1.0]}, {"position": [1.0]}
            )
            return weighed(mass)

        return make

    channels = [bc.tunable.objective("w_force"), bc.tunable.budget("n_position", "z_force", 0.5)]
    return bc.tune([plant(4.0), plant(5.0)], 1, 1, parts, channels=channels, starts=2)


@functools.cache
def designed_on_a_reduction():
    two = control.tf([1.0], [1.0, 0.1, 4.0]) + control.tf([1.0], [1.0, 9.0, 900.0])
    small = bc.reduce(control.ss(two, inputs="force", outputs="position"), order=2)
    return bc.h_infinity(weighed(small), 1, 1)


@functools.cache
def machine():
    base = RigidBody("base", GROUND.at(0), free("y"), mass=20.0)
    beam = Beam("beam", base.at(0), revolute(), (0.0, 0.0), (BeamSection(3.0, 2.0, 500.0),), FiniteElements(4))
    return Assembly(
        bodies=(base, beam),
        links=(SpringDamper(beam.at(1.0), base.at(1.0), "y", stiffness=900.0, damping=3.0),),
        forces=(Force("drive", base.at(0)), Force("tip_force", beam.at(3.0))),
        outputs=(Output("tip", beam.at(3.0)),),
    )


@functools.cache
def family():
    return bc.boom_family(half="yaw")


@functools.cache
def suspension():
    """Return a weak damper between boom and platform, as a controller of the boom's yaw."""
    filtered = bc.low_pass(20.0, 50.0)
    filtered.input_labels, filtered.output_labels = ["stroke_anti"], ["suspension_anti"]
    return filtered


@functools.cache
def track():
    return bc.iso_track("C", 50.0, seed=1)


@functools.cache
def motion():
    return bc.platform_motion(track(), speed=3.0, duration=4.0, sample_time=0.01)


@functools.cache
def hub_beam():
    return bc.hub_beam(model="sfoam", modes=2)


@functools.cache
def loop():
    signals = {"actuator_left": motion().left, "actuator_right": motion().right}
    friction = bc.CoulombFriction(8.0)
    return bc.simulate_loop(
        boom(), None, signals, motion().time, sample_time=0.01, stroke_limit=0.005, friction=friction
    )


@functools.cache
def beam_loop():
    time = np.linspace(0.0, 1.0, 51)
    sensors = [bc.BeamSensor("gauge", "strain", 0.5, 0.01)]
    drive = {"torque": 10.0 * np.sin(time)}
    return bc.simulate_loop(hub_beam(), None, drive, time, sample_time=0.02, sensors=sensors)


@functools.cache
def slew():
    return bc.optimal_slew(hub_beam(), np.pi / 2, 200.0, "effort", duration=4.0, intervals=20)


@functools.cache
def tracked():
    return slew().track(sample_time=0.05, settle=1.0)


@functools.cache
def tracking_study():
    return tracked().monte_carlo(4, stiffness=0.1, tip_mass=(0.0, 0.1))


@functools.cache
def drive():
    signals = {"inputs": ["hub_angle", "hub_speed"], "outputs": "torque"}
    drives = [control.ss([], [], [], [[-150.0, -gain]], **signals) for gain in (200.0, 300.0)]
    return bc.schedule(drives, [0.0, 2.0])


@functools.cache
def linear_slew():
    return bc.optimal_slew(hub_beam().linearize(), 1.0, 200.0)


@functools.cache
def comparison():
    return compare_slews(bc.hub_beam(modes=1), np.pi / 2, 200.0, tip_masses=(0.0, 0.1))


@functools.cache
def measured_curve():
    """Return a curve that has its phase, as it is read from a file."""
    frequencies, response = OMEGA / (2.0 * np.pi), np.asarray(mass().frequency_response(OMEGA).frdata)
    return MeasuredCurve(frequencies, np.abs(response[0]), ("measured 1",), response, ("in_1",), ("out_1",))


@functools.cache
def record():
    """Return a force, the place of the mass that it pushes, and the time between samples [s]."""
    force = np.random.default_rng(0).standard_normal(1000)
    return (
        {"force": force},
        {"place": bc.forced_response(mass(), {"force": force}, 0.1 * np.arange(1000.0))["position"]},
        0.1,
    )


@functools.cache
def measured_response():
    return bc.estimate_response(*record())


@functools.cache
def identified():
    return bc.identify(*record())


@functools.cache
def fitted():
    hz, free = [0.25, 0.58, 0.95, 2.8, 4.0], ["spring_stiffness", "youngs_modulus"]
    return bc.fit(bc.spray_boom, hz, free, bc.BoomParameters(), starts=2)


def exact_loop():
    opened = yaw().select("suspension_anti", "stroke_anti")
    return bc.analysis.exact_loop_stability(
        opened.frequency_response, suspension(), np.linalg.eigvals(yaw().to_statespace().A)
    )


def spray():
    return bc.spray_deposit(
        loop().time, [loop()["tip_left"], loop()["tip_right"]], [-6.0, 6.0], 3.0, nozzles=bc.nozzle_positions(6.0, 1.0)
    )
