"""Worst cases from both sides: bounds that nothing exceeds, near the worst that is found, and said where there are none."""

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.analysis.box.loops import BoxLoops
from boomctl.structure import AffineFamily, SecondOrderModel
from boomctl.structure.families import Slope
from boomctl.structure.matrices import Structure
from boomctl.structure.ports import Ports
from tests.analysis.loop_cases import Walls
from tests.profiles import examples
from tests.strategies import seeds

GRID = np.geomspace(1e-3, 1e5, 600)  # continuous: [rad/s]; sampled: tangents of half the angle on the unit circle


class Judged(Walls):
    """Masses between walls with up to two injection points, and signals chosen from all there are."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        super().__init__(rng, int(rng.integers(1, 4)))
        self.points = [str(x) for x in rng.permutation(["u", "y"])[: seed % 3]]
        inputs = ["push", *(f"{x}_injected" for x in self.points)]
        self.driven = [str(x) for x in rng.permutation(inputs)[: rng.integers(1, len(inputs) + 1)]]
        self.judged = [str(x) for x in rng.permutation(["y", "z", "u"])[: rng.integers(1, 4)]]

    def gain(self, factors):
        """Return the largest singular value of the loop over all frequencies, on finer and finer grids."""
        grid, values = GRID, np.zeros(1)
        for _ in range(4):
            at = 1j * grid if self.K.isctime() else (1.0 + 1j * grid) / (1.0 - 1j * grid)
            values = np.linalg.svd(self.responses(factors, at, self.driven, self.judged), compute_uv=False)[:, 0]
            top = int(np.clip(values.argmax(), 1, len(grid) - 2))
            grid = np.geomspace(grid[top - 1], grid[top + 1], 30)
        return float(values.max())

    def rms(self, factors):
        """Return the H2 norm by quadrature over frequency."""
        if self.K.isctime():
            grid = np.geomspace(1e-5, 1e6, 4_000)
            G = self.responses(factors, 1j * grid, self.driven, self.judged)
            return float(np.sqrt(np.trapezoid((np.abs(G) ** 2).sum(axis=(1, 2)) * grid / np.pi, np.log(grid))))
        circle = np.exp(1j * np.pi * (np.arange(4_000) + 0.5) / 4_000)
        G = self.responses(factors, circle, self.driven, self.judged)
        return float(np.sqrt((np.abs(G) ** 2).sum(axis=(1, 2)).mean()))

    def worst(self, **options):
        return bc.worst_case(
            self.family, self.K, self.driven, self.judged, delay=self.delay, injection_points=self.points, **options
        )

    def anywhere(self, count):
        """Return the parameters of points drawn."""
        return 1.0 + (self.family.high - 1.0) * self.rng.uniform(-1.0, 1.0, (count, self.size))


@pytest.mark.parametrize("numbers", [[1], pytest.param([0, *range(2, 60)], marks=pytest.mark.slow)])
def test_worst_case_bounds_the_box_and_is_attained(numbers):
    """Of continuous loops, and at every third seed a sampled one, which takes longer."""
    for case in [*map(Judged, numbers), *(Judged(n).sampled() for n in numbers if n % 3 == 1)]:
        tolerance = 1e-2 if case.points else 1e-3
        found = case.worst(rtol=tolerance)
        assert found.upper_bound < np.inf, found.message
        here = case.gain([*found.worst_values.values()])
        assert found.worst_norm.lower_bound * (1.0 - 1e-6) <= here <= found.worst_norm.lower_bound * (1.0 + 1e-6)
        assert max(map(case.gain, case.anywhere(20))) <= found.upper_bound
        assert (
            found.worst_norm.lower_bound
            <= found.upper_bound
            <= found.worst_norm.lower_bound * (1.0 + 1.001 * tolerance)
        )


@pytest.mark.parametrize("sampled", [pytest.param(False, marks=pytest.mark.slow), True])
def test_worst_h2_norm_with_injection_is_attained(sampled):
    for seed in (1, 2):
        case = Judged(seed).sampled() if sampled else Judged(seed)
        case.judged = ["y", "z"]
        found = case.worst(norm="h2")
        assert case.rms([*found.worst_values.values()]) == pytest.approx(found.worst_norm.value, rel=1e-4)
        assert max(map(case.rms, case.anywhere(4))) <= found.worst_norm.value * (1.0 + 1e-4)


def test_robust_stability_checks_injection_points_alone():
    case = Judged(1)
    found = bc.robust_stability(case.family, case.K, injection_points=["y", "u"])
    assert found == bc.robust_stability(case.family, case.K)


@pytest.mark.slow
@pytest.mark.parametrize("judged", [["hub_speed", "tip_displacement"], ["torque"]])
def test_sampled_worst_case_with_uncertain_outputs(judged):
    """A measured speed feels the platform by the inverse of the mass; a hub's angle is an integrator that nothing feels."""
    beam = bc.hub_beam(bc.HubBeamParameters(damping_ratio=0.01), model="sfoam", modes=1)
    family = beam.family(hub_speed=(0.0, 4.0), tip_mass=(0.0, 0.1))
    drive = control.ss([], [], [], [[-100.0, -200.0]], 0.01, inputs=["hub_speed", "hub_angle"], outputs="torque")
    found = bc.worst_case(family, drive, "tip_force", judged, delay=0.004)
    assert found.relative_gap <= 1.001e-3
    for delta in ([1.0, -1.0], [0.3, 0.2]):
        loop = bc.feedback_loop(family.at(delta), drive, delay=0.004)
        assert bc.hinf_norm(bc.synthesis.select_channels(loop, "tip_force", judged)).lower_bound <= found.upper_bound
    brake = control.ss([], [], [], [[-100.0]], 0.01, inputs="hub_speed", outputs="torque")
    assert bc.robust_stability(family, brake, delay=0.004).proved


