"""The road of designs/measured_hub.py: the record gives back the truth, and what is proved over the box holds on the rig."""

import numpy as np
import pytest

import boomctl as bc
from designs.measured_hub import (
    COUNT,
    DELAY,
    NOMINAL,
    STEP,
    TRUTH,
    design,
    family,
    measured,
    on_the_rig,
    optimal,
    proofs,
    rig,
    sampled,
    tuned,
    weighed,
)


@pytest.mark.slow
def test_the_record_gives_back_the_truth():
    found = measured()
    assert found.success
    for name, value in TRUTH.items():
        low, high = family().ranges[name]
        assert low < value < high
        assert abs(found.values[name] / value - 1.0) < 0.01  # the drawing is off by 7 to 40 %
        assert abs(NOMINAL[name] / value - 1.0) > 0.07


@pytest.mark.slow
@pytest.mark.parametrize(("made", "states", "most"), [(tuned, 3, 0.39), (optimal, 6, 0.37)])
def test_what_is_proved_over_the_box_holds_on_the_true_rig(made, states, most):
    K = sampled(made())
    assert K.nstates == states
    stable, worst = proofs(K)
    assert stable.proved
    assert stable.small_gain < 0.4  # around what the parameters do not explain
    assert worst.upper_bound < most  # rad/N
    true = bc.feedback_loop(rig(TRUTH), K, delay=DELAY)["hub_angle", "tip_force"]
    assert bc.hinf_norm(true).lower_bound <= worst.upper_bound
    loop = on_the_rig(K)
    assert np.abs(loop["hub_angle"]).max() < 0.05
    assert np.abs(loop["hub_angle"][-round(0.2 / STEP) :]).max() < 5.0 * COUNT


@pytest.mark.slow
def test_h_infinity_near_bound_on_fitted_rig():
    P = weighed(rig(measured().parameters))
    norms = [bc.hinf_norm(bc.lft(P, each.controller)).lower_bound for each in (tuned(), optimal())]
    assert optimal().certificate.lower_bound <= norms[1] < norms[0]
    assert norms[1] < 1.06 * optimal().certificate.lower_bound


@pytest.mark.slow
def test_the_report_says_what_was_measured_and_proved():
    made = design()
    for name in ("PD with notch", "H-infinity"):
        assert made.synthesis_info[f"{name}, sampled loop over the box"].startswith("proved stable over the box")
    assert "correlated over frequency" in made.synthesis_info["intervals from"]
    assert made.evaluate().stable
