"""Campbell diagrams and mode shapes of hub-beams."""

import numpy as np
import pytest

import boomctl as bc


@pytest.mark.parametrize("model", ["sfoam", "foam", "geometrically-exact"])
def test_campbell_crossings_on_both_lines(model):
    h = bc.hub_beam(model=model, modes=3)
    speeds = np.linspace(0.0, 10.0, 11)
    found = h.campbell(speeds, count=2, orders=(1.0, 2.5))
    assert found.eigenfrequencies_hz[4] == pytest.approx(h.eigenfrequencies_hz(speeds[4])[:2], rel=1e-12)
    assert found.critical_speeds
    for met in found.critical_speeds:
        assert met.frequency_hz == pytest.approx(h.eigenfrequencies_hz(met.hub_speed)[met.mode - 1], rel=1e-9)
        assert met.frequency_hz == pytest.approx(met.order * met.hub_speed / (2.0 * np.pi), rel=1e-12)
    gap = found.eigenfrequencies_hz[:, :, None] - speeds[:, None, None] * np.array(found.orders) / (2.0 * np.pi)
    assert len(found.critical_speeds) == int((gap[:-1] * gap[1:] < 0.0).sum())


def test_campbell_first_order_has_no_crossing():
    """Stiffening goes on for good: above the crossing the frequency stays below the line."""
    met = bc.hub_beam(model="geometrically-exact", modes=8).campbell(np.linspace(0.0, 20.0, 41), count=1, orders=(1,))
    assert len(met.critical_speeds) == 1
    sfoam = bc.hub_beam(model="sfoam", modes=8).campbell(np.linspace(0.0, 20.0, 41), count=1, orders=(1,))
    assert sfoam.critical_speeds[0].hub_speed == pytest.approx(met.critical_speeds[0].hub_speed, rel=1e-3)


def test_campbell_tlam_ends_at_divergence():
    """``f^2 = f0^2 - (w / 2 pi)^2``, as ``K2 - w^2 M2``: order 1 meets it at ``2 pi f0 / sqrt 2``."""
    h = bc.hub_beam(model="tlam", modes=3)
    found = h.campbell(np.linspace(0.0, 10.0, 21), count=1, orders=(1.0,))
    rest = h.eigenfrequencies_hz(0.0)[0]
    assert found.hub_speeds[-1] == pytest.approx(found.divergence_speed, rel=1e-5)
    assert found.critical_speeds[0].hub_speed == pytest.approx(2.0 * np.pi * rest / np.sqrt(2.0), rel=1e-9)
    assert found.eigenfrequencies_hz[:, 0] ** 2 == pytest.approx(
        rest**2 - (found.hub_speeds / 2.0 / np.pi) ** 2, abs=1e-9
    )


@pytest.mark.parametrize("model", ["tlam", "sfoam", "foam", "cfoam", "geometrically-exact"])
def test_shapes_at_rest_have_the_frequencies_and_are_orthogonal(model):
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.3), model=model, modes=3)
    found = h.mode_shapes(3)
    assert found.eigenfrequencies_hz == pytest.approx(h.eigenfrequencies_hz()[:3], rel=1e-8)
    small = h._small_motion(0.0)
    assert found.shapes.T @ small.mass[1:, 1:] @ found.shapes == pytest.approx(np.eye(3), abs=1e-9)
    assert found.kinds == ("bending",) * 3
    if model == "foam":
        assert h.mode_shapes(6).kinds == ("bending",) * 3 + ("axial",) * 3
    tip = found["beam"].displacement[:, -1, 1]
    assert tip == pytest.approx(small.tip[1:] @ found.shapes, rel=1e-5, abs=1e-7 * np.abs(tip).max())
