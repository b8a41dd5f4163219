"""Derivatives that tuning rests on, against differences of the values themselves; its programs and peaks."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.tunable.structures import Physical
from boomctl.tuning.loops import Closed
from boomctl.tuning.plants import FamilyPlants, build_plants
from boomctl.tuning.point import ActiveFunction, Point
from boomctl.tuning.problem import DAMPING, DECAY, FASTEST_POLE, GAIN_LIMIT, Problem
from boomctl.tuning.responses import Response
from boomctl.tuning.solver.polish import Polish, least, peak_hessian
from tests.profiles import examples
from tests.tuning.test_tune import family, swing, weighed

T = bc.tunable
STEP = 2e-5  # of differences of fourth order: what they leave out goes with its fourth power
WITHIN = 1e-6  # of the largest entry: values are right to 1e-10 near the axis, and divided by the step
STRUCTURES = {
    "gain": T.gain(),
    "free": T.state_space(2),
    "strictly proper": T.state_space(2, strictly_proper=True),
    "pid": T.pid(),
    "ppf": T.ppf(2),
    "notch": T.gain() * T.notch(),
    "series": T.notch() * T.state_space(1),
    "sum": T.gain() + T.ppf() + T.plant_parameter("p", 1.0, 2.0),
    "shared": T.decentralized(T.pid() * T.notch(), shared_parameters=True),
    "decentralized": T.decentralized(("y[3]", "u[3]", T.ppf()), (["y[3]", "y[4]"], "u[4]", T.gain())),
}


def problem_of(name, channels, limits=None, seed=2):
    """Return the problem of a structure between two random stable plants of two measurements and two controls."""
    plants = build_plants([swing(k) for k in (seed, seed + 1)], 2, 2, ())
    return Problem.of(STRUCTURES[name], plants, tuple(channels), limits or {})


def stable_point(problem, seed, edge=None):
    """Return the loops at numbers that are stable: small ones, as the plants are; the controller's states decay."""
    rng = np.random.default_rng(seed)
    ends = np.array([each.ends() for each in problem.free]).T
    base = np.where(np.isfinite(ends).all(axis=0), rng.uniform(-0.5, 0.5, len(problem.free)), 0.0)
    for i, each in enumerate(problem.free):
        if each.name in (f"A[{k}, {k}]" for k in range(problem.order)):
            base[i] -= 1.0
    for size in (0.3, 0.1, 0.03, 0.01, 0.003):
        point = Point(problem, problem.clipped(base + size * rng.normal(size=len(base))), edge=edge)
        if point.stable:
            return point
    pytest.fail("no stable loop drawn")


def differences(function, x):
    return np.array(
        [
            (8.0 * (function(x + d) - function(x - d)) - (function(x + 2.0 * d) - function(x - 2.0 * d)))
            / (12.0 * STEP)
            for d in STEP * np.eye(len(x))
        ]
    )


@pytest.mark.parametrize("name", STRUCTURES)
@examples(20)
@given(seed=st.integers(0, 10_000))
def test_derivatives_of_any_controller_are_differences(name, seed):
    problem, rng = problem_of(name, [T.objective()]), np.random.default_rng(seed)
    matrix, x = problem.matrix, problem.clipped(rng.normal(size=len(problem.free)))
    weights = rng.normal(size=matrix.value(x).shape)
    wanted = differences(lambda x: matrix.value(x).ravel(), x)
    assert matrix.jacobian(x) == pytest.approx(wanted, rel=WITHIN, abs=WITHIN * np.abs(wanted).max(initial=1.0))
    bends = differences(lambda x: matrix.jacobian(x) @ weights.ravel(), x)
    assert matrix.hessian(x, weights) == pytest.approx(bends, rel=WITHIN, abs=WITHIN * np.abs(bends).max(initial=1.0))


def merit(point):
    """Return the value of what the search makes small, and its gradient."""
    value, gradient = point.merit(7.0)
    return value, gradient()


def abscissa(point):
    value, gradient = point.abscissa()
    return value, gradient()


def edge(point):
    """Return how near the edge of stability is, as a bound counts it, and its gradient."""
    worst = max((piece for piece in point.active_functions(1e-6) if piece.channel < 0), key=lambda piece: piece.value)
    assert worst.value == pytest.approx(np.log(0.5 / point.edge_distance), rel=1e-9)
    return np.log(0.5 / point.edge_distance), worst.gradient


