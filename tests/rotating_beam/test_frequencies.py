"""Frequencies and critical speeds: the laws of stiffening, then the reference numbers to all their digits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.rotating_beam import HubBeamParameters, hub_beam
from boomctl.rotating_beam.published import FREQUENCIES_HZ
from tests.profiles import examples
from tests.rotating_beam import references
from tests.rotating_beam.strategies import parameters

BAI = HubBeamParameters()


@examples(25)
@given(p=parameters(), slow=st.floats(0.0, 50.0), faster=st.floats(1.01, 3.0))
def test_sfoam_never_softens(p, slow, faster):
    beam = hub_beam(p, "sfoam", 4)
    low, high = beam.eigenfrequencies_hz(slow), beam.eigenfrequencies_hz(slow * faster)
    assert np.all(high >= low * (1.0 - 1e-12))
    assert beam.divergence_speed() == math.inf


@examples(15)
@given(p=parameters())
def test_all_models_agree_at_rest(p):
    at_rest = hub_beam(p, "sfoam", 3).eigenfrequencies_hz(0.0)
    for model in ("tlam", "sfoam-consistent", "foam", "cfoam"):
        np.testing.assert_allclose(hub_beam(p, model, 3).eigenfrequencies_hz(0.0), at_rest, rtol=1e-12)
    both = hub_beam(p, "foam", 3).eigenfrequencies_hz(0.0, coupled=True)
    assert all(np.min(np.abs(both / each - 1.0)) < 1e-9 for each in at_rest)


@examples(15)
@given(p=parameters())
def test_tlam_softens_to_nothing_at_its_critical_speed(p):
    beam = hub_beam(p, "tlam", 4)
    critical = beam.divergence_speed()
    assert beam.eigenfrequencies_hz(0.9999999 * critical)[0] < 1e-3 * beam.eigenfrequencies_hz(0.0)[0]
    with pytest.raises(ValueError, match="loses its stiffness"):
        beam.eigenfrequencies_hz(critical * 1.0000001)


@pytest.mark.parametrize("model", ["foam", "cfoam", "geometrically-exact"])
def test_axial_stiffness_is_lost(model):
    """At the first frequency of a bar that is clamped at one end."""
    beam = hub_beam(BAI, model, 12)
    bar = math.pi / 2.0 / BAI.length * math.sqrt(BAI.youngs_modulus / BAI.density)
    assert beam.divergence_speed() == pytest.approx(bar, rel=1e-12)
    for call in (beam.eigenfrequencies_hz, beam.linearize):
        with pytest.raises(ValueError, match=r"hub_speed = 990: expected less than 980\.2171 rad/s"):
            call(990.0)


def test_table_2_frequencies_up_to_printed_factor():
    """The geometrically exact beam differs by its axial stretch."""
    for model, modes, rest, turning in (("foam", 40, 5e-9, 5e-9), ("geometrically-exact", 16, 5e-7, 5e-5)):
        beam = hub_beam(BAI, model, modes)
        np.testing.assert_allclose(beam.eigenfrequencies_hz(0.0)[:5], references.CLAMPED_HZ, rtol=0, atol=rest)
        np.testing.assert_allclose(beam.eigenfrequencies_hz(1.0)[:5], references.FOAM_HZ_AT_1, rtol=0, atol=turning)
        assert beam.eigenfrequencies_hz(1.0, coupled=True)[0] == pytest.approx(
            references.FOAM_HZ_AT_1_COUPLED, abs=turning
        )
    for (model, speed), printed in FREQUENCIES_HZ.items():
        computed = hub_beam(BAI, model, 40).eigenfrequencies_hz(speed)[:5] * references.PUBLISHED_OVER_EXACT
        np.testing.assert_allclose(computed, printed, rtol=0, atol=6e-5, err_msg=model)


@pytest.mark.parametrize("tip_mass", [0.0, 0.1, 0.5])
def test_tip_mass(tip_mass):
    p = HubBeamParameters(tip_mass=tip_mass)
    critical = hub_beam(p, "tlam", 100).divergence_speed()
    assert critical == pytest.approx(references.TLAM_CRITICAL_SPEED[tip_mass], abs=5e-7)
    for model, modes, atol in (("foam", 100, 5e-4), ("geometrically-exact", 10, 8e-4)):
        lowest = 2.0 * np.pi * hub_beam(p, model, modes).eigenfrequencies_hz(10.0)[0]
        assert lowest == pytest.approx(references.FOAM_LOWEST_AT_10[tip_mass], abs=atol)


@pytest.mark.parametrize("speed", references.WRIGHT_FLAPWISE)
@pytest.mark.parametrize(("model", "modes", "area"), [("sfoam", 40, 1.0), ("geometrically-exact", 14, 1e12)])
def test_wright_flapwise(model, modes, area, speed):
    """Wright et al. 1982; the area of the exact beam makes it all but inextensible."""
    p = HubBeamParameters(
        length=1.0,
        density=1.0 / area,
        area=area,
        youngs_modulus=1.0,
        second_moment=1.0,
        hub_inertia=1.0,
        hub_radius=0.0,
    )
    chordwise = 2.0 * np.pi * hub_beam(p, model, modes).eigenfrequencies_hz(speed)[:3]
    np.testing.assert_allclose(np.hypot(chordwise, speed), references.WRIGHT_FLAPWISE[speed], rtol=0, atol=5.1e-5)


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
