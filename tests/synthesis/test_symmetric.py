"""Controllers of two halves act on the machine as each does on its half."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.synthesis import join_symmetric, split_controller
from tests.profiles import examples
from tests.strategies import seeds

MODEL = bc.spray_boom(elements=6, accelerometer_bandwidth_hz=20.0)
FORCES, STROKES = ["suspension_right", "suspension_left"], ["stroke_right", "stroke_left"]


def half_controller(side: str, seed: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    A, B, C = rng.standard_normal((3, 3)) - 5.0 * np.eye(3), rng.standard_normal((3, 2)), rng.standard_normal((1, 3))
    names = {"inputs": [f"tip_acceleration_{side}", f"stroke_{side}"], "outputs": [f"suspension_{side}"]}
    return control.ss(A, B, C, 0.0, **names)


def single(side: str, A, B, C, D=0.0, dt: float | None = 0.0) -> control.StateSpace:
    """Return a controller of one half, of its stroke alone."""
    return control.ss(A, B, C, D, dt, inputs=[f"stroke_{side}"], outputs=[f"suspension_{side}"])


def at(system: control.StateSpace, omega: float, inputs: list[str], outputs: list[str]) -> np.ndarray:
    value = system(1j * omega, squeeze=False)
    rows = [system.output_labels.index(name) for name in outputs]
    return value[np.ix_(rows, [system.input_labels.index(name) for name in inputs])]


@pytest.mark.parametrize(("side", "parity"), [("sym", 1.0), ("anti", -1.0)])
def test_the_machine_sees_each_half_s_controller(side, parity):
    halves = {"sym": half_controller("sym", 1), "anti": half_controller("anti", 2)}
    joined = join_symmetric(MODEL, halves["sym"], halves["anti"])
    assert joined.nstates == 6
    mode = np.array([1.0, parity]) / np.sqrt(2.0)
    tips = ["tip_right_acceleration", "tip_left_acceleration"]
    for stem, names in (("stroke", STROKES), ("tip_acceleration", tips)):
        part = at(halves[side], 1.7, [f"{stem}_{side}"], [f"suspension_{side}"])[0, 0]
        assert np.allclose(at(joined, 1.7, names, FORCES) @ mode, part * mode, rtol=1e-12)


def test_integrator_chains_in_any_signal_order():
    A = [[0.0, 1e-3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1e5]]
    chain = single("anti", A, [[0.0], [1.0], [1.0]], [[1.0, 0.0, 1.0]])
    other = half_controller("sym", 3)[0, 1]
    other = single("sym", other.A, other.B, other.C)
    joined = join_symmetric(MODEL, other, chain)
    for whole in (joined, joined[:, joined.input_labels[::-1]]):
        sym, anti, _ = split_controller(MODEL, whole)
        assert anti.nstates == 3
        assert sym.nstates <= 3
        assert np.isclose(anti(0.2j), chain(0.2j), rtol=1e-6)


@examples(100)
@given(seeds, st.sampled_from([None, 0, 0.01, 0.3]), st.booleans())
def test_a_gain_of_one_half_goes_with_the_time_of_the_other(seed, dt, turned):
    rng = np.random.default_rng(seed)
    n, sides = int(rng.integers(0, 4)), ("sym", "anti")[:: -1 if turned else 1]
    gain, timed = (
        single(side, *(rng.standard_normal(shape) for shape in ((m, m), (m, 1), (1, m), (1, 1))), time)
        for side, m, time in zip(sides, (0, n if dt is not None else 0), (None, dt), strict=True)
    )
    joined = join_symmetric(MODEL, *((timed, gain) if turned else (gain, timed)))
    assert joined.dt == dt or (not dt and not joined.nstates)  # a gain has no time
    mode = np.array([1.0, -1.0 if turned else 1.0]) / np.sqrt(2.0)
    assert np.allclose(at(joined, 0.7, STROKES, FORCES) @ mode, gain.D[0, 0] * mode, rtol=1e-12)


def test_a_discrete_controller_is_split_into_discrete_ones():
    halves = half_controller("sym", 1), half_controller("anti", 2)
    discrete = [control.sample_system(half, 0.01, "tustin") for half in halves]
    for half, whole in zip(discrete, halves, strict=True):
        half.update_names(inputs=whole.input_labels, outputs=whole.output_labels)
    *found, missed = split_controller(MODEL, join_symmetric(MODEL, *discrete))
    assert missed < 1e-9
    for half, expected in zip(found, discrete, strict=True):
        assert (half.dt, half.nstates) == (0.01, expected.nstates)
        z = np.exp(0.3j)
        places = [half.input_labels.index(name) for name in expected.input_labels]
        assert half(z).reshape(half.noutputs, -1)[:, places] == pytest.approx(expected(z).reshape(half.noutputs, -1))


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 8))])
@pytest.mark.parametrize(
    ("of_sym", "of_anti"),
    [
        ([0.0], [-1.0]),
        ([0.0, -4.0], [-2.0]),
        ([-1e-9, -4.0], [-2.0]),
        ([0.0, -4.0], [0.0, -4.0]),
        ([-1e-6, -1.0], [-30.0, -2.0]),
        ([1.0, -4.0], [-1.0]),
        ([[[0.0, 3.0], [-3.0, 0.0]]], [-1.0]),
        ([0.0, -1.0, -2.0, -3.0, -1e3], [-1.0, -2.0, -3.0]),
    ],
    ids=["alone", "integrator", "leaky", "alike", "slow lag", "unstable", "undamped", "many"],
)
def test_halves_are_found_again_in_any_coordinates(of_sym, of_anti, seed):
    """Joined and turned, they are the same two controllers: no lasting state of one is left, hidden, in the other."""
    rng = np.random.default_rng(seed)

    def half(side, blocks):
        A = linalg.block_diag(*blocks)
        return single(side, A, rng.standard_normal((len(A), 1)), rng.standard_normal((1, len(A))), 0.3)

    given = half("sym", of_sym), half("anti", of_anti)
    joined = join_symmetric(MODEL, *given)
    T = np.linalg.qr(rng.standard_normal(joined.A.shape))[0]
    names = {"inputs": joined.input_labels, "outputs": joined.output_labels}
    omega = np.geomspace(1e-2, 1e3, 50)
    turned = control.ss(T @ joined.A @ T.T, T @ joined.B, joined.C @ T.T, joined.D, **names)
    for whole, slack, most in ((joined, 1e-9, 1e-12), (turned, 1e-6, 1e-6)):
        *found, missed = split_controller(MODEL, whole)
        assert missed < most
        assert whole is turned or [one.nstates for one in found] == [one.nstates for one in given]
        for one, other in zip(found, given, strict=True):
            assert np.abs(one(1j * omega) / other(1j * omega) - 1.0).max() < slack


@examples(200)
@given(seeds, st.floats(-9.0, -2.0))
def test_split_controller_reports_coupling(seed, power):
    """As a synthesis on a machine that is not quite symmetric makes it: pairs of nearly equal poles, faintly coupled."""
    rng = np.random.default_rng(seed)
    halves = half_controller("sym", seed), half_controller("anti", seed + rng.integers(0, 2))
    joined, mixing = join_symmetric(MODEL, *halves), 10.0**power
    A, B, C = (m * (1.0 + mixing * rng.standard_normal(m.shape)) for m in (joined.A, joined.B, joined.C))
    A = A + mixing * rng.standard_normal(A.shape)
    whole = control.ss(A, B, C, 0.0, inputs=joined.input_labels, outputs=joined.output_labels)
    *found, missed = split_controller(MODEL, whole)
    omega = np.geomspace(1e-2, 1e3, 50)
    for one, other in zip(found, halves, strict=True):
        truth = other[:, one.input_labels](1j * omega)
        assert np.abs(one(1j * omega) - truth).max() < 100.0 * mixing * np.abs(truth).max()
    assert missed < 100.0 * mixing
