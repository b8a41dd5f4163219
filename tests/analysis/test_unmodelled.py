"""Stability with dynamics that a family does not model: what is proved is stable with whatever is within the bounds."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.box.unmodeled import _folded
from boomctl.identification.uncertainty_weight import overbound
from boomctl.lti.system import of
from boomctl.structure import AffineFamily, SecondOrderModel
from tests.profiles import examples
from tests.strategies import seeds


def family(damping=0.1, unit=1.0, strength=1.0):
    """Return two masses of which a stiffness and a mass are uncertain, with units of the second's place and force."""

    def make(values):
        k, m = values["stiffness"], values["mass"]
        M, K = np.diag([1.0, m]), np.array([[2.0 + k, -k], [-k, k]])
        C = damping * np.array([[2.0, -1.0], [-1.0, 1.0]])
        return SecondOrderModel(M, C, K, {"u": [1.0, 0.0], "v": [0.0, strength]}, {"y": [1.0, 0.0], "z": [0.0, unit]})

    return AffineFamily.from_function({"stiffness": (0.8, 1.2), "mass": (0.9, 1.1)}, make)


def named(system, inputs="u", outputs="y"):
    system = control.ss(system)
    time = (system.dt,) if system.dt else ()
    return control.ss(system.A, system.B, system.C, system.D, *time, inputs=inputs, outputs=outputs)


def damper(gain=0.6, corner=8.0):
    return named(control.ss(-corner, corner, corner * gain, -corner * gain), "y", "u")


def with_beside(plant, beside):
    """Return a plant with dynamics beside it, by names."""
    P = of(plant).statespace("plant")
    into = [[float(name == own) for name in P.input_labels] for own in beside.input_labels]
    out = [[float(name == own) for own in beside.output_labels] for name in P.output_labels]
    both = P + control.ss([], [], [], out) * beside * control.ss([], [], [], into)
    return named(both, P.input_labels, P.output_labels)


def turned(W, rng):
    """Return dynamics as large as a bound at every frequency, their phase turned by passes of all drawn."""
    found = control.ss(W) * rng.choice([-1.0, 1.0])
    for rate in rng.uniform(0.1, 20.0, rng.integers(0, 3)):
        found = found * control.ss(-rate, 1.0, 2.0 * rate, -1.0)
    return found


def slowest(plant, K, late=0.0):
    """Return the rate of the slowest pole of a loop."""
    poles = bc.feedback_loop(plant, K, injection_points=K.input_labels, delay=late).poles()
    return np.log(np.abs(poles)).max() if K.dt else poles.real.max()


BOUND = named(bc.synthesis.band_pass(0.05, 0.3, 6.0) * bc.low_pass(1.0, 9.0))


def scaled(W, by):
    return control.ss(W.A, W.B, by * W.C, by * W.D, inputs=W.input_labels, outputs=W.output_labels)


SLOW = [pytest.param(late, marks=pytest.mark.slow) for late in (0.0, 0.07)]


@pytest.mark.parametrize("late", [None, *SLOW])
def test_proved_loop_stable_with_any_admissible_dynamics(late):
    """Up to 5 % below where small gain ends; drawn: points of the box, and dynamics that touch the bounds everywhere."""
    rng, plants = np.random.default_rng(0), family()
    K = damper() if late is None else bc.discretize(damper(), 0.1)
    loose = bc.robust_stability(plants, K, additive_uncertainty=scaled(BOUND, 0.1), delay=late or 0.0)
    assert loose.proved
    W = scaled(BOUND, 0.1 * 0.95 / loose.small_gain)
    tight = bc.robust_stability(plants, K, additive_uncertainty=W, delay=late or 0.0)
    assert tight.proved
    assert tight.small_gain == pytest.approx(0.95, rel=1e-3)
    assert "with unmodeled dynamics" in tight.method
    for _ in range(40):
        plant = with_beside(plants.at(rng.uniform(-1.0, 1.0, 2)), named(turned(W, rng)))
        assert slowest(plant, K, late or 0.0) < 0.0


