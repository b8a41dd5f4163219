"""Derivatives that the tuning of controllers rests on, against differences of the values themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.synthesis.plants.channels import places
from boomctl.synthesis.plants.partition import partition
from boomctl.tuning.hessian import peak_hessian
from boomctl.tuning.point import Point
from boomctl.tuning.problem import Closed, Problem, ScaledPlant, ports_of
from boomctl.tuning.responses import Paths, Response, grid, peaks
from boomctl.tuning.solver.bundle import least
from boomctl.tuning.solver.descent import _weak_wolfe
from tests.profiles import examples
from tests.tuning.test_tune import swing

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
    "shared": T.decentralized(T.lead(), shared_parameters=True),
    "decentralized": T.decentralized(("y[3]", "u[3]", T.lead()), (["y[3]", "y[4]"], "u[4]", T.gain())),
}


def problem_of(structure, channels, seed=2, **bounds):
    """Return two random stable plants and a structure between their two measurements and two controls."""
    plants = tuple(partition(swing(k), 2, 2) for k in (seed, seed + 1))
    scaled = tuple(ScaledPlant.of(plant) for plant in plants)
    return problem_between(plants, lambda values: scaled, structure, channels, **bounds)


def problem_between(plants, make, structure, channels, **bounds):
    """Return the problem of tuning a structure between the signals of plants, which ``make`` returns for numbers."""
    ports = ports_of(plants)
    free = structure.free(ports)
    ends = np.array([each.ends() for each in free])
    where = [places(plants[0], channel) for channel in channels]
    middle = ends.mean(axis=1) if np.isfinite(ends).all() else np.zeros(len(free))
    limits = {"fastest_pole": None, "max_gain": None, "min_damping_ratio": None, "min_decay_rate": None} | bounds
    return Problem(
        structure=structure,
        ports=ports,
        free=free,
        low=ends[:, 0],
        high=ends[:, 1],
        plants=make,
        count=len(plants),
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


def merit(point):
    """Return the value of what the search makes small, and its gradient."""
    value, gradient = point.merit(7.0)
    return value, gradient()


def abscissa(point):
    value, gradient = point.abscissa()
    return value, gradient()


def edge(point):
    """Return how near the edge of stability is, as a bound counts it, and its gradient."""
    worst = max(point.bounds, key=lambda piece: piece.value)
    assert worst.value == pytest.approx(np.log(0.5 / point.apart), rel=1e-9)
    return np.log(0.5 / point.apart), worst.gradient


ONE = T.objective("u[0]", "y[0]", norm="h2")  # finite with any controller


@pytest.mark.parametrize(
    ("read", "name", "seed", "channel", "bounds"),
    [
        *((merit, name, 1, T.objective(), {}) for name in STRUCTURES),
        *((merit, name, 1, ONE, {}) for name in STRUCTURES if name != "strictly proper"),
        (merit, "strictly proper", 1, T.objective(norm="h2"), {}),
        *((edge, name, 3, T.objective(), {"edge": 0.5}) for name in STRUCTURES),
        (merit, "free", 3, T.objective(), {"min_damping_ratio": 0.99}),
        (merit, "free", 3, T.objective(), {"min_decay_rate": 50.0}),
        (merit, "free", 3, T.objective(), {"fastest_pole": 1e-3}),
        (merit, "ppf", 3, T.objective(), {"fastest_pole": 1e-3}),  # of a pair of poles
        (merit, "free", 3, T.objective(), {"max_gain": 1e-3}),
        (abscissa, "free", 4, T.objective(), {}),  # two poles of about that size
        (abscissa, "free", 3, T.objective(), {"fastest_pole": 1e-3}),
    ],
)
def test_gradient_is_its_difference(read, name, seed, channel, bounds):
    problem = problem_of(STRUCTURES[name], [channel], **bounds)
    x = stable_point(problem, seed)
    assert read is edge or (Point(problem, x).excess > 0.0) == bool(bounds)
    wanted = differences(lambda x: read(Point(problem, x))[0], x)
    least = 1.0 if read is edge else 0.0
    assert read(Point(problem, x))[1] == pytest.approx(wanted, abs=WITHIN * max(np.abs(wanted).max(), least))


ENDS = {"all": (), "a column": ("u[0]",), "a row": (None, "y[0]"), "a wide one": (None, ["y[0]", "y[1]"])}


@pytest.mark.parametrize(("name", "ends"), [*((name, "all") for name in STRUCTURES), *(("free", e) for e in ENDS)])
def test_the_second_derivatives_of_a_peak_are_differences_of_its_gradient(name, ends):
    problem = problem_of(STRUCTURES[name], [T.objective(*ENDS[ends])])
    x = stable_point(problem, 2)
    point = Point(problem, x)
    piece = max(point.pieces(1e-6), key=lambda piece: piece.value)
    found = peak_hessian(point, piece)
    assert found == pytest.approx(found.T, abs=1e-9 * np.abs(found).max())
    wanted = differences(lambda x: Point(problem, x).merit(1.0)[1](), x)
    assert found == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())  # the place of the peak is known to 1e-7


@examples(60)
@given(st.integers(0, 10_000), st.booleans())
def test_line_search_convex_function_meets_weak_wolfe(seed, fresh):
    """The step falls enough, and after it the function falls less steeply by a half."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    root, x, d = rng.normal(size=(n, n)), rng.normal(size=n), 10.0 ** rng.uniform(-3.0, 3.0) * rng.normal(size=n)

    def function(x):
        return float(
            0.5 * x @ root.T @ root @ x + np.sqrt(1.0 + x @ x)
        ), lambda: root.T @ root @ x + x / np.sqrt(1.0 + x @ x)

    value, slope = function(x)
    d = -d * np.sign(d @ slope())
    falling = float(d @ slope())
    point, found, gradient = _weak_wolfe(
        function, x, d, value, falling, -np.inf * np.ones(n), np.inf * np.ones(n), fresh
    )
    step = float(np.linalg.norm(point - x) / np.linalg.norm(d))
    assert found <= value + 1e-4 * step * falling * (1.0 - 1e-9)
    assert gradient @ d >= 0.5 * falling


