"""A user's script that uses every public name.  It is not run: a type checker reads it (`test_typed.py`).

What `reveal_type` is asked for here must be known: neither Any nor Unknown.
"""

from typing import reveal_type

import numpy as np

import boomctl as bc
from boomctl.structure import AffineFamily, SecondOrderModel, prescribe_displacement

reveal_type(bc.__version__)
omega = np.geomspace(0.6, 60.0, 100)

# the boom
p = bc.BoomParameters(spring_stiffness=900.0)
reveal_type(p.length)
m = bc.spray_boom(p, discretization="finite", elements=6)
reveal_type(m)
reveal_type(m.M)
reveal_type(m.input_labels)
reveal_type(m.eigenfrequencies_hz(5))
reveal_type(m.frequency_response(omega))
reveal_type(m.select("actuator_left", "tip_left"))
plant = m.to_statespace()
reveal_type(plant)
jolt, yaw = bc.split_symmetric(m)
reveal_type(yaw)
reveal_type(bc.exact_frequency_response(p, omega))
reveal_type(bc.exact_eigenfrequencies_hz(p, 5, damped=False))
reveal_type(bc.boom_family(subsystem="yaw"))
family: AffineFamily = bc.boom.yaw_family(subsystem="yaw")
reveal_type(family.at(np.zeros(family.nparameters)))

# any structure
g = SecondOrderModel(np.eye(2), np.eye(2), np.eye(2), {"f1": [1.0, 0.0], "f2": [0.0, 1.0]}, {"y": [1.0, 1.0]})
reveal_type(prescribe_displacement(g, ["f1"], hold=["f2"]))

# tracks, tractor, spray
track = bc.iso_track("C", 200.0, seed=1)
reveal_type(track)
reveal_type(bc.bump_track(0.1, 1.0))
reveal_type(bc.boom.Track(0.1, np.zeros(10), np.zeros(10), 1.8).heights(0.3))
tractor = bc.boom.TractorParameters(mass=5000.0)
reveal_type(bc.boom.tractor_system(tractor, speed=2.5))
motion: bc.boom.PlatformMotion = bc.platform_motion(track, tractor, speed=2.5)
reveal_type(motion.left)
reveal_type(bc.sine_sweep(0.1, 5.0, 30.0, 0.01))
bc.boom.write_motion("motion.csv", motion)
reveal_type(bc.read_motion("motion.csv"))
footprint = bc.boom.Footprint(width=1.0)
tips = bc.boom.split_jolt_yaw(np.zeros((10, 2)), [-6.0, 6.0])
reveal_type(tips)
reveal_type(bc.nozzle_positions())
spray = bc.spray_deposit(motion.time, np.zeros((2, 10)), [-6.0, 6.0], 3.0, footprint=footprint)
reveal_type(spray)
reveal_type(spray.cv)
reveal_type(spray.plot())
reveal_type(bc.spray_deposit_components(motion.time, np.zeros((2, 10)), [-6.0, 6.0], 3.0))

# analysis
s = bc.sigma(m)
reveal_type(s)
reveal_type(s.omega)
reveal_type(s.peak)
reveal_type(s.certified)
reveal_type(s.plot(label="boom", linestyle="--"))
reveal_type(bc.sigma(m, frequency_hz=[0.1, 1.0]).frequency_hz)
reveal_type(bc.compare_sigma({"boom": m, "again": plant}).plot(frequency_unit="rad/s"))
reveal_type(bc.read_frequency_response("curve.csv").plot())
curve = bc.read_frequency_response("curve.csv")
reveal_type(curve)
reveal_type(curve.response)
fitted = bc.fit(bc.spray_boom, [0.25, 0.59, 0.94], ["spring_stiffness"], bc.BoomParameters())
reveal_type(fitted)
reveal_type(fitted.intervals["spring_stiffness"])
reveal_type(fitted.certificate.certified)
reveal_type(fitted.unidentifiable)
reveal_type(fitted.plot())
reveal_type((fitted.success, fitted.message, fitted.nfev, fitted.elapsed))
measured = bc.estimate_frequency_response(
    np.zeros((100, 1)), {"tip": np.zeros(100)}, 0.01, frequency_range_hz=(1.0, 20.0)
)
reveal_type(measured)
reveal_type(measured.coherence)
reveal_type(measured.plot())
identified = bc.identify(np.zeros((100, 1)), {"tip": np.zeros(100)}, 0.01, modes=2, frequency_range_hz=(1.0, 20.0))
reveal_type(identified)
reveal_type(identified.modes[0].frequency_interval_hz)
reveal_type(identified.model)
reveal_type(identified.plot())
reveal_type(bc.identify(measured).fit_percent)
reveal_type((identified.success, identified.message, identified.elapsed))
reveal_type(bc.hinf_norm(plant))
reveal_type(bc.h2_norm(plant).value)
reveal_type(bc.prove(bc.hinf_norm(plant)).proved)
reveal_type(bc.mode_table(m).rows[0].damping_ratio)