UNREACHED = control.ss(np.diag([-1.0, -2.0]), [[1.0], [0.0]], [[0.0, 1.0]], 0.0, inputs="y", outputs="u")


@pytest.mark.parametrize(
    ("K", "by"),
    [
        (damper(), 0.0),
        (UNREACHED, 1.0),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in ((damper(0.0), 1.0), (bc.discretize(damper(), 0.1), 0.0))
        ),
    ],
)
def test_uncertainty_that_misses_the_control_changes_nothing(K, by):
    nominal = bc.robust_stability(family(), K)
    found = bc.robust_stability(family(), K, additive_uncertainty=scaled(BOUND, by))
    assert nominal.proved
    assert found == replace(nominal, small_gain=0.0, cells=found.cells)


def test_uncertainty_beyond_bound_not_proved():
    """Of one entry small gain is necessary: a pass of all turns the phase until a pole crosses the axis."""
    plants, K = family(), damper()
    found = bc.robust_stability(plants, K, additive_uncertainty=BOUND)
    for by in (0.97, 1.03):
        W = scaled(BOUND, by / found.small_gain)
        again = bc.robust_stability(plants, K, additive_uncertainty=W)
        assert again.proved == (by < 1.0)
        assert again.destabilizing_values is None
    assert "small-gain norm 1.03" in again.message
    gains = []
    for delta in np.random.default_rng(0).uniform(-1.0, 1.0, (30, 2)):
        plant = plants.at(delta).select("u", "y").to_statespace()
        around = control.ss(W) * named(K, "y", "u") * control.feedback(control.ss([], [], [], 1.0), plant * K, sign=1)
        gains.append((bc.hinf_norm(around), delta, around))
    norm, delta, around = max(gains, key=lambda each: each[0].lower_bound)
    assert 0.95 < norm.lower_bound <= 1.03 * (1.0 + 1e-9)
    omega, value = norm.peak_omega, around(1j * norm.peak_omega)
    larger = scaled(W, 1.02 / norm.lower_bound)
    angle = np.angle(1.0 / value) % (2.0 * np.pi)  # of -+ (s - r)/(s + r), from pi down to 0
    sign, angle = (1.0, angle) if angle < np.pi else (-1.0, angle - np.pi)
    rate = omega / np.tan(0.5 * (np.pi - angle)) if angle else 0.0
    turn = sign * control.ss(-rate, 1.0, -2.0 * rate, 1.0)
    assert np.angle(turn(1j * omega) * value) == pytest.approx(0.0, abs=1e-6)
    assert slowest(with_beside(plants.at(delta), named(larger * turn)), K) > 0.0


def band_pass(rng):
    corner, dt = 10.0 ** rng.uniform(-1.0, 1.0), 10.0 ** rng.uniform(-2.0, -0.5)
    order = int(rng.integers(1, 3))
    return bc.synthesis.band_pass(1.0, 0.5 * corner, 4.0 * corner) * bc.low_pass(1.0, 6.0 * corner, order), corner, dt


def resonance(rng):
    corner, dt, zeta = 10.0 ** rng.uniform(-1.0, 2.0), 10.0 ** rng.uniform(-2.0, 0.0), 10.0 ** rng.uniform(-5.0, -1.0)
    return control.tf([corner**2], [1.0, 2.0 * zeta * corner, corner**2]), corner, dt


@pytest.mark.slow
@pytest.mark.parametrize("make", [band_pass, resonance])
@given(seed=seeds)
@examples(40)
def test_discrete_bound_covers_sampled_dynamics(make, seed):
    """However narrow, and wherever samples see it.

    Where nothing folds back, the bound of what falls slowly is no more than 1.5 times larger.
    """
    rng = np.random.default_rng(seed)
    W, corner, dt = make(rng)
    W, half = named(W), np.pi / dt
    seen = np.abs((W.poles() + 1j * half).imag % (2.0 * half) - half)  # resonances as samples see them
    near = seen[:, None] + W.poles().real[:, None] * np.linspace(-3.0, 3.0, 61)
    omega = np.clip(np.r_[np.geomspace(1e-6, 0.999, 400) * half, near.ravel()], 1e-7 * half, 0.999 * half)
    bound = np.linalg.norm(_folded(of(W), dt).response(omega)[0], axis=0)
    for phases in (W, *(turned(W, rng) for _ in range(5))):
        met = control.sample_system(control.ss(phases), dt, "zoh")
        assert (np.abs(met(np.exp(1j * omega * dt))) <= bound).all()
    size = np.abs(W(1j * omega))
    large = (omega < 0.02 * half) & (size > 0.3 * size.max())  # elsewhere what folds back is not small beside it
    if make is band_pass and W.nstates == 3 and 6.0 * corner < 0.05 * half:
        assert np.median(bound[large] / size[large]) < 1.5


