"""The tuned drive of designs/tuned_hub.py, and the LQG beside it."""

import numpy as np
import pytest

from boomctl.studies.catalogue import load_design
from designs.tuned_hub import BETWEEN, MASSES, NOISE_GAIN, beam, norms, regulators, worst


@pytest.mark.slow
def test_it_beats_every_lqg_for_the_middle_over_the_payloads():
    """Three states beside eight: as good where the LQG was made for, less than a third as much at the ends."""
    made = load_design("tuned_hub")
    result = made.evaluate()
    K = made.controller
    assert (K.nstates, result.stable) == (3, True)
    assert worst(K) == pytest.approx(0.0176, rel=5e-3)
    assert max(norms(K, mass)[1] for mass in MASSES) <= NOISE_GAIN * (1.0 + 1e-5)
    found = regulators()
    assert all(other.nstates == beam(MASSES[1]).nstates for other in found)
    nominal, spread = [norms(other, MASSES[1])[0] for other in found], [worst(other) for other in found]
    assert nominal == sorted(nominal)
    assert (nominal[0], spread[0]) == (pytest.approx(0.0117, rel=5e-3), pytest.approx(0.0626, rel=5e-3))
    assert min(spread) > 1.5 * worst(K)
    assert norms(K, MASSES[1])[0] == pytest.approx(0.0113, rel=1e-2)
    assert np.allclose(BETWEEN[[0, -1]], [MASSES[0], MASSES[-1]])
