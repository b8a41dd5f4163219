"""Mode tables: known poles, shares that depend on nothing arbitrary, peaks that the response has."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis import hinf_norm, mode_table
from boomctl.boom import spray_boom
from boomctl.structure import SecondOrderModel
from tests.analysis.loop_cases import chain
from tests.profiles import examples


@given(st.integers(0, 1000))
@examples(25)
def test_shares_depend_neither_on_coordinates_nor_on_units(seed):
    rng = np.random.default_rng(seed)
    model = chain(seed)
    table, system = mode_table(model), model.to_statespace()
    T = rng.standard_normal((system.nstates,) * 2) + 3.0 * np.eye(system.nstates)
    units_in, units_out = 10.0 ** rng.uniform(-4, 4, 3), 10.0 ** rng.uniform(-4, 4, 3)
    other = control.ss(
        T @ system.A @ np.linalg.inv(T),
        T @ system.B * units_in,
        units_out[:, None] * system.C @ np.linalg.inv(T),
        0.0,
    )
    for mine, theirs in zip(table.rows, mode_table(other).rows, strict=True):
        assert theirs.pole == pytest.approx(mine.pole, rel=1e-6)
        assert theirs.input_shares == pytest.approx(mine.input_shares, rel=1e-4, abs=1e-6)
        assert theirs.output_shares == pytest.approx(mine.output_shares, rel=1e-4, abs=1e-6)


def test_an_oscillators_row_is_its_frequency_damping_and_peak():
    model = SecondOrderModel([[1.0]], [[0.04]], [[4.0]], {"f": [1.0]}, {"y": [3.0]})
    (row,) = mode_table(model).rows
    assert row.omega == pytest.approx(2.0)
    assert row.damping == pytest.approx(0.01)
    assert row.frequency_hz == pytest.approx(2.0 * np.sqrt(1 - 1e-4) / (2 * np.pi))
    assert row.peaks[0, 0] == pytest.approx(hinf_norm(model.to_statespace()).lower, rel=1e-2)


def test_the_cradle_does_not_move_yaw_modes_nor_does_its_slip_show_them():
    table = mode_table(spray_boom())
    yaw = table.rows[0]
    assert yaw.frequency_hz == pytest.approx(0.2450, abs=1e-4)
    assert yaw.input_shares[table.inputs.index("cradle")] < 1e-8
    assert yaw.output_shares[table.outputs.index("cradle_slip")] < 1e-8
    assert yaw.input_shares[table.inputs.index("actuator_left")] == pytest.approx(1.0)
    assert "actuator_left" in table.render(2)
    assert len(table.render(2).splitlines()) == 3


def test_undamped_modes_that_show_have_no_bound_and_free_bodies_are_refused():
    undamped = SecondOrderModel([[1.0]], [[0.0]], [[4.0]], {"f": [1.0]}, {"y": [1.0]})
    assert mode_table(undamped).rows[0].peaks[0, 0] == np.inf
    with pytest.raises(ValueError, match="free rigid body"):
        mode_table(SecondOrderModel([[1.0]], [[0.0]], [[0.0]], {"f": [1.0]}, {"y": [1.0]}))