@given(seed=seeds, order=st.integers(3, 8), fall=st.integers(0, 2))
@examples(40)
def test_a_bound_is_above_and_falls_as_it_is_told(seed, order, fall):
    rng = np.random.default_rng(seed)
    omega = np.sort(10.0 ** rng.uniform(-1.0, 2.0, 60))
    size = 10.0 ** rng.uniform(-6.0, 3.0) * rng.rayleigh(size=60) / (1.0 + np.square(omega / 5.0))
    W = overbound(omega, size, order, fall)
    assert len(W.A) == order
    assert (W.poles.real < 0.0).all()
    there = np.abs(W.response(omega)[0, 0]) / size
    assert there.min() >= 1.0
    away = np.geomspace(1.0, 1e8, 300)
    below = np.abs(W.response(omega[0] / away)[0, 0]) / size[0]
    above = np.abs(W.response(omega[-1] * away)[0, 0]) / (size[-1] * away**-fall)
    beyond = min(below.min(), above.min())
    assert beyond >= 0.999
    assert min(there.min(), beyond) == pytest.approx(1.0, abs=1e-3)  # it touches
    far = 1e4 * omega[-1] * np.array([1.0, 10.0])
    high = np.abs(W.response(far)[0, 0])
    assert high[1] / high[0] == pytest.approx(10.0**-fall, rel=1e-3)


@pytest.mark.slow
def test_uncertainty_invariant_to_units():
    rng, plants = np.random.default_rng(1), family(0.3)
    K = control.ss(
        -8.0 * np.eye(2), 8.0 * np.eye(2), 3.0 * np.eye(2), -3.0 * np.eye(2), inputs=["y", "z"], outputs=["u", "v"]
    )
    entry = control.ss(BOUND)
    W = control.ss([], [], [], [[1.0, 0.5], [0.5, 1.0]]) * control.append(entry, entry)
    W = named(W, ["u", "v"], ["y", "z"])
    found = bc.robust_stability(plants, K, additive_uncertainty=scaled(W, 0.1))
    assert found.proved
    W = scaled(W, 0.095 / found.small_gain)
    assert bc.robust_stability(plants, K, additive_uncertainty=W).proved
    for _ in range(20):
        plant = plants.at(rng.uniform(-1.0, 1.0, 2))
        for u in "uv":
            for y in "yz":
                share = 0.5 if (u == "v") == (y == "y") else 1.0
                beside = named(share * 0.095 / found.small_gain * turned(entry, rng), u, y)
                plant = with_beside(plant, beside)
        assert slowest(plant, K) < 0.0
    for unit, strength in ((1024.0, 1.0), (1.0, 1024.0)):
        S, T = np.diag([1.0, 1.0 / unit]), np.diag([1.0, 1.0 / strength])
        K2 = named(control.ss(K.A, K.B @ S, T @ K.C, T @ K.D @ S), ["y", "z"], ["u", "v"])
        W2 = named(np.linalg.inv(S) * W * np.linalg.inv(T), ["u", "v"], ["y", "z"])
        again = bc.robust_stability(family(0.3, unit, strength), K2, additive_uncertainty=scaled(W2, 0.5))
        assert again.proved
        # units are scaled by powers of two
        assert again.small_gain == pytest.approx(0.5 * 0.95, rel=1e-2 if strength == 1.0 else 0.5)
