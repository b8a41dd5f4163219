"""What parameters do not explain lies within the band, and what is proved with it is stable on the truth."""

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.identification import uncertainty_weight
from tests.identification.rig import RIG, START, rig

OMEGA = 2.0 * np.pi * np.geomspace(0.3, 20.0, 80)


def with_stand(p):
    """Return the drive on a stand that gives way: what the two angles of the model do not tell."""
    plain = rig(p)
    M = np.diag([*np.diag(plain.M), 0.4])
    C, K = np.zeros((3, 3)), np.zeros((3, 3))
    C[:2, :2], K[:2, :2] = plain.C, plain.K
    turn = np.array([1.0, 0.0, -1.0])  # friction and motor act against the stand
    C += p["friction"] * (np.outer(turn, turn) - np.diag([1.0, 0.0, 0.0])) + np.diag([0.0, 0.0, 2.0])
    K[2, 2] = 900.0
    forces = {"volt": p["gain"] * turn}
    outputs = {"motor": [1.0, 0.0, -1.0], "load": [0.0, 1.0, 0.0]}
    return bc.structure.SecondOrderModel(M, C, K, forces, outputs)


def measured(rng, noise=0.02):
    G = with_stand(RIG).frequency_response(OMEGA)
    size = noise * np.abs(G.frdata)
    errors = size * (rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape))
    found = bc.identification.FrequencyResponseEstimate(
        G.frdata + errors, OMEGA, inputs=["volt"], outputs=["motor", "load"]
    )
    found.deviation, found.coherence = size, np.ones((2, len(OMEGA)))
    found.quantity, found.source = ("displacement", "displacement"), "drawn"
    return found


@pytest.mark.slow
def test_a_band_holds_what_the_fitted_model_leaves_of_the_truth():
    """Of the truth, without errors, at all frequencies but a few; it is no larger than it must be at the peak."""
    for seed in range(3):
        H = measured(np.random.default_rng(seed))
        model = rig(bc.fit(rig, H, list(RIG), START, n_starts=1).parameters).frequency_response(OMEGA).frdata
        W = uncertainty_weight(H, model)
        assert W.nstates == 12
        assert [W.input_labels, W.output_labels] == [["volt"], ["motor", "load"]]
        band = np.abs(W(1j * OMEGA)[:, 0])
        assert (np.abs(with_stand(RIG).frequency_response(OMEGA).frdata - model)[:, 0] <= band).mean() > 0.95
        hidden = np.abs(H.frdata - model)[:, 0] + np.sqrt(2.0 * np.log(20.0)) * H.deviation[:, 0]
        assert (band >= hidden).all()
        assert (band.max(axis=1) < 1.3 * hidden.max(axis=1)).all()
        assert np.exp(np.mean(np.log(band / hidden))) < 8.0  # valleys between resonances are filled


def test_uncertainty_weight_of_entries_and_datasets():
    H, other = (measured(np.random.default_rng(seed)) for seed in (0, 1))
    s = 1j * OMEGA
    both = uncertainty_weight(H, rig(RIG))
    motor = uncertainty_weight(H, rig(RIG), outputs="motor")
    assert motor.nstates == 6
    np.testing.assert_allclose(motor(s), both(s)[0, 0], rtol=1e-9)
    days = uncertainty_weight([H, other], rig(RIG), outputs="motor", fall=1, order=5)
    for each in (H, other):
        left = np.abs(each.frdata[0, 0] - rig(RIG).frequency_response(OMEGA).frdata[0, 0])
        assert (np.abs(days(s)) >= left).all()
    far = np.abs(days(1j * np.array([1e6, 1e7])))
    assert far[0] / far[1] == pytest.approx(10.0, rel=1e-3)


@pytest.mark.slow
def test_what_is_proved_with_the_band_is_stable_on_the_truth():
    """The stand is in no model.  A soft controller is proved, sampled too; of a stiff one the loop over the family alone."""
    H = measured(np.random.default_rng(0))
    fitted = bc.fit(rig, H, list(RIG), START, n_starts=1)
    family, W = fitted.family(range_margin=0.02), uncertainty_weight(H, rig(fitted.parameters), outputs="motor")

    def pd(gain):
        corner = 100.0
        D = -gain * (1.0 + 0.1 * corner)
        return control.ss(-corner, corner, gain * 0.1 * corner, D, inputs="motor", outputs="volt")

    soft, stiff = pd(1.0), pd(20.0)
    found = bc.robust_stability(family, soft, additive_uncertainty=W)
    assert found.proved
    assert bc.feedback_loop(with_stand(RIG), soft, injection_points="motor").poles().real.max() < 0.0
    late = bc.robust_stability(family, bc.discretize(soft, 0.005), delay=0.002, additive_uncertainty=W)
    assert late.proved
    assert late.small_gain > found.small_gain  # what samples fold back, and the delay
    assert bc.robust_stability(family, stiff).proved
    assert not bc.robust_stability(family, stiff, additive_uncertainty=W).proved
