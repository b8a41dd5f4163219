"""Bad input: one line that names the argument, its value and what was expected."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import interpolate, special

import boomctl as bc
from boomctl.rotating_beam import free, hold, hub_beam, hub_profile, sine_torque, spin_up, torque
from tests.profiles import examples

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


def short_move(start, length, size, after=0.0):
    """A smooth turn by ``size`` rad within ``length`` s, and back after a while unless that is zero."""

    def scaled(t, begin):
        return np.clip((np.asarray(t) - begin) / length, 0.0, 1.0)

    def total(one):
        return lambda t: one(scaled(t, start)) - (one(scaled(t, start + after)) if after else 0.0)

    return (
        total(lambda x: size * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)),
        total(lambda x: size / length * 30.0 * x**2 * (1.0 - x) ** 2),
        total(lambda x: size / length**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)),
    )


@given(st.floats(0.0, 9.0), st.floats(0.01, 1.0), st.floats(-3.0, 3.0), st.sampled_from([0.0, 0.3]))
@examples(60)
def test_a_short_motion_is_told_from_a_wrong_one(start, length, size, after):
    angle, speed, acceleration = short_move(start, length, size if abs(size) > 1e-3 else 1.0, after)
    hub_profile(angle, speed, acceleration).checked_until(10.0)
    for wrong in (
        (angle, lambda t: 1.1 * speed(t), acceleration),
        (angle, speed, lambda t: -acceleration(t)),
    ):
        with pytest.raises(
            ValueError, match=r"expected the derivative of the .*; from .* to .* s the .* differs by up to"
        ):
            hub_profile(*wrong).checked_until(10.0)


_FEW_SINES = st.lists(
    st.tuples(st.floats(0.3, 40.0), st.floats(0.05, 1.0), st.floats(0.0, 6.3)), min_size=1, max_size=4
)


def swaying(sines, end):
    """A motion by sines (frequency [rad/s], amplitude of the speed [rad/s], phase) and a short turn within them."""
    turn = short_move(0.4 * end, 0.07 * end, 0.02 * end)

    def derivative(k):
        def value(t):
            t = np.asarray(t)
            return turn[k](t) + sum(a * w ** (k - 1) * np.sin(w * t + p + 0.5 * k * np.pi) for w, a, p in sines)

        return value

    return tuple(derivative(k) for k in range(3))


@pytest.mark.slow
@given(
    _FEW_SINES,
    st.floats(0.7, 20.0),
    st.sampled_from(["acceleration", "speed", "sine of the acceleration", "sine of the speed"]),
    st.floats(-8.0, -2.0),
    st.one_of(st.floats(1.0, 50.0), st.integers(1, 5)),
)
@examples(200)
def test_functions_that_nearly_belong_together_are_refused(sines, end, what, share, swift):
    """By down to 1e-8 of the largest speed, in all of it or in one sine, also one that even intervals do not show."""
    angle, speed, acceleration = swaying(sines, end)
    largest = np.abs(speed(np.linspace(0.0, end, 2001))).max()
    off, w = 10.0**share, 128.0 * np.pi * swift / end if isinstance(swift, int) else swift
    wrong = {
        "acceleration": (angle, speed, lambda t: (1.0 + off) * acceleration(t)),
        "speed": (angle, lambda t: (1.0 + off) * speed(t), lambda t: (1.0 + off) * acceleration(t)),
        "sine of the acceleration": (angle, speed, lambda t: acceleration(t) + off * largest * w * np.sin(w * t)),
        "sine of the speed": (angle, lambda t: speed(t) + off * largest * np.sin(w * t), acceleration),
    }[what]
    hub_profile(angle, speed, acceleration).checked_until(end)
    with pytest.raises(ValueError, match=r"expected the derivative of the .*; from .* to .* s the .* differs by up to"):
        hub_profile(*wrong).checked_until(end)


@given(st.floats(0.1, 0.9), st.floats(-3.0, -0.5), st.floats(0.0, 0.6), st.floats(0.05, 0.4), st.floats(1.0, 10.0))
@examples(200)
def test_steps_of_a_short_motion_beside_a_jump_are_none_of_rounding(middle, power, begin, share, end):
    """A jump of the acceleration where a short motion is looked at closely: nothing lies between two neighbours of it."""
    width, jump = 10.0**power, (begin * end, (begin + share) * end)

    def speed(t):
        return 0.1 / (width * np.sqrt(np.pi)) * np.exp(-(((t - middle * end) / width) ** 2))

    def since(t, k):
        return np.maximum(np.asarray(t) - jump[0], 0.0) ** k - np.maximum(np.asarray(t) - jump[1], 0.0) ** k

    found = hub_profile(
        lambda t: 0.05 * (1.0 + special.erf((t - middle * end) / width)) + 0.1 * since(t, 2),
        lambda t: speed(t) + 0.2 * since(t, 1),
        lambda t: -2.0 * (t - middle * end) / width**2 * speed(t) + 0.2 * ((t >= jump[0]) & (t < jump[1])),
    ).checked_until(end)
    assert np.diff(found.breakpoints).min(initial=end) > 1e-13 * end


def test_tables_of_a_motion_belong_together_as_one_spline():
    times = np.linspace(0.0, 5.0, 101)
    table = interpolate.CubicSpline(times, 1.0 - np.cos(times), bc_type="clamped")
    functions = tuple(table if not k else table.derivative(k) for k in range(3))
    hub_profile(*functions).checked_until(5.0)
    with pytest.raises(ValueError, match=r"of tables take one spline and its derivatives$"):
        hub_profile(*(lambda t, f=f: np.interp(t, times, f(times)) for f in functions)).checked_until(5.0)


@pytest.mark.parametrize("power", [2.2, 2.5, 2.9])
def test_functions_with_a_root_in_them_belong_together(power):
    """Their slope has a root where nothing says so; it is looked at as closely as it takes."""

    def since(t):
        return np.maximum(np.asarray(t) - 1.2345, 0.0)

    hub_profile(
        lambda t: since(t) ** power,
        lambda t: power * since(t) ** (power - 1.0),
        lambda t: power * (power - 1.0) * since(t) ** (power - 2.0),
    ).checked_until(5.0)


@pytest.mark.parametrize("width", [5e-4, 0.01, 0.03])
@pytest.mark.parametrize("middle", [3.0, 3.05])
def test_a_short_motion_within_a_long_time_is_simulated(width, middle):
    """A smooth turn by 0.1 rad within some six widths; nothing of it jumps, so that there is nothing to announce."""

    def speed(t):
        return 0.1 / (width * np.sqrt(np.pi)) * np.exp(-(((t - middle) / width) ** 2))

    functions = (
        lambda t: 0.05 * (1.0 + special.erf((t - middle) / width)),
        speed,
        lambda t: -2.0 * (t - middle) / width**2 * speed(t),
    )
    t, around = np.linspace(0.0, 10.0, 101), tuple(middle + width * np.linspace(-6.0, 6.0, 25))
    plain, announced = (BEAM.simulate(hub_profile(*functions, breakpoints=b), t) for b in ((), around))
    largest = np.abs(announced.tip_displacement).max()
    assert largest > 0.1
    assert np.abs(plain.tip_displacement - announced.tip_displacement).max() < 1e-8 * largest
