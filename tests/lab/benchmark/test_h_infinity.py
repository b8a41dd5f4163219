"""The scenes of H-infinity synthesis: a peer that hangs stalls nothing, and one that claims a norm is judged by its loop."""

from dataclasses import replace

import pytest

from boomctl.lab.benchmark.measure import measured
from boomctl.lab.benchmark.peers import hinfsyn
from boomctl.lab.benchmark.run import maker


def only(scene, *names):
    """Return a scene of some settings: the default of ours, and others."""
    kept = [s for s in scene.settings if s.competitor in names or s.label == "tolerance 0.01"]
    return replace(scene, settings=tuple(kept))


@pytest.mark.slow
def test_ours_is_near_the_bound_and_the_peer_is_judged_by_its_loop():
    ours, peer = measured(only(maker("h-infinity-si")("quick"), "control.hinfsyn"), 1e-3, lambda text: None).points
    assert 0.0 <= ours.error <= 0.0101
    assert peer.error > 10.0


@pytest.mark.slow
def test_a_peer_that_hangs_is_killed(monkeypatch):
    monkeypatch.setattr(hinfsyn, "PATIENCE", 1e-3)
    ours, peer = measured(only(maker("h-infinity-cheap")("quick"), "control.hinfsyn"), 1e-3, lambda text: None).points
    assert "killed after 0.001 s" in peer.failed
    assert 0.0 <= ours.error <= 0.0101
