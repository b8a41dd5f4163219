"""Worst cases from both sides: bounds that nothing exceeds, near the worst that is found, and said where there are none."""

import re
import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.box.level import DrivenLoops
from boomctl.lti.system import of
from boomctl.structure import AffineFamily, SecondOrderModel
from boomctl.structure.matrices import Structure
from boomctl.structure.ports import Ports
from tests.profiles import examples
from tests.strategies import seeds


def chain(rng, parameters):
    """Return a family of three masses between walls whose springs, masses and dampers are uncertain, and a damper on it."""
    springs, masses, dampers = rng.uniform(1.0, 9.0, 4), rng.uniform(0.5, 2.0, 3), rng.uniform(0.02, 0.2, 4)
    names = [f"p{k}" for k in range(parameters)]
    parts = [("spring", i) for i in range(4)] + [("mass", i) for i in range(3)] + [("damper", i) for i in range(4)]
    chosen = [parts[i] for i in rng.permutation(len(parts))[:parameters]]
    spread = rng.uniform(0.05, 0.3, parameters)

    def make(values):
        k, m, c = springs.copy(), masses.copy(), dampers.copy()
        for name, (kind, i) in zip(names, chosen, strict=True):
            {"spring": k, "mass": m, "damper": c}[kind][i] *= values[name]
        M, (C, K) = np.diag(m), (np.diag(x[:-1] + x[1:]) - np.diag(x[1:-1], 1) - np.diag(x[1:-1], -1) for x in (c, k))
        forces = {"push": np.array([1.0, 0.0, 0.0]), "u": np.array([0.0, 1.0, 0.0])}
        return SecondOrderModel(M, C, K, forces, {"y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]})

    family = AffineFamily.through({n: (1.0 - s, 1.0 + s) for n, s in zip(names, spread, strict=True)}, make)
    corner, strength = rng.uniform(5.0, 20.0), rng.uniform(0.05, 0.4)
    K = control.ss(-corner, corner, corner * strength, -corner * strength, inputs="y", outputs="u")
    return family, K


def norm_at(family, K, delta, inputs, outputs, delay=0.0):
    closed = bc.feedback_loop(family.at(delta), K, delay=delay)
    rows, columns = (
        [names.index(name) for name in wanted]
        for names, wanted in ((closed.output_labels, outputs), (closed.input_labels, inputs))
    )
    return bc.hinf_norm(closed[rows, columns])


def sampled(K, rng):
    """Return a controller as it runs in a computer, and its delay [s]."""
    dt = rng.uniform(0.02, 0.2)
    held = control.sample_system(K, dt, "tustin")
    late = rng.choice([0.0, rng.uniform(0.0, 1.0), 1.0, rng.uniform(1.0, 2.0)]) * dt
    return control.ss(held.A, held.B, held.C, held.D, dt, inputs="y", outputs="u"), float(late)


@pytest.mark.slow
@pytest.mark.parametrize("judged", [["hub_speed", "tip_displacement"], ["torque"]])
def test_outputs_that_parameters_change_are_bounded_too_in_sampled_loops(judged):
    """A measured speed feels the platform by the inverse of the mass; a hub's angle is an integrator that nothing feels."""
    beam = bc.hub_beam(bc.HubBeamParameters(damping_ratio=0.01), model="sfoam", modes=1)
    family = beam.family(hub_speed=(0.0, 4.0), tip_mass=(0.0, 0.1))
    drive = control.ss([], [], [], [[-100.0, -200.0]], 0.01, inputs=["hub_speed", "hub_angle"], outputs="torque")
    found = bc.worst_case(family, drive, "tip_force", judged, delay=0.004)
    assert found.gap <= 1.001e-3
    for delta in ([1.0, -1.0], [0.3, 0.2]):
        loop = bc.feedback_loop(family.at(delta), drive, delay=0.004)
        rows = [loop.output_labels.index(name) for name in judged]
        assert bc.hinf_norm(loop[rows, [loop.input_labels.index("tip_force")]]).lower <= found.upper_bound
    brake = control.ss([], [], [], [[-100.0]], 0.01, inputs="hub_speed", outputs="torque")
    assert bc.robust_stability(family, brake, delay=0.004).proved


@pytest.mark.slow
def test_a_sampled_loop_that_changes_too_fast_over_the_box_is_told_in_a_line():
    def make(values):
        return SecondOrderModel(
            np.eye(1), [[2.0]], [[1e8 * values["stiffness"]]], {"push": [1.0], "u": [1.0]}, {"y": [1.0]}
        )

    family = AffineFamily.through({"stiffness": (0.5, 1.5)}, make)
    still = control.ss([], [], [], [[-1.0]], 0.1, inputs="y", outputs="u")
    found = bc.worst_case(family, still, "push", "y")
    assert found.upper_bound == np.inf
    assert found.reason.startswith("the sampled loop changes too fast over the box")
    verdict = bc.robust_stability(family, still)
    assert not verdict.proved
    assert verdict.unstable_at is None
    assert "too fast" in verdict.reason


@examples(40)
@given(seed=seeds, parameters=st.integers(1, 3))
def test_controllers_may_read_speeds(seed, parameters):
    """The loops that are proved are those closed by name: all states measured, controllers with states of their own."""
    rng = np.random.default_rng(seed)
    family = bc.with_states(chain(rng, parameters)[0])
    read = [name for name in family.centre.outputs if name not in ("y", "z")]
    size = int(rng.integers(0, 3))
    K = control.ss(
        -rng.uniform(1.0, 9.0) * np.eye(size) + 0.3 * rng.standard_normal((size, size)),
        rng.standard_normal((size, len(read))),
        rng.standard_normal((1, size)),
        rng.standard_normal((1, len(read))),
        inputs=read,
        outputs="u",
    )
    loops = DrivenLoops.of(family, of(K, "K"), ["push"], ["y", "z"])
    for delta in rng.uniform(-1.0, 1.0, (2, parameters)):
        closed = bc.feedback_loop(family.at(delta), K)[[0, 1], [0]]
        for omega in (0.3, 2.0, 11.0):
            wanted = closed(1j * omega, squeeze=False)
            here = loops.at(delta).response(np.array([omega]))[:, :, 0]
            np.testing.assert_allclose(here, wanted, rtol=1e-7, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("parameters", [3, 4])
def test_three_and_four_parameters(parameters):
    family, K = chain(np.random.default_rng(5), parameters)
    found = bc.worst_case(family, K, "push", "z", tolerance=1e-2)
    assert found.norm.lower <= found.upper_bound <= 1.0101 * found.norm.lower


@pytest.mark.slow
def test_a_hardly_damped_box_is_told_of_in_a_line():
    def make(values):
        K = np.array([[9.0, -4.0], [-4.0, 4.0 * values["spring"]]])
        M = np.diag([1.0, values["mass"]])
        return SecondOrderModel(
            M, 1e-8 * K, K, {"push": [1.0, 0.0], "u": [0.0, 1.0]}, {"y": [1.0, 0.0], "z": [0.0, 1.0]}
        )

    family = AffineFamily.through({"spring": (1.2, 2.8), "mass": (0.8, 1.2)}, make)
    nothing = control.ss([], [], [], [[0.0]], inputs="y", outputs="u")
    found = bc.worst_case(family, nothing, "push", "z", tolerance=1e-4)
    assert found.upper_bound == np.inf
    assert re.search(r"about \de\+\d\d cells, more than max_cells = 60000", found.reason)


@pytest.mark.parametrize("half", ["jolt", "yaw"])
def test_the_loops_of_the_proof_are_those_of_the_boom_with_its_filters(half):
    family = bc.boom_family(half=half, accelerometer_bandwidth_hz=20.0)
    end = {"jolt": "sym", "yaw": "anti"}[half]
    rng = np.random.default_rng(3)
    signals = {"inputs": [f"stroke_{end}", f"tip_acceleration_{end}"], "outputs": f"suspension_{end}"}
    K = control.ss(-40.0 * np.eye(2), np.diag([3.0, 1.0]), -rng.uniform(1.0, 9.0, (1, 2)), [[-2.0, -0.5]], **signals)
    inputs, outputs = [f"actuator_{end}"], [f"tip_{end}", f"tip_acceleration_{end}"]
    loops = DrivenLoops.of(family, of(K, "K"), inputs, outputs)
    for delta in ([0.0, 0.0], [1.0, -1.0], [-0.3, 0.8]):
        closed = bc.feedback_loop(family.at(delta), K)
        for omega in (0.5, 3.0, 20.0, 150.0):
            wanted = closed(1j * omega, squeeze=False)[[closed.output_labels.index(n) for n in outputs]]
            wanted = wanted[:, [closed.input_labels.index(n) for n in inputs]]
            here = loops.at(np.array(delta)).response(np.array([omega]))[:, :, 0]
            np.testing.assert_allclose(here, wanted, rtol=1e-7, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.5, 2.0])
def test_a_filter_that_decays_within_a_sample_hides_no_norm(dt):
    """Its states hardly act on the others: scales by the state matrix alone grow without bound, and digits are lost."""

    def make(values):
        k = values["stiffness"]
        structure = Structure.of(np.eye(2), 0.3 * np.eye(2), np.array([[1.0 + k, -k], [-k, k]]), ("p", "q"))
        lines = np.zeros((3, 2, 2))
        lines[0, 0], lines[2, 1] = [1.0, 0.0], [0.0, 1.0]
        return SecondOrderModel.of(structure, Ports.of_forces(("u", "w"), np.eye(2), ("y", "a"), lines, (None, 20.0)))

    family = AffineFamily.through({"stiffness": (0.9, 1.1)}, make)
    K = control.ss([[0.3]], [[1.0]], [[-0.05]], [[-0.05]], dt, inputs="y", outputs="u")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = bc.worst_case(family, K, "w", "a", delay=0.3 * dt)
        norm = norm_at(family, K, [0.0], ["w"], ["a"], 0.3 * dt)
    assert found.upper_bound < np.inf, found.reason
    assert norm.certified
    loop = bc.feedback_loop(family.at([0.0]), K, delay=0.3 * dt)["a", "w"]
    largest = max(abs(complex(loop(np.exp(1j * angle)))) for angle in np.linspace(0.0, np.pi, 4001))
    assert largest <= found.nominal.upper * (1.0 + 1e-9)
    assert found.nominal.lower <= largest * (1.0 + 1e-5)


@examples(20)
@given(seed=seeds, parameters=st.integers(1, 3))
def test_worst_case_bounds_the_box_and_is_attained(seed, parameters):
    rng = np.random.default_rng(seed)
    family, K = chain(rng, parameters)
    outputs = [str(name) for name in rng.permutation(["y", "u", "z"])]
    found = bc.worst_case(family, K, "push", outputs, tolerance=1e-3)
    assert found.upper_bound < np.inf, found.reason
    assert found.norm.lower <= found.upper_bound <= found.norm.lower * (1.0 + 1.001e-3)
    for delta in rng.uniform(-1.0, 1.0, (10, parameters)):
        assert norm_at(family, K, delta, ["push"], outputs).lower <= found.upper_bound


def test_speeds_sent_on_at_once_are_not_judged():
    speed = np.array([[[0.0]], [[1.0]], [[0.0]]])
    ports = Ports.of_forces(("u", "w"), np.ones((1, 2)), ("v",), speed)

    def make(values):
        return SecondOrderModel.of(Structure.of(np.eye(1), 0.1 * np.eye(1), values["k"] * np.eye(1), ("q",)), ports)

    family = AffineFamily.through({"k": (0.9, 1.1)}, make)
    K = control.ss([], [], [], [[-0.2]], inputs="v", outputs="u")
    assert "no speed on at once" in bc.worst_case(family, K, "w", "u").reason


def test_routes_to_a_norm_agree_as_far_as_both_are_certified():
    """Each lower bound is less by its own rounding, which differs: of a hub-beam by two parts in a million."""
    family = bc.hub_beam(model="sfoam", modes=2).family(hub_speed=(0.0, 6.0))
    damper = control.ss([], [], [], [[-20.0]], 0.005, inputs="hub_speed", outputs="torque")
    found = bc.worst_case(family, damper, "disturbance_torque", "tip_displacement", max_cells=10)
    assert "more than max_cells = 10" in found.reason


def test_where_there_is_no_bound_it_is_said_why():
    family, K = chain(np.random.default_rng(1), 2)
    assert bc.worst_case(family, K, "push", "z", tolerance=None).reason == "none was asked for"
    few = bc.worst_case(family, K, "push", "z", max_cells=1, tolerance=1e-6)
    assert few.upper_bound == np.inf
    assert "max_cells = 1" in few.reason
    beam = bc.hub_beam(bc.HubBeamParameters(damping_ratio=0.01), model="sfoam", modes=1)
    brake = control.ss([], [], [], [[-100.0]], inputs="hub_speed", outputs="torque")
    turning = beam.family(hub_speed=(0.0, 2.0))
    assert "hides" in bc.worst_case(turning, brake, "tip_force", "tip_displacement").reason  # the hub's angle
    assert "places" in bc.worst_case(turning, brake, "tip_force", "hub_speed").reason

    def beside(values):  # a mass on a spring, and one that floats by itself
        K, C = np.diag([4.0 * values["spring"], 0.0]), np.diag([0.1, 0.0])
        return SecondOrderModel(np.eye(2), C, K, {"push": [1.0, 0.0], "u": [1.0, 0.0]}, {"y": [1.0, 0.0]})

    damper = control.ss([], [], [], [[-1.0]], inputs="y", outputs="u")
    floating = bc.worst_case(AffineFamily.through({"spring": (0.9, 1.1)}, beside), damper, "push", "y")
    assert np.isfinite(floating.norm.lower)
    assert "hides" in floating.reason
    unstable = control.ss([], [], [], [[50.0]], inputs="y", outputs="u")
    lost = bc.worst_case(family, unstable, "push", "z")
    assert (lost.norm.lower, lost.upper_bound) == (np.inf, np.inf)
    assert "unstable" in lost.reason
