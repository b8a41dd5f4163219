"""One of each kind of object that public functions return: small ones, quickly made."""

import functools

import control
import numpy as np

import boomctl as bc
from boomctl.exchange import ControllerMetadata
from boomctl.identification import MeasuredFrequencyResponse
from boomctl.slew import SlewComparison, SlewRow, SwitchingFunction
from boomctl.structure import (
    GROUND,
    Assembly,
    Beam,
    BeamSegment,
    FiniteElements,
    Force,
    Output,
    RigidBody,
    SecondOrderModel,
    SpringDamper,
    planar,
    revolute,
)
from boomctl.studies.sweeps import FailedPoint

OMEGA = np.array([1.0, 2.0, 5.0])


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
        noise={"position": 0.1},
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
    """Return gains tuned for two models with a limit, and a plant parameter beside them."""
    parts = bc.tunable.pid(integral=False) + bc.tunable.plant_parameter("damping", 0.05, 0.5)

    def plant(stiffness):
        def make(values):
            mass = SecondOrderModel(
                [[1.0]], [[values["damping"]]], [[stiffness]], {"force": [1.0]}, {"position": [1.0]}
            )
            return weighed(mass)

        return make

    channels = [bc.tunable.objective("w_force"), bc.tunable.constraint("n_position", "z_force", 0.5)]
    return bc.tune([plant(4.0), plant(5.0)], 1, 1, parts, channels=channels, n_starts=1)


@functools.cache
def designed_on_a_reduction():
    two = control.tf([1.0], [1.0, 0.1, 4.0]) + control.tf([1.0], [1.0, 9.0, 900.0])
    small = bc.reduce(control.ss(two, inputs="force", outputs="position"), order=2)
    return bc.h_infinity(weighed(small), 1, 1)


@functools.cache
def machine():
    base = RigidBody("base", GROUND.at(0), planar("y"), mass=20.0)
    beam = Beam("beam", base.at(0), revolute(), (0.0, 0.0), (BeamSegment(3.0, 2.0, 500.0),), FiniteElements(4))
    return Assembly(
        bodies=(base, beam),
        springs=(SpringDamper(beam.at(1.0), base.at(1.0), "y", stiffness=900.0, damping=3.0),),
        forces=(Force("drive", base.at(0)), Force("tip_force", beam.at(3.0))),
        outputs=(Output("tip", beam.at(3.0)),),
    )


@functools.cache
def family():
    return bc.boom_family(subsystem="yaw")


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
    return bc.simulate_loop(boom(), None, motion().time, signals, sample_time=0.01, end_stop=0.005, friction=friction)


@functools.cache
def beam_loop():
    time = np.linspace(0.0, 1.0, 51)
    sensors = [bc.BeamSensor("gauge", "strain", 0.5, 0.01)]
    drive = {"torque": 10.0 * np.sin(time)}
    return bc.simulate_loop(hub_beam(), None, time, drive, sample_time=0.02, sensors=sensors)


@functools.cache
def slew():
    return bc.optimal_slew(hub_beam(), np.pi / 2, 200.0, "effort", duration=4.0, intervals=20)


@functools.cache
def tracked():
    return slew().track(sample_time=0.05, dwell_time=1.0)


@functools.cache
def tracking_study():
    return tracked().monte_carlo(4, stiffness=0.1, tip_mass=(0.0, 0.1))


@functools.cache
def drive():
    signals = {"inputs": ["hub_angle", "hub_speed"], "outputs": "torque"}
    drives = [control.ss([], [], [], [[-150.0, -gain]], **signals) for gain in (200.0, 300.0)]
    return bc.gain_schedule(drives, [0.0, 2.0])


@functools.cache
def linear_slew():
    return bc.optimal_slew(hub_beam().linearize(), 1.0, 200.0)


@functools.cache
def comparison():
    profile, t = linear_slew().torque_profile, np.linspace(0.0, 3.0, 20)
    rows = [
        SlewRow(name, 2.0 + k, 0.1, 0.0, 0.0, 5.0, 9.0, 0.05, 0.2, np.array([0.1, 0.3]), profile, t, np.sin(t))
        for k, name in enumerate(("bang-bang", "ZV", "EI"))
    ]
    return SlewComparison(1.0, 200.0, tuple(rows), tip_masses=np.array([0.0, 0.5]))