@pytest.mark.slow
def test_sampled_worst_case_of_strong_dependence_raises():
    def make(values):
        return SecondOrderModel(
            np.eye(1), [[2.0]], [[1e8 * values["stiffness"]]], {"push": [1.0], "u": [1.0]}, {"y": [1.0]}
        )

    family = AffineFamily.from_function({"stiffness": (0.5, 1.5)}, make)
    still = control.ss([], [], [], [[-1.0]], 0.1, inputs="y", outputs="u")
    found = bc.worst_case(family, still, "push", "y")
    assert found.upper_bound == np.inf
    assert found.message.startswith("the sampled loop changes too fast over the box")
    verdict = bc.robust_stability(family, still)
    assert not verdict.proved
    assert verdict.destabilizing_values is None
    assert "too fast" in verdict.message


def loops_with_speeds(rng, half):
    """Return a family all states of which are measured, and a controller with states of its own that reads them."""
    family = bc.with_state_outputs(Walls(rng, int(rng.integers(1, 4))).family)
    read = [name for name in family.nominal.output_labels if name not in ("y", "z")]
    size = int(rng.integers(0, 3))
    A = -rng.uniform(1.0, 9.0) * np.eye(size) + 0.3 * rng.standard_normal((size, size))
    B, C, D = (rng.standard_normal(shape) for shape in ((size, len(read)), (1, size), (1, len(read))))
    return family, control.ss(A, B, C, D, inputs=read, outputs="u"), ["push"], ["y", "z"]


def loops_with_speeds_of_platform(rng, half):
    """Return a half of the boom whose speeds, relative to a platform that moves it, are measured."""
    family = bc.with_state_outputs(bc.boom_family(subsystem=half))
    end = {"jolt": "sym", "yaw": "anti"}[half]
    read = [name for name in family.nominal.output_labels if name.endswith("_x2")] + [f"stroke_{end}"]
    size = len(read)
    B, C, D = (rng.standard_normal(shape) for shape in ((2, size), (1, 2), (1, size)))
    K = control.ss(-3.0 * np.eye(2), B, 9.0 * C, 5.0 * D, inputs=read, outputs=f"suspension_{end}")
    return family, K, [f"actuator_{end}"], [f"stroke_{end}", f"tip_{end}"]


