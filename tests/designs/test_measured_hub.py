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
    proofs,
    rig,
    sampled,
)


@pytest.mark.slow
def test_from_a_record_to_a_loop_on_the_true_rig():
    found = measured()
    assert found.certified
    for name, value in TRUTH.items():
        low, high = family().ranges[name]
        assert low < value < high
        assert abs(found.values[name] / value - 1.0) < 0.01  # the drawing is off by 7 to 40 %
        assert abs(NOMINAL[name] / value - 1.0) > 0.07
    stable, worst = proofs()
    assert stable.proved
    true = bc.feedback_loop(rig(TRUTH), sampled(), delay=DELAY)["hub_angle", "tip_force"]
    assert bc.hinf_norm(true).lower <= worst.upper_bound < np.inf
    loop = on_the_rig()
    assert np.abs(loop["hub_angle"]).max() < 0.05
    assert np.abs(loop["hub_angle"][-round(0.2 / STEP) :]).max() < 5.0 * COUNT


@pytest.mark.slow
def test_the_report_says_what_was_measured_and_proved():
    made = design()
    assert made.facts["sampled loop over the box"].startswith("stable over the whole box, proved")
    assert "blocks of neighbouring frequencies" in made.facts["intervals from"]
    assert made.evaluate().stable
