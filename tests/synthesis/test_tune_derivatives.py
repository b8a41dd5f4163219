"""Derivatives that the tuning of controllers rests on, against differences of the values themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.synthesis.plants.partition import partition
from boomctl.synthesis.tuning.certificate import places
from boomctl.synthesis.tuning.hessian import peak_hessian
from boomctl.synthesis.tuning.point import Point
from boomctl.synthesis.tuning.problem import Problem, ScaledPlant, ports_of
from boomctl.synthesis.tuning.solver.quadratic import least
from tests.profiles import examples
from tests.synthesis.test_tune import swing

T = bc.tunable
STEP = 2e-5  # of differences of fourth order: what they leave out goes with its fourth power
WITHIN = 1e-6  # of the largest entry: values are right to 1e-10 near the axis, and divided by the step
STRUCTURES = {
    "gain": T.gain(),
    "free": T.state_space(2),
    "strictly proper": T.state_space(2, strictly_proper=True),
    "pd": T.pid(integral=False),
    "lead": T.lead(),
    "ppf": T.ppf(),
    "notch": T.gain() * T.notch(),
    "series": T.gain() * T.state_space(1),
    "sum": T.gain() + T.ppf(),
    "shared": T.decentralised(T.lead(), shared=True),
    "decentralised": T.decentralised(("y[3]", "u[3]", T.lead()), (["y[3]", "y[4]"], "u[4]", T.gain())),
}


def problem_of(structure, channels, seed=2, **bounds):
    """Return two random stable plants and a structure between their two measurements and two controls."""
    plants = tuple(partition(swing(k), 2, 2) for k in (seed, seed + 1))
    ports = ports_of(plants)
    free = structure.free(ports)
    ends = np.array([each.ends() for each in free])
    where = [places(plants[0], channel) for channel in channels]
    scaled = tuple(ScaledPlant.of(plant) for plant in plants)
    middle = (
        np.where(np.isfinite(ends[:, 1]), ends.mean(axis=1), 0.0) if np.isfinite(ends).all() else np.zeros(len(free))
    )
    limits = {"fastest_pole": None, "gain_limit": None, "damping": None, "decay": None} | bounds
    return Problem(
        structure=structure,
        ports=ports,
        free=free,
        low=ends[:, 0],
        high=ends[:, 1],
        plants=lambda values: scaled,
        count=2,
        channels=tuple(channels),
        columns=tuple(np.array(c) for c, _ in where),
        rows=tuple(np.array(r) for _, r in where),
        order=structure.system(middle, ports).A.shape[0],
        **limits,
    )


def stable_point(problem, seed):
    """Return numbers at which the loops are stable: small ones, as the plants are."""
    rng = np.random.default_rng(seed)
    base = np.where(np.isfinite(problem.low) & np.isfinite(problem.high), rng.uniform(-0.5, 0.5, len(problem.low)), 0.0)
    for size in (0.3, 0.1, 0.03, 0.01, 0.003):
        x = problem.clipped(base + size * rng.normal(size=len(base)))
        if problem.order:  # states of the controller decay by themselves
            x = _decaying(problem, x)
        if Point(problem, x).stable:
            return x
    pytest.skip("no stable loop drawn")
    return None


def _decaying(problem, x):
    names = [each.name for each in problem.free]
    for i in range(problem.order):
        if f"A[{i}, {i}]" in names:
            x[names.index(f"A[{i}, {i}]")] -= 1.0
    return x


def differences(function, x):
    return np.array(
        [
            (8.0 * (function(x + d) - function(x - d)) - (function(x + 2.0 * d) - function(x - 2.0 * d)))
            / (12.0 * STEP)
            for d in STEP * np.eye(len(x))
        ]
    )


@pytest.mark.parametrize("name", STRUCTURES)
def test_slopes_of_a_controller_are_its_differences(name):
    problem = problem_of(STRUCTURES[name], [T.objective()])
    x = stable_point(problem, 0)
    slopes = problem.controller(x).slopes
    assert slopes == pytest.approx(
        differences(lambda x: problem.controller(x).value, x), abs=WITHIN * np.abs(slopes).max()
    )


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("name", STRUCTURES)
def test_the_gradient_of_the_largest_norm_is_its_difference(name, norm):
    if norm == "h2" and name != "strictly proper":
        norm_channels = [T.objective("u[0]", "y[0]", norm="h2")]
    else:
        norm_channels = [T.objective(norm=norm)]
    problem = problem_of(STRUCTURES[name], norm_channels)
    x = stable_point(problem, 1)
    gradient = Point(problem, x).merit(1.0)[1]()
    assert gradient == pytest.approx(
        differences(lambda x: Point(problem, x).merit(1.0)[0], x), abs=WITHIN * np.abs(gradient).max()
    )


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_second_derivatives_of_a_peak_are_differences_of_its_gradient(name):
    problem = problem_of(STRUCTURES[name], [T.objective()])
    x = stable_point(problem, 2)
    point = Point(problem, x)
    piece = max(point.pieces(1e-6), key=lambda piece: piece.value)
    found = peak_hessian(point, piece)
    assert found == pytest.approx(found.T, abs=1e-9 * np.abs(found).max())
    wanted = differences(lambda x: Point(problem, x).merit(1.0)[1](), x)
    assert found == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())  # the place of the peak is known to 1e-7


@pytest.mark.parametrize("bounds", [{"damping": 0.99}, {"decay": 50.0}, {"fastest_pole": 1e-3}, {"gain_limit": 1e-3}])
def test_gradients_of_bounds_are_their_differences(bounds):
    problem = problem_of(T.state_space(2), [T.objective()], **bounds)
    x = stable_point(problem, 3)
    assert Point(problem, x).excess > 0.0
    gradient = Point(problem, x).merit(7.0)[1]()
    wanted = differences(lambda x: Point(problem, x).merit(7.0)[0], x)
    assert gradient == pytest.approx(wanted, abs=WITHIN * np.abs(wanted).max())


def test_the_gradient_of_the_largest_real_part_is_its_difference():
    problem = problem_of(T.state_space(2), [T.objective()])
    x = stable_point(problem, 4)
    gradient = Point(problem, x).abscissa()[1]
    assert gradient == pytest.approx(
        differences(lambda x: Point(problem, x).abscissa()[0], x), abs=WITHIN * np.abs(gradient).max()
    )


@examples(60)
@given(st.integers(0, 10_000))
def test_a_quadratic_programme_meets_its_conditions(seed):
    """Slopes balance, no row is exceeded, multipliers are not negative and act on rows that are met alone."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 15))
    root = rng.normal(size=(n, n))
    H, c, G, h = (
        root @ root.T + 1e-3 * np.eye(n),
        rng.normal(size=n),
        rng.normal(size=(m, n)),
        rng.uniform(0.01, 1.0, m),
    )
    y, z = least(H, c, G, h)
    assert np.abs(H @ y + c + G.T @ z).max() <= 1e-7
    assert (G @ y - h).max() <= 1e-8
    assert z.min() >= -1e-12
    assert np.abs(z * (G @ y - h)).max() <= 1e-8


@pytest.mark.parametrize("name", STRUCTURES)
def test_the_slope_towards_the_edge_of_stability_is_its_difference(name):
    problem = problem_of(STRUCTURES[name], [T.objective()], edge=0.5)
    x = stable_point(problem, 3)
    point = Point(problem, x)
    worst = max(point.bounds, key=lambda piece: piece.value)
    assert worst.value == pytest.approx(np.log(0.5 / point.apart), rel=1e-9)
    wanted = differences(lambda x: np.log(0.5 / Point(problem, x).apart), x)
    assert worst.gradient == pytest.approx(wanted, abs=WITHIN * max(np.abs(wanted).max(), 1.0))
