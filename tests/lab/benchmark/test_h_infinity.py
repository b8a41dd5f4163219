"""The benchmark of H-infinity synthesis: one referee for both sides, and a peer that hangs stalls nothing."""

import pytest

from boomctl.lab.benchmark.suspension import h_infinity, hinfsyn
from boomctl.lab.benchmark.suspension.h_infinity import cheap_control_plant, h_infinity_lines


@pytest.mark.slow
def test_ours_is_near_the_bound_and_the_peer_is_judged_by_its_loop():
    rows = h_infinity_lines(1, lambda text: None)
    for row in rows:
        assert row.error is not None
        assert 0.0 <= row.error <= 0.0101
        assert row.peer_error is None or row.peer_error > -1e-6
    assert rows[-1].peer_error is not None
    assert rows[-1].peer_error > 10.0


def test_a_peer_that_hangs_is_killed(monkeypatch):
    monkeypatch.setattr(hinfsyn, "PATIENCE", 1e-3)
    row = h_infinity._row("short of patience", cheap_control_plant(), 2, 1, 1)
    assert row.peer is None
    assert "killed after 0.001 s" in row.job
    assert row.error is not None
