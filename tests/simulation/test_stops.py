"""End stops: against impacts in closed form, and by the laws of an inelastic, one-sided stop."""

import control as ct
import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.simulation import CoulombFriction, simulate_loop
from boomctl.simulation.contact.stops import StopMaps, stop_step
from tests.profiles import examples
from tests.strategies import seeds

_FREE = ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [0.5]], np.eye(2), 0.0, inputs=["f"], outputs=["x", "v"])


def test_a_thrown_mass_stops_dead():
    time = np.linspace(0.0, 2.0, 201)
    found = simulate_loop(
        _FREE, None, time, None, sample_time=0.01, end_stop={"x": (1.003, "f")}, initial_state=[0.0, 1.5]
    )
    before = time < 1.003 / 1.5
    np.testing.assert_allclose(found["x"][before], 1.5 * time[before], atol=1e-12)
    np.testing.assert_allclose(found["x"][time > 0.68], 1.003, atol=1e-12)
    np.testing.assert_allclose(found["v"][time > 0.68], 0.0, atol=1e-12)
    first = found.stop_contacts[0]
    assert first.impulse == pytest.approx(-3.0, rel=1e-9)  # 2 kg at 1.5 m/s
    assert first.impact_speed == pytest.approx(1.5)
    assert first.side == 1
    assert first.time == pytest.approx(1.003 / 1.5, abs=0.01)


def test_mass_rests_at_stop_and_leaves():
    time = np.linspace(0.0, 6.0, 601)
    pushed = np.where(time <= 3.0, 2.0, -2.0 * (time - 3.0))
    found = simulate_loop(_FREE, None, time, {"f": pushed}, sample_time=0.01, end_stop={"x": (0.5, "f")})
    resting = (time > 1.1) & (time < 2.99)
    np.testing.assert_allclose(found["x"][resting], 0.5, atol=1e-10)
    np.testing.assert_allclose(found["v"][resting], 0.0, atol=1e-10)
    total = sum(hit.impulse for hit in found.stop_contacts if hit.time < 3.0)
    assert total == pytest.approx(-2.0 * 3.0, rel=0.01)  # what was pushed: the mass is at rest again
    later = time > 3.1
    np.testing.assert_allclose(found["x"][later], np.maximum(0.5 - (time[later] - 3.0) ** 3 / 6.0, -0.5), atol=0.01)
    assert found.stop_contacts[0].side == 1
    assert found.stop_contacts[-1].side == -1


