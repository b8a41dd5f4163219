"""Fixed time and limits: closed forms and a programme, one optimum; a bound that does not know the mesh; limits kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.slew import replan
from boomctl.slew.effort import effort_on_mesh
from boomctl.slew.linear import guess_from, least_effort
from boomctl.slew.nlp.program import prepare, solve
from boomctl.slew.nlp.refinement import refined
from boomctl.slew.nlp.transcription import transcribe
from boomctl.slew.objectives import Units
from boomctl.slew.problem import Limits, slew_problem
from boomctl.slew.replay import prescribed_error, replayed
from tests.profiles import examples
from tests.slew.systems import rigid

pytestmark = pytest.mark.early

ANGLE, LIMIT = np.pi / 2, 200.0


@pytest.fixture(scope="module")
def beam():
    return bc.hub_beam(modes=1)


@examples(10)
@given(st.floats(0.2, 2.0), st.floats(1.3, 3.0))
def test_rigid_effort_is_the_closed_form(angle, stretch):
    inertia, limit = 50.0, 100.0
    duration = stretch * 2.0 * np.sqrt(inertia * angle / limit)
    slew = bc.optimal_slew(rigid(inertia), angle, limit, "effort", duration, intervals=80)
    free = 12.0 * (inertia * angle) ** 2 / duration**3  # torque 6 J angle / T^2 (1 - 2 t / T)
    if 6.0 * inertia * angle / duration**2 < limit:
        assert slew.cost == pytest.approx(free, rel=1e-3)
    assert slew.cost >= free * (1.0 - 1e-9)
    assert -1e-9 < slew.certificate.optimality_gap < 1e-3
    assert slew.certificate.optimality_status == "proved"


@examples(5)
@given(st.floats(0.2, 2.0), st.floats(0.5, 3.0))
def test_rigid_jerk_is_the_fifth_order_polynomial(angle, duration):
    slew = bc.optimal_slew(rigid(2.0), angle, 1e3, "jerk", duration, intervals=100)
    share = slew.time / duration
    assert slew.cost == pytest.approx(720.0 * angle**2 / duration**5, rel=1e-3)
    assert slew.hub_angle == pytest.approx(angle * share**3 * (10.0 - 15.0 * share + 6.0 * share**2), abs=1e-3 * angle)


@pytest.mark.slow
def test_each_objective_is_best_at_its_own(beam):
    slews = {
        name: bc.optimal_slew(beam, ANGLE, LIMIT, name, 3.6, intervals=60) for name in ("effort", "torque-rate", "tip")
    }
    rate = {name: np.sum(np.diff([0.0, *slew.torque_profile.start_values, 0.0]) ** 2) for name, slew in slews.items()}
    tip = {name: np.abs(slew.tip_displacement).max() for name, slew in slews.items()}
    effort = {name: slew.torque_profile.effort for name, slew in slews.items()}
    assert min(effort, key=lambda name: effort[name]) == "effort"
    assert min(rate, key=lambda name: rate[name]) == "torque-rate"
    assert min(tip, key=lambda name: tip[name]) == "tip"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed_limit", 0.7),
        pytest.param("tip_limit", 1.0, marks=pytest.mark.slow),
        pytest.param("moment_limit", 35.0, marks=pytest.mark.slow),
        pytest.param("torque_rate_limit", 800.0, marks=pytest.mark.slow),
    ],
)
def test_limits_are_kept_on_a_dense_replay(beam, name, value):
    slew = bc.optimal_slew(beam, ANGLE, LIMIT, intervals=100, **{name: value})
    t = np.linspace(0.0, slew.duration, 4001)
    r = beam.simulate(
        bc.maneuvers.applied_torque(slew.torque_profile, slew.torque_profile.breakpoints), t, rtol=1e-10, atol=1e-12
    )
    reached = {
        "speed_limit": np.abs(r.hub_speed).max(),
        "tip_limit": np.abs(r.tip_displacement).max(),
        "moment_limit": np.abs(r.states @ beam._root_moment_row).max(),
        "torque_rate_limit": slew.torque_profile.max_rate,
    }[name]
    assert reached <= value * (1.0 + 1e-6)
    assert np.abs(slew.torque).max() <= LIMIT * (1.0 + 1e-9)
    assert slew.certificate.constraint_violation <= 1e-6
    assert name in slew.certificate.active_constraints
    assert slew.duration > bc.optimal_slew(beam, ANGLE, LIMIT).duration


@pytest.mark.slow
@pytest.mark.parametrize("points", [1, 2])
def test_collocation_of_points_is_of_twice_that_order(beam, points):
    problem, errors = slew_problem(beam, ANGLE, Limits(LIMIT), "effort", 3.6), []
    for intervals in (40, 80):
        guess = guess_from(problem, least_effort(problem, 3.6, intervals).profile, intervals)
        found = solve(prepare(problem, intervals, points, guess), problem, guess, problem.limits)
        errors.append(prescribed_error(problem, replayed(problem, found.profile)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0 * points, abs=0.5)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_end_of_a_programme_is_met_to_the_tolerance(beam, tolerance):
    """On few intervals by more collocation points."""
    slew = bc.optimal_slew(beam, 1.0, LIMIT, "torque-rate", 4.0, intervals=20, rtol=tolerance)
    assert slew.certificate.prescribed_terminal_error <= tolerance


_PAYLOAD = {"tip_masses": (0.2,)}


@pytest.mark.parametrize(
    ("model", "objective", "limits", "ask"),
    [
        ("sfoam", "time", {"speed": 0.7}, {}),
        pytest.param("sfoam", "jerk", {"moment": 30.0}, {}, marks=pytest.mark.slow),
        ("sfoam", "tip", {"torque_rate": 500.0}, _PAYLOAD),
        ("foam", "effort", {}, {}),
        ("linear", "time", {}, {}),
        ("linear", "torque-rate", {}, {}),
    ],
)
def test_derivatives_of_a_programme_are_those_of_casadi(model, objective, limits, ask):
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), model=model, modes=1) if model != "linear" else rigid(50.0)
    problem = slew_problem(h, 1.0, Limits(LIMIT, **limits), objective, None if objective == "time" else 4.0, **ask)
    rng = np.random.default_rng(0)
    sizes = rng.uniform(0.5, 2.0, problem.start.size)
    t = transcribe(problem, 4, 2, Units(sizes, 100.0, 2.0, 0.3))
    x, p = 0.1 * rng.standard_normal(t.layout.size) + 0.5, rng.uniform(0.5, 2.0, t.nlp.size1_in(1))
    m = rng.standard_normal(t.nlp.size1_out(1))
    outputs, aux = ["grad:f:x", "jac:g:x", "triu:hess:gamma:x:x"], {"gamma": ["f", "g"]}
    known = t.nlp.factory("known", ["x", "p", "lam:f", "lam:g"], outputs, aux)
    gradient, jacobian, hessian = (np.array(each) for each in known(x, p, 0.7, m))
    found = t.derivatives
    ours = (found["grad_f"](x, p)[1], found["jac_g"](x, p)[1], found["hess_lag"](x, p, 0.7, m))
    for mine, true, share in zip(ours, (gradient, jacobian, hessian), (1e-9, 1e-12, 1e-12), strict=True):
        assert (np.abs(mine - true) <= np.maximum(1e-9 * np.abs(true), share * np.abs(true).max())).all()


def test_solving_again_with_other_data(beam):
    slew = bc.optimal_slew(beam, ANGLE, LIMIT, "effort", 3.6, intervals=60)
    again = replan(slew, angle=1.4, torque_limit=180.0)
    fresh = bc.optimal_slew(beam, 1.4, 180.0, "effort", 3.6, intervals=60)
    assert again.cost == pytest.approx(fresh.cost, rel=1e-7)
    assert again.hub_angle[-1] == pytest.approx(1.4, abs=1e-6)
    fastest = bc.optimal_slew(rigid(50.0), 1.0, 100.0)  # planned without a programme: planned once more
    assert replan(fastest, angle=1.4).duration == pytest.approx(np.sqrt(1.4) * fastest.duration, rel=1e-9)


def test_replanned_on_one_mesh_without_an_optimality_gap():
    again = replan(bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "jerk", 4.0, intervals=40), angle=1.1)
    assert again.certificate.optimality_gap == np.inf
    assert again.certificate.summary.endswith("no other mesh to estimate the optimality gap")
    assert "no optimality gap is estimated" in replan.__doc__


def _programme(h, angle, limits, duration, intervals, **ask):
    """The least effort that a programme finds on a mesh, which knows nothing of closed forms."""
    problem = slew_problem(h, angle, limits, "effort", duration, intervals=intervals, **ask)
    found = refined(problem, least_effort(problem, duration, intervals).profile)
    return found.profile, found.gap


def test_payloads_come_to_rest_together():
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), modes=1)
    masses = (0.0, 0.2)
    slew = bc.optimal_slew(h, ANGLE, LIMIT, "effort", 5.0, tip_masses=masses, intervals=60)
    for mass in (0.1, *masses):
        other = h.with_tip_mass(mass)
        r = other.simulate(
            bc.maneuvers.applied_torque(slew.torque_profile, slew.torque_profile.breakpoints),
            slew.duration + np.linspace(0, 3, 31),
        )
        assert np.abs(r.tip_displacement).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("ask", [{"speed_limit": 0.7}, {"objective": "tip", "duration": 3.6}])
def test_gap_is_cost_change_on_finer_mesh(beam, ask):
    fine, half = (bc.optimal_slew(beam, ANGLE, LIMIT, intervals=N, **ask) for N in (80, 40))
    costs = [slew.plan.solution.cost for slew in (fine, half)]
    change = abs(costs[0] - costs[1]) / costs[0]
    assert fine.certificate.optimality_gap == pytest.approx(change, rel=0.1)


@pytest.mark.parametrize(
    ("duration", "intervals", "other"), [(2.93, 40, 20), (2.915, 20, 40)], ids=["halved", "doubled"]
)
def test_gap_of_least_effort_to_finer_mesh(duration, intervals, other):
    h = bc.hub_beam(modes=1)  # whose least time is 2.909 s
    slew, compared = (bc.optimal_slew(h, np.pi / 2, 200.0, "effort", duration, intervals=n) for n in (intervals, other))
    # the other mesh is solved with steps that are not halved
    assert slew.certificate.optimality_gap == pytest.approx(abs(compared.cost / slew.cost - 1.0), rel=1e-3)


_SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("limit", "turn", "change", "limits", "ask"),
    [
        (LIMIT, ANGLE, {}, {}, {}),
        pytest.param(145.0, ANGLE, {}, {}, {}, marks=_SLOW),
        (LIMIT, ANGLE, {}, {}, _PAYLOAD),
        (145.0, None, {}, {}, {"final_speed": 0.8}),
        (LIMIT, ANGLE, None, {}, {}),
        pytest.param(145.0, ANGLE, None, {}, {}, marks=_SLOW),
        (2000.0, 3.0, {"tip_mass": 0.5}, {}, {}),  # the tip goes out to nearly half of the length
        pytest.param(145.0, ANGLE, {"model": "sfoam-consistent"}, {}, {}, marks=_SLOW),
        pytest.param(LIMIT, ANGLE, {}, {"speed": 0.66}, {}, marks=_SLOW),
        (LIMIT, ANGLE, None, {"speed": 0.66, "tip": 0.84}, {}),
        pytest.param(LIMIT, ANGLE, {}, {"tip": 0.8}, {}, marks=_SLOW),
        pytest.param(LIMIT, ANGLE, {}, {"moment": 25.0, "speed": 0.67}, {}, marks=_SLOW),
        pytest.param(LIMIT, ANGLE, {"tip_mass": 0.0}, {"tip": 1.05}, {"tip_masses": (0.3,)}, marks=_SLOW),
    ],
)
def test_least_effort_of_a_beam_is_what_a_programme_finds(limit, turn, change, limits, ask):
    """Nodes at which limits are met are exchanged; both ways tighten limits by what is exceeded between the nodes."""
    h, ask = bc.hub_beam(**({"modes": 1, "tip_mass": 0.1} | (change or {}))), ask | {"rtol": 1e-7}
    h = h.linearize() if change is None else h
    given = {f"{kind}_limit": value for kind, value in limits.items()}
    known = bc.optimal_slew(h, turn, limit, "effort", 4.0, intervals=60, **given, **ask)
    found, gap = _programme(h, turn, Limits(limit, **limits), 4.0, 60, **ask)
    certificate = known.certificate
    assert certificate.method == "least effort"
    assert known.stages[0] == "least effort on 60 intervals"
    assert known.cost == pytest.approx(found.effort, rel=1e-6)
    assert known.torque_profile.start_values == pytest.approx(found.start_values, abs=1e-3 * limit)
    assert certificate.constraint_violation <= 1e-9
    assert certificate.prescribed_terminal_error <= 1e-6
    assert set(certificate.active_constraints) <= {*given, "torque_limit"}
    assert ("torque_limit" in certificate.active_constraints) == (found.peak > 0.9999 * limit)
    if limits:  # they are met
        assert bc.optimal_slew(h, turn, limit, "effort", 4.0, intervals=60, **ask).cost < known.cost * (1.0 - 1e-6)
    elif change is None:  # the bound of a linear plant does not know the mesh
        assert certificate.optimality_status == "proved"
        assert 0.0 < certificate.optimality_gap < 2e-3
        assert known.terminal_error < 1e-11
    else:
        assert certificate.optimality_status == "stationary"
        assert certificate.optimality_gap == pytest.approx(gap, rel=1e-2)


@pytest.mark.parametrize("limits", [{}, {"speed": 0.66}, {"tip": 0.8}])
def test_joined_intervals_take_the_effort_of_a_mesh_half_as_fine(limits):
    problem = slew_problem(bc.hub_beam(modes=1), ANGLE, Limits(LIMIT, **limits), "effort", 4.0)
    fine, coarse = (effort_on_mesh(problem, 4.0, n, problem.limits) for n in (60, 30))
    assert fine.more == pytest.approx(coarse.profile.effort / fine.profile.effort - 1.0, rel=1e-2)


@pytest.mark.slow
def test_a_replay_is_asked_for_by_a_method_and_kept():
    slew = bc.optimal_slew(bc.hub_beam(modes=1), 1.0, 200.0, "effort", 4.0, intervals=20)
    heard = []
    found = slew.replay(progress=heard.append)
    assert {(item.task, item.completed) for item in heard if item.stage in ("foam", "geometrically-exact")} == {
        ("replay", 0),
        ("replay", 1),
    }
    assert [each.model for each in found] == ["foam", "geometrically-exact"]
    assert slew.replay() is found


def test_a_long_replay_says_where_it_looks_less_closely(monkeypatch):
    plant = bc.hub_beam(modes=3).linearize()
    asked = {"duration": 6.0, "objective": "effort", "speed_limit": 1.0}
    monkeypatch.setattr("boomctl.slew.replay._MOST_SAMPLES", 1200)
    with pytest.warns(UserWarning, match="in a period of the fastest vibration"):
        bc.optimal_slew(plant, ANGLE, LIMIT, **asked)
