"""The scene of identification: the peer is exact where it can be, and everybody is judged by one measure."""

import numpy as np
import pytest
from scipy import signal

from boomctl.lab.benchmark.peers.subspace import subspace, unexplained
from boomctl.lab.benchmark.scenes.rotary_days import rotary_days
from boomctl.lab.benchmark.scenes.steel_frame import BAND, STEP, errors, fit_percent, frequencies, steel_frame


@pytest.mark.parametrize("method", ["MOESP", "N4SID"])
def test_the_peer_is_exact_without_errors(method):
    pytest.importorskip("ctrlsys")
    rng, hz = np.random.default_rng(0), np.array([40.0, 170.0])
    poles = np.exp((-3.0 + 2j * np.pi * hz) * STEP)
    A = np.kron(np.diag(poles.real), np.eye(2)) + np.kron(np.diag(poles.imag), [[0.0, 1.0], [-1.0, 0.0]])
    B, C, D = (rng.standard_normal(shape) for shape in ((4, 2), (3, 4), (3, 2)))
    u = rng.standard_normal((2000, 2))
    y = signal.dlsim((A, B, C, D, 1.0), u)[1]
    model = subspace(method, 4, u[:1500], y[:1500], (0.0, 0.5))
    assert errors(frequencies(model), hz).max() < 1e-9
    for k, true in enumerate((C @ B, C @ A @ B)):
        assert model[2] @ np.linalg.matrix_power(model[0], k) @ model[1] == pytest.approx(true, abs=1e-9)
    assert model[3] == pytest.approx(D, abs=1e-9)
    Y, left = unexplained(model, u[1500:], y[1500:], (0.0, 0.5))
    assert np.abs(left).max() < 1e-9 * np.abs(Y).max()
    assert fit_percent(model, u[1500:], y[1500:]).min() > 100.0 - 1e-6


def test_a_pole_answers_for_one_mode():
    assert errors(np.array([10.0, 30.3]), np.array([10.0, 10.1, 30.0])) == pytest.approx([0.0, 1.0, 0.01])
    assert BAND[1] < 0.5 / STEP


@pytest.mark.slow
def test_ours_predicts_more_than_the_peer_and_keeps_its_promises():
    pytest.importorskip("ctrlsys")
    scene = steel_frame("quick")
    ours, peer = (setting.cold(0.0) for setting in scene.settings[:2])
    numbers = [scene.found(answer) for answer in (ours, peer)]
    assert scene.error(ours) < 1e-3
    assert scene.error(peer) < 1e-2
    for name in ("mean fit held back [%]", "least fit held back [%]"):
        assert 90.0 < numbers[1][name] < numbers[0][name] < 98.0


@pytest.mark.slow
def test_the_days_of_a_beam_are_fitted_and_its_loop_is_proved():
    ours, peer, proof, worst = rotary_days("quick").settings
    error, found = (getattr(rotary_days("quick"), name) for name in ("error", "found"))
    fitted = ours.cold(0.0)
    assert error(fitted) == pytest.approx(error(peer.cold(0.0)), rel=1e-3)  # least squares of the same
    assert error(fitted) < 0.02
    assert all(value > 95.0 for value in found(fitted).values())
    assert error(proof.cold(0.0)) == 0.0
    assert error(worst.cold(0.0)) < 0.051
