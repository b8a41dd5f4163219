"""Derivatives by physical parameters, against differences of high order of loops made and closed apart from the search."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.synthesis.plants.partition import partition
from boomctl.tunable.structures import Physical
from boomctl.tuning.hessian import peak_hessian
from boomctl.tuning.plants import FamilyPlants, made_plants
from boomctl.tuning.point import Point
from tests.profiles import examples
from tests.tuning.test_tune import family, weighed
from tests.tuning.test_tune_derivatives import problem_between

T = bc.tunable
WITHIN = 1e-7  # relative, of gradients
TUNED = Physical("p", -1.0, 1.0), Physical("q", -1.0, 1.0)


def problem_of(plants, structure, channels):
    """Return the problem of tuning plants for a structure and their physical parameters."""
    whole = structure + plants.physical[0] + plants.physical[1]
    return problem_between(plants.given(np.zeros(2)), plants.scaled, whole, channels)


def moving(seed, norm):
    """Return a plant that moves in all its matrices as two parameters do, and the problem of tuning it.

    Feedthroughs from controls to measurements included, and parameters that multiply each other; H2 norms want none from
    disturbances to performance.
    """
    rng = np.random.default_rng(seed)
    n, nw, nz = 3, 2, 2
    terms = 0.2 * rng.normal(size=(4, n + nz + 2, n + nw + 2))
    terms[0][:n, :n] -= 2.0 * np.eye(n)
    if norm == "h2":
        terms[:, n : n + nz, n : n + nw] = 0.0

    def make(values):
        S = terms[0] + values["p"] * terms[1] + values["q"] ** 2 * terms[2] + values["p"] * values["q"] * terms[3]
        return control.ss(S[:n, :n], S[:n, n:], S[n:, :n], S[n:, n:])

    plants = made_plants([make], 2, 2, TUNED)
    assert plants.stages == ("physical parameters by polynomials of degree p 1, q 2",)
    structure = T.state_space(1, strictly_proper=norm == "h2")
    problem = problem_of(plants, structure, [T.objective(norm="h2" if norm == "h2" else "hinf")])
    x = 0.1 * rng.normal(size=len(problem.free))
    x[0] = -1.0
    return make, problem, x


def richardson(function, step=1e-3, rounds=5):
    """Return a derivative at zero by differences extrapolated to a step of nothing."""
    table = []
    for k in range(rounds):
        h = step / 2**k
        table.append([(function(h) - function(-h)) / (2.0 * h)])
        for j in range(k):
            table[k].append((4 ** (j + 1) * table[k][j] - table[k - 1][j]) / (4 ** (j + 1) - 1))
    return table[-1][-1]


def largest_gain(loop, omega):
    """Return the largest singular value at a frequency, without what python-control's responses lose to rounding."""
    if not np.isfinite(omega):
        return np.linalg.norm(loop.D, 2)
    states = np.linalg.solve(1j * omega * np.eye(loop.nstates) - loop.A, loop.B)
    return np.linalg.norm(loop.C @ states + loop.D, 2)


@pytest.mark.parametrize("norm", ["hinf", "h2", "slowest pole"])
@examples(40)
@given(st.integers(0, 10_000))
def test_gradient_of_moving_plant_is_its_difference(norm, seed):
    make, problem, x = moving(seed, norm)
    point = Point(problem, x)

    def closed(x):
        plant = partition(make(problem.physical_values(x)), 2, 2)
        return bc.lft(plant.system.statespace("P"), problem.lti(x, plant.measurements, plant.controls).statespace("K"))

    slowest = np.sort(np.round(closed(x).poles().real, 9))[::-1]
    if not point.stable or slowest[0] - slowest[slowest < slowest[0]][0] < 0.01:  # another pole is soon as slow
        return
    piece = max(point.pieces(1e-6), key=lambda p: p.value)
    gradient = point.abscissa()[1]() * problem.ports.rate if norm == "slowest pole" else piece.gradient

    def value(x):
        loop = closed(x)
        if norm == "hinf":
            return np.log(largest_gain(loop, piece.omega))
        return np.log(bc.h2_norm(loop).value) if norm == "h2" else loop.poles().real.max()

    for place, unit in enumerate(np.eye(len(x))):
        wanted = richardson(lambda h, unit=unit: value(x + h * unit))
        assert gradient[place] == pytest.approx(wanted, abs=WITHIN * np.abs(gradient).max())


def test_second_derivatives_of_a_peak_by_two_parameters_are_differences_of_its_gradient():
    tuned = Physical("k", 2.0, 6.0), Physical("c", 0.1, 1.0)
    plants = FamilyPlants(family(), weighed, 1, 1, tuned).plants()
    assert plants.stages == ("physical parameters by polynomials of degree k 1, c 1",)
    problem = problem_of(plants, T.state_space(2), [T.objective()])
    x = 0.02 * np.random.default_rng(0).normal(size=len(problem.free))
    x[problem.physical] = 0.2
    x[[i for i, each in enumerate(problem.free) if each.name in ("A[0, 0]", "A[1, 1]")]] -= 1.0
    piece = max(Point(problem, x).pieces(1e-6), key=lambda p: p.value)
    found = peak_hessian(Point(problem, x), piece)
    for row, unit in zip(found, np.eye(len(x)), strict=True):
        wanted = [Point(problem, x + h * unit).merit(1.0)[1]() for h in (1e-4, -1e-4)]
        assert row == pytest.approx((wanted[0] - wanted[1]) / 2e-4, abs=1e-5 * np.abs(found).max())


def turned(values):
    """Return a damped oscillator whose states are others at each damping."""
    c = values["c"]
    A, B, C = np.array([[0.0, 1.0], [-4.0, -c]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0], [0.0, 0.3 * c]])
    by = np.sign(np.sin(40.0 * c)) * np.array([[1.0, c], [0.0, 1.0]])
    return control.ss(by @ A @ np.linalg.inv(by), by @ B, C @ np.linalg.inv(by), 0.0)


@pytest.mark.slow
def test_a_plant_whose_states_differ_is_tuned_by_differences_and_says_so():
    found = bc.tune(turned, 0, 0, T.plant_parameter("c", 0.05, 5.0), n_starts=2)
    assert "physical parameters by differences" in found.certificate.stages
    least = min(bc.hinf_norm(turned({"c": c})).lower_bound for c in np.linspace(0.05, 5.0, 300))
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

    found = bc.tune(make, 0, 0, T.plant_parameter("c", 0.05, 5.0), n_starts=2)
    assert "physical parameters by polynomials of degree c 1" in found.certificate.stages
    assert len(asked) < 30  # to find the polynomial, to compare it, and to verify what was found
