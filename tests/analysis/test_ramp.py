"""How fast a parameter may change: what is proved stays bounded, what blows up is not proved, bounds hold between corners."""

import control as ct
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.analysis.box import ramp
from boomctl.analysis.box.loops import BoxLoops
from boomctl.structure import AffineFamily, PolynomialFamily, SecondOrderModel
from tests.profiles import examples

_STEPS = 400  # of constant matrices over a period: exact enough to tell a multiplier of 1.05 from one


def springs(seed=0, depth=0.5, n=1, low=0.01, high=0.3):
    """Return lightly damped masses on springs that a parameter stiffens, and the first frequency."""
    rng = np.random.default_rng(seed)
    rates, ratio = np.sort(rng.uniform(0.5, 3.0, n)) * (1.0 + np.arange(n)), np.exp(rng.uniform(*np.log([low, high])))
    mixed = linalg.expm(0.6 * (lambda X: X - X.T)(rng.standard_normal((n, n))))
    # between K0 - 0.9 depth K0 and K0 + 0.9 depth K0: stiff at every value
    K0, K1 = (
        np.diag(rates**2),
        depth * np.diag(rates) @ mixed @ np.diag(rng.choice([-1.0, 1.0], n)) @ mixed.T @ np.diag(rates),
    )
    C = 2.0 * ratio * np.diag(rates)
    ports = {"force": np.eye(n)[0]}, {"place": np.eye(n)[0]}

    def make(values):
        return SecondOrderModel(np.eye(n), C, K0 + values["p"] * 0.9 * K1, *ports)

    return AffineFamily.through({"p": (-1.0, 1.0)}, make), float(rates[0]), float(ratio)


def multiplier(family, course, period):
    """Return by how much a period of a course, a function of time, makes the loop without control grow at most."""
    loops, h = BoxLoops.of(family, _IDLE), period / _STEPS
    step = np.eye(2 * family.centre.n)
    for k in range(_STEPS):
        here = loops.at(np.array([course((k + 0.5) * h)]))
        step = linalg.expm(h * np.linalg.solve(here.E, here.A)) @ step
    return float(np.abs(np.linalg.eigvals(step)).max())


_IDLE = ct.ss([], [], [], [[0.0]], inputs="place", outputs="force")


@pytest.mark.slow
@examples(40)
@given(st.integers(0, 10_000), st.floats(0.2, 1.0), st.integers(1, 2))
def test_what_is_proved_does_not_grow_under_the_worst_waves(seed, depth, n):
    """Triangles at the rate proved, of many periods, parametric resonance among them, never make the loop grow."""
    family, omega, _ = springs(seed, depth, n)
    found = bc.analysis.ramp_bound(family, _IDLE)
    assert 0.0 < found.rate <= found.at_most
    assert found.slack >= 0.0
    for share in (0.3, 0.5, 1.0, 2.0):  # of the period of parametric resonance, pi/omega, and others
        period = share * 2.0 * np.pi / omega
        height = min(found.rate * period / 4.0, 1.0)

        def wave(t, height=height, period=period):
            return height * (2.0 / np.pi) * np.arcsin(np.sin(2.0 * np.pi * t / period))

        assert multiplier(family, wave, period) < 1.0


@pytest.mark.slow
@examples(40)
@given(st.integers(0, 10_000), st.floats(0.4, 1.0))
def test_what_grows_under_a_wave_is_not_proved_for_its_rate(seed, depth):
    """Mathieu's equation: stable while the stiffness stays, unstable while it swings at twice the frequency."""
    family, omega, _ = springs(seed, depth, low=0.01, high=0.1)
    assert bc.robust_stability(family, _IDLE).proved
    period, found = np.pi / omega, bc.analysis.ramp_bound(family, _IDLE)
    for height in (0.2, 0.5, 1.0):
        if multiplier(family, lambda t, a=height: a * np.cos(2.0 * omega * t), period) > 1.0:
            assert found.rate < 2.0 * omega * height


def test_a_scheduled_gain_that_is_stable_at_every_value_and_not_on_a_ramp():
    """A classic trap: the gain turns the stiffness of a mass with the parameter that it follows."""
    mass = SecondOrderModel([[1.0]], [[0.1]], [[1.0]], {"force": [1.0]}, {"place": [1.0], "p": [0.0]})
    family = PolynomialFamily(("p",), np.array([-1.0]), np.array([1.0]), mass, ())
    gains = [ct.ss([], [], [], [[0.9 * k]], inputs="place", outputs="force") for k in (-1.0, 1.0)]
    drive = bc.schedule(gains, [-1.0, 1.0], "p")
    assert bc.robust_stability(family, drive).proved
    found, loops = bc.analysis.ramp_bound(family, drive), BoxLoops.of(family, drive)
    step, period = np.eye(2), np.pi
    for k in range(_STEPS):
        here = loops.at(np.array([np.cos(2.0 * (k + 0.5) * period / _STEPS)]))
        step = linalg.expm(period / _STEPS * here.A) @ step
    assert np.abs(np.linalg.eigvals(step)).max() > 1.2  # it swings at 2 rad/s at most
    assert 0.0 < found.rate < 2.0