def switching_function():
    t = np.linspace(0.0, 2.0, 50)
    return SwitchingFunction(t, 1.0 - t, 200.0 * np.sign(1.0 - t), np.array([1.0]), 200.0)


@functools.cache
def measured_curve():
    """Return a curve that has its phase, as it is read from a file."""
    frequencies, response = OMEGA / (2.0 * np.pi), np.asarray(mass().frequency_response(OMEGA).frdata)
    return MeasuredFrequencyResponse(frequencies, np.abs(response[0]), ("measured 1",), response, ("in_1",), ("out_1",))


@functools.cache
def record():
    """Return a force, the place of the mass that it pushes, and the time between samples [s]."""
    force = np.random.default_rng(0).standard_normal(1000)
    return (
        {"force": force},
        {"place": bc.forced_response(mass(), 0.1 * np.arange(1000.0), {"force": force})["position"]},
        0.1,
    )


@functools.cache
def measured_response():
    return bc.estimate_frequency_response(*record())


@functools.cache
def identified():
    return bc.identify(*record())


@functools.cache
def fitted():
    hz, free = [0.25, 0.58, 0.95, 2.8, 4.0], ["spring_stiffness", "youngs_modulus"]
    return bc.fit(bc.spray_boom, hz, free, bc.BoomParameters(), n_starts=2)


def exact_loop():
    opened = yaw().select("suspension_anti", "stroke_anti")
    return bc.analysis.nyquist_stability(
        opened.frequency_response, suspension(), np.linalg.eigvals(yaw().to_statespace().A)
    )


def spray():
    return bc.spray_deposit(
        loop().time,
        [loop()["tip_left"], loop()["tip_right"]],
        [-6.0, 6.0],
        3.0,
        nozzles=bc.nozzle_positions(spacing=1.0)[3:-3],
    )


def abs_of(x):
    return abs(x)


