"""Sampled loops: against the same loop stepped event by event; margins against what they say."""

import warnings

import control
import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exceptions import MarginLossWarning
from tests.analysis.loop_cases import radius, step_matrix
from tests.analysis.test_margins import random_case
from tests.profiles import examples

pytestmark = pytest.mark.filterwarnings("ignore::boomctl.exceptions.MarginLossWarning")


def beside_its_margin(plant, controller, loop):
    """Return the spectral radius just below the delay margin of a loop, and just above."""
    changes = ({"further": loop.delay_margin * f, "at": loop.signal} for f in (1.0 - 1e-5, 1.0 + 1e-5))
    return [radius(plant, controller, 0.0, **change) for change in changes]


@examples(200)
@given(st.integers(0, 100_000))
def test_sampled_loop_poles_match_event_simulation(seed):
    plant, controller, delay = random_case(seed, "sampled")
    loop = bc.feedback_loop(plant, controller, controller.output_labels, delay=delay)
    brute = np.linalg.eigvals(step_matrix(plant, controller, delay))
    ours = loop.poles()
    # the stepped one remembers more, which are further poles at zero; those are Jordan blocks, which rounding moves far
    for pole in brute[np.abs(brute) > 0.3]:
        assert np.abs(np.poly(ours) @ pole ** np.arange(len(ours), -1, -1.0)) <= 1e-9 * np.abs(
            1.0 + np.abs(pole)
        ) ** len(ours)
    assert np.abs(ours).max() == pytest.approx(np.abs(brute).max(), abs=1e-6) or np.abs(brute).max() < 0.3


def loop_with_a_window(seed):
    """Return a loop of one signal that a short range of further delays makes unstable, those delays, and their radii.

    Its controller rings from sample to sample; the gain is that at which the least stable of the delays is hardly unstable.
    """
    rng = np.random.default_rng(seed)
    n, dt = int(rng.integers(1, 5)), 0.1
    A = 3.0 * rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + rng.uniform(0.1, 2.0)) * np.eye(n)
    plant = control.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), 0.0, inputs="u", outputs="y")
    T = rng.standard_normal((2, 2))
    AK = np.linalg.solve(T, np.diag([-rng.uniform(0.8, 0.99), rng.uniform(-0.5, 0.5)]) @ T)
    BK, CK, DK = rng.standard_normal((2, 1)), rng.standard_normal((1, 2)), 0.1 * rng.standard_normal((1, 1))
    delays = dt * np.linspace(0.0, 2.0, 41)

    def at(gain):
        K = control.ss(AK, BK, gain * CK, gain * DK, dt, inputs="y", outputs="u")
        return K, np.array([radius(plant, K, 0.0, further=delay, at="u") for delay in delays])

    low, high = 0.0, 100.0
    for _ in range(10):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at(middle)[1].max() < 1.0 else (low, middle)
    return plant, *at(high), delays


@pytest.mark.slow  # windows are drawn by stepping many loops
@examples(40)
@given(st.integers(0, 100_000))
def test_delay_margin_window_wider_than_the_grid_is_found(seed):
    """Two of the delays, a twentieth of a sample apart, are unstable: the window is wider than a part of the grid."""
    for draw in range(20):  # most loops have no window
        plant, controller, radii, delays = loop_with_a_window(seed + 100_001 * draw)
        unstable = radii > 1.0 + 1e-9
        if radii[0] < 1.0 - 1e-6 and (unstable[1:] & unstable[:-1]).any():
            break
    else:
        assume(False)
    found = bc.margins(plant, controller)
    for loop in found.loops:
        assert loop.delay_margin <= delays[1:][unstable[1:] & unstable[:-1]][0]
        below, above = beside_its_margin(plant, controller, loop)
        assert below < 1.0 < above


def test_delay_margin_at_actuator_and_sensor_of_single_loop():
    P = control.tf([5.0], [1.0, 3.0, 3.0, 1.0], inputs="u", outputs="y")
    K = control.ss(0.5, 1.0, -0.15, 0.0, 0.3, inputs="y", outputs="u")
    late = bc.margins(P, K, delay=0.1)
    assert late["y"].delay_margin == pytest.approx(late["u"].delay_margin, rel=1e-6)


