"""Controllers of a given structure: exact optima, gradients, several models, limits, plant parameters, families."""

import signal
import threading
import time
from itertools import pairwise, product
from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exceptions import SynthesisError
from boomctl.lti.system import Lti
from boomctl.structure import SecondOrderModel
from boomctl.synthesis.plants.partition import partition
from boomctl.tuning.certificate import _bounds, loop_of, lower_bound
from boomctl.tuning.point import Point
from boomctl.tuning.problem import GAIN_LIMIT
from tests.profiles import examples, is_hunt
from tests.refusals import assert_refused, refusals

T = bc.tunable


def lag(pole=1.0, effort=1.0, noise=0.1):
    """Return ``x' = -pole x + w + u``, ``z = (x, effort u)``, ``y = x + noise n``."""
    D = [[0, 0, 0], [0, 0, effort], [0, noise, 0]]
    names = {"inputs": ["w", "n", "u"], "outputs": ["z", "zu", "y"]}
    return control.ss(-pole, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], D, **names)


def oscillator(values):
    """Return a mass on a spring of 4 N/m and a damper, its place and a tenth of its speed to a force."""
    A = [[0.0, 1.0], [-4.0, -values["c"]]]
    return control.ss(A, [[0.0], [1.0]], [[1.0, 0.0], [0.0, 0.1]], 0.0, inputs="f", outputs=["place", "speed"])