@pytest.mark.parametrize(
    ("read", "name", "seed", "channel", "limits"),
    [
        *((merit, name, 1, T.objective(), {}) for name in ("free", "notch")),
        (merit, "ppf", 1, T.objective("u[0]", "y[0]", norm="h2"), {}),  # finite with any controller
        (merit, "strictly proper", 1, T.objective(norm="h2"), {}),
        (edge, "free", 3, T.objective(), {}),
        pytest.param(edge, "notch", 3, T.objective(), {}, marks=pytest.mark.slow),
        (merit, "free", 3, T.objective(), {DAMPING: 0.99}),
        (merit, "free", 3, T.objective(), {DECAY: 50.0}),
        (merit, "free", 3, T.objective(), {FASTEST_POLE: 1e-3}),
        pytest.param(
            merit, "ppf", 3, T.objective(), {FASTEST_POLE: 1e-3}, marks=pytest.mark.slow
        ),  # of a pair of poles
        (merit, "free", 3, T.objective(), {GAIN_LIMIT: 1e-3}),
        (abscissa, "free", 4, T.objective(), {}),  # two poles of about that size
        (abscissa, "free", 3, T.objective(), {FASTEST_POLE: 1e-3}),
    ],
)
def test_gradient_is_its_difference(read, name, seed, channel, limits):
    point = stable_point(problem_of(name, [channel], limits), seed, 0.5 if read is edge else None)
    assert read is edge or (point.excess > 0.0) == bool(limits)
    wanted = differences(lambda x: read(point.with_parameters(x))[0], point.x)
    least = 1.0 if read is edge else 0.0
    assert read(point)[1] == pytest.approx(wanted, abs=WITHIN * max(np.abs(wanted).max(), least))


ENDS = {"all": (), "a column": ("u[0]",), "a row": (None, "y[0]"), "a wide one": (None, ["y[0]", "y[1]"])}


# plants that a controller with an integrator makes stable are rare
PEAKS = [*(("free", e, 2) for e in ENDS), ("notch", "all", 2), ("decentralized", "all", 2), ("shared", "all", 19)]


@pytest.mark.parametrize(("name", "ends", "plants"), PEAKS)
def test_peak_hessian_matches_differences(name, ends, plants):
    point = stable_point(problem_of(name, [T.objective(*ENDS[ends])], seed=plants), 2)
    piece = max(point.active_functions(1e-6), key=lambda piece: piece.value)
    found = peak_hessian(point, piece)
    assert found == pytest.approx(found.T, abs=1e-9 * np.abs(found).max())
    wanted = differences(lambda x: point.with_parameters(x).merit(1.0)[1](), point.x)
    assert found == pytest.approx(wanted, abs=1e-4 * np.abs(wanted).max())  # the place of the peak is known to 1e-7


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

    tuned = Physical("p", -1.0, 1.0), Physical("q", -1.0, 1.0)
    plants = build_plants([make], 2, 2, tuned)
    assert plants.stages == ("plant parameters by polynomials of degree p 1, q 2",)
    structure = T.state_space(1, strictly_proper=norm == "h2") + tuned[0] + tuned[1]
    problem = Problem.of(structure, plants, (T.objective(norm="h2" if norm == "h2" else "hinf"),), {})
    x = 0.1 * rng.normal(size=len(problem.free))
    x[0] = -1.0
    return problem, x


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


@pytest.mark.parametrize("norm", ["hinf", pytest.param("h2", marks=pytest.mark.slow), "slowest pole"])
@examples(40)
@given(st.integers(0, 10_000))
def test_gradient_of_moving_plant_is_its_difference(norm, seed):
    problem, x = moving(seed, norm)
    point = Point(problem, x)

    def closed(x):
        plant = problem.plants.original(x[problem.physical])[0]
        return bc.lft(plant.system.statespace("P"), problem.lti(x).statespace("K"))

    slowest = np.sort(np.round(closed(x).poles().real, 9))[::-1]
    if not point.stable or slowest[0] - slowest[slowest < slowest[0]][0] < 0.01:  # another pole is soon as slow
        return
    piece = max(point.active_functions(1e-6), key=lambda p: p.value)
    gradient = point.abscissa()[1]() * problem.ports.rate if norm == "slowest pole" else piece.gradient

    def value(x):
        loop = closed(x)
        if norm == "hinf":
            return np.log(largest_gain(loop, piece.omega))
        return np.log(bc.h2_norm(loop).value) if norm == "h2" else loop.poles().real.max()

    for place, unit in enumerate(np.eye(len(x))):
        wanted = richardson(lambda h, unit=unit: value(x + h * unit))
        assert gradient[place] == pytest.approx(wanted, abs=1e-7 * np.abs(gradient).max())


