"""One number of each slew design."""

import pytest

from designs import min_time_slew, robust_payload_slew, spin_up_slew


def test_min_time_slew():
    found = min_time_slew.main(modes=1)
    assert found.switches == 3
    assert found.rigid_duration < found.duration < 0.8 * found.shaped_duration
    assert found.duration == pytest.approx(2.909, abs=5e-3)
    assert found.vibration < 1e-6 < found.rigid_vibration


def test_robust_payload_slew():
    found = robust_payload_slew.main(modes=1, intervals=60)
    assert found.robust_swing < 1e-4
    assert found.robust_swing_between < 0.1 * found.nominal_swing


def test_spin_up_slew():
    found = spin_up_slew.main(modes=1)
    assert found.rigid_duration < found.duration < found.smooth_duration
    assert found.vibration < 1e-6 < found.smooth_vibration