@pytest.mark.slow
@examples(60)
@given(st.integers(0, 100_000))
@example(5544)  # A fourfold pole: rounding of the response moves the crossing by 3e-5.
def test_delay_margin_with_repeated_poles(seed):
    """A regulator and a filter of like weights: poles of the loop come twice, or nearly, in Jordan blocks."""
    rng = np.random.default_rng(seed)
    omega, zeta, dt = rng.uniform(0.5, 5.0), rng.uniform(0.001, 0.2), rng.uniform(0.05, 0.2)
    A, b = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]), np.array([[0.0], [1.0]])
    plant = control.ss(A, b, b.T if rng.random() < 0.5 else b[::-1].T, 0.0, inputs="u", outputs="y")
    like = 10.0 ** rng.uniform(-2, 1)
    other = like * (1.0 + 10.0 ** rng.uniform(-14, -2) * (rng.random() < 0.5))
    sampled = control.sample_system(plant, dt, name="plant")
    controller = bc.lqg(sampled, None, 1.0, {"u": other}, 1.0, output_weight={"y": like}).controller
    found = bc.margins(plant, controller)
    for loop in found.loops:
        if loop.delay_margin < 50.0 * dt:
            below, above = beside_its_margin(plant, controller, loop)
            assert below < 1.0 < above
        tried = np.linspace(0.0, min(loop.delay_margin, 20.0 * dt), 41)[:-1]
        assert max(radius(plant, controller, 0.0, further=delay, at=loop.signal) for delay in tried) < 1.0


@pytest.mark.slow
@examples(100)
@given(st.integers(0, 100_000))
def test_gains_within_disk_keep_loop_stable(seed):
    plant, controller, delay = random_case(seed, "sampled")
    assume(radius(plant, controller, delay) < 0.995)
    found = bc.margins(plant, controller, delay=delay)
    rng = np.random.default_rng(seed)
    gain = min(found.multiloop_io.gain_margin, 1e6) ** 0.999
    P, K = np.ones(plant.ninputs), np.ones(plant.noutputs)
    for _ in range(3):
        P, K = (gain ** rng.choice([-1.0, 1.0], len(each)) for each in (P, K))
        changed = control.ss(
            controller.A, controller.B * K, controller.C * P[:, None], controller.D * K * P[:, None], controller.dt,
            inputs=controller.input_labels, outputs=controller.output_labels,
        )  # fmt: skip
        assert radius(plant, changed, delay) < 1.0
    assert found.multiloop_io.certified


@pytest.mark.slow
def test_fast_sampling_has_the_margins_of_the_continuous_loop():
    plant = control.ss([[0.0, 1.0], [-4.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    K = control.ss([[-30.0]], [[1.0]], [[900.0]], [[-35.0]], inputs="place", outputs="force")
    before = bc.margins(plant, K)
    errors = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        now = bc.margins(plant, bc.discretize(K, dt))
        errors.append(abs(now["force"].phase_margin_deg - before["force"].phase_margin_deg))
        assert now["force"].disk_margin.alpha == pytest.approx(before["force"].disk_margin.alpha, rel=20.0 * dt)
    # half a sample of delay: of first order
    assert np.divide(errors[:2], errors[1:]) == pytest.approx([2.0, 2.0], rel=0.05)


@pytest.mark.slow
def test_what_sampling_costs_is_warned_of():
    plant = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="place")
    K = control.ss([[-20.0]], [[1.0]], [[360.0]], [[-20.0]], inputs="place", outputs="force")
    with pytest.warns(MarginLossWarning, match="takes the disk margin from .* to .* at all controls"):
        bc.margins(plant, bc.discretize(K, 0.05), delay=0.2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bc.margins(plant, bc.discretize(K, 0.002), delay=0.001)
        # the plant is discrete: what was before is not known
        bc.margins(control.sample_system(plant, 0.05, name="plant"), bc.discretize(K, 0.05), delay=0.05)