def swing(seed, states=4, nmeas=2, ncon=2):
    """Return a generalized plant drawn at random: noise on what is measured, effort weighed."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(states, states))
    A -= np.eye(states) * (np.linalg.eigvals(A).real.max() + 0.1 * rng.random())
    B1, B2, C1, C2 = (rng.normal(size=s) for s in ((states, 1), (states, ncon), (1, states), (nmeas, states)))
    B = np.hstack([B1, np.zeros((states, nmeas)), B2])
    C = np.vstack([C1, np.zeros((ncon, states)), C2])
    D = np.zeros((1 + ncon + nmeas, 1 + nmeas + ncon))
    D[1 : 1 + ncon, 1 + nmeas :] = 0.3 * np.eye(ncon)
    D[1 + ncon :, 1 : 1 + nmeas] = 0.2 * np.eye(nmeas)
    return control.ss(A, B, C, D)


# -- exact optima -----------------------------------------------------------------------------------------------------


@examples(20)
@given(st.floats(0.2, 5.0), st.floats(0.2, 5.0))
def test_tune_gain_matches_closed_form(pole, effort):
    """Without noise ``u = k x`` gives ``sqrt(1 + effort^2 k^2)/(pole - k)`` at zero: least at ``k = -1/(pole effort^2)``."""
    found = bc.tune(lag(pole, effort, noise=0.0), 1, 1, T.gain(), channels=[T.objective("w")], n_starts=2)
    k = -1.0 / (pole * effort**2)
    assert found.gamma == pytest.approx(np.sqrt(1.0 + (effort * k) ** 2) / (pole - k), rel=1e-6)
    assert found.values["gain[u, y]"] == pytest.approx(k, rel=1e-3)
    assert found.certificate.norm_bounds.certified


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_tune_full_order_near_bound(seed):
    P = swing(seed, states=2, nmeas=1, ncon=1)
    found = bc.tune(P, 1, 1, T.state_space(2), n_starts=4)
    assert found.certificate.lower_bound <= found.gamma * (1.0 + 1e-6)
    assert found.gamma <= 1.01 * found.certificate.lower_bound


@pytest.mark.slow
def test_the_h2_norm_of_the_plants_order_is_that_of_h2_synthesis():
    P = swing(0, states=2, nmeas=1, ncon=1)
    found = bc.tune(P, 1, 1, T.state_space(2, strictly_proper=True), norm="h2", n_starts=3)
    assert found.gamma == pytest.approx(bc.h2(P, 1, 1).norm, rel=1e-4)


def test_tune_reaches_norm_of_zero():
    """What is measured is the disturbance itself: a gain of -1 cancels it, and nothing is left."""
    P = control.ss(-1.0, [[1.0, 1.0]], [[1.0], [0.0]], [[0.0, 0.0], [1.0, 0.0]])
    found = bc.tune(P, 1, 1, T.gain(), n_starts=2, initial_controller={"gain[u[1], y[1]]": 0.5})
    assert found.gamma == pytest.approx(0.0, abs=1e-12)
    assert found.values["gain[u[1], y[1]]"] == pytest.approx(-1.0)
    assert [start.origin for start in found.starts] == ["given", "low-gain"]


# -- what a result holds ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_result_is_verified_from_what_was_handed_in():
    P = swing(3)
    found = bc.tune(P, 2, 2, T.gain(), n_starts=3)
    loop = bc.lft(P, found.controller)
    assert loop.poles().real.max() < 0.0
    assert bc.hinf_norm(loop).lower_bound == pytest.approx(found.gamma, rel=1e-6)
    omega = np.geomspace(1e-3, 1e3, 4000)
    seen = np.linalg.svd(np.moveaxis(np.asarray(loop(1j * omega)), 2, 0), compute_uv=False).max()
    assert seen <= found.gamma * (1.0 + 1e-9)
    assert found.certificate.lower_bound <= found.gamma
    assert found.certificate.stationarity <= 1e-3
    assert {peak.value for peak in found.certificate.active_peaks}
    for peak in found.certificate.active_peaks:
        at = np.asarray(loop(1j * peak.omega)) if np.isfinite(peak.omega) else loop.D
        assert np.linalg.norm(at, 2) == pytest.approx(peak.value, rel=1e-5)


def test_units_of_the_signals_do_not_matter():
    P = lag()
    scaled = control.ss(
        P.A, P.B * [[1.0, 1.0, 1e3]], P.C * [[1.0], [1.0], [1e-4]], P.D * [1.0, 1.0, 1e3] * [[1.0], [1.0], [1e-4]]
    )
    one, other = bc.tune(P, 1, 1, T.gain(), n_starts=2), bc.tune(scaled, 1, 1, T.gain(), n_starts=2)
    assert other.gamma == pytest.approx(one.gamma, rel=1e-6)


# -- structures -------------------------------------------------------------------------------------------------------

STRUCTURES = {
    "gain": T.gain(),
    "pid": T.pid(),
    "ppf": T.ppf(2),
    "notch": T.gain() * T.notch(),
    "shared": T.decentralized(T.gain() + T.ppf(), shared_parameters=True),
}


def two_by_two():
    P = swing(7)
    return control.ss(P.A, P.B, P.C, P.D, inputs=["w", "n0", "n1", "u0", "u1"], outputs=["z", "e0", "e1", "y0", "y1"])


@pytest.mark.slow
@pytest.mark.parametrize("name", STRUCTURES)
def test_a_structure_gives_the_controller_that_its_numbers_say(name):
    """The response is put together anew from the values, part by part."""
    found = bc.tune(two_by_two(), 2, 2, STRUCTURES[name], n_starts=1, time_limit=20.0)
    assert str(found).startswith("TuneResult: controller of ")
    v, K = found.values, found.controller

    def matrix(word, end=""):
        return np.array([[v[f"{word}[u{i}, y{j}]{end}"] for j in range(2)] for i in range(2)])

    for s in (0.3j, 2.0j, 40.0j):
        if name == "gain":
            wanted = matrix("gain")
        elif name == "pid":
            wanted = (
                matrix("proportional") + matrix("integral") / s + matrix("derivative") * s / (s / v["filter"] + 1.0)
            )
        elif name == "ppf":
            parts = [(v[f"frequency{k}"], v[f"damping{k}"], matrix(f"ppf{k}")) for k in (1, 2)]
            wanted = sum(G / (s**2 / w**2 + 2.0 * z * s / w + 1.0) for w, z, G in parts)
        elif name == "notch":
            w, a, b = v["notch"], v["depth"], v["width"]
            wanted = matrix("gain") * (s**2 + 2.0 * a * w * s + w**2) / (s**2 + 2.0 * b * w * s + w**2)
        else:
            w, z = v["frequency"], v["damping"]
            one = v["gain[u0, y0]"] + v["ppf[u0, y0]"] / (s**2 / w**2 + 2.0 * z * s / w + 1.0)
            wanted = one * np.eye(2)
        assert np.asarray(K(s)) == pytest.approx(np.asarray(wanted), rel=1e-8, abs=1e-10)


@pytest.mark.slow
def test_loops_side_by_side_read_and_set_nothing_else():
    within = T.decentralized((["y0", "y1"], "u0", T.pid(integral=False)))
    parts = T.decentralized(("y0", "u1", T.gain()), (["y0", "y1"], "u0", within))
    K = bc.tune(two_by_two(), 2, 2, parts, n_starts=1).controller
    response = np.asarray(K(2.0j))
    assert response[1, 1] == 0.0
    assert (response[[0, 0, 1], [0, 1, 0]] != 0.0).all()


# -- several models, limits, bounds ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_of_two_models_the_worse_one_counts_and_both_are_stable():
    """Around lags of 1 and -0.5 the least gain for both is where neither norm can fall without the other's rising."""
    plants = [lag(1.0), lag(-0.5)]
    found = bc.tune(plants, 1, 1, T.gain(), n_starts=2)
    norms = [bc.hinf_norm(bc.lft(P, found.controller)).lower_bound for P in plants]
    assert max(norms) == pytest.approx(found.gamma, rel=1e-6)
    assert all(loop.poles().real.max() < 0.0 for loop in found.closed_loops)
    gains = np.linspace(-30.0, -0.51, 20_001)
    least = min(max(_norm_of_lag(pole, k) for pole in (1.0, -0.5)) for k in gains)
    assert found.gamma == pytest.approx(least, rel=1e-4)
    assert found.gamma <= least * (1.0 + 1e-6)