@examples(25)
@given(st.integers(0, 10_000), st.tuples(st.integers(1, 4), st.integers(1, 3)))
def test_polynomials_are_averages_of_their_coefficients(seed, degrees):
    rng, n = np.random.default_rng(seed), 3
    places, back = ramp._bernstein(degrees)
    powers = [(i, j) for i in range(degrees[0] + 1) for j in range(degrees[1] + 1)]
    terms = rng.standard_normal((len(powers), n, n))
    terms = terms + terms.transpose(0, 2, 1)

    def at(t):
        return sum(t[0] ** i * t[1] ** j * X for (i, j), X in zip(powers, terms, strict=True))

    coefficients = np.tensordot(back, np.array([at(t) for t in places]), 1)
    largest = np.linalg.eigvalsh(coefficients)[:, -1].max()
    for t in rng.uniform(0.0, 1.0, (20, 2)):
        assert np.linalg.eigvalsh(at(t))[-1] <= largest + 1e-9
    for corner in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):  # there coefficients are values
        assert np.abs(coefficients - at(corner)).max(axis=(1, 2)).min() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "damping"), [("sfoam", 0.0), pytest.param("foam", 0.01, marks=pytest.mark.slow)], ids=["sfoam", "foam"]
)
def test_a_hub_beam_with_any_mass_at_its_tip_and_its_certificate(model, damping):
    """V' is tried again at points drawn over the box, with loops closed anew: the least share left is the slack."""
    family = bc.hub_beam(bc.HubBeamParameters(damping_ratio=damping), model, 1).family((0.0, 4.0), (0.0, 0.1))
    signals = {"inputs": ["hub_speed", "root_moment"], "outputs": "torque"}
    drives = [ct.ss([], [], [], [[-gain, -0.3]], **signals) for gain in (30.0, 60.0)]
    found = bc.analysis.ramp_bound(family, bc.schedule(drives, [0.0, 4.0]), tolerance=0.3)
    assert found.proved
    assert found.parameter == "hub_speed"
    assert 0.0 <= found.slack < 0.5
    assert found.rate >= 0.6 * found.at_most
    beside = bc.analysis.ramp_bound(family, drives[0], "tip_mass", tolerance=0.3)
    assert beside.parameter == "tip_mass"
    assert beside.proved


@pytest.mark.slow
@examples(40)
@given(st.integers(0, 10_000))
def test_the_certificate_is_of_the_loop_in_whatever_states_the_controller_is(seed):
    """With states of sizes far apart: what is proved is found again in loops closed anew."""
    rng = np.random.default_rng(seed)
    family, omega, _ = springs(seed, rng.uniform(0.1, 0.8), low=0.02, high=0.3)
    omega, scales = omega * 10.0 ** rng.uniform(0.3, 1.5), 10.0 ** rng.uniform(-4.0, 4.0, 2)
    A, B, C = np.array([[0.0, 1.0], [-(omega**2), -omega]]), np.array([[0.0], [omega**2]]), np.array([[0.03, 0.0]])
    signals = {"inputs": "place", "outputs": "force"}
    given = ct.ss(A * scales / scales[:, None], B / scales[:, None], C * scales, 0.0, **signals)
    found, plain = (
        bc.analysis.ramp_bound(family, each, tolerance=0.5) for each in (given, ct.ss(A, B, C, 0.0, **signals))
    )
    assert found.proved == plain.proved
    assert found.slack >= 0.0


def test_a_loop_that_is_unstable_says_where():
    family, *_ = springs(3)
    push = ct.ss([], [], [], [[100.0]], inputs="place", outputs="force")
    found = bc.analysis.ramp_bound(family, push)
    assert found.rate == 0.0
    assert found.unstable_at is not None
    assert "unstable at p" in found.render()


def test_a_grid_too_coarse_proves_nothing_and_says_so():
    family, *_ = springs(1, 1.0, 1, low=1e-5, high=1e-4)
    found = bc.analysis.ramp_bound(family, _IDLE, max_cells=1)
    assert found.rate == 0.0
    assert "not proved for any change of p" in found.render()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameter": "q"}, "unknown parameter 'q'"),
        ({"tolerance": 0.0}, "tolerance = 0.0: expected a number greater than zero"),
        ({"max_cells": 0}, "max_cells = 0: expected a whole number not below 1"),
        ({"max_cells": 10**9}, "max_cells = 1000000000: expected a whole number of at most 100000"),
        ({"controller": ct.ss(_IDLE, dt=0.1)}, "expected continuous time"),
    ],
)
def test_bad_input_is_refused_by_name(change, message):
    given = {"family": springs()[0], "controller": _IDLE, **change}
    with pytest.raises(ValueError, match=message):
        bc.analysis.ramp_bound(**given)