def test_physical_peak_hessian_matches_differences():
    tuned = Physical("k", 2.0, 6.0), Physical("c", 0.1, 1.0)
    plants = FamilyPlants(family(), weighed, 1, 1, tuned).plants()
    assert plants.stages == ("plant parameters by polynomials of degree k 1, c 1",)
    problem = Problem.of(T.state_space(2) + tuned[0] + tuned[1], plants, (T.objective(),), {})
    x = 0.02 * np.random.default_rng(0).normal(size=len(problem.free))
    x[problem.physical] = 0.2
    x[[i for i, each in enumerate(problem.free) if each.name in ("A[0, 0]", "A[1, 1]")]] -= 1.0
    piece = max(Point(problem, x).active_functions(1e-6), key=lambda p: p.value)
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


def stepping(values):
    return control.ss([[-1.0 - round(values["c"])]], [[1.0]], [[1.0]], 0.0)


def growing(values):
    return control.ss(
        -np.eye(1 + round(values["c"])), np.ones((1 + round(values["c"]), 1)), np.ones((1, 1 + round(values["c"]))), 0.0
    )


@pytest.mark.parametrize("make", [turned, stepping, growing])
def test_tune_plant_that_is_no_polynomial_refused_with_remedy(make):
    with pytest.raises(ValueError, match=r"`P` must return plants .*polynomials of c.*states=\"coordinates\""):
        bc.tune(make, 0, 0, T.plant_parameter("c", 0.05, 5.0), n_starts=1)


def test_a_mass_is_a_polynomial_of_some_degree():
    """One over a mass is a series that ends after some terms, the sooner the narrower its range."""

    def make(values):
        m = values["m"]
        return control.ss([[0.0, 1.0], [-4.0 / m, -0.5 / m]], [[0.0], [1.0 / m]], [[1.0, 0.0]], 0.0)

    found = build_plants([make], 0, 0, (Physical("m", 1.0, 2.0),)).stages
    assert found == ("plant parameters by polynomials of degree m 18",)  # coefficients fall by (3 + sqrt(8)) each


def chain(values):
    """Return masses between springs and walls, displacements to forces."""
    m = np.array([values[name] for name in sorted(values)])
    n = len(m)
    K = 10.0 * np.eye(n) - 5.0 * np.eye(n, k=1) - 5.0 * np.eye(n, k=-1)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / m[:, None], -0.02 * K / m[:, None]]])
    return control.ss(A, np.vstack([np.zeros((n, n)), np.diag(1.0 / m)]), np.eye(n, 2 * n), 0.0)


def coupled(values):
    """Return two bodies with mass coupling."""
    M = np.diag([values["m1"], values["m2"]]) + 0.2
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-5.0 * np.linalg.inv(M), -0.1 * np.linalg.inv(M)]])
    return control.ss(A, np.eye(4)[:, 2:], np.eye(2, 4), 0.0)