def _norm_of_lag(pole, k):
    """Return the largest singular value of the loop with a gain: at zero, or at infinity, of two by two matrices."""
    a = pole - k
    at_zero = np.array([[1.0, 0.1 * k], [k, k * (0.1 * k) + 0.1 * k * a]]) / a
    return max(np.linalg.norm(at_zero, 2), abs(0.1 * k))


def test_a_limit_is_kept_and_said_to_be_used_up():
    """``|k|/(1 - k)`` at most 0.25 means ``k >= -1/3``, and the objective ``1/(1 - k)`` is 0.75."""
    P = lag(noise=0.0)
    channels = [T.objective("w", "z"), T.constraint("w", "zu", 0.25)]
    found = bc.tune(P, 1, 1, T.gain(), channels=channels, n_starts=2)
    assert found.gamma == pytest.approx(0.75, rel=1e-5)
    assert any("limit" in said for said in found.certificate.active_constraints)
    assert found.certificate.channel_norms[1].value <= 0.25 * (1.0 + 1e-5)


def test_h2_limits_go_with_h_infinity_objectives():
    """The square of the H2 norm of the effort is ``k^2/(2 (1 - k))``: at ``k = -1`` it is 1/4."""
    channels = [T.objective("w", "z"), T.constraint("w", "zu", 0.5, norm="h2")]
    found = bc.tune(lag(noise=0.0), 1, 1, T.gain(), channels=channels, n_starts=2)
    assert found.gamma == pytest.approx(0.5, rel=1e-5)


def test_max_gain_is_kept_where_the_infimum_is_at_infinite_gain():
    found = bc.tune(lag(), 1, 1, T.gain(), channels=[T.objective("w", "z")], max_gain=9.0, n_starts=2)
    assert found.gamma == pytest.approx(0.1, rel=1e-5)
    assert found.certificate.active_constraints == ("max_gain = 9.0",)
    free = bc.tune(lag(), 1, 1, T.gain(), channels=[T.objective("w", "z")], n_starts=2)
    assert "diverges" in free.certificate.active_constraints[0]


