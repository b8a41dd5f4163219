"""What leaves the house as a state space: python-control computes with it what the model itself answers.

Tolerances: a ten-billionth for 12 elements, what rounding of the fastest mode leaves of the slowest; 1e-7 for 100 elements.
"""

import control
import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.structure import SecondOrderModel
from tests.profiles import examples
from tests.strategies import seeds

BAND = np.geomspace(0.1, 600.0, 80)
ACCURACY = {12: 1e-9, 100: 1e-7}


@pytest.fixture(scope="module", params=[12, 100])
def boom(request):
    model = bc.spray_boom(elements=request.param, accelerometer_bandwidth_hz=20.0)
    return model, model.to_statespace(), ACCURACY[request.param]


def test_every_channel_away_from_its_zeros(boom):
    model, system, accuracy = boom
    true = model.frequency_response(BAND).frdata
    shown = np.abs(true) > 1e-3 * np.abs(true).max(axis=2, keepdims=True)
    assert (np.abs(system(1j * BAND) - true)[shown] / np.abs(true)[shown]).max() < accuracy


def test_norms(boom):
    model, _, accuracy = boom
    small = model.select(["actuator_left", "actuator_right"], ["tip_left", "tip_right"])
    given = small.to_statespace()
    ours = bc.sigma(small)
    assert ours.certified
    at = given(1j * ours.peak_omega)
    assert np.linalg.norm(at, 2) == pytest.approx(ours.peak, rel=accuracy)
    if model.ncoordinates < 40:  # of 400 states it takes seconds
        assert bc.hinf_norm(given).lower_bound == pytest.approx(ours.peak, rel=2e-6)
        assert control.linfnorm(given)[0] == pytest.approx(ours.peak, rel=1e-6)


def test_names_are_kept_and_modes_are_named(boom):
    model, system, _ = boom
    assert system.input_labels == list(model.input_labels)
    assert system.output_labels == list(model.output_labels)
    assert system.state_labels[:2] == ["mode1.x1", "mode2.x1"]
    assert len(set(system.state_labels)) == system.nstates
    own = model.to_statespace(states="coordinates")
    assert own.state_labels[0] == f"{model.coordinates[0]}.x1"
    assert own.nstates == system.nstates


def test_matrix_coordinates_retained_or_rotated():
    def chain(stiff):
        K = np.array([[1.0 + stiff, -stiff], [-stiff, stiff + 2.0]])
        return SecondOrderModel(np.eye(2), 0.1 * np.eye(2), K, {"u": [1.0, 0.0]}, {"y": [0.0, 1.0]})

    assert chain(3.0).to_statespace().state_labels == ["q0.x1", "q1.x1", "q0.x2", "q1.x2"]
    stiff = chain(1e9).to_statespace()
    assert stiff.state_labels[0] == "mode1.x1"
    omega = np.geomspace(0.1, 1e5, 60)
    # the soft part of these entries is stored to a ten-millionth
    true = chain(1e9).frequency_response(omega).frdata
    assert (np.abs(stiff(1j * omega) - true) < 1e-6 * np.abs(true)).all()


@examples(200)
@given(seed=seeds)
def test_gyroscopic_terms_in_every_form(seed):
    """What turns a motion that nothing strains or damps acts on it still: the response of the matrices, solved for."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    strained = max(n - int(rng.integers(0, 3)), 1)
    root = rng.standard_normal((n, n))
    M = root @ root.T + 0.3 * np.eye(n)
    rows = rng.standard_normal((n, strained)) * 10.0 ** rng.uniform(-2.0, 3.0, strained)
    K, turning = rows @ rows.T, rng.standard_normal((n, n))
    C = 0.1 * 10.0 ** rng.uniform(-3.0, 0.0) * K + turning - turning.T
    force, place = rng.standard_normal((2, n))
    model = SecondOrderModel(M, C, K, {"f": force}, {"y": place})
    omega = 10.0 ** rng.uniform(-1.0, 2.0, 6)
    wanted = np.array([place @ np.linalg.solve(K + 1j * w * C - w**2 * M, force) for w in omega])
    for states in ("modes", "coordinates", None):
        found = model.to_statespace(states=states)(1j * omega)
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6 * np.abs(wanted).max())
