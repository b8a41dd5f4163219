"""Mode tables: known poles, shares that depend on nothing arbitrary, peaks that the response has."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.analysis import hinf_norm, mode_table
from boomctl.boom import spray_boom
from boomctl.structure import SecondOrderModel
from tests.profiles import examples


def test_an_oscillators_row_is_its_frequency_damping_and_peak():
    model = SecondOrderModel([[1.0]], [[0.04]], [[4.0]], {"f": [1.0]}, {"y": [3.0]})
    (row,) = mode_table(model).rows
    assert row.omega == pytest.approx(2.0)
    assert row.damping_ratio == pytest.approx(0.01)
    assert row.frequency_hz == pytest.approx(2.0 * np.sqrt(1 - 1e-4) / (2 * np.pi))
    assert row.modal_peaks[0, 0] == pytest.approx(hinf_norm(model.to_statespace()).lower_bound, rel=1e-2)


def test_cradle_uncoupled_from_yaw_modes():
    table = mode_table(spray_boom())
    yaw = table.rows[0]
    assert yaw.frequency_hz == pytest.approx(0.2450, abs=1e-4)
    assert yaw.input_participation[table.input_labels.index("cradle")] < 1e-8
    assert yaw.output_participation[table.output_labels.index("cradle_slip")] < 1e-8
    assert yaw.input_participation[table.input_labels.index("actuator_left")] == pytest.approx(1.0)
    assert "actuator_left" in table.to_string(2)


def free_train(seed):
    """Return a train of carts on free wheels: one force moves it, one within it does not; two outputs alike."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    unit = 10.0 ** rng.uniform(-1, 3)
    joints = np.diff(np.eye(n), axis=0)
    K = unit**2 * joints.T @ np.diag(rng.uniform(1.0, 9.0, n - 1)) @ joints
    M = np.diag(rng.uniform(1.0, 3.0, n))
    within, between = rng.standard_normal(n - 1) @ joints, rng.standard_normal(n - 1) @ joints
    inputs = {"push": np.eye(n)[0], "within": within}
    return SecondOrderModel(M, 0.02 / unit * K, K, inputs, {"place": np.eye(n)[-1], "strain": between}), M, K, unit


@given(st.integers(0, 100_000))
@examples(200)
def test_modes_of_free_chain_invariant_to_units(seed):
    model, M, K, unit = free_train(seed)
    w = np.sqrt(linalg.eigh(K, M, eigvals_only=True)[1:])
    expected = -0.01 * w**2 / unit + 1j * w * np.sqrt(1.0 - (0.01 * w / unit) ** 2)
    system = model.to_statespace()
    n = system.nstates
    rng = np.random.default_rng(seed)
    T = np.linalg.qr(rng.standard_normal((n, n)))[0] * rng.uniform(1.0, 3.0, n)
    units_in, units_out = 10.0 ** rng.uniform(-4, 4, 2), 10.0 ** rng.uniform(-4, 4, (2, 1))
    mixed = control.ss(
        T @ system.A @ np.linalg.inv(T), T @ system.B * units_in, units_out * system.C @ np.linalg.inv(T), 0.0
    )
    for mine, theirs in zip(mode_table(model).rows, mode_table(mixed).rows, strict=True):
        assert theirs.input_participation == pytest.approx(mine.input_participation, rel=1e-4, abs=1e-6)
        assert theirs.output_participation == pytest.approx(mine.output_participation, rel=1e-4, abs=1e-6)
    for given_system in (model, mixed, control.c2d(system, 0.1 / unit)):
        rows = mode_table(given_system).rows
        assert len(rows) == 2 + len(w)
        for row in rows[:2]:
            assert row.pole == 0.0
            assert row.damping_ratio == 0.0
            assert row.z in (None, 1.0)
            assert row.input_participation.tolist() == row.output_participation.tolist() == [1.0, 0.0]
            assert row.modal_peaks.tolist() == [[np.inf, 0.0], [0.0, 0.0]]
        for row, pole in zip(rows[2:], expected, strict=True):
            assert row.pole == pytest.approx(pole, rel=1e-6)
            assert row.modal_peaks[0, 0] < np.inf
        assert max((row.output_participation[0] for row in rows[2:]), default=1.0) == 1.0  # among those that vibrate


def test_modes_beside_an_undamped_one_are_relative_to_the_highest_finite_mode():
    system = control.ss(np.diag([0.0, -2.0, -3.0]), [[1.0], [2.0], [0.3]], [[1.0, 1.0, 1.0]], 0.0)
    assert [row.input_participation[0] for row in mode_table(system).rows] == pytest.approx([1.0, 1.0, 0.1])


@pytest.mark.parametrize("seed", [0, 1, 271])
def test_integrators_in_dense_coordinates_are_poles_at_zero(seed):
    """Chains of two or three integrators beside single ones and fast modes; rounding moves the eigenvalues of such chains."""
    rng = np.random.default_rng(seed)
    chain = np.eye(3 if seed % 2 else 2, k=1)
    A = linalg.block_diag(chain, np.zeros((seed % 3, seed % 3)), [[-56.9]], [[-160.0, 160.0], [-160.0, -160.0]])
    T = rng.standard_normal(A.shape)
    B, C = np.linalg.solve(T, rng.standard_normal((len(A), 1))), rng.standard_normal((1, len(A))) @ T
    rows = mode_table(control.ss(np.linalg.solve(T, A @ T), B, C, 0.0)).rows
    assert sum(row.pole == 0.0 for row in rows) == len(chain) + seed % 3