@pytest.mark.slow
def test_poles_keep_to_what_is_asked():
    P = swing(3)
    found = bc.tune(P, 2, 2, T.state_space(2), n_starts=3, fastest_pole=2.0, min_damping_ratio=0.3, min_decay_rate=0.05)
    assert np.abs(found.controller.poles()).max() <= 2.0 * (1.0 + 1e-4)
    poles = found.closed_loop.poles()
    assert (-poles.real / np.abs(poles)).min() >= 0.3 - 1e-4
    assert poles.real.max() <= -0.05 + 1e-4


@pytest.mark.parametrize(
    ("bound", "signal"),
    [
        ({"fastest_pole": 0.5}, "largest"),
        ({"min_decay_rate": 4.0}, "least"),
        pytest.param({"min_damping_ratio": 0.95}, "least", marks=pytest.mark.slow),
    ],
)
def test_bounds_are_judged_by_the_verified_loops(bound, signal, monkeypatch):
    """The search takes every bound on poles as satisfied: the certificate does not."""
    monkeypatch.setattr(Point, "_of_kind", lambda *_: [])
    (name, value), *_ = bound.items()
    with pytest.raises(SynthesisError, match=f"no controller found satisfies {name} = {value}: it reaches ") as caught:
        bc.tune(swing(3, 2, 1, 1), 1, 1, T.state_space(1), n_starts=1, **bound)
    reached = float(str(caught.value).rpartition(" ")[2])
    assert reached > value if signal == "largest" else reached < value


def test_reason_of_a_zero_bound_names_the_relaxation():
    """``x' = -x + w + u``, ``z = x = y``: without noise and weight."""
    P = control.ss(-1.0, [[1.0, 1.0]], [[1.0], [1.0]], 0.0)
    found = lower_bound([partition(P, 1, 1)], [(1.0, 0, T.objective())], 20.0)
    assert found[0] == 0.0
    assert found[1].startswith(
        "none: full-order synthesis of a relaxed problem reaches zero; measurements: rates in place"
    )
    below = lower_bound([partition(lag(), 1, 1)], [(0.5, 0, T.objective())], 20.0)  # the least norm is 0.7071
    assert below == (0.0, "none: the bound was made by rounding")


def test_max_gain_of_unstable_controller_is_its_response_peak():
    """``1.5 (s + 1)/(s - 1)`` has the gain 1.5 at all frequencies, but no norm."""
    K = Lti(np.array([[1.0]]), np.array([[1.0]]), np.array([[3.0]]), np.array([[1.5]]))
    problem = SimpleNamespace(ports=SimpleNamespace(rate=1.0), limits={GAIN_LIMIT: 2.0})
    ((text, value, excess),) = _bounds(problem, K, [K])
    assert text == "max_gain = 2.0"
    assert (value, excess) == pytest.approx((1.5, -0.25))


# -- plant parameters and families ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_damper_alone_is_tuned_to_where_two_channels_meet():
    """``1/(c w)`` of the place against what the damper's force costs: the minimum of a function of one number."""

    def plant(v):
        A = [[0.0, 1.0], [-4.0, -v["c"]]]
        C = [[1.0, 0.0], [0.0, 0.3 * v["c"]]]
        return control.ss(A, [[0.0], [1.0]], C, 0.0, inputs="f", outputs=["place", "force"])

    found = bc.tune(plant, 0, 0, T.plant_parameter("c", 0.05, 5.0), n_starts=2)
    least = min(bc.hinf_norm(plant({"c": c})).lower_bound for c in np.linspace(0.05, 5.0, 300))
    assert found.gamma <= least * (1.0 + 1e-9)
    assert found.gamma == pytest.approx(least, rel=1e-4)
    assert found.plant_parameters.keys() == {"c"}
    assert found.certificate.lower_bound_source == "none: the plant itself is tuned"