# reduction
red = bc.reduce(m, order=10, method="balanced", omega_range=(0.0, 80.0))
reveal_type(red)
reveal_type(red.system)
reveal_type(red.error_norm)

with bc.progress_callback(print):
    reveal_type(bc.reduce(m, order=10, progress=lambda told: reveal_type(told)))
reveal_type(bc.Progress("task", "stage", 1.0).elapsed)

# synthesis
scales = {"actuator_anti": 0.03, "suspension_anti": 150.0, "tip_anti": 0.2, "stroke_anti": 0.05}
small = bc.scale_signals(yaw, scales)
reveal_type(small)
reveal_type(bc.ScaledStateSpace(small, scales=small.scales).scales)
P = bc.generalized_plant(
    small,
    disturbances={"actuator_anti": bc.low_pass(1.0, 2.0)},
    performance={"tip_anti": bc.synthesis.band_pass(1.0, 2.0, 3.0)},
    effort={"suspension_anti": bc.shelf(2.0, 7200.0, 39.0, order=2)},
    noise={"stroke_anti": bc.synthesis.high_pass(1.0, 20.0)},
    measurements=["stroke_anti"],
    controls=["suspension_anti"],
)
reveal_type(P)
reveal_type(bc.mixed_sensitivity(plant, W1=1.0))
d = bc.h_infinity(P, nmeas=1, ncon=1)
reveal_type(d)
reveal_type(d.controller)
reveal_type(d.gamma)
reveal_type(d.certificate.summary)
reveal_type((d.success, d.message, d.elapsed))
reveal_type(bc.h_infinity(red, 1, 1).certificate.full_plant)
T = bc.tunable
parts = [
    T.gain(),
    T.pid(),
    T.notch(),
    T.ppf(),
    T.state_space(2),
    T.decentralized(T.gain()),
    T.plant_parameter("c", 0.1, 1.0),
]
reveal_type(parts[0])
reveal_type(T.pid(integral=False) * T.notch(5.0, 50.0) + T.gain())
tuned = bc.tune(P, 1, 1, T.gain(), channels=[T.objective(), T.constraint(None, "z_tip_anti", 2.0)], n_starts=2)
reveal_type(tuned)
reveal_type(tuned.controller)
reveal_type((tuned.success, tuned.message, tuned.nit, tuned.elapsed))
reveal_type(tuned.certificate.active_peaks[0].omega)
reveal_type(bc.exceptions.ReductionWarning("said"))
reveal_type(bc.h2(P, 1, 1))
reveal_type(bc.lqr(plant, {"tip_left": 1.0}, np.eye(1)).gain)
reveal_type(bc.kalman(plant, np.eye(1), np.eye(1)).estimator)
reveal_type(bc.lqg(plant, None, np.eye(1), np.eye(1), np.eye(1), ["tip_left"], ["cradle"]).controller)
reveal_type(
    bc.synthesis.loop_transfer_recovery(plant, None, 1.0, 1.0, 1.0, noise_intensities=[1.0], omega_range=(0.1, 1.0))
)
K = bc.unscale_controller(d.scaled_controller)
reveal_type(K)
reveal_type(bc.lft(P, d.controller))
reveal_type(bc.reduce_controller(P, d, order=4))
Kd = bc.discretize(K, 0.002)
reveal_type(Kd)
reveal_type(bc.synthesis.select_channels(plant, "cradle", "tip_left"))
K_jolt, K_yaw, error = bc.synthesis.split_controller(m, K)
reveal_type(K_yaw)
reveal_type(bc.join_symmetric(m, K_jolt, K_yaw))
reveal_type(bc.write_controller(Kd, "suspension.c", control_limit=60.0))
reveal_type(bc.read_controller("suspension.json"))
reveal_type(bc.exchange.read_controller_metadata("suspension.json"))
reveal_type(bc.margins(yaw, K))
reveal_type(bc.bode(m, omega)["tip_left", "actuator_left"])
reveal_type(bc.nyquist(yaw, K).stable)
reveal_type(bc.step(yaw, 5.0).time)
reveal_type(bc.impulse(yaw, 5.0).plot())
reveal_type(bc.pzmap(yaw).zeros)
reveal_type(bc.compare({"margins": bc.margins(yaw, K), "loop": bc.feedback_loop(yaw, K)}).to_dict())
reveal_type(m.mode_shapes(3).names)
reveal_type(bc.feedback_loop(yaw, K))
reveal_type(bc.with_state_outputs(yaw))
reveal_type(bc.with_state_outputs(family).names)
reveal_type(bc.analysis.sample_plant(yaw, 0.02, delay=0.01))
reveal_type(bc.analysis.sampled_data_norm(yaw, bc.discretize(K, 0.02)))
reveal_type(bc.analysis.closed_loop_response(yaw.frequency_response(omega), K))
reveal_type(bc.robust_stability(family, K).proved)
speeds = bc.hub_beam(model="sfoam", modes=2)
turning = speeds.family(hub_speed=(0.0, 6.0), tip_mass=(0.0, 0.1))
drive = bc.gain_schedule([bc.lqr(speeds.linearize(w), 1.0, 1.0).controller for w in (0.0, 6.0)], [0.0, 6.0])
reveal_type(turning)
reveal_type(drive.to_nlsys(references="hub_speed"))
reveal_type(drive.at(3.0))
reveal_type(bc.robust_stability(turning, drive).proved)
reveal_type(bc.studies.MachineDesign)
reveal_type(bc.analysis.robust_stability_margin(family, K).lower_bound)
reveal_type(bc.worst_case(family, K, ["actuator_anti"], ["tip_anti"]).worst_norm)
try:
    exact = bc.analysis.nyquist_stability(lambda w: bc.exact_frequency_response(p, w), K, plant_poles=[-1.0])
    reveal_type(exact)
