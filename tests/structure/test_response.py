"""Frequency responses of large structures equal the direct solution, and say where rounding ends them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exceptions import AccuracyWarning
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.direct import direct_response, respond
from tests.references import direct
from tests.strategies import seeds, structures

BAND = 2 * np.pi * np.geomspace(0.1, 10.0, 40)
TIPS, ACTUATORS = ["tip_left", "tip_right"], ["actuator_left", "actuator_right"]


def random_chain(seed, n, symmetric=True):
    """Return masses in a row between walls, random springs and dampers, pushed and read at three of them."""
    rng = np.random.default_rng(seed)
    D = np.eye(n + 1, n) - np.eye(n + 1, n, k=-1)
    K = D.T @ (rng.uniform(0.5, 2.0, n + 1)[:, None] * D)
    C = 0.02 * K + D.T @ (rng.uniform(0.0, 0.05, n + 1)[:, None] * D)
    if not symmetric:
        C = C + 0.01 * (np.eye(n, k=1) - np.eye(n, k=-1))
    places = rng.choice(n, 3, replace=False)
    ports = {f"p{i}": np.eye(n)[place] for i, place in enumerate(places)}
    return SecondOrderModel(np.diag(rng.uniform(0.5, 2.0, n)), C, K, ports, ports)


@given(seed=seeds, n=st.sampled_from([39, 40, 90, 300]))
def test_chains_respond_as_the_direct_solution(seed, n):
    """Every entry down to a millionth of the largest: what crosses a long chain is as tiny as its decay."""
    omega = np.geomspace(1e-3, 4.0, 9)
    model = random_chain(seed, n)
    truth = direct(model, omega)
    found = model.frequency_response(omega).frdata
    assert (np.abs(found - truth) < 1e-7 * np.maximum(np.abs(truth), 1e-6 * np.abs(truth).max())).all()


@given(seeds)
def test_unsymmetric_chains_respond_as_the_direct_solution(seed):
    omega = np.geomspace(1e-2, 3.0, 30)  # so many that modes are tried first
    model = random_chain(seed, 70, symmetric=False)
    found, truth = respond(model.structure, model.ports, omega), direct(model, omega)
    worst = max(np.linalg.cond(model.K + 1j * w * model.C - w * w * model.M) for w in omega)
    assert np.abs(found - truth).max() < 1e-15 * worst * np.abs(truth).max()


@given(st.sampled_from([40, 80]), st.floats(0.05, 1.5))
def test_structures_on_the_brink_respond_as_the_direct_solution(n, lift):
    """A negative stiffness, of an inverted pendulum say, makes K indefinite; the response is there nevertheless."""
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1) - lift * np.eye(n)
    model = SecondOrderModel(np.eye(n), 0.05 * np.eye(n), K, {"f": np.eye(n)[0]}, {"y": np.eye(n)[3]})
    omega = np.array([0.3, 1.0, 2.0])
    assert np.allclose(model.frequency_response(omega).frdata, direct(model, omega), rtol=1e-7, atol=1e-9)


@given(structures(least=6, most=12))
def test_many_frequencies_match_direct_solution(structure):
    """They come from modes and a few dampers."""
    omega = np.linspace(0.01, 5.0, 200)
    truth = direct(structure.model, omega)
    assert np.abs(structure.model.frequency_response(omega).frdata - truth).max() < 1e-9 * np.abs(truth).max()


@pytest.mark.parametrize("away", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("damping", [1e-9, 1e-5, 1e-1])
def test_modes_limited_by_damper_match_direct_solution(damping, away):
    """At their own frequencies, where terms of the sum over modes cancel."""
    stiffness = np.arange(1.0, 7.0) ** 2
    C = damping * np.outer(stiffness / 9.0, stiffness / 9.0)
    model = SecondOrderModel(np.eye(6), C, np.diag(stiffness), {"f": np.ones(6)}, {"y": np.ones(6)})
    omega = np.sort(np.concatenate([np.linspace(0.5, 6.4, 300), np.sqrt(stiffness) * (1.0 + away)]))
    found, truth = model.frequency_response(omega).frdata, direct(model, omega)
    assert (np.abs(found - truth) < 1e-8 * np.abs(truth).max(axis=(0, 1))).all()


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("damper", [1e2, 1e9, 1e14])
def test_each_response_behind_strong_damper_is_accurate(place, damper):
    """A damper that nearly holds a mass: the responses beyond it are differences of large terms."""
    K = 2.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1)
    C = damper * np.diag(np.eye(4)[place])
    outputs = {f"y{i}": row for i, row in enumerate(np.eye(4))}
    model = SecondOrderModel(np.eye(4), C, K, {"f": np.eye(4)[0]}, outputs)
    omega = np.linspace(0.01, 3.0, 2000)
    truth = direct(model, omega)
    assert (np.abs(model.frequency_response(omega).frdata - truth) <= 1e-8 * np.abs(truth)).all()


def test_unsymmetric_mass_of_light_part_matches_direct_solution():
    M, K = np.diag([1e12, 1.0, 1.0]), np.diag([1e12, 1.0, 2.0])
    M[1, 2], M[2, 1] = 0.3, -0.3
    model = SecondOrderModel(M, 0.1 * np.eye(3), K, {"f": np.eye(3)[1]}, {"y": np.eye(3)[2]})
    omega = np.linspace(0.01, 3.0, 2000)
    assert model.frequency_response(omega).frdata == pytest.approx(direct(model, omega), rel=1e-9)


@pytest.mark.parametrize("others", [np.array([]), np.linspace(0.1, 0.9, 60)])
def test_an_undamped_resonance_hit_exactly_is_refused(others):
    K = np.diag(np.arange(1.0, 7.0) ** 2)
    model = SecondOrderModel(np.eye(6), np.zeros((6, 6)), K, {"f": np.ones(6)}, {"y": np.ones(6)})
    with pytest.raises(ValueError, match=r"omega.*(undamped resonance|infinite)"):
        model.frequency_response([*others, 2.0])


@pytest.mark.parametrize("n", [1, 20, 60, 200])
def test_a_floating_structure_has_no_static_response(n):
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[0, 0] = K[-1, -1] = 1.0 if n > 1 else 0.0
    model = SecondOrderModel(np.eye(n), 0.1 * K, K, {"f": np.eye(n)[0]}, {"y": np.eye(n)[-1]})
    assert np.isfinite(model.frequency_response([0.1, 1.0]).frdata).all()
    with pytest.raises(ValueError, match="infinite"):
        model.frequency_response([0.0, 1.0])


def test_imposed_displacements_carry_the_boom_along_at_rest():
    """Both tips follow the straight line through the two actuators, six meters out."""
    found = bc.spray_boom().frequency_response([0.0], ACTUATORS, TIPS).frdata[:, :, 0]
    lever = 6.0 / 1.78
    assert np.allclose(found, [[0.5 + lever, 0.5 - lever], [0.5 - lever, 0.5 + lever]], rtol=1e-9)


def test_frequency_response_matrices_of_unlike_springs_warns():
    """Matrices without rows: a stiff spring in the stiffness matrix leaves few digits of the soft ones beside it."""
    K = np.array([[1e14 + 1.0, -1e14], [-1e14, 1e14]])
    model = SecondOrderModel(np.eye(2), np.zeros((2, 2)), K, {"f": [0.0, 1.0]}, {"y": [1.0, 0.0]})
    with pytest.warns(AccuracyWarning, match="rounding of the frequency response"):
        model.frequency_response([0.1])


@pytest.mark.parametrize("frequencies", [1, 7, 40])
def test_direct_response_in_pieces_is_the_whole(monkeypatch, frequencies):
    model, omega = random_chain(3, 90), np.geomspace(0.01, 2.0, frequencies)
    whole = direct_response(model.structure, model.ports, omega)
    monkeypatch.setattr("boomctl.structure.response.direct._ENTRIES", 90 * 90 * 3)
    assert np.array_equal(direct_response(model.structure, model.ports, omega), whole)