def test_tune_parameter_ends_at_limit():
    found = bc.tune(oscillator, 0, 0, T.plant_parameter("c", 0.05, 1.0), n_starts=1)
    assert found.plant_parameters == found.values == {"c": 1.0}  # that end, and no digit beyond
    assert "c at its maximum, 1" in found.certificate.active_constraints


@examples(200)
@given(seed=st.integers(0, 100_000))
def test_range_of_a_parameter_has_no_digit_beyond_its_ends(seed):
    rng = np.random.default_rng(seed)
    low, high = np.sort(rng.uniform(0.0, 1.0, 2) * 10.0 ** rng.uniform(-3.0, 3.0)).tolist()
    value = T.plant_parameter("c", low, high).physicals()[0].number.value
    assert (value(-1.0), value(1.0)) == (low, high)
    assert all(low <= value(x) <= high for x in (*rng.uniform(-1.0, 1.0, 9), *np.nextafter([-1.0, 1.0], 0.0)))


def family():
    """Return a mass on an uncertain spring with an uncertain damper."""
    return bc.structure.AffineFamily.from_function(
        {"k": (2.0, 6.0), "c": (0.1, 1.0)},
        lambda v: SecondOrderModel([[1.0]], [[v["c"]]], [[v["k"]]], {"f": [1.0]}, {"x": [1.0]}),
    )


def weighed(model):
    return bc.generalized_plant(
        model,
        disturbances={"f": 1.0},
        performance={"x": 1.0},
        effort={"f": 0.2},
        noise={"x": 0.05},
        measurements="x",
        controls="f",
    )


@pytest.mark.slow
def test_over_a_family_nothing_inside_is_worse_than_said():
    found = bc.tune(weighed, 1, 1, T.pid(integral=False, omega_max=50.0), family=family(), n_starts=2)
    rng = np.random.default_rng(0)
    inside = [*rng.uniform(-1.0, 1.0, (40, 2)), *(np.array(p) for p in product((-1.0, 0.0, 1.0), repeat=2))]
    worst = max(bc.hinf_norm(bc.lft(weighed(family().at(d)), found.controller)).lower_bound for d in inside)
    assert worst <= found.gamma * 1.002
    assert found.certificate.worst_case.value <= found.gamma * 1.002


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 9 if is_hunt() else 3))
def test_tune_worst_points_of_objective_and_constraint(seed):
    rng = np.random.default_rng(seed)
    stiffness, damping = np.sort(rng.uniform(1.0, 6.0, 2)), np.sort(rng.uniform(0.1, 1.0, 2))
    box = bc.structure.AffineFamily.from_function(
        {"k": tuple(stiffness), "c": tuple(damping)},
        lambda v: SecondOrderModel([[1.0]], [[v["c"]]], [[v["k"]]], {"f": [1.0]}, {"x": [1.0]}),
    )
    channels = [T.objective("w_f", "z_x"), T.constraint("w_f", "z_f", float(rng.uniform(0.3, 1.0)))]
    found = bc.tune(weighed, 1, 1, T.pid(integral=False, omega_max=50.0), channels=channels, family=box, n_starts=2)
    for d in product((-1.0, 0.0, 1.0), repeat=2):
        loop = bc.lft(weighed(box.at(np.array(d))), found.controller)
        assert bc.hinf_norm(loop["z_x", "w_f"]).lower_bound <= found.certificate.worst_case.value * (1.0 + 1e-6)


@pytest.mark.slow
def test_tune_one_parameter_of_family():
    parts = T.pid(integral=False, omega_max=50.0) + T.plant_parameter("c", 0.1, 1.0)
    found = bc.tune(weighed, 1, 1, parts, family=family(), n_starts=1)
    assert found.plant_parameters["c"] == pytest.approx(1.0, rel=1e-3)  # damping costs nothing here
    for k in (-1.0, 0.0, 1.0):
        loop = bc.lft(weighed(family().at([k, 1.0])), found.controller)
        assert bc.hinf_norm(loop).lower_bound <= found.gamma * 1.002