def any_programme(rng):
    """Return a quadratic programme: Hessian, slope, rows and what they may come to."""
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 15))
    root = rng.normal(size=(n, n))
    return root @ root.T + 1e-3 * np.eye(n), rng.normal(size=n), rng.normal(size=(m, n)), rng.uniform(0.01, 1.0, m)


def programme_of_a_step(rng):
    """Return one with pieces nearly as high as the highest, little curvature, ends near and far."""
    n, k = int(rng.integers(2, 14)), int(rng.integers(2, 9))
    damping, slopes = 10.0 ** rng.uniform(-9, 2), rng.normal(size=(k, n))
    slopes /= np.sqrt((slopes**2).max(axis=0))
    below, root = np.append(0.0, 10.0 ** rng.uniform(-8, -1, k - 1)), rng.normal(size=(n, int(rng.integers(0, n + 1))))
    H, unit = np.zeros((n + 1, n + 1)), np.eye(n + 1)
    H[:n, :n] = 0.1 * root @ root.T + damping * np.eye(n)
    G = np.vstack([np.column_stack([slopes, -np.ones(k)]), unit[:n], -unit[:n]])
    return H, unit[n], G, np.concatenate([below, 10.0 ** rng.uniform(-11, 3, 2 * n)])


# of the last four, rounding holds residuals up: going on past it would spoil them
@pytest.mark.parametrize("seed", [*range(20), 365, 518, 653, 1247])
@pytest.mark.parametrize("draw", [any_programme, programme_of_a_step])
def test_quadratic_programme_meets_its_conditions(draw, seed):
    """Slopes balance, no row is exceeded, multipliers are not negative and act on rows that are met alone."""
    H, c, G, h = draw(np.random.default_rng(seed))
    y, z = least(H, c, G, h)
    assert np.abs(H @ y + c + G.T @ z).max() <= 1e-8
    assert (G @ y - h).max() <= 1e-8
    assert z.min() >= -1e-12
    assert np.abs(z * (G @ y - h)).max() <= 1e-9 * h.max()


