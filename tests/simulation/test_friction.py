"""Coulomb friction: against solutions in closed form, and by the law itself."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.simulation import CoulombFriction, simulate_loop
from tests.profiles import examples
from tests.simulation.cases import mass_on_spring


def _law(force, static=None, substeps=1):
    return CoulombFriction(force, static, force_input="f", slip_output="x", substeps=substeps)


def _fading(x0, time, stiffness=100.0, mass=1.0, force=1.0):
    """Return the free motion of a mass on a spring with friction: half cosines about -+ F/k, then rest."""
    omega, gap = np.sqrt(stiffness / mass), force / stiffness
    x, side, start = x0, np.sign(x0), 0.0
    found = np.full(len(time), x0)
    while abs(x) > gap:
        here = time >= start
        found[here] = side * gap + (x - side * gap) * np.cos(omega * (time[here] - start))
        start += np.pi / omega
        x = 2.0 * side * gap - x
        side = -side
    found[time >= start] = x
    return found


@pytest.mark.parametrize("x0", [-0.23, 0.0099, *(pytest.param(x0, marks=pytest.mark.slow) for x0 in (0.37, 0.051))])
def test_free_motion_fades_in_straight_lines_and_stops(x0):
    errors = []
    for steps in (100, 200, 400):
        time = np.linspace(0.0, 8.0, 8 * steps + 1)
        found = simulate_loop(
            mass_on_spring(), None, time, None, sample_time=1.0 / steps, friction=_law(1.0), initial_state=[x0, 0.0]
        )
        errors.append(np.abs(found["x"] - _fading(x0, time)).max())
        energy = 50.0 * (x0**2 - found["x"][-1] ** 2) - 0.5 * found["v"][-1] ** 2
        assert found.friction.dissipated_energy == pytest.approx(energy, abs=0.05 * (100.0 / steps) ** 2)
    assert errors[0] < 2e-3 * abs(x0) + 1e-15
    assert errors[2] < errors[0] / 10.0 + 1e-12


@examples(100)
@given(st.floats(0.02, 0.5), st.floats(0.5, 20.0), st.integers(40, 200), st.integers(1, 8), st.floats(-0.2, 0.2))
def test_the_error_of_coarse_steps_is_estimated(x0, omega, points, substeps, speed):
    """A mass on a spring that fades, or slides under a sine: against a closed form, and against steps 32 times as fine."""
    plant, time = mass_on_spring(1.0, omega**2), np.linspace(0.0, 20.0 / omega, points)
    free = {"sample_time": time[1], "initial_state": [x0, 0.0]}
    found = simulate_loop(plant, None, time, None, friction=_law(0.05 * omega**2, substeps=substeps), **free)
    off = np.abs(found["x"] - _fading(x0, time, omega**2, 1.0, 0.05 * omega**2)).max()
    assert off <= 1.5 * found.error_estimate + 1e-12
    push, free = {"f": 0.2 * omega**2 * np.sin(0.7 * omega * time)}, free | {"initial_state": [x0, speed * omega]}
    found, fine = (
        simulate_loop(plant, None, time, push, friction=_law(0.05 * omega**2, substeps=n), **free)
        for n in (substeps, 32 * substeps)
    )
    off = np.abs(found["x"] - fine["x"]).max()
    assert off <= 1.5 * found.error_estimate + 1e-12
    assert "error estimated" in repr(found)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3, 8])
def test_the_error_with_impacts_is_estimated(seed):
    """A mass that rubs on a carriage with end stops, against steps 16 times as fine."""
    rng, mass, time = np.random.default_rng(seed), np.eye(2), np.linspace(0.0, 3.0, 241)
    mass[1, 1] /= rng.uniform(0.5, 4.0)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-mass @ np.diag([20.0, 5.0]), -mass @ np.diag([0.5, 0.1])]])
    B = np.vstack([np.zeros((2, 3)), mass @ [[1.0, 0.0, -1.0], [0.0, 1.0, 1.0]]])
    names = {"inputs": ["carriage", "mass", "rubbing"], "outputs": ["slip", "way"]}
    plant = ct.ss(A, B, [[-1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]], 0.0, **names)
    loads = np.sin(np.outer([3.0, rng.uniform(2.0, 9.0)], time)) * rng.uniform(2.0, 8.0, (2, 1))
    found, fine = (
        simulate_loop(
            plant,
            None,
            time,
            {"carriage": loads[0], "mass": loads[1]},
            sample_time=time[1],
            friction=CoulombFriction(1.0, force_input="rubbing", slip_output="slip", substeps=substeps),
            end_stop={"way": (0.1, "carriage")},
        )
        for substeps in (4, 64)
    )
    assert len(found.stop_contacts) > 1
    assert np.abs(found["slip"] - fine["slip"]).max() <= 1.5 * found.error_estimate


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "share"), [(1.4, 0.3), (0.7, 0.4), (2.0, 0.5), (0.8, 0.4)])
def test_den_hartog_without_stops(ratio, share):
    """Source: Den Hartog (1931): largest displacement of a mass on a spring under a sine, sliding without stops."""
    stiffness, pushed = 100.0, 5.0
    friction = share * pushed
    period = 2.0 * np.pi / (10.0 * ratio)
    steps, cycles = 400, 120
    time = np.linspace(0.0, cycles * period, cycles * steps + 1)
    found = simulate_loop(
        mass_on_spring(1.0, stiffness),
        None,
        time,
        {"f": pushed * np.cos(10.0 * ratio * time)},
        sample_time=period / steps,
        friction=_law(friction),
    )
    largest = np.abs(found["x"][-5 * steps :]).max()
    response = 1.0 / (1.0 - ratio**2)
    damping = np.sin(np.pi / ratio) / (ratio * (1.0 + np.cos(np.pi / ratio)))
    expected = pushed / stiffness * np.sqrt(response**2 - (share * damping) ** 2)
    assert largest == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(("static", "speed"), [(1.0, 0.0), (1.7, 0.0), (1.7, -3.9)])
def test_break_away_under_a_growing_force(static, speed):
    """A free mass is pulled with a force that grows evenly: the rest moves it from the static force on, or once it turns."""
    plant = ct.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs=["f"], outputs=["x"])
    errors, start, stop = [], {"initial_state": [0.0, speed]}, np.sqrt(1.0 - 2.0 * speed) - 1.0
    begin = max(stop, static)
    for steps in (64, 128, 256):
        time = np.linspace(0.0, 3.0, 3 * steps + 1)
        found = simulate_loop(
            plant, None, time, {"f": time}, sample_time=1.0 / steps, friction=_law(1.0, static), **start
        )["x"]
        before, after = np.minimum(time, stop), np.maximum(time - begin, 0.0)
        exact = speed * before + 0.5 * before**2 + (before**3 + after**3) / 6.0 + 0.5 * (begin - 1.0) * after**2
        errors.append(np.abs(found - exact).max())
    assert errors[2] < 1e-4
    assert errors[2] < errors[0] / 8.0 + 1e-9


def test_a_support_that_moves_carries_what_sticks_to_it():
    """The slip has a displacement input: the mass must follow the support without creeping away from it."""
    A, B = [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]
    plant = ct.ss(A, B, [[1.0, 0.0]], [[-1.0, 0.0]], inputs=["d", "f"], outputs=["x"])
    for steps, most in ((200, 4e-4), (400, 1e-4)):
        time = np.linspace(0.0, 4.0, 4 * steps + 1)
        d = 0.3 * (1.0 - np.cos(4.0 * time))
        found = simulate_loop(plant, None, time, {"d": d}, sample_time=1.0 / steps, friction=_law(100.0))
        assert np.abs(found["x"]).max() < most
        assert found.friction.stick_fraction > 0.999  # the first slope is not zero


def test_damper_to_moving_support_sticking_mass_holds():
    """Friction bears what the damper pulls with, ``c d'``; the velocity has a part in the support's displacement."""
    m, c = 2.0, 5.0
    A, B = [[0.0, 1.0], [0.0, -c / m]], [[c / m, 0.0], [-((c / m) ** 2), 1.0 / m]]
    plant = ct.ss(A, B, [[1.0, 0.0]], [[0.0, 0.0]], inputs=["d", "f"], outputs=["x"])
    time = np.linspace(0.0, 4.0, 801)
    d = {"d": 0.3 * (1.0 - np.cos(4.0 * time))}
    found = simulate_loop(plant, None, time, d, sample_time=0.005, friction=_law(10.0))
    assert np.abs(found["x"]).max() < 1e-4
    assert found.friction.stick_fraction > 0.999
    np.testing.assert_allclose(found.friction.force, -c * 1.2 * np.sin(4.0 * time), atol=0.1)


def _shaken_boom(h, force, substeps):
    time = h * np.arange(round(4.0 / h) + 1)
    platform = {
        name: 0.03 * np.sin(2.0 * np.pi * freq_hz * time) ** 3
        for name, freq_hz in (("actuator_left", 0.9), ("actuator_right", 0.6))
    }
    law = CoulombFriction(force, substeps=substeps)
    return simulate_loop(bc.spray_boom(elements=8), None, time, platform, sample_time=h, friction=law).friction


@pytest.mark.slow
def test_substeps_do_not_loosen_a_cradle_on_a_shaken_platform():
    """A displacement given at points has no corners there: what holds on a fine grid holds with any substeps."""
    assert _shaken_boom(0.001, 200.0, 1).dissipated_energy < 1e-4
    fine = _shaken_boom(0.0005, 100.0, 1)
    for substeps in (1, 4, 32):
        held, slipping = _shaken_boom(0.004, 200.0, substeps), _shaken_boom(0.004, 100.0, substeps)
        assert held.stick_fraction > 0.999
        assert held.dissipated_energy < 1e-4
        assert slipping.dissipated_energy == pytest.approx(fine.dissipated_energy, rel=0.06)
        assert slipping.stick_fraction == pytest.approx(fine.stick_fraction, abs=0.01)
