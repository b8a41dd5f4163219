"""The boom as an affine family: the same boom at every point, and parameters that stay possible."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.boom import BoomParameters, boom_family, spray_boom, yaw_family
from boomctl.boom.families import scaled_boom
from tests.profiles import examples

factors = st.floats(-1.0, 1.0)


@given(factors, factors, st.sampled_from([None, 30.0]))
@examples(15)
def test_the_family_is_the_boom_at_every_point(a, b, bandwidth):
    family = boom_family(accelerometer_bandwidth_hz=bandwidth)
    exact = spray_boom(
        scaled_boom(BoomParameters(), **family.denormalize([a, b])), accelerometer_bandwidth_hz=bandwidth
    )
    mine = family.at([a, b])
    for name in ("M", "C", "K"):
        assert getattr(mine, name) == pytest.approx(getattr(exact, name), rel=1e-9, abs=1e-9 * np.abs(exact.K).max())
    omega = np.geomspace(0.5, 60.0, 20)
    ours, theirs = (m.frequency_response(omega).frdata for m in (mine, exact))
    assert np.abs(ours - theirs).max() <= 1e-7 * np.abs(theirs).max()


def test_a_heavier_boom_keeps_its_tubes_share():
    p = BoomParameters()
    for mass in (0.5, 0.8, 1.2, 3.0):
        scaled = scaled_boom(p, mass_factor=mass)
        assert scaled.tube_mass / scaled.boom_mass == pytest.approx(p.tube_mass / p.boom_mass)
        assert scaled.tube_inertia / scaled.boom_inertia == pytest.approx(p.tube_inertia / p.boom_inertia)


def test_yaw_family_frequency_range():
    family = yaw_family()
    assert family.at([-1.0]).eigenfrequencies_hz(1)[0] == pytest.approx(0.2450, abs=1e-4)
    stiff = spray_boom(replace(BoomParameters(), spring_stiffness=float(family.high[0])))
    assert stiff.eigenfrequencies_hz(1)[0] == pytest.approx(0.34, rel=1e-9)
    assert yaw_family(subsystem="yaw").nominal.input_labels == ("actuator_anti", "suspension_anti")