@given(seed=seeds)
@examples(15)
def test_strokes_never_pass_and_stops_only_push_and_take_energy(seed):
    rng = np.random.default_rng(seed)
    n = 3
    Q = rng.standard_normal((n, n))
    K, M = Q @ Q.T + 5.0 * np.eye(n), np.diag(rng.uniform(0.5, 2.0, n))
    inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, np.zeros((n, n))]])
    loads = rng.standard_normal((n, 2))
    B, C = np.vstack([np.zeros((n, 2)), inverse @ loads]), np.hstack([loads.T, np.zeros((2, n))])
    outputs = ["stroke_a", "stroke_b", *(f"q{k}" for k in range(2 * n))]
    plant = ct.ss(A, B, np.vstack([C, np.eye(2 * n)]), 0.0, inputs=["suspension_a", "suspension_b"], outputs=outputs)
    time = np.linspace(0.0, 5.0, 1001)
    start = np.concatenate([np.zeros(n), rng.standard_normal(n)])
    found = simulate_loop(plant, None, time, None, sample_time=0.005, end_stop=0.25, initial_state=start)
    for stroke in found._strokes.values():
        assert np.abs(stroke).max() <= 0.25 * (1.0 + 1e-8)
    for hit in found.stop_contacts:
        assert hit.impulse * hit.side <= 0.0
    states = np.array([found[f"q{k}"] for k in range(2 * n)])
    q, v = states[:n], states[n:]
    energy = 0.5 * np.einsum("it,ij,jt->t", q, K, q) + 0.5 * np.einsum("it,ij,jt->t", v, M, v)
    assert (np.diff(energy) <= 1e-9 * energy[0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [48, 69, 107])
def test_a_shaken_boom_between_narrow_stops(seed):
    """White noise of the platform, a kink at every sample: both stops at once, on either side, one driving the other."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 0.6, 601)
    platform = 4e-3 * rng.standard_normal((2, len(time)))
    platform -= platform[:, :1]
    found = simulate_loop(
        bc.spray_boom(elements=8),
        None,
        time,
        {"actuator_left": platform[0], "actuator_right": platform[1]},
        sample_time=1e-3,
        end_stop=1.2e-3,
        friction=CoulombFriction(10.0, 15.0),
    )
    assert max(np.abs(stroke).max() for stroke in found._strokes.values()) <= 1.2e-3 * (1.0 + 1e-8)
    assert {hit.side for hit in found.stop_contacts} == {-1, 1}
    assert all(hit.impulse * hit.side <= 0.0 for hit in found.stop_contacts)
    assert found.friction.dissipated_energy > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("heavy", [0.5, 2.0, 8.0])
def test_sticking_continues_at_end_stop(heavy):
    """A mass on a carriage at its stop: pulled by more than sliding friction and less than what holds, it stays."""
    M, r = np.diag([1.0, heavy]), np.array([-1.0, 1.0])
    loads = np.linalg.inv(M) @ np.column_stack([[1.0, 0.0], [0.0, 1.0], r])
    A = np.zeros((4, 4))
    A[:2, 2:], A[2:, 2:] = np.eye(2), -np.linalg.inv(M) @ np.diag([0.8, 0.0])
    B, C = np.vstack([np.zeros((2, 3)), loads]), np.array([[-1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    plant = ct.ss(A, B, C, 0.0, inputs=["carriage", "mass", "rubbing"], outputs=["slip", "way"])
    time = np.linspace(0.0, 8.0, 1601)
    pull = np.interp(time, [4.0, 5.0, 6.0, 8.0], [0.0, 1.6, 1.6, 2.4])
    found = simulate_loop(
        plant,
        None,
        time,
        {"carriage": np.full(1601, 3.0 + heavy), "mass": pull},
        sample_time=0.005,
        friction=CoulombFriction(1.0, 2.0, force_input="rubbing", slip_output="slip"),
        end_stop={"way": (0.1, "carriage")},
    )
    before = (time > 4.0) & (time < 6.98)
    assert np.ptp(found["slip"][before]) < 1e-6
    np.testing.assert_allclose(found["way"][time > 4.0], 0.1, atol=1e-9)
    np.testing.assert_allclose(found.friction.force[before], -pull[before], atol=0.02)
    sliding = time - 7.0  # the pull passes 2 N at 7 s and grows by 0.4 N/s; sliding friction is 1 N
    moved = np.where(sliding > 0.0, (0.5 * sliding**2 + 0.4 / 6.0 * sliding**3) / heavy, 0.0)
    later = time > 7.0
    np.testing.assert_allclose((found["slip"] - found["slip"][before][0])[later], moved[later], atol=2e-3 / heavy)


def test_a_stop_that_moves_is_left_only_when_pulled():
    """A mass pressed to a stop of a support that moves: one contact, however finely the points between are stepped."""
    plant = ct.ss([[0, 1.0], [0, 0]], [[0, 0], [0, 1.0]], [[1.0, 0]], [[-1.0, 0]], inputs=["d", "f"], outputs=["x"])
    time = np.linspace(0.0, 4.0, 401)
    motion = {"d": 0.3 * (1.0 - np.cos(4.0 * time)), "f": np.full(401, 20.0)}
    found = simulate_loop(plant, None, time, motion, sample_time=0.01, end_stop={"x": (0.05, "f")})
    np.testing.assert_allclose(found["x"][time > 0.2], 0.05, atol=1e-9)
    assert len([hit for hit in found.stop_contacts if hit.end_time > 0.2]) == 1


@pytest.mark.parametrize("seed", range(20))
def test_stop_step_is_complementary(seed):
    """Two coupled masses: no stop is passed, a touched one only pushes, and without its effect it would be passed."""
    rng, h = np.random.default_rng(seed), 0.1
    root = rng.normal(size=(2, 2))
    inverse = root @ root.T + 0.3 * np.eye(2)  # of the mass matrix
    both = np.hstack([h * inverse, 0.5 * h * inverse])
    maps = StopMaps(both, np.hstack([inverse, inverse]), both, np.ones(2))
    position, velocity = rng.uniform(-1.3, 1.3, 2), rng.normal(size=2)
    found = stop_step(maps, position, velocity)
    assert (found is None) == (np.abs(position) <= 1.0).all()
    if found is None:
        return
    end = position + both @ found.amounts
    assert np.abs(end).max() <= 1.0 + 1e-9
    for i, side in enumerate(found.sides):
        assert side or found.impulses[i] == 0.0
        assert found.impulses[i] * side <= 0.0
        own = both[i, [i, i + 2]] @ found.amounts[[i, i + 2]]
        assert not side or (end[i] - own) * side >= 1.0 - 1e-9


def test_contradictory_stops_raise():
    maps = StopMaps(np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((2, 2)), np.ones(1))
    with np.errstate(all="ignore"), pytest.raises(ArithmeticError, match="finer timepts"):
        stop_step(maps, np.array([2.0]), np.array([1.0]))


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.4, *(pytest.param(d, marks=pytest.mark.slow) for d in (0.5, 0.8, 2.0))])
@pytest.mark.parametrize(("per_sample", "displaced"), [(1, False), (2, False), (0.5, False), (1, True)])
def test_stop_reached_between_samples(delay, per_sample, displaced):
    """The largest stroke is found on a grid four times finer; a stop just beyond it does nothing, one within it does."""
    h, m = 0.05, 120
    rng = np.random.default_rng(4)
    moved = [[-0.2, 0.0, 0.0]] if displaced else [[0.0, 0.0, 0.0]]
    A, B = [[0.0, 1.0], [-9.0, -0.6]], [[0.0, 0.0, 0.0], [0.3, 1.0, 1.0]]
    plant = ct.ss(A, B, [[1.0, 0.0]], moved, inputs=["d", "u", "f"], outputs=["x"])
    law = ct.ss(0.6, 1.0, [[-1.0]], [[-2.0]], h * per_sample, inputs=["x"], outputs=["u"])
    time = h * np.arange(m + 1)
    d = np.sin(1.7 * time) + np.sin(0.9 * time + 1.0) - np.sin(1.0) if displaced else rng.standard_normal(m + 1)
    options = {"sample_time": h * per_sample, "delay": delay * h}
    fine = h / 4.0 * min(per_sample, 1.0) * np.arange(round(m * 4 / min(per_sample, 1.0)) + 1)
    plain = simulate_loop(plant, law, time, {"d": d}, **options)
    finely = simulate_loop(plant, law, fine, {"d": np.interp(fine, time, d)}, **options)
    largest = np.abs(finely["x"]).max()
    bend = 2e-3 if displaced else 1e-6  # what is displaced runs along a cubic between the points, not along lines
    beyond = simulate_loop(plant, law, time, {"d": d}, end_stop={"x": (largest * (1.0 + bend), "f")}, **options)
    assert beyond.stop_contacts == ()
    np.testing.assert_allclose(beyond["x"], plain["x"], atol=1e-12)
    within = simulate_loop(plant, law, time, {"d": d}, end_stop={"x": (largest * (1.0 - bend), "f")}, **options)
    assert within.stop_contacts
    assert np.abs(within["x"]).max() <= largest * (1.0 - bend) * (1.0 + 1e-8)


def test_coupled_stops_raise():
    """Two stops on one and the same stroke: only one of them can be asked what to do."""
    one = np.array([[0.5, 0.25], [0.5, 0.25]])
    maps = StopMaps(np.repeat(one, 2, axis=1), np.repeat(2.0 * one, 2, axis=1), np.zeros((1, 4)), np.ones(2))
    assert maps.answer((0, 1), ()) is None
    found = stop_step(maps, np.array([1.1, 1.1 + 1e-14]), np.array([0.3, 0.3]))
    assert found is not None
    assert np.abs(found.amounts).max() < 10.0