except bc.exceptions.SynthesisError as refused:
    reveal_type(refused)

# simulation
friction = bc.CoulombFriction(8.0)
run = bc.simulate_loop(m, Kd, motion.time, {"actuator_left": motion.left}, sample_time=0.002, friction=friction)
reveal_type(run)
reveal_type(run["tip_left"])
reveal_type(run.plot())
reveal_type((run.success, run.message))
reveal_type(run.to_pandas())
reveal_type(bc.forced_response(m, motion.time, {"actuator_left": motion.left}))

# studies
for name in bc.studies.design_names():
    reveal_type(bc.studies.load_design(name))
scene = bc.studies.FieldScenario(road_class="D")
reveal_type(bc.studies.evaluate_suspension("passive", scene, p).spray.cv)
reveal_type(bc.studies.SuspensionDesign("mine", "a passive one").evaluate(scene).active.spray.cv)
reveal_type(bc.studies.SlewDesign)
reveal_type(bc.studies.MachineDesign("mine", "of my own", m, K).evaluate().after.peak)
swept = bc.sweep(bc.spray_boom, parameters={"spring_stiffness": [900.0, 1100.0]})
reveal_type(swept)
reveal_type(swept["value"])
reveal_type(bc.structure.FiniteElements(4))
reveal_type(bc.studies.suspension.suspension_model(p))
draw = bc.plotting.figure_of  # its type names options, which are open
reveal_type(bc.slew.input_shaper)
reveal_type(bc.simulation.TimeVaryingController)
packages = (
    bc.analysis,
    bc.boom,
    bc.exchange,
    bc.identification,
    bc.reduction,
    bc.rotating_beam,
    bc.simulation,
    bc.synthesis,
    bc.tuning,
)

# the hub-beam
q = bc.HubBeamParameters(tip_mass=0.1)
h = bc.hub_beam(q, model="sfoam", modes=5)
reveal_type(h.campbell([0.0, 1.0, 4.0]).critical_speeds[0].hub_speed)
reveal_type(h.mode_shapes(3).shapes)
reveal_type(h)
reveal_type(bc.hub_beam(q, model="geometrically-exact"))
reveal_type(bc.hub_beam(q, accuracy=0.1, maneuver=bc.spin_up(1.0, 2.0), timepts=[1.0, 3.0]))
reveal_type(h.eigenfrequencies_hz(hub_speed=1.0, coupled=False))
reveal_type(h.divergence_speed())
r = h.simulate(bc.spin_up(final_speed=2.8, duration=30.0), np.linspace(0, 60, 601))
reveal_type(r)
reveal_type(r.tip_displacement)
reveal_type(h.simulate(bc.sine_torque(amplitude=200.0, period=10.0, duration=10.0), [0.0, 1.0]).energy)
for maneuver in (
    bc.maneuvers.hold_angle(),
    bc.maneuvers.free_hub(),
    bc.maneuvers.applied_torque(np.sin),
    bc.maneuvers.prescribed_motion(np.sin, np.cos, np.sin),
):
    reveal_type(h.simulate(maneuver, [0.0, 1.0]).hub_angle)
reveal_type(h.to_nlsys())
reveal_type(h.linearize(hub_speed=1.0))
sensor = bc.BeamSensor("gauge", "strain", position=0.5, height=0.01)
reveal_type(sensor)
reveal_type(h.linearize(sensors=[sensor]))
reveal_type(bc.simulate_loop(h, None, [0.0, 0.1], None, sample_time=0.1, sensors=[sensor]))
try:
    slew = bc.optimal_slew(h, angle=np.pi / 2, torque_limit=200.0)
    reveal_type(slew)
    reveal_type(slew.duration)
    reveal_type(slew.certificate)
    reveal_type((slew.success, slew.message, slew.nit, slew.elapsed))
    reveal_type(slew.torque_profile.switching_times)
    reveal_type(slew.plot())
    tracked = slew.track(torque_limit=250.0)
    reveal_type(tracked)
    reveal_type(tracked.simulate(h.with_tip_mass(0.2)))
    reveal_type(tracked.monte_carlo(256, stiffness=0.1, tip_mass=(0.0, 0.2)).residual_vibration)
    planned: bc.slew.SlewResult = bc.optimal_slew(h.linearize(), 1.0, 200.0)
    reveal_type(planned.residual_energy)
except bc.exceptions.SlewError as refused:
    reveal_type(refused)
