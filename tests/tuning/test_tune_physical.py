"""Derivatives by physical parameters, against differences of high order of loops made and closed apart from the search."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.boom.families import scaled_boom
from boomctl.structure import AffineFamily
from boomctl.synthesis.plants.partition import partition
from boomctl.tunable.structures import Physical
from boomctl.tuning.hessian import peak_hessian
from boomctl.tuning.plants import FamilyPlants, made_plants
from boomctl.tuning.point import Point
from tests.profiles import examples
from tests.tuning.test_tune_derivatives import problem_between

T = bc.tunable
KINDS = {  # springs, dampers, masses, positions of the boom, and which half feels them
    "spring_stiffness": (550.0, 2200.0, "anti"),
    "cradle_damping": (20.0, 1000.0, "sym"),
    "hinge_damping": (2.0, 2000.0, "anti"),
    "boom_mass": (35.0, 60.0, "sym"),
    "youngs_modulus": (1.5e11, 2.1e11, "anti"),
    "spring_distance": (1.0, 1.7, "anti"),
    "mass": (0.8, 1.2, "anti"),
}
WITHIN = 1e-7  # relative, of gradients


def half(side, values):
    """Return half of the boom with some parameters changed; ``mass`` scales its beam."""
    values = dict(values)
    changed = replace(bc.BoomParameters(), **{k: v for k, v in values.items() if k != "mass"})
    boom = bc.spray_boom(
        scaled_boom(changed, mass=values.get("mass", 1.0)), elements=4, accelerometer_bandwidth_hz=20.0
    )
    return bc.split_symmetric(boom)[side == "anti"]


def weighed(side, plant):
    """Return the generalised plant of a half: platform and force to tip and force, filtered, so that all norms exist."""
    return bc.generalized_plant(
        plant,
        disturbances={f"actuator_{side}": bc.low_pass(0.1, 5.0), f"suspension_{side}": bc.low_pass(30.0, 50.0)},
        performance={f"tip_{side}": 10.0},
        effort={f"suspension_{side}": 0.02},
        measurements=[f"stroke_{side}", f"tip_acceleration_{side}"],
        controls=[f"suspension_{side}"],
    )


def made(name, states="coordinates"):
    """Return the plants that one parameter of the boom makes, and its end numbers."""
    low, high, side = KINDS[name]
    make = lambda values: weighed(side, half(side, values).to_statespace(states=states))  # noqa: E731
    return made_plants([make], 2, 1, (Physical(name, low, high),)), make


def problem_of(plants, structure, channels):
    """Return the problem of tuning plants for a structure."""
    return problem_between(plants.given(np.zeros(len(plants.physical))), plants.scaled, structure, channels)


def begun(problem, seed=0):
    """Return a controller that hardly acts but does, so that the loop is stable, and a parameter off the middle."""
    rng = np.random.default_rng(seed)
    drawn = rng.normal(size=len(problem.free))
    own = [i for i, each in enumerate(problem.free) if each.name.startswith("A[") and each.name[2] == each.name[5]]
    for size in (0.02, 0.005, 0.001, 0.0002):
        x = size * drawn
        x[own] -= 1.0
        x[problem.physical] = 0.2
        if Point(problem, x).stable:
            return x
    raise AssertionError("no stable loop drawn")


def richardson(function, x, step=0.02, rounds=5):
    """Return a derivative by differences extrapolated to a step of nothing."""
    table = []
    for k in range(rounds):
        h = step / 2**k
        table.append([(function(x + h) - function(x - h)) / (2.0 * h)])
        for j in range(k):
            table[k].append((4 ** (j + 1) * table[k][j] - table[k - 1][j]) / (4 ** (j + 1) - 1))
    return table[-1][-1]


def loop_at(problem, x, make, number):
    """Return the loop made by the user's function and closed by the controller, at another number of the parameter."""
    moved = x.copy()
    moved[problem.physical] = number
    plant = make(problem.physical_values(moved))
    K = problem.lti(x, tuple(plant.output_labels[-2:]), tuple(plant.input_labels[-1:]))
    return bc.close_loop(plant, K.statespace("K"))


