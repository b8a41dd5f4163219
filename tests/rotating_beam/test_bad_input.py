"""Bad input: one line that names the argument, its value and what was expected."""

import math

import numpy as np
import pytest

import boomctl as bc
from boomctl.rotating_beam import free, hold, hub_beam, hub_profile, sine_torque, spin_up, torque

FIELDS = ("length", "density", "area", "youngs_modulus", "second_moment", "hub_inertia", "hub_radius", "tip_mass")
BEAM = hub_beam(modes=2)


@pytest.mark.parametrize("name", [*FIELDS, "tip_position", "damping_ratio"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_parameters_out_of_range(name, value):
    with pytest.raises(ValueError, match=f"^{name} = .*expected"):
        bc.HubBeamParameters(**{name: value})


@pytest.mark.parametrize("name", FIELDS)
def test_parameters_of_another_kind(name):
    for value in ("1", None, True, 1j):
        with pytest.raises(TypeError, match=f"^{name} = .*expected"):
            bc.HubBeamParameters(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"), [("length", 0.0), ("tip_position", 8.1), ("damping_ratio", 1.0), ("second_moment", 0.0)]
)
def test_parameters_at_the_edge(name, value):
    with pytest.raises(ValueError, match=f"^{name} = "):
        bc.HubBeamParameters(**{name: value})


def test_hub_may_have_neither_inertia_nor_radius():
    beam = hub_beam(bc.HubBeamParameters(hub_inertia=0.0, hub_radius=0.0), "foam", 3)
    assert np.isfinite(beam.simulate(sine_torque(1.0, 2.0, 2.0), [1.0, 3.0]).tip_displacement).all()


def test_parameters_from_toml(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text("[hub_beam]\ntip_mass = 0.1\n")
    assert bc.HubBeamParameters.from_toml(path) == bc.HubBeamParameters(tip_mass=0.1)
    path.write_text("tipmass = 0.1\n")
    with pytest.raises(ValueError, match=r"unknown key 'tipmass'"):
        bc.HubBeamParameters.from_toml(path)
    path.write_text("tip_mass = \n")
    with pytest.raises(ValueError, match=r"beam.toml: not a TOML file"):
        bc.HubBeamParameters.from_toml(path)


@pytest.mark.parametrize("modes", [0, -1, 201])
def test_number_of_modes(modes):
    with pytest.raises(ValueError, match=f"^modes = {modes}: expected"):
        hub_beam(modes=modes)


@pytest.mark.parametrize("modes", [2.0, "5", True])
def test_kind_of_the_number_of_modes(modes):
    with pytest.raises(TypeError, match=r"^modes = "):
        hub_beam(modes=modes)


def test_models():
    with pytest.raises(ValueError, match=r"model = 'fadm': expected one of tlam, sfoam"):
        hub_beam(model="fadm")
    with pytest.raises(TypeError, match=r"expected HubBeamParameters"):
        hub_beam(3.0)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan])
def test_durations(duration):
    with pytest.raises(ValueError, match=r"^duration = "):
        spin_up(1.0, duration)
    with pytest.raises(ValueError, match=r"^duration = "):
        sine_torque(1.0, 1.0, duration)
    with pytest.raises(ValueError, match=r"^period = "):
        sine_torque(1.0, duration, 1.0)


def test_manoeuvres():
    with pytest.raises(ValueError, match=r"^final_speed = "):
        spin_up(math.inf, 1.0)
    with pytest.raises(TypeError, match=r"^torque = 3.0: expected a function"):
        torque(3.0)
    with pytest.raises(TypeError, match=r"^speed = None: expected a function"):
        hub_profile(np.sin, None, np.sin)
    with pytest.raises(ValueError, match=r"^acceleration: expected the derivative of the speed"):
        BEAM.simulate(hub_profile(np.sin, np.cos, np.sin), [1.0])
    with pytest.raises(TypeError, match=r"^manoeuvre = 1.0: expected"):
        BEAM.simulate(1.0, [1.0])
    with pytest.raises(ValueError, match=r"^torque at t = .* expected a finite number"):
        BEAM.simulate(torque(lambda t: math.nan), [1.0])


@pytest.mark.parametrize("timepts", [[], [-1.0, 1.0], [1.0, 1.0], [0.0, math.nan], [[0.0, 1.0]], [2.0, 1.0]])
def test_instants(timepts):
    with pytest.raises(ValueError, match=r"^timepts"):
        BEAM.simulate(free(), timepts)


def test_initial_state():
    with pytest.raises(ValueError, match=r"^initial of shape \(2,\): expected \(6,\)"):
        BEAM.simulate(free(), [1.0], initial=[0.0, 1.0])
    with pytest.raises(ValueError, match=r"^initial: expected finite"):
        BEAM.simulate(free(), [1.0], initial=[math.nan] * 6)
    with pytest.raises(ValueError, match=r"^initial hub angle = 0.2: expected 0.1"):
        BEAM.simulate(hold(0.1), [1.0], initial=[0.2, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("name", ["rtol", "atol"])
def test_tolerances(name):
    for value in (0.0, -1e-6, math.nan):
        with pytest.raises(ValueError, match=f"^{name} = "):
            BEAM.simulate(free(), [1.0], **{name: value})


def test_speeds():
    for call in (BEAM.frequencies_hz, BEAM.linearize):
        with pytest.raises(ValueError, match=r"^hub_speed = nan"):
            call(math.nan)