def loops_with_filters(rng, half):
    """Return a half of the boom with accelerometers behind filters, and a controller that reads one."""
    family = bc.boom_family(subsystem=half, accelerometer_bandwidth_hz=20.0)
    end = {"jolt": "sym", "yaw": "anti"}[half]
    signals = {"inputs": [f"stroke_{end}", f"tip_acceleration_{end}"], "outputs": f"suspension_{end}"}
    K = control.ss(-40.0 * np.eye(2), np.diag([3.0, 1.0]), -rng.uniform(1.0, 9.0, (1, 2)), [[-2.0, -0.5]], **signals)
    return family, K, [f"actuator_{end}"], [f"tip_{end}", f"tip_acceleration_{end}"]


def loops_with_feedthrough(rng, half):
    """Return a family whose outputs feel all inputs at once, and a controller with signals injected at both of its ends."""
    walls = Walls(rng, int(rng.integers(1, 4)))
    ports, E = walls.family.nominal.ports, np.zeros((3, 2, 2))
    E[0] = 0.5 * rng.standard_normal((2, 2))
    nominal = SecondOrderModel.of(walls.family.nominal.structure, replace(ports, E=E))
    return replace(walls.family, nominal=nominal), walls.K, ["u_injected", "push", "y_injected"], ["u", "z", "y"]


@pytest.mark.parametrize(
    ("make", "half"),
    [
        (loops_with_speeds, None),
        (loops_with_feedthrough, None),
        (loops_with_speeds_of_platform, "yaw"),
        (loops_with_filters, "jolt"),
        (loops_with_filters, "yaw"),
    ],
)
@examples(40)
@given(seed=seeds)
def test_loops_of_the_proof_are_those_closed_by_name(make, half, seed):
    rng = np.random.default_rng(seed)
    family, K, inputs, outputs = make(rng, half)
    (loops,) = BoxLoops.of(family, K).parts(inputs, outputs)
    points = [name.removesuffix("_injected") for name in inputs if name.endswith("_injected")]
    for delta in rng.uniform(-1.0, 1.0, (2, family.nparameters)):
        closed = bc.synthesis.select_channels(bc.feedback_loop(family.at(delta), K, points), inputs, outputs)
        for omega in (0.5, 3.0, 20.0, 150.0):
            wanted = closed(1j * omega, squeeze=False)
            here = loops.at(delta).response(np.array([omega]))[:, :, 0]
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
        ports = Ports.of_forces(("u", "w"), np.eye(2), ("y", "a"), lines)
        return SecondOrderModel.of(structure, replace(ports, bandwidths=(None, 20.0)))

    family = AffineFamily.from_function({"stiffness": (0.9, 1.1)}, make)
    K = control.ss([[0.3]], [[1.0]], [[-0.05]], [[-0.05]], dt, inputs="y", outputs="u")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = bc.worst_case(family, K, "w", "a", delay=0.3 * dt)
        loop = bc.feedback_loop(family.at([0.0]), K, delay=0.3 * dt)["a", "w"]
        norm = bc.hinf_norm(loop)
    assert found.upper_bound < np.inf, found.message
    assert norm.certified
    largest = max(abs(complex(loop(np.exp(1j * angle)))) for angle in np.linspace(0.0, np.pi, 4001))
    assert largest <= found.nominal.upper_bound * (1.0 + 1e-9)
    assert found.nominal.lower_bound <= largest * (1.0 + 1e-5)


def test_routes_to_a_norm_agree_as_far_as_both_are_certified():
    """Each lower bound is less by its own rounding, which differs: of a hub-beam by two parts in a million."""
    family = bc.hub_beam(model="sfoam", modes=2).family(hub_speed=(0.0, 6.0))
    damper = control.ss([], [], [], [[-20.0]], 0.005, inputs="hub_speed", outputs="torque")
    found = bc.worst_case(family, damper, "disturbance_torque", "tip_displacement", max_cells=10)
    assert "more than max_cells = 10" in found.message
    assert found.upper_bound == np.inf


