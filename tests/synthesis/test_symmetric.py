"""Controllers of two halves act on the machine as each does on its half."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.synthesis import join_symmetric, split_controller
from tests.profiles import examples
from tests.strategies import seeds

MODEL = bc.spray_boom(elements=6, accelerometer_bandwidth_hz=20.0)


def half_controller(side: str, seed: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 3)) - 5.0 * np.eye(3)
    measured = [f"tip_acceleration_{side}", f"stroke_{side}"]
    return control.ss(
        A,
        rng.standard_normal((3, 2)),
        rng.standard_normal((1, 3)),
        0.0,
        inputs=measured,
        outputs=[f"suspension_{side}"],
    )


def at(system: control.StateSpace, omega: float, inputs: list[str], outputs: list[str]) -> np.ndarray:
    value = system(1j * omega, squeeze=False)
    rows = [system.output_labels.index(name) for name in outputs]
    return value[np.ix_(rows, [system.input_labels.index(name) for name in inputs])]


@pytest.mark.parametrize(("side", "parity"), [("sym", 1.0), ("anti", -1.0)])
def test_the_machine_sees_each_half_s_controller(side, parity):
    halves = {"sym": half_controller("sym", 1), "anti": half_controller("anti", 2)}
    joined = join_symmetric(MODEL, halves["sym"], halves["anti"])
    assert joined.nstates == 6
    forces = ["suspension_right", "suspension_left"]
    mode = np.array([1.0, parity]) / np.sqrt(2.0)
    for stem, names in (
        ("stroke", ["stroke_right", "stroke_left"]),
        ("tip_acceleration", ["tip_right_acceleration", "tip_left_acceleration"]),
    ):
        half_name = f"{stem}_{side}"
        whole = at(joined, 1.7, names, forces) @ mode
        part = at(halves[side], 1.7, [half_name], [f"suspension_{side}"])[0, 0]
        assert np.allclose(whole, part * mode, rtol=1e-12)


@pytest.mark.parametrize(("A", "stable"), [([[0.0]], 1.0), ([[2.0]], 1.0), ([[0.0, 3.0], [-3.0, 0.0]], 1.0)])
def test_lasting_states_of_one_half_stay_there(A, stable):
    """An integrator, an unstable pole, an undamped mode: none is left, hidden, in the controller of the other half."""
    n = len(A)
    lasting = control.ss(A, np.ones((n, 1)), np.ones((1, n)), 0.5, inputs=["stroke_sym"], outputs=["suspension_sym"])
    other = control.ss([[-stable]], [[1.0]], [[2.0]], 0.0, inputs=["stroke_anti"], outputs=["suspension_anti"])
    halves = split_controller(MODEL, join_symmetric(MODEL, lasting, other))
    assert [half.nstates for half in halves[:2]] == [n, 1]
    assert np.isclose(halves[0](1.7j), lasting(1.7j), rtol=1e-9)
    assert np.isclose(halves[1](1.7j), other(1.7j), rtol=1e-6)
    assert halves[2] < 1e-12


def test_chains_of_integrators_stay_whole_in_the_order_of_any_signals():
    chain = control.ss(
        [[0.0, 1e-3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1e5]], [[0.0], [1.0], [1.0]], [[1.0, 0.0, 1.0]], 0.0,
        inputs=["stroke_anti"], outputs=["suspension_anti"],
    )  # fmt: skip
    other = half_controller("sym", 3)[0, 1]
    other = control.ss(other.A, other.B, other.C, 0.0, inputs=["stroke_sym"], outputs=["suspension_sym"])
    joined = join_symmetric(MODEL, other, chain)
    swapped = control.ss(
        joined.A, joined.B[:, ::-1], joined.C, joined.D[:, ::-1],
        inputs=joined.input_labels[::-1], outputs=joined.output_labels,
    )  # fmt: skip
    for whole in (joined, swapped):
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
        control.ss(
            *(rng.standard_normal(shape) for shape in ((states, states), (states, 1), (1, states), (1, 1))), time,
            inputs=[f"stroke_{side}"], outputs=[f"suspension_{side}"],
        )
        for side, states, time in zip(sides, (0, n if dt is not None else 0), (None, dt), strict=True)
    )  # fmt: skip
    joined = join_symmetric(MODEL, *((timed, gain) if turned else (gain, timed)))
    assert joined.dt == dt or (not dt and not joined.nstates)  # a gain has no time
    mode = np.array([1.0, -1.0 if turned else 1.0]) / np.sqrt(2.0)
    forces, strokes = ["suspension_right", "suspension_left"], ["stroke_right", "stroke_left"]
    assert np.allclose(at(joined, 0.7, strokes, forces) @ mode, gain.D[0, 0] * mode, rtol=1e-12)


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


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("of_sym", "of_anti"),
    [
        ([0.0, -4.0], [-2.0]),
        ([-1e-9, -4.0], [-2.0]),
        ([0.0, -4.0], [0.0, -4.0]),
        ([-1e-6, -1.0], [-30.0, -2.0]),
        ([1.0, -4.0], [-1.0]),
        ([0.0, -1.0, -2.0, -3.0, -1e3], [-1.0, -2.0, -3.0]),
    ],
    ids=["integrator", "leaky", "alike", "slow lag", "unstable", "many"],
)
def test_halves_are_found_again_in_any_coordinates(of_sym, of_anti, seed):
    """Joined and turned, they are the same two controllers: what is examined half by half is what is used."""
    rng = np.random.default_rng(seed)

    def half(side, poles):
        n = len(poles)
        return control.ss(
            np.diag(poles), rng.standard_normal((n, 1)), rng.standard_normal((1, n)), 0.3,
            inputs=[f"stroke_{side}"], outputs=[f"suspension_{side}"],
        )  # fmt: skip

    given = half("sym", of_sym), half("anti", of_anti)
    joined = join_symmetric(MODEL, *given)
    turned = np.linalg.qr(rng.standard_normal(joined.A.shape))[0]
    whole = control.ss(
        turned @ joined.A @ turned.T, turned @ joined.B, joined.C @ turned.T, joined.D,
        inputs=joined.input_labels, outputs=joined.output_labels,
    )  # fmt: skip
    *found, missed = split_controller(MODEL, whole)
    omega = np.geomspace(1e-2, 1e3, 50)
    for one, other in zip(found, given, strict=True):
        assert np.abs(one(1j * omega) / other(1j * omega) - 1.0).max() < 1e-6
    assert missed < 1e-6


@examples(200)
@given(seeds, st.floats(-9.0, -2.0))
def test_a_controller_that_mixes_the_halves_a_little_is_split_and_measured(seed, power):
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