def loop_of(A, seed):
    """Return a loop with given states and random ends, its rows and columns."""
    rng, n = np.random.default_rng(seed), len(A)
    B, C, D = rng.normal(size=(n, 3)), rng.normal(size=(2, n)), rng.normal(size=(2, 3))
    before, after, around = rng.normal(size=(n + 2, 4)), rng.normal(size=(5, n + 3)), rng.normal(size=(5, 4))
    return Closed(A, B, C, D, before, after, around), np.array([1, 0]), np.array([2, 0])


def states(kind):
    """Return states whose eigenvectors are independent, or not."""
    A = np.random.default_rng(1).normal(size=(5, 5)) - 4.0 * np.eye(5)
    return A if kind == "independent" else np.diag([-2.0] * 5) + np.diag([1.0] * 4, 1)


@pytest.mark.parametrize("kind", ["independent", "defective"])
def test_what_leads_through_a_loop_is_made_of_its_resolvent(kind):
    loop, rows, columns = loop_of(states(kind), 3)
    n, response = len(loop.A), Response.of(loop, columns, rows)
    assert response.A.ndim == (1 if kind == "independent" else 2)
    paths = Paths.of(response, loop, columns, rows)
    B, C, D = loop.part(columns, rows)
    enters, leaves = np.hstack([B, loop.before[:n]]), np.vstack([C, loop.after[:, :n]])
    beside = np.block([[D, loop.before[n + rows]], [loop.after[:, n + columns], loop.around]])
    omega = np.array([0.0, 0.7, np.inf, 13.0])
    for w, found in zip(omega, paths.passages(omega), strict=True):
        P = np.linalg.inv(1j * w * np.eye(n) - loop.A) if np.isfinite(w) else np.zeros((n, n))
        wanted = leaves @ P @ enters + beside
        assert found.U * found.values @ found.Vh == pytest.approx(wanted[:2, :2], abs=1e-12)
        assert found.left == pytest.approx(wanted[:2, 2:], abs=1e-12)
        assert found.right == pytest.approx(wanted[2:, :2], abs=1e-12)
        assert found.around == pytest.approx(wanted[2:, 2:], abs=1e-12)
        for power in (2, 3) if np.isfinite(w) else ():
            several = leaves @ np.linalg.matrix_power(P, power) @ enters
            assert paths.through_states(np.array([w]), power)[0] == pytest.approx(several, abs=1e-12)


@examples(40)
@given(st.integers(0, 10_000))
def test_peaks_are_no_lower_than_on_a_fine_grid_and_the_highest_is_so_in_any_window(seed):
    rng = np.random.default_rng(seed)
    rates, ratios = np.exp(rng.uniform(-1.0, 2.0, 3)), np.exp(rng.uniform(-5.0, -1.0, 3))
    A = np.zeros((6, 6))
    for k, (w, z) in enumerate(zip(rates, ratios, strict=True)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-z * w, w], [-w, -z * w]]
    loop, rows, columns = loop_of(A, seed)
    response = Response.of(loop, columns, rows)
    omega = grid(response.poles, np.zeros(0))
    values = response.largest(omega)
    (at, found), (there, highest) = (peaks(response, omega, values, window) for window in (0.1, 0.0))
    assert found[0] == pytest.approx(highest[0], rel=1e-12)
    assert (len(there), at[0]) == (1, pytest.approx(there[0], rel=1e-6))
    fine = [np.linalg.inv(1j * w * np.eye(6) - A) for w in np.geomspace(0.01, 100.0, 3000)]
    B, C, D = loop.part(columns, rows)
    assert found[0] >= max(np.linalg.norm(C @ P @ B + D, 2) for P in fine) * (1.0 - 1e-9)
    for w, value in zip(at, found, strict=True):
        P = np.linalg.inv(1j * w * np.eye(6) - A) if np.isfinite(w) else np.zeros((6, 6))
        assert value == pytest.approx(np.linalg.norm(C @ P @ B + D, 2), rel=1e-9)
        assert value >= 0.9 * found[0]