@pytest.mark.slow
@pytest.mark.parametrize("starts", [1, 3])
@pytest.mark.parametrize("seed", range(12 if is_hunt() else 3))
def test_the_optimum_of_a_lower_order_is_a_start(seed, starts):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    A, B = rng.standard_normal((n, n)), rng.standard_normal((n, 4))
    C = rng.standard_normal((4, n))
    D = np.zeros((4, 4))
    D[2, 3], D[3, 2] = 1.0, 1.0  # effort and noise
    P = control.ss(A, B, C, D)
    reached = []
    for order in (0, 1, 2):
        structure = T.state_space(order) if order else T.gain()
        try:
            found = bc.tune(P, 1, 1, structure, n_starts=starts)
        except SynthesisError:
            assert not reached  # what a lower order reaches, a higher one does
            continue
        if reached:
            begun = [said for said in found.certificate.stages if said.startswith(f"from order {order - 1}")]
            assert float(begun[-1].split()[-1]) <= reached[-1] * (1.0 + 1e-5)
        reached.append(found.gamma)
    for less, more in pairwise(reached):
        assert more <= less * (1.0 + 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9, 61, *range(200, 230 if is_hunt() else 203)])
def test_what_the_best_start_came_to_is_what_is_verified(seed):
    """Peaks of lightly damped loops that stand side by side: none is passed over, be it higher by a hundred-thousandth."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    stiffness = 10.0 ** rng.uniform(-1.0, 2.0, n)
    damping = 10.0 ** rng.uniform(-4.0, -1.0, n) * np.sqrt(stiffness)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(stiffness), -np.diag(damping)]])
    force = rng.standard_normal((n, 4))
    C = np.hstack([rng.standard_normal((4, n)), np.zeros((4, n))])
    D = np.zeros((4, 4))
    D[2, 3], D[3, 2] = 0.1, 0.1  # effort and noise
    P = control.ss(A, np.vstack([0.0 * force, force]), C, D)
    try:
        found = bc.tune(P, 1, 1, T.state_space(1) if seed % 2 else T.gain(), n_starts=2)
    except SynthesisError:
        return  # not every plant of the class is stabilized from two starts
    assert found.gamma == pytest.approx(min(start.objective for start in found.starts), rel=1e-6)


# -- what is refused, and what ends early -----------------------------------------------------------------------------


def tuned(P=None, structure=None, nmeas=1, ncon=1, **options):
    """Tune a gain around a lag, or as the arguments say."""
    structure = T.gain() if structure is None else structure
    return bc.tune(lag() if P is None else P, nmeas, ncon, structure, n_starts=1, **options)


def tuned_from(structure, states, signals=1, **change):
    """A start from a controller of some order that the structure may have, or not."""
    names = {"inputs": ["y"] if signals == 1 else signals, "outputs": ["u"] if signals == 1 else signals} | change
    ones = np.ones((max(states, signals),) * 2)
    B, C, D = ones[:states, :signals], ones[:signals, :states], ones[:signals, :signals]
    return tuned(structure=structure, initial_controller=control.ss(-np.eye(states), B, C, D, **names))


DAMPER, WIDER = T.plant_parameter("c", 0.1, 1.0), T.plant_parameter("c", 0.1, 2.0)
INTEGRATORS = [[0.0, 1.0], [0.0, 0.0]]
REFUSED = r"""
tuned(channels=[T.objective("v")]) -> disturbance
tuned(channels=[]) -> channels
tuned(channels=[T.objective()], norm="h2") -> norm
tuned(norm="h2") -> feedthrough
tuned(structure=T.pid(), max_gain=1.0) -> integrates
tuned(control.ss(0.5, [[1, 1]], [[1], [1]], 0, 0.1)) -> P
tuned([lag(), swing(0, 2, 1, 1)]) -> model 2
tuned(oscillator, DAMPER + WIDER, 0, 0) -> twice
tuned(structure=T.gain() + DAMPER) -> function
tuned(weighed, T.gain() + T.plant_parameter("m", 0.1, 1.0), family=family()) -> parameter of the family
tuned(control.ss(1.0, [[1.0, 0.0]], [[1.0], [1.0]], 0.0)) -> SynthesisError: not stabilizable
tuned(control.ss(INTEGRATORS, np.eye(2), [[1.0, 0.0], [1.0, 0.0]], 0.0))
    -> SynthesisError: no controller of this structure.*; smallest spectral abscissa reached: 0 rad/s