FACTORIES = {
    "BoomParameters": bc.BoomParameters,
    "SecondOrderModel": boom,
    "SecondOrderModel, by accuracy": lambda: bc.spray_boom(accuracy=0.01, max_frequency_hz=2.0),
    "SecondOrderModel, user's": mass,
    "Assembly": machine,
    "CrossSection": lambda: bc.structure.rectangular_section(0.06, 0.02, 0.002),
    "AffineFamily": family,
    "PolynomialFamily": lambda: hub_beam().family((0.0, 2.0)),
    "ScheduledController": drive,
    "Track": track,
    "PlatformMotion": motion,
    "TractorParameters": bc.boom.TractorParameters,
    "Footprint": bc.boom.Footprint,
    "SprayResult": spray,
    "FieldScenario": bc.studies.FieldScenario,
    "SuspensionDesign": lambda: bc.studies.SuspensionDesign(
        "mine", "of two springs", controller=suspension(), synthesis_info={"peak": "9.87 with its best dampers" * 20}
    ),
    "MachineResult": lambda: bc.studies.MachineDesign("mine", "a half", yaw(), suspension()).evaluate(),
    "SlewDesign": lambda: bc.studies.SlewDesign("mine", "a turn", hub_beam(), {"planned": slew()}),
    "SweepResult": lambda: bc.sweep(abs_of, {"x": [1.0, -2.0]}, units={"x": "m"}),
    "SweepResult, of arrays": lambda: bc.sweep(np.full, {"shape": 3, "fill_value": [1.0, 2.0]}),
    "FailedPoint": lambda: FailedPoint({"x": 1.0}, "ValueError: no", "trace"),
    "SigmaResult": lambda: bc.sigma(boom()),
    "SigmaResult, norm not yet computed": lambda: bc.sigma(boom(), OMEGA),
    "SigmaResult, of data": lambda: bc.sigma(boom().frequency_response(OMEGA)),
    "ModeTable": lambda: bc.mode_table(yaw()),
    "LoopMargin": lambda: bc.margins(yaw(), suspension())["stroke_anti"],
    "SigmaComparison": lambda: bc.compare_sigma({"boom": boom(), "mass": mass()}),
    "Margins": lambda: bc.margins(yaw(), suspension()),
    "RobustStability": lambda: bc.robust_stability(family(), suspension()),
    "RobustStabilityMargin": lambda: bc.analysis.robust_stability_margin(family(), suspension(), max_factor=1.2),
    "WorstCase": lambda: bc.worst_case(family(), suspension(), ["actuator_anti"], ["tip_anti"], rtol=0.2),
    "NyquistStability": exact_loop,
    "MeasuredFrequencyResponse": measured_curve,
    "FrequencyResponseEstimate": measured_response,
    "Identification": identified,
    "FitResult": fitted,
    "FitResult, not determined": lambda: bc.fit(
        bc.hub_beam, [0.46, 2.9], ["youngs_modulus", "second_moment"], bc.HubBeamParameters(), n_starts=1
    ),
    "ReductionResult": lambda: bc.reduce(yaw().select("actuator_anti", "tip_anti"), order=4),
    "ReductionResult, second-order": lambda: bc.reduce(
        yaw().select("actuator_anti", "tip_anti"), order=2, method="second-order"
    ),
    "LqrResult": lambda: bc.lqr(mass(), np.eye(2), np.eye(1)),
    "KalmanResult": lambda: bc.kalman(mass(), np.eye(2), np.eye(1)),
    "LqgResult": lambda: bc.lqg(mass(), np.eye(2), 1.0, np.eye(2), 1.0),
    "RecoveryResult": lambda: bc.synthesis.loop_transfer_recovery(
        mass(), np.eye(2), 1.0, np.eye(2), 1.0, noise_intensities=[1.0, 100.0], omega_range=(0.1, 10.0)
    ),
    "H2Result": lambda: bc.h2(generalized(), 1, 1),
    "HInfinityResult": h_infinity,
    "HInfinityResult, of a reduction": designed_on_a_reduction,
    "TuneResult": tuned,
    "ReducedController": lambda: bc.reduce_controller(generalized(), h_infinity().controller, order=1),
    "ControllerMetadata": lambda: ControllerMetadata({"tip": "m", "torque": ""}, {"norm": 1.0}, {"boomctl": "0"}),
    "CoulombFriction": lambda: bc.CoulombFriction(8.0),
    "LoopResult": loop,
    "ForcedResponse": lambda: bc.forced_response(mass(), np.linspace(0.0, 5.0, 50), {"force": np.ones(50)}),
    "LoopResult, of a hub-beam": beam_loop,
    "BeamSensor": lambda: bc.BeamSensor("gauge", "strain", 0.5, 0.01),
    "HubBeamParameters": bc.HubBeamParameters,
    "AssumedModesBeam": hub_beam,
    "AssumedModesBeam, by accuracy": lambda: bc.hub_beam(accuracy=1e-3, maneuver=bc.spin_up(1.0, 2.0), timepts=3.0),
    "GeometricallyExactBeam, by accuracy": lambda: bc.hub_beam(
        accuracy=1e-5, maneuver=bc.spin_up(2.0, 4.0), timepts=5.0
    ),
    "GeometricallyExactBeam": lambda: bc.hub_beam(model="geometrically-exact", modes=2),
    "SimulationResult": lambda: hub_beam().simulate(bc.spin_up(0.5, 5.0), np.linspace(0.0, 6.0, 50)),
    "SpinUp": lambda: bc.spin_up(2.8, 30.0),
    "SineTorque": lambda: bc.sine_torque(200.0, 10.0, 10.0),
    "Torque": lambda: bc.maneuvers.applied_torque(np.sin),
    "Hold": bc.maneuvers.hold_angle,
    "Free": bc.maneuvers.free_hub,
    "SlewResult": slew,
    "TrackedSlew": tracked,
    "TrackingStudy": tracking_study,
    "SlewResult, of a StateSpace": linear_slew,
    "SlewComparison": comparison,
    "SlewRow": lambda: comparison().rows[0],
    "SwitchingFunction": switching_function,
    "TorqueProfile": lambda: slew().torque_profile,
    "Shaper": lambda: bc.slew.input_shaper("ZV", 1.0, 0.0),
    "BodeResult": lambda: bc.bode(boom()),
    "NyquistResult": lambda: bc.nyquist(yaw(), suspension()),
    "TimeResponse": lambda: bc.step(boom(), np.linspace(0.0, 5.0, 50)),
    "PoleZeroResult": lambda: bc.pzmap(yaw()),
    "Comparison": lambda: bc.compare({"one": beam_loop(), "again": beam_loop()}),
    "Comparison, of a run and a loop": lambda: bc.compare({"run": loop(), "loop": [mass(), bc.sigma(yaw())]}),
    "ModeShapes": lambda: boom().mode_shapes(5),
    "CampbellDiagram": lambda: hub_beam().campbell([0.0, 1.0, 4.0]),
}
