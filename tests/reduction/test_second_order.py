"""Structure-preserving reduction: the result is a structure, stable, and verified."""

import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.lti.frequency import singular_values
from boomctl.lti.system import of
from boomctl.structure import SecondOrderModel
from tests.strategies import structures


@given(structures(least=5))
def test_the_result_is_a_passive_structure_and_its_error_is_verified(structure):
    red = bc.reduce(structure.model, order=6, method="second-order")
    small = red.system
    assert isinstance(small, SecondOrderModel)
    assert (small.n, red.order) == (3, 6)
    assert (small.inputs, small.outputs) == (structure.model.inputs, structure.model.outputs)
    for matrix in (small.M, small.C, small.K):
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    omega = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 800)])
    full = np.asarray(structure.model.frequency_response(omega).frdata)
    shown = singular_values(full - np.asarray(small.frequency_response(omega).frdata))[0]
    assert shown.max() <= red.measured_error * (1 + 1e-6)
    assert shown.max() >= 0.5 * red.measured_error
    assert shown[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("elements", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_the_boom_keeps_its_names_and_comes_within_a_wanted_error(elements):
    model = bc.spray_boom(elements=elements).select(ACTUATORS, TIPS)
    red = bc.reduce(model, error=1.0, method="second-order")
    assert (red.system.inputs, red.system.outputs) == (ACTUATORS, TIPS)
    assert red.measured_error <= 1.0
    omega = bc.sigma(model).omega
    full = np.asarray(model.frequency_response(omega).frdata)
    shown = singular_values(full - of(red.system.to_statespace()).balanced().response(omega))[0]
    assert shown.max() <= red.measured_error
    worse = bc.reduce(model, order=red.order - 2, method="second-order")
    assert worse.measured_error > 1.0


def test_a_band_is_reduced_for_itself():
    model = bc.spray_boom(elements=20).select(ACTUATORS, TIPS)
    band = (60.0, 75.0)
    small = bc.reduce(model, order=6, method="second-order", omega_range=band)
    wide = bc.reduce(model, order=6, method="second-order")
    omega = np.linspace(*band, 400)
    full = np.asarray(model.frequency_response(omega).frdata)
    errors = [
        singular_values(full - np.asarray(r.system.frequency_response(omega).frdata))[0].max() for r in (small, wide)
    ]
    assert errors[0] <= small.measured_error * (1 + 1e-6)
    assert errors[0] <= errors[1]


def test_what_cannot_be_is_refused():
    model = bc.spray_boom(elements=6)
    with pytest.raises(ValueError, match="even number"):
        bc.reduce(model, order=5, method="second-order")
    with pytest.raises(TypeError, match="SecondOrderModel"):
        bc.reduce(model.to_statespace(), order=4, method="second-order")