tuned(channels=[T.constraint("w", "zu", 0.1), T.constraint("w", "z", 0.2)])
    -> SynthesisError: no controller found meets all limits
tuned(lag(-1.0), max_gain=0.5) -> SynthesisError: ^no controller found satisfies max_gain = 0\.5: it reaches 1\.0000
tuned(lag(-1.0), time_limit=1e-6) -> SynthesisError: in the time allowed
tuned(two_by_two(), T.decentralized((["y0", "y1"], "u0", T.notch()), ("y1", "u1", T.gain())), 2, 2)
    -> between 2 measurement\(s\) and 1 control\(s\)
tuned_from(T.state_space(1), 2) -> initial_controller: .*at most 1 states, got 2
tuned_from(T.gain(), 1) -> initial_controller .*expected a structure tunable.state_space, got Gain
tuned_from(T.state_space(1, strictly_proper=True), 1) -> initial_controller: .*strictly proper
tuned_from(T.state_space(1), 1, inputs=["v"]) -> initial_controller: expected 1 .*, y, got v
tuned_from(T.state_space(1), 1, 2, inputs=2, outputs=2) -> initial_controller: expected 1 .*, y, got u.0., u
tuned_from(T.state_space(1), 1, dt=0.1) -> initial_controller: .*expected continuous time
T.plant_parameter("c", np.nan, 1.0) -> low = nan
T.plant_parameter("c", 1.0, 1.0) -> low, high = 1, 1
T.notch(2.0, 1.0) -> omega_min, omega_max = 2, 1
"""


@refusals(REFUSED)
def test_combination_that_is_impossible_refused_in_one_line(call, words):
    assert_refused(call, words, globals())


@pytest.mark.parametrize("pole", [0.0, 2.0j])
def test_certificate_hidden_pole_on_axis_refused(pole):
    """A pole that neither a channel nor the controller sees: the loop does not forget how it began."""
    A = np.diag([-1.0, 0.0, 0.0])
    A[1, 2], A[2, 1] = abs(pole), -abs(pole)
    P = control.ss(A, np.eye(3)[:, [0, 0]], np.eye(3)[[0, 0]], 0.0)
    with pytest.raises(SynthesisError, match="could not be verified: the loop has a pole at"):
        loop_of(partition(P, 1, 1), Lti(*(np.zeros(shape) for shape in ((0, 0), (0, 1), (1, 0))), np.array([[-1.0]])))


@pytest.mark.slow
@pytest.mark.parametrize("stage", ["order 1, start", "order 2, start"])
def test_the_time_limit_returns_the_best_so_far_verified(stage, monkeypatch):
    P, late = swing(13, states=12, nmeas=3, ncon=3), []
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + 1e6 * len(late))
    monkeypatch.setattr("boomctl.progress.time", clock)

    def over(told):
        if (told.stage, told.completed) == (stage, 3):
            late.append(told)

    found = bc.tune(P, 3, 3, T.state_space(2), n_starts=5, time_limit=1e5, progress=over)
    assert "stopped: time limit" in found.certificate.stages
    assert not found.success
    assert bc.hinf_norm(bc.lft(P, found.controller)).lower_bound == pytest.approx(found.gamma, rel=1e-6)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="signals to a thread")
def test_an_interrupt_returns_the_best_so_far_verified():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # tests may run where it is ignored
    P = swing(13, states=12, nmeas=3, ncon=3)
    main, begun = threading.main_thread().ident, threading.Event()

    def heard(told):
        if told.completed == 3:
            begun.set()

    def interrupt():
        begun.wait()
        signal.pthread_kill(main, signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    try:
        found = bc.tune(P, 3, 3, T.state_space(3), n_starts=500, time_limit=1e5, progress=heard)
    finally:
        signal.signal(signal.SIGINT, before)
    assert "stopped" in found.certificate.stages
    assert not found.success
    assert bc.hinf_norm(bc.lft(P, found.controller)).lower_bound == pytest.approx(found.gamma, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("states", [0, 1, 2])
def test_tune_initial_controller_of_lower_order(states):
    P, rng = swing(3), np.random.default_rng(0)
    K = control.ss(-np.eye(states), rng.normal(size=(states, 2)), 0.01 * rng.normal(size=(2, states)), np.zeros((2, 2)))
    K = control.ss(K, inputs=["y[3]", "y[4]"], outputs=["u[3]", "u[4]"])
    found = bc.tune(P, 2, 2, T.state_space(2), n_starts=1, initial_controller=K)
    assert found.starts[0].origin == "given"
    assert found.gamma <= bc.hinf_norm(bc.lft(P, K)).upper_bound


@pytest.mark.slow
def test_tune_continues_from_result():
    P = swing(3)
    first = bc.tune(P, 2, 2, T.state_space(1), n_starts=2)
    turned = first.controller[[1, 0], [1, 0]]  # signals go by their names
    for start in (first.controller, turned):
        again = bc.tune(P, 2, 2, T.state_space(1), n_starts=1, initial_controller=start)
        assert again.starts[0].objective <= first.gamma * (1.0 + 1e-6)


# -- almost unstable loops ---------------------------------------------------------------------------------------------


def lag_and_swing():
    """Return a lag that gain calms, and a swing beside it, which no channel sees, that the same gain drives."""
    A = [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -0.02]]
    B = [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    C = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    return control.ss(A, B, C, 0.0, inputs=["w", "u1", "u2"], outputs=["z", "y1", "y2"])


def test_a_loop_that_ends_at_the_edge_of_stability_says_so():
    """A gain of ``-k`` in both leaves a norm of ``1/(1 + k)`` and a decay of ``(0.02 - k)/2``: least where none is left."""
    both = T.decentralized(T.gain(), shared_parameters=True)
    kept = bc.tune(lag_and_swing(), 2, 2, both, n_starts=1, min_decay_rate=0.005)
    assert kept.gamma == pytest.approx(1.0 / 1.01, rel=1e-5)
    assert "almost unstable" not in kept.certificate.summary
    found = bc.tune(lag_and_swing(), 2, 2, both, n_starts=1)
    assert found.gamma == pytest.approx(1.0 / 1.02, rel=1e-5)
    assert found.certificate.spectral_abscissa < 0.0
    told = found.certificate.summary
    assert "almost unstable: a pole at" in told
    assert "set min_decay_rate=" in told


def test_tune_ignores_slow_plant_pole():
    A = [[-1.0, 0.0, 0.0], [0.0, -1e-8, 1.0], [0.0, -1.0, -1e-8]]
    P = control.ss(A, np.eye(3)[:, [0, 0]], np.eye(3)[[0, 0]], 0.0, inputs=["w", "u"], outputs=["z", "y"])
    found = bc.tune(P, 1, 1, T.gain(), n_starts=1, max_gain=2.0)
    assert found.gamma == pytest.approx(1.0 / 3.0, rel=1e-5)
    assert "almost unstable" not in found.certificate.summary


def test_a_smooth_minimum_is_told_from_a_slope():
    """One piece, whose gradient alone is the hull: it counts beside what it bends."""
    B, C = [[0.0, 0.0, 0.0], [1.0, 0.5, 1.0]], [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])  # no noise: a gain is allowed
    P = control.ss([[0.0, 1.0], [-1.0, -0.1]], B, C, D)
    found = bc.tune(P, 1, 1, T.gain(), norm="h2", n_starts=2)
    assert len(found.certificate.active_peaks) == 1
    assert found.certificate.stationarity < 1e-4
