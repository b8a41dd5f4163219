"""Input shapers by their defining laws; the comparison."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.plotting import figure_of
from boomctl.slew import compare_slews, input_shaper, rest_to_rest_torque, spin_up_torque
from tests.profiles import examples

frequencies = st.floats(0.5, 50.0)
dampings = st.floats(0.0, 0.3)


@given(st.sampled_from(["ZV", "ZVD"]), frequencies, dampings)
def test_zv_and_zvd_leave_nothing(name, frequency, damping):
    train = input_shaper(name, frequency, damping)
    assert train.amplitudes.sum() == pytest.approx(1.0)
    assert train.residual_vibration(frequency, damping) < 1e-12


def test_shaper_uses_free_hub_mode():
    h = bc.hub_beam(model="cfoam", modes=3, tip_mass=0.5)
    poles = h.linearize().poles()
    first = min(poles[np.abs(poles) > 1e-3], key=abs)
    assert input_shaper("ZVD", h).residual_vibration(abs(first), -first.real / abs(first)) < 1e-9


@given(frequencies)
def test_zvd_is_flat_and_ei_is_level(frequency):
    zv, zvd, ei = (input_shaper(name, frequency) for name in ("ZV", "ZVD", "EI"))
    aside = 1.001 * frequency
    assert zvd.residual_vibration(aside) < 1e-2 * zv.residual_vibration(aside)
    assert ei.residual_vibration(frequency) == pytest.approx(0.05, rel=1e-9)
    assert ei.residual_vibration(1.1 * frequency) < zv.residual_vibration(1.1 * frequency)


@examples(300)
@example("constant", "EI", 0.0, 1.0)
@example("smooth", "ZV", 0.0, 1.0)
@given(
    st.sampled_from(["bang-bang", "smoothed", "versine", "constant", "smooth"]),
    st.sampled_from(["none", "ZV", "ZVD", "EI"]),
    st.floats(-9.0, 7.0),
    st.one_of(st.floats(0.01, 10.0), st.fractions(0.25, 4.0, max_denominator=8).map(float)),
)
def test_shaped_torque_invariant_to_time_scale(shape, name, decades, spacing):
    """Sums in rational numbers: each instant is as exact as a double is, beside the duration, whatever that is."""
    T = 10.0**decades
    train = input_shaper(name, np.pi / (spacing * T))  # in step with the torque's own instants, or not
    if shape in ("constant", "smooth"):
        speed = T if shape == "constant" else 0.5 * T
        torque, wanted = spin_up_torque(shape, train, speed, 1.0, 1.0), (Fraction(speed), None)
    else:
        angle = T * T * {"bang-bang": 0.25, "versine": 0.5 / np.pi, "smoothed": 0.2}[shape]
        torque, wanted = rest_to_rest_torque(shape, train, angle, 1.0, 1.0), (Fraction(0), Fraction(angle))
    speed, turned = Fraction(0), Fraction(0)
    edges, values = ([Fraction(float(x)) for x in each] for each in (torque.edges, torque.start_values))
    for h, value in zip(np.diff(np.array(edges, dtype=object)), values, strict=True):
        turned, speed = turned + h * (speed + value * h / 2), speed + value * h
    assert abs(speed - wanted[0]) <= 1e-11 * torque.duration
    assert torque.angular_momentum == pytest.approx(float(speed), abs=1e-11 * torque.duration)
    assert wanted[1] is None or abs(turned - wanted[1]) <= 1e-11 * torque.duration * T
    assert np.diff(torque.edges).min() > 0.9e-12 * torque.duration  # what coincides but for rounding is one instant


@pytest.mark.slow
@pytest.mark.parametrize("modes", [1, 2])
def test_comparison_ranks_as_the_theory_says(modes):
    h = bc.hub_beam(modes=modes)
    slew = bc.optimal_slew(h, 0.5, 100.0)
    comparison = compare_slews(h, 0.5, 100.0, {"fastest": slew})
    table = {line.name: line for line in comparison.rows}
    assert table["bang-bang"].duration < table["fastest"].duration < table["bang-bang, ZV"].duration
    assert table["fastest"].residual_vibration < 1e-6
    assert table["bang-bang, ZV"].residual_vibration < 0.1 * table["bang-bang"].residual_vibration
    zv, zvd = table["bang-bang, ZV"], table["bang-bang, ZVD"]
    assert max(zvd.residual_vibration_low, zvd.residual_vibration_high) < 0.4 * max(
        zv.residual_vibration_low, zv.residual_vibration_high
    )
    smooth = table["smoothed bang-bang"]
    assert table["bang-bang"].duration < smooth.duration < table["versine"].duration
    assert smooth.residual_vibration < table["bang-bang"].residual_vibration
    for line in table.values():
        assert abs(line.angle_error) < 0.02
    assert len(figure_of(comparison.plot).axes) == 6


@pytest.mark.slow
def test_compare_slews_plays_tip_masses():
    h = bc.hub_beam(bc.HubBeamParameters(tip_mass=0.1), modes=1)
    slew = bc.optimal_slew(h, 0.5, 100.0)
    found = compare_slews(h, 0.5, 100.0, {"fastest": slew}, tip_masses=(0.1, 0.4))
    assert found.tip_masses.tolist() == [0.1, 0.4]
    line = found["fastest"]
    assert line.vibrations[0] < 1e-4
    after = slew.duration + np.linspace(0.0, 10.0, 2001)
    heavier = h.with_tip_mass(0.4).simulate(
        bc.maneuvers.applied_torque(slew.torque_profile, slew.torque_profile.breakpoints), after
    )
    assert line.vibrations[1] == pytest.approx(np.abs(heavier.tip_displacement).max(), rel=1e-2)
    assert len(figure_of(found.plot).axes) == 7