def largest_gain(loop, omega):
    """Return the largest singular value at a frequency, without what python-control's responses lose to rounding."""
    if not np.isfinite(omega):
        return np.linalg.norm(loop.D, 2)
    states = np.linalg.solve(1j * omega * np.eye(loop.nstates) - loop.A, loop.B)
    return np.linalg.norm(loop.C @ states + loop.D, 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_gains_and_h2_norms_change_with_a_parameter_as_differences_say(name):
    plants, make = made(name)
    problem = problem_of(plants, T.state_space(2) + plants.physical[0], [T.objective(), T.objective(norm="h2")])
    x = begun(problem)
    point, place = Point(problem, x), problem.physical[0]
    assert "polynomials" in plants.path[0]
    omega = 2.5  # rad/s, beside the resonances: these are so sharp that differences would need steps like rounding
    found = point.pieces(1e-6, {(0, 0, omega)})
    pieces = [next(p for p in found if p.omega == omega), next(p for p in found if p.channel == 1)]

    def gain(number):
        return np.log(largest_gain(loop_at(problem, x, make, number), omega))

    wanted = [
        richardson(gain, x[place]),
        richardson(lambda number: np.log(bc.h2_norm(loop_at(problem, x, make, number)).value), x[place]),
    ]
    for piece, value in zip(pieces, wanted, strict=True):
        assert piece.gradient[place] == pytest.approx(value, rel=WITHIN, abs=1e-3 * WITHIN)


def test_the_slowest_pole_moves_as_differences_say():
    plants, make = made("hinge_damping")
    problem = problem_of(plants, T.state_space(2) + plants.physical[0], [T.objective()])
    x = begun(problem, 2)
    gradient = Point(problem, x).abscissa()[1]() * problem.ports.rate
    wanted = richardson(lambda number: float(loop_at(problem, x, make, number).poles().real.max()), x[-1])
    assert gradient[-1] == pytest.approx(wanted, rel=WITHIN)


def test_second_derivatives_of_a_peak_by_two_parameters_are_differences_of_its_gradient():
    family = AffineFamily.through(
        {"mass": (0.8, 1.2), "hinge_damping": (2.0, 2000.0)}, lambda values: half("anti", values)
    )
    tuned = Physical("mass", 0.8, 1.2), Physical("hinge_damping", 2.0, 2000.0)
    plants = FamilyPlants(family, lambda model: weighed("anti", model), 2, 1, tuned).plants()
    assert plants.path == ("physical parameters by polynomials of degree mass 14, hinge_damping 2",)
    problem = problem_of(plants, T.state_space(2) + tuned[0] + tuned[1], [T.objective()])
    x = begun(problem)
    piece = max(Point(problem, x).pieces(1e-6), key=lambda p: p.value)
    found = peak_hessian(Point(problem, x), piece)
    for row, unit in zip(found, np.eye(len(x)), strict=True):
        wanted = [Point(problem, x + h * unit).merit(1.0)[1]() for h in (1e-4, -1e-4)]
        assert row == pytest.approx((wanted[0] - wanted[1]) / 2e-4, abs=1e-5 * np.abs(found).max())


@examples(40)
@given(st.integers(0, 10_000))
def test_a_plant_that_moves_in_all_its_matrices_has_the_gradient_of_its_norm(seed):
    """Feedthroughs from controls to measurements included, and two parameters that multiply each other."""
    rng = np.random.default_rng(seed)
    n, nw, nz = 3, 2, 2
    terms = 0.2 * rng.normal(size=(4, n + nz + 2, n + nw + 2))
    terms[0][:n, :n] -= 2.0 * np.eye(n)

    def make(values):
        S = terms[0] + values["p"] * terms[1] + values["q"] ** 2 * terms[2] + values["p"] * values["q"] * terms[3]
        return control.ss(S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:])

    tuned = Physical("p", -1.0, 1.0), Physical("q", -1.0, 1.0)
    plants = made_plants([make], 2, 2, tuned)
    assert plants.path == ("physical parameters by polynomials of degree p 1, q 2",)
    problem = problem_of(plants, T.state_space(1) + tuned[0] + tuned[1], [T.objective()])
    x = 0.1 * rng.normal(size=len(problem.free))
    x[0] = -1.0
    point = Point(problem, x)
    if not point.stable:
        return
    piece = max(point.pieces(1e-6), key=lambda p: p.value)

    def value(x):
        plant = partition(make(problem.physical_values(x)), 2, 2)
        loop = bc.close_loop(
            plant.system.statespace("P"), problem.lti(x, plant.measurements, plant.controls).statespace("K")
        )
        return np.log(largest_gain(loop, piece.omega))

    for place, unit in enumerate(np.eye(len(x))):
        wanted = richardson(lambda h, unit=unit: value(x + h * unit), 0.0, 1e-3)  # 0.02 is too long for ten of 11,000
        assert piece.gradient[place] == pytest.approx(wanted, abs=WITHIN * np.abs(piece.gradient).max())


def turned(values):
    """Return a damped oscillator whose states are others at each damping."""
    c = values["c"]
    A, B, C = np.array([[0.0, 1.0], [-4.0, -c]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0], [0.0, 0.3 * c]])
    by = np.sign(np.sin(40.0 * c)) * np.array([[1.0, c], [0.0, 1.0]])
    return control.ss(by @ A @ np.linalg.inv(by), by @ B, C @ np.linalg.inv(by), 0.0)


@pytest.mark.slow
def test_a_plant_whose_states_differ_is_tuned_by_differences_and_says_so():
    found = bc.tune(turned, 0, 0, T.physical("c", 0.05, 5.0), starts=2)
    assert "physical parameters by differences" in found.certificate.path
    least = min(bc.hinf_norm(turned({"c": c})).lower for c in np.linspace(0.05, 5.0, 300))
    assert found.gamma <= least * (1.0 + 1e-9)


def test_a_parameter_that_steps_is_no_polynomial():
    def make(values):
        return control.ss([[-1.0 - round(values["c"])]], [[1.0]], [[1.0]], 0.0)

    assert made_plants([make], 0, 0, (Physical("c", 0.0, 4.0),)).series == (None,)


def test_no_plant_is_made_once_it_is_a_polynomial():
    asked = []

    def make(values):
        asked.append(values["c"])
        return control.ss(
            [[0.0, 1.0], [-4.0, -values["c"]]], [[0.0], [1.0]], [[1.0, 0.0], [0.0, 0.3 * values["c"]]], 0.0
        )

    found = bc.tune(make, 0, 0, T.physical("c", 0.05, 5.0), starts=2)
    assert "physical parameters by polynomials of degree c 1" in found.certificate.path
    assert len(asked) < 30  # to find the polynomial, to compare it, and to verify what was found