def root_damped(values):
    """Return a unit mass with a damper of constant damping ratio."""
    k = values["k"]
    return control.ss([[0.0, 1.0], [-k, -0.1 * np.sqrt(k)]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)


@pytest.mark.parametrize(
    ("make", "low", "high", "names"),
    [
        (chain, 0.1, 2.0, ["m"]),
        (chain, 0.5, 2.0, ["m1", "m2"]),
        (chain, 0.9, 1.1, ["m1", "m2", "m3"]),
        pytest.param(coupled, 0.5, 2.0, ["m1", "m2"], marks=pytest.mark.slow),
        (root_damped, 1.0, 100.0, ["k"]),
    ],
)
def test_plants_of_smooth_functions_of_parameters(make, low, high, names):
    """Wide ranges need high degrees, and several parameters many plants, fewer if the matrices are sums over parameters."""
    plants = build_plants([make], 0, 0, tuple(Physical(name, low, high) for name in names))
    omega = np.geomspace(0.1, 30.0, 100)
    for x in np.random.default_rng(3).uniform(-1.0, 1.0, (20, len(names))):
        exact, found = plants.original(x)[0].system, plants.scaled(x, 0)[0].system
        wanted = exact.response(omega, quiet=True)
        assert np.abs(found.response(omega, quiet=True) - wanted).max() <= 1e-9 * np.abs(wanted).max()


def test_no_plant_is_made_once_it_is_a_polynomial():
    asked = []

    def make(values):
        asked.append(values["c"])
        return control.ss(
            [[0.0, 1.0], [-4.0, -values["c"]]], [[0.0], [1.0]], [[1.0, 0.0], [0.0, 0.3 * values["c"]]], 0.0
        )

    found = bc.tune(make, 0, 0, T.plant_parameter("c", 0.05, 5.0), n_starts=2)
    assert "plant parameters by polynomials of degree c 1" in found.certificate.stages
    assert len(asked) < 40  # to find the polynomial, to compare it, and to verify what was found


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


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("weight", [1.0, 1e2, 1e4, 1e6])
def test_no_other_step_is_lower_with_any_penalty_weight(weight, seed):
    """Of the highest of some planes, the weighted worst of others, and a quadratic form, at steps around the one returned."""
    rng, n, k = np.random.default_rng(seed), 6, 17
    values, slopes, limit = -0.1 * rng.uniform(size=k), rng.normal(size=(k, n)), np.arange(k) >= 12
    functions = [ActiveFunction(0, 0, 1.0, float(values[i]), slopes[i], bool(limit[i]), passage=None) for i in range(k)]
    box = SimpleNamespace(low=np.full(n, -0.3), high=np.full(n, 0.4))
    search = Polish(lambda x: SimpleNamespace(x=x, problem=box), np.zeros(n), weight=weight, gain=0.0)
    search._sizes, search._H = np.ones(n), np.diag(rng.uniform(size=n))

    def merit(d):
        there = values + slopes @ d
        forms = 0.5 * ((search._H.diagonal() + search._damping) * d * d).sum()
        return there[~limit].max() + weight * max(there[limit].max(), 0.0) + forms

    d = search._step(functions, float(values[~limit].max()))[0]
    others = d + 10.0 ** rng.uniform(-7, 0, (3000, 1)) * rng.normal(size=(3000, n))
    others = np.clip(others, box.low, box.high)
    assert (d >= box.low - 1e-12).all()
    assert (d <= box.high + 1e-12).all()
    assert merit(d) <= min(map(merit, others)) + 1e-9 * max(1.0, 1e-3 * weight)


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
    n, response = len(loop.A), Response(loop, rows, columns, np.zeros(0))
    assert response.A.ndim == (1 if kind == "independent" else 2)
    B, C, D = loop.B[:, columns], loop.C[rows], loop.D[np.ix_(rows, columns)]
    enters, leaves = np.hstack([B, loop.before[:n]]), np.vstack([C, loop.after[:, :n]])
    beside = np.block([[D, loop.before[n + rows]], [loop.after[:, n + columns], loop.around]])
    omega = np.array([0.0, 0.7, np.inf, 13.0])
    for w, found in zip(omega, response.passages(omega), strict=True):
        P = np.linalg.inv(1j * w * np.eye(n) - loop.A) if np.isfinite(w) else np.zeros((n, n))
        wanted = leaves @ P @ enters + beside
        assert found.U * found.values @ found.Vh == pytest.approx(wanted[:2, :2], abs=1e-12)
        assert found.left == pytest.approx(wanted[:2, 2:], abs=1e-12)
        assert found.right == pytest.approx(wanted[2:, :2], abs=1e-12)
        assert found.around == pytest.approx(wanted[2:, 2:], abs=1e-12)
        for power in (2, 3) if np.isfinite(w) else ():
            several = leaves @ np.linalg.matrix_power(P, power) @ enters
            assert response.through_states(np.array([w]), power)[0] == pytest.approx(several, abs=1e-12)


@examples(40)
@given(st.integers(0, 10_000))
def test_peaks_are_no_lower_than_on_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    rates, ratios = np.exp(rng.uniform(-1.0, 2.0, 3)), np.exp(rng.uniform(-5.0, -1.0, 3))
    A = np.zeros((6, 6))
    for k, (w, z) in enumerate(zip(rates, ratios, strict=True)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-z * w, w], [-w, -z * w]]
    loop, rows, columns = loop_of(A, seed)
    at, found = Response(loop, rows, columns, np.zeros(0)).peaks
    fine = [np.linalg.inv(1j * w * np.eye(6) - A) for w in np.geomspace(0.01, 100.0, 3000)]
    B, C, D = loop.B[:, columns], loop.C[rows], loop.D[np.ix_(rows, columns)]
    assert found[0] >= max(np.linalg.norm(C @ P @ B + D, 2) for P in fine) * (1.0 - 1e-9)
    for w, value in zip(at, found, strict=True):
        P = np.linalg.inv(1j * w * np.eye(6) - A) if np.isfinite(w) else np.zeros((6, 6))
        assert value == pytest.approx(np.linalg.norm(C @ P @ B + D, 2), rel=1e-9)
        assert value >= 0.9 * found[0]
