"""Calls of users' scripts with real arguments; `test_public_names` compares their signatures."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.structure import Assembly, Beam, BeamSegment, RigidBody, SecondOrderModel, prescribe_displacement

pytestmark = pytest.mark.slow
OMEGA = np.geomspace(0.6, 60.0, 20)


def test_spray_boom_calls():
    p = bc.BoomParameters()
    assert p.replace(spring_stiffness=900.0).spring_stiffness == 900.0
    assert p.scaled(length=14.0).length == 14.0
    m = bc.spray_boom(p, discretization="finite", elements=6)
    assert bc.spray_boom(spring_stiffness=900.0).M.shape == m.C.shape == m.K.shape
    for discretization, options in (
        ("high-order", {"elements": 4, "order": 6}),
        ("discrete-hermite", {"elements": 6}),
        ("discrete-geometric", {"elements": 6}),
    ):
        assert bc.spray_boom(p, discretization=discretization, **options).eigenfrequencies_hz(2).size == 2
    for excitation in ("displacement", "velocity", "acceleration", "force"):
        assert bc.spray_boom(excitation=excitation).input_labels == m.input_labels
    assert m.input_labels == ("actuator_left", "actuator_right", "suspension_left", "suspension_right", "cradle")
    assert m.output_labels == ("tip_left", "tip_right", "stroke_left", "stroke_right", "cradle_slip")
    assert {"tip_left_acceleration", "tip_right_acceleration"} <= set(
        bc.spray_boom(accelerometer_bandwidth_hz=20.0).output_labels
    )
    assert bc.spray_boom(accuracy=1e-3, max_frequency_hz=5.0).selection is not None
    H = m.frequency_response(OMEGA, inputs="cradle", outputs="tip_left")
    assert isinstance(H, control.FrequencyResponseData)
    assert m.to_statespace(inputs=["cradle"], outputs=["tip_left"]).input_labels == ["cradle"]
    jolt, yaw = bc.split_symmetric(m)
    assert (jolt.output_labels[0], yaw.output_labels[0]) == ("tip_sym", "tip_anti")
    exact = bc.exact_frequency_response(p, OMEGA, inputs="cradle", outputs="tip_left", excitation="displacement")
    assert isinstance(exact, control.FrequencyResponseData)
    assert bc.exact_eigenfrequencies_hz(p, count=5, damped=True).size == 5
    s = bc.sigma(yaw, omega=None, inputs=None, outputs=None, frequency_hz=None)
    assert s.certified
    assert s.sigma.shape[-1] == s.omega.size
    assert s.peak_omega > 0.0
    assert s.plot() is not None
    norm = bc.hinf_norm(yaw)
    assert norm.lower_bound <= float(norm) <= norm.upper_bound
    assert norm.certified
    assert norm.peak_omega == pytest.approx(s.peak_omega, rel=1e-3)
    assert bc.h2_norm(yaw.select("actuator_anti", "tip_anti")).lower_bound > 0.0


def test_field_calls():
    p = bc.BoomParameters()
    track = bc.iso_track("C", 60.0, seed=1)
    assert bc.bump_track(0.1, 1.0).left.max() == pytest.approx(0.1)
    motion = bc.platform_motion(track, speed=3.0)
    m = bc.spray_boom(p, nozzles=bc.nozzle_positions(p))
    names = [name for name in m.output_labels if name.startswith("nozzle")]
    moved = bc.forced_response(m, motion.time, {"actuator_left": motion.left, "actuator_right": motion.right}, names)
    dose = bc.spray_deposit(motion.time, np.array([moved[name] for name in names]), bc.nozzle_positions(p), 3.0)
    assert 0.0 < dose.cv < 1.0
    sweep = bc.sine_sweep(0.5, 2.0, 5.0, 0.01)
    run = bc.simulate_loop(
        bc.spray_boom(elements=4),
        None,
        sweep.time,
        {"actuator_left": sweep.left},
        sample_time=0.01,
        delay=0.0,
        control_limit=None,
        rate_limit=None,
        end_stop=None,
        quantization=None,
        anti_windup=True,
        friction=bc.CoulombFriction(8.0),
    )
    assert run["tip_left"].size == sweep.time.size


def test_machine_calls():
    g = SecondOrderModel(
        np.diag([1.0, 2.0, 3.0]),
        0.1 * np.eye(3),
        np.eye(3),
        force_inputs={"f1": [1.0, 0.0, 0.0], "f2": [0.0, 1.0, 0.0]},
        outputs={"y": [1.0, 1.0, 1.0]},
    )
    assert prescribe_displacement(g, ["f1"], hold=["f2"]).input_labels == ("f1",)
    ground = bc.structure.GROUND
    beam = Beam(
        "b",
        ground.at(0.0),
        bc.structure.fixed(),
        (0.0, 0.0),
        [BeamSegment(1.0, 2.0, 5.0)],
        bc.structure.FiniteElements(2),
    )
    assert (beam.at(1.0).x, beam.at_point(0.5, 0.0).x, beam.start.x, beam.end.x) == (1.0, 0.5, 0.0, 1.0)
    load = RigidBody("load", beam.end, bc.structure.fixed(), mass=1.0)
    push = bc.structure.Force("push", load.at(1.0, 0.0), "y")
    read = bc.structure.Output("y", load.at(1.0, 0.0), "y")
    assert Assembly((beam, load), forces=(push,), outputs=(read,)).assemble().output_labels == ("y",)


def test_hub_beam_calls():
    q = bc.HubBeamParameters(tip_mass=0.1)
    for model in ("tlam", "sfoam", "sfoam-consistent", "foam", "cfoam", "geometrically-exact"):
        h = bc.hub_beam(q, model=model, modes=2)
        assert h.eigenfrequencies_hz(hub_speed=1.0, coupled=False).size >= 2
    h = bc.hub_beam(q, model="sfoam", modes=3)
    assert bc.hub_beam(tip_mass=0.1).divergence_speed() > 0.0
    timepts = np.linspace(0.0, 2.0, 21)
    r = h.simulate(bc.spin_up(final_speed=2.8, duration=30.0), timepts)
    for name in ("tip_displacement", "hub_angle", "hub_speed", "torque", "energy", "angular_momentum"):
        assert getattr(r, name).shape == r.time.shape == (21,)
    assert r.small_deformation_until > 0.0
    assert h.simulate(bc.sine_torque(amplitude=200.0, period=10.0, duration=10.0), timepts).time.size == 21
    assert isinstance(h.to_nlsys(), control.NonlinearIOSystem)
    assert isinstance(h.linearize(hub_speed=0.0), control.StateSpace)
    assert h.campbell([0.0, 1.0]).plot() is not None
    assert h.family(hub_speed=(0.0, 6.0)).names == ("hub_speed",)
    slew = bc.optimal_slew(h, angle=np.pi / 2, torque_limit=200.0, objective="time")
    assert h.simulate(slew).time.size > 1
    assert slew.time[-1] == pytest.approx(slew.duration)
    assert slew.torque.shape == slew.hub_angle.shape == slew.tip_displacement.shape
    assert slew.torque_profile.switching_times.size > 0
    assert slew.certificate.terminal_error < 1e-3
    assert slew.plot() is not None
    assert slew.track(torque_limit=250.0).simulate()["hub_angle"][-1] == pytest.approx(np.pi / 2, abs=1e-2)
    for objective in ("effort", "jerk", "torque-rate", "tip"):
        found = bc.optimal_slew(h, angle_deg=45.0, torque_limit=200.0, objective=objective, duration=4.0)
        assert found.duration == pytest.approx(4.0)


def test_method_calls(tmp_path):
    yaw = bc.split_symmetric(bc.spray_boom())[1]
    system = yaw.select(["actuator_anti"], ["tip_anti"])
    for method in ("balanced", "singular-perturbation", "hankel", "modal", "second-order"):
        red = bc.reduce(system, order=6, method=method)
        assert red.order == 6
        assert red.error_norm > 0.0
    assert bc.reduce(system, max_error=0.5).error_bound <= 0.5
    assert bc.reduce(system, order=6, omega_range=(0.5, 20.0)).system.nstates == 6
    small = bc.reduce(yaw, order=6, method="balanced")
    d = bc.lqg(
        small, None, 1e-4, {"actuator_anti": 1e-4}, 1e-6, ["stroke_anti"], ["suspension_anti"], output_weight=1.0
    )
    scales = {"actuator_anti": 0.03, "suspension_anti": 150.0, "tip_anti": 0.2, "stroke_anti": 0.05}
    P = bc.generalized_plant(
        bc.scale_signals(yaw, scales),
        disturbances={"actuator_anti": 1.0},
        performance={"tip_anti": 1.0},
        effort={"suspension_anti": 0.5},
        noise={"stroke_anti": 0.1},
        measurements=["stroke_anti"],
        controls=["suspension_anti"],
    )
    d = bc.h_infinity(P)
    assert d.controller.nstates == d.scaled_controller.nstates
    assert d.closed_loop.noutputs == 2
    assert d.certificate.norm_bounds.upper_bound >= d.gamma
    assert bc.tune(P, structure=bc.tunable.gain(), n_starts=1, family=None).gamma >= d.gamma * 0.999
    K = d.controller
    assert bc.margins(yaw, K, delay=0.0)["suspension_anti"].gain_margin[1] > 1.0
    assert bc.feedback_loop(yaw, K, delay=0.0, injection_points=()).noutputs > 0
    family = bc.boom_family(subsystem="yaw")
    proof = bc.robust_stability(family, K, injection_points=())
    assert proof.proved or proof.message or proof.destabilizing_values
    w = bc.worst_case(family, K, ["actuator_anti"], ["tip_anti"], injection_points=(), rtol=0.1)
    assert w.lower_bound <= w.upper_bound
    assert set(w.worst_values) == set(family.names)
    assert bc.prove(bc.hinf_norm(small.system)).proved
    assert bc.compare({"LQG": bc.margins(yaw, K), "tuned": bc.margins(yaw, K)}).names == ("LQG", "tuned")
    assert bc.analysis.sample_plant(system, 0.01, delay=0.0).dt == 0.01
    for name in ("k.json", "k.mat", "k.c"):
        bc.write_controller(bc.discretize(K, 0.002), tmp_path / name, allow_subsystem=True)
    assert bc.read_controller(tmp_path / "k.json").dt == 0.002


def test_data_calls(tmp_path):
    rng = np.random.default_rng(0)
    mass = control.ss(
        [[0.0, 1.0], [-400.0, -0.8]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs=["force"], outputs=["place"]
    )
    force, step = rng.standard_normal(4000), 0.02
    moved = bc.forced_response(mass, step * np.arange(4000), {"force": force})["place"]
    H = bc.estimate_frequency_response({"force": force}, {"place": moved}, step)
    assert H.coherence.max() <= 1.0
    found = bc.identify(
        {"force": force},
        {"place": moved},
        step,
        modes=1,
        rigid_body=None,
        frequency_range_hz=(0.5, 8.0),
        quantity="displacement",
        intersample="bl",
    )
    assert found.fit_percent["place"] > 50.0
    assert found.modes[0].frequency_hz == pytest.approx(20.0 / 2.0 / np.pi, rel=1e-2)
    assert found.system.nstates >= 2
    assert found.family(probability=0.95).names
    assert bc.fit(
        bc.spray_boom, bc.spray_boom().eigenfrequencies_hz(3), free=["spring_stiffness"], initial=bc.BoomParameters()
    ).values
    checkpoint = tmp_path / "sweep.jsonl"
    swept = bc.sweep(_double, parameters={"x": [1.0, 2.0]}, checkpoint=checkpoint, n_jobs=1, backend=None)
    assert list(swept["value"]) == [2.0, 4.0]


def _double(x):
    return 2.0 * x