def test_where_there_is_no_bound_it_is_said_why():
    case = Walls(np.random.default_rng(1), 2)
    family, K = case.family, case.K
    assert bc.worst_case(family, K, "push", "z", rtol=None).message == "not requested"
    few = bc.worst_case(family, K, "push", "z", max_cells=1, rtol=1e-6)
    assert few.upper_bound == np.inf
    assert "max_cells = 1" in few.message
    beam = bc.hub_beam(bc.HubBeamParameters(damping_ratio=0.01), model="sfoam", modes=1)
    brake = control.ss([], [], [], [[-100.0]], inputs="hub_speed", outputs="torque")
    turning = beam.family(hub_speed=(0.0, 2.0))
    assert "unobservable" in bc.worst_case(turning, brake, "tip_force", "tip_displacement").message  # the hub's angle
    assert "positions" in bc.worst_case(turning, brake, "tip_force", "hub_speed").message

    speed = np.array([[[0.0]], [[1.0]], [[0.0]]])
    ports = Ports.of_forces(("u", "w"), np.ones((1, 2)), ("v",), speed)

    def moving(values):
        return SecondOrderModel.of(Structure.of(np.eye(1), 0.1 * np.eye(1), values["k"] * np.eye(1), ("q",)), ports)

    sent = control.ss([], [], [], [[-0.2]], inputs="v", outputs="u")
    plants = AffineFamily.from_function({"k": (0.9, 1.1)}, moving)
    assert "no speed on at once" in bc.worst_case(plants, sent, "w", "u").message

    def beside(values):  # a mass on a spring, and one that floats by itself
        K, C = np.diag([4.0 * values["spring"], 0.0]), np.diag([0.1, 0.0])
        return SecondOrderModel(np.eye(2), C, K, {"push": [1.0, 0.0], "u": [1.0, 0.0]}, {"y": [1.0, 0.0]})

    damper = control.ss([], [], [], [[-1.0]], inputs="y", outputs="u")
    floating = bc.worst_case(AffineFamily.from_function({"spring": (0.9, 1.1)}, beside), damper, "push", "y")
    assert np.isfinite(floating.worst_norm.lower_bound)
    assert "unobservable" in floating.message
    unstable = control.ss([], [], [], [[50.0]], inputs="y", outputs="u")
    lost = bc.worst_case(family, unstable, "push", "z")
    assert (lost.worst_norm.lower_bound, lost.upper_bound) == (np.inf, np.inf)
    assert str(lost).startswith("WorstCase: loop unstable or undamped at p0 = 1, p1 = 1\n  The controller acts")


@pytest.mark.parametrize(("gain", "largest"), [(0.07, 24.370262), (0.12, np.inf)])
def test_a_proof_finds_what_the_search_passes_by(gain, largest):
    """The controller takes the damping where its narrow resonance meets the plant's, between the points of the search."""
    family = AffineFamily.from_function(
        {"k": (1.0, 9.0)},
        lambda p: SecondOrderModel([[1.0]], [[0.05]], [[p["k"]]], {"u": [1.0], "w": [1.0]}, {"y": [1.0]}),
    )
    A = [[0.0, 1.0], [-(2.72**2), -0.272]]
    K = control.ss(A, [[0.0], [1.0]], [[-gain, 0.0]], 0.0, inputs="y", outputs="u")
    searched, found = (bc.worst_case(family, K, "w", "y", rtol=rtol) for rtol in (None, 1e-3))
    assert searched.lower_bound < 20.2
    assert found.lower_bound == pytest.approx(largest, rel=1e-3)
    assert found.lower_bound <= largest <= found.upper_bound
    assert found.worst_values["k"] == pytest.approx(7.35, abs=0.4)
    assert (bc.robust_stability(family, K).destabilizing_values is None) == (largest < np.inf)


def test_worst_case_sums_terms_of_one_parameter():
    """A family may split the change by a parameter into several terms."""
    family = AffineFamily.from_function(
        {"gain": (0.5, 1.5)},
        lambda p: SecondOrderModel([[1.0]], [[0.4]], [[1.0]], {"u": [p["gain"]], "w": [1.0]}, {"y": [1.0]}),
    )
    ((power, slope),) = family.coefficients
    half = Slope(*(0.5 * getattr(slope, letter) for letter in "MCKBL"))
    K = control.ss([], [], [], [[-2.0]], inputs="y", outputs="u")
    whole, split = (bc.worst_case(f, K, "w", "y") for f in (family, replace(family, coefficients=((power, half),) * 2)))
    assert split.upper_bound == pytest.approx(whole.upper_bound, rel=1e-9)
    assert split.lower_bound == pytest.approx(whole.lower_bound, rel=1e-9)
