"""The tractor: Newton's law, statics, symmetry, spectra of its motion, and the filter that stands for them."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

import boomctl as bc
from boomctl.boom.track_filter import _log_slopes, _magnitude
from boomctl.boom.tractor import GRAVITY
from tests.profiles import examples

P = bc.boom.TractorParameters()
SPEEDS = st.floats(0.5, 6.0)


@st.composite
def tractors(draw):
    """Tractors with numbers up to a third off the usual ones."""
    scale = {field.name: draw(st.floats(0.75, 1.33)) for field in fields(P)}
    return replace(P, **{name: factor * getattr(P, name) for name, factor in scale.items()})


@given(tractors(), SPEEDS, st.floats(0.1, 30.0))
@examples(25)
def test_forces_on_the_body_are_mass_times_acceleration(p, speed, omega):
    """Wheel by wheel, from heights felt and motion of the hubs, as one would write them on paper."""
    s, ground = 1j * omega, np.array([0.3, -0.7, 1.1, 0.4])
    system = bc.boom.tractor_system(p, speed)
    X = np.linalg.solve(s * np.eye(18) - system.A, system.B @ ground)
    x, z, pitch, roll, yaw = X[:5]
    felt = ground / (1 + s * p.contact_length / (2 * np.sqrt(6) * speed)) ** 2
    ahead = np.array([1, 1, 0, 0]) * p.wheelbase - p.centre_to_rear
    across = 0.5 * p.track_width * np.array([-1, 1, -1, 1])
    k, c = (
        np.repeat([getattr(p, f"tyre_{what}_{axle}") for axle in ("front", "rear")], 2)
        for what in ("stiffness", "damping")
    )
    lift = (k + s * c) * (felt - z - ahead * pitch - across * roll)
    front = p.mass * GRAVITY * p.centre_to_rear / p.wheelbase / 2
    load = np.repeat([front, p.mass * GRAVITY / 2 - front], 2)
    push = -load * s * felt / speed - p.rolling_resistance * lift
    below = p.centre_height - p.hub_height
    drive = -(p.drive_stiffness + s * p.drive_damping) * (x + below * pitch)
    side = 2 * (
        p.cornering_stiffness_front * (p.wheelbase - p.centre_to_rear) ** 2
        + p.cornering_stiffness_rear * p.centre_to_rear**2
    )
    steer = -(side / speed) * (s + 2 * np.pi * p.steering_corner_hz) * yaw
    balances = (
        (p.mass * s**2 * x, push.sum() + drive),
        (p.mass * s**2 * z, lift.sum()),
        (p.pitch_inertia * s**2 * pitch, lift @ ahead + below * (push.sum() + drive)),
        (p.roll_inertia * s**2 * roll, lift @ across),
        (p.yaw_inertia * s**2 * yaw, push @ across + steer),
    )
    size = np.abs(lift).max() + np.abs(push).max() + np.abs(drive)
    for inertia, force in balances:
        assert abs(inertia - force) < 1e-9 * size
    boom = x + (p.centre_height - p.boom_height) * pitch
    turned = 0.5 * bc.BoomParameters().actuator_distance * yaw
    assert pytest.approx([boom - turned, boom + turned], rel=1e-9) == system.C @ X


@given(tractors(), SPEEDS)
@examples(25)
def test_the_tractor_is_stable_and_raised_ground_moves_no_boom(p, speed):
    system = bc.boom.tractor_system(p, speed)
    assert np.linalg.eigvals(system.A).real.max() < 0.0
    static = -system.C @ np.linalg.solve(system.A, system.B)
    assert np.abs(static.sum(axis=1)).max() < 1e-9 * np.abs(static).max()
    pitch = np.array([1.0, 1.0, 0.0, 0.0])
    assert static @ pitch == pytest.approx([(p.hub_height - p.boom_height) / p.wheelbase] * 2)


def test_uphill_the_tractor_hangs_back_by_its_weight_over_the_drives_stiffness():
    slope, step = 0.05, 0.01
    heights = slope * step * np.arange(6001)
    track = bc.boom.Track(step, heights, heights, P.track_width)
    motion = bc.platform_motion(track, P, 2.0)
    pitched = -(P.boom_height - P.hub_height) * slope
    assert motion.jolt[0] == pytest.approx(pitched)
    assert motion.jolt[-1] == pytest.approx(pitched - P.mass * GRAVITY * slope / P.drive_stiffness, rel=1e-6)
    assert np.abs(motion.yaw).max() < 1e-12


def test_a_tractor_on_the_mirrored_track_does_the_mirrored_motion():
    track = bc.iso_track("D", 60.0, 2)
    mirrored = replace(track, left=track.right, right=track.left)
    found, other = (bc.platform_motion(item, P, 2.5) for item in (track, mirrored))
    assert found.left == pytest.approx(other.right, abs=1e-12)
    assert found.yaw == pytest.approx(-other.yaw, abs=1e-12)
    even = bc.platform_motion(bc.iso_track("D", 60.0, 2, coherence="full"), P, 2.5)
    assert np.abs(even.yaw).max() < 1e-12
    assert even.jolt.std() > 1e-3


def test_a_stone_under_the_left_wheels_turns_the_left_side_back():
    """It holds the left side back when met, and lets go behind its top; front wheels first, rear ones a wheelbase later."""
    motion = bc.platform_motion(bc.boom.bump_track(0.1, 0.5, "left", position=8.0, length=40.0), P, 2.0)
    met, again = (8.0 - P.wheelbase) / 2.0, 8.0 / 2.0
    before = motion.time < met - 0.01
    assert np.abs(motion.left[before]).max() < 1e-9
    for begin in (met, again):
        climbing = (motion.time > begin + 0.05) & (motion.time < begin + 0.12)
        assert (np.diff(motion.yaw[climbing]) > 0.0).all()
    assert np.abs(motion.yaw[motion.time > 18.0]).max() < 0.05 * np.abs(motion.yaw).max()


def test_without_steering_a_step_under_one_side_turns_the_heading_for_good():
    """Impulses alone count: half the weight times the step's slope, over the speed, at half the track width."""
    free, rise = replace(P, steering_corner_hz=0.0), 0.1
    s = np.clip((0.01 * np.arange(4001) - 8.0) / 0.5, 0.0, 1.0)
    left = rise * (s - np.sin(2 * np.pi * s) / (2 * np.pi))
    motion = bc.platform_motion(bc.boom.Track(0.01, left, 0.0 * left, P.track_width), free, 2.0)
    impulse = 0.5 * P.track_width * 0.5 * P.mass * GRAVITY * rise / 2.0
    assert motion.yaw[-1] == pytest.approx(impulse / P.yaw_damping(2.0), rel=1e-4)
    over = bc.platform_motion(bc.boom.bump_track(0.1, 0.5), free, 2.0)
    assert abs(over.yaw[-1]) < 1e-4 * np.abs(over.yaw).max()


def test_a_finer_sampling_of_the_same_straight_ground_changes_nothing():
    track = bc.iso_track("C", 40.0, 1, step=0.04, band=(0.05, 3.0))
    coarse, fine = (bc.platform_motion(track, P, 2.0, sample_time=h) for h in (0.02, 0.005))
    assert fine.left[::4] == pytest.approx(coarse.left, abs=1e-7 * coarse.left.std())
    assert fine.right[::4] == pytest.approx(coarse.right, abs=1e-7 * coarse.right.std())


def test_on_a_periodic_track_each_harmonic_is_the_frequency_response_to_it():
    """Straight lines between points weigh a harmonic with sinc^2."""
    speed, count = 2.0, 2000
    track = bc.iso_track("C", 80.0, 7, step=0.04, periodic=True)
    motion = bc.platform_motion(track, P, speed, sample_time=0.02)
    assert motion.left[0] == pytest.approx(motion.left[-1], abs=1e-5 * motion.left.std())
    k = np.arange(2, 200)
    ground = np.array([np.fft.rfft(side)[k] for side in (track.left, track.right)]) * np.sinc(k / count) ** 2
    omega = 2 * np.pi * k * speed / track.length
    ahead = np.exp(1j * omega * P.wheelbase / speed)
    H = bc.boom.tractor_system(P, speed)(1j * omega, squeeze=False)
    expected = np.einsum("oik,ik->ok", H, np.vstack([ground * ahead, ground]))
    found = np.array([np.fft.rfft(side[:-1])[k] for side in (motion.left, motion.right)])
    assert np.abs(found - expected).max() < 2e-4 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("periodic", [False, True])
def test_the_density_is_that_of_the_motions(periodic):
    """Mean square displacement and velocity over many tracks against the integrals, jolt and yaw apart.

    A track that goes round has its own waves only, and a stationary motion from the first sample on; on one with ends,
    whose waves lie close together, the start is over after 25 s, e^-8 of it.
    """
    squares = []
    for seed in range(24):
        track = bc.iso_track("D", 200.0, seed, periodic=periodic)
        motion = bc.platform_motion(track, P, 2.5, sample_time=5e-3)
        for y in (motion.jolt, 0.5 * motion.actuator_distance * motion.yaw):
            late = y if periodic else y[5000:]
            squares += [np.mean(late**2), np.mean((np.diff(late) / 5e-3) ** 2)]
    found = np.array(squares).reshape(-1, 4)
    spacing = 2.5 / 200.0 if periodic else 2.5 / 4000.0
    f = spacing * np.arange(1, round(8.75 / spacing))
    density = bc.boom.platform_density(f, P, 2.5, "D")
    expected = [
        np.sum(item * weight) * f[0]
        for item in (density.jolt, density.difference)
        for weight in (1.0, (2 * np.pi * f) ** 2)
    ]
    error = found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - expected) < 5.0 * error).all()
    assert (error < 0.1 * np.array(expected)).all()


def densities(system, f):
    """Return the one-sided densities of jolt and half difference behind white noise of unit intensity."""
    H = system(2j * np.pi * f, squeeze=False)
    return [2.0 * (np.abs(0.5 * (H[1] + sign * H[0])) ** 2).sum(axis=0) for sign in (1, -1)]


def smoothed(f, density, grid):
    """Return means over a third of an octave."""
    power = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(f))])
    edge = 2.0 ** (1 / 6)
    return (np.interp(grid * edge, f, power) - np.interp(grid / edge, f, power)) / (grid * (edge - 1 / edge))


@pytest.mark.parametrize("speed", [1.5, *(pytest.param(v, marks=pytest.mark.slow) for v in (2.0, 2.5, 3.0, 4.0))])
def test_the_filter_has_the_density_of_the_motion(speed):
    """A third of an octave wide: within 2 dB (RMS over the band); RMS velocity within 5, displacement within 10 %."""
    f, grid = np.geomspace(0.025, 9.0, 6000), np.geomspace(0.05, 5.0, 80)
    exact = bc.boom.platform_density(f, P, speed, "D", band=(1e-6, 1e3))
    found = densities(bc.boom.track_filter(P, speed, "D"), f)
    for ours, true in zip(found, (exact.jolt, exact.difference), strict=True):
        decibel = 10.0 * np.log10(smoothed(f, ours, grid) / smoothed(f, true, grid))
        assert np.sqrt(np.mean(decibel**2)) < 2.0
        for weight, within in ((1.0, 0.10), (f**2, 0.05)):
            sizes = [np.sqrt(np.trapezoid(item * weight, f)) for item in (ours, true)]
            assert sizes[0] == pytest.approx(sizes[1], rel=within)


@pytest.mark.slow
def test_the_filter_is_a_small_stable_named_system():
    system = bc.boom.track_filter()
    assert system.nstates == 12
    assert system.input_labels == ["track_jolt", "track_yaw"]
    assert system.output_labels == ["actuator_left", "actuator_right"]
    assert np.linalg.eigvals(system.A).real.max() < 0.0
    assert np.abs(system.D).max() == 0.0
    assert np.abs(system.C @ system.B).max() < 1e-12 * np.abs(system.C @ system.A @ system.B).max()
    W = solve_continuous_lyapunov(system.A, -system.B @ system.B.T)
    half = system.C @ W @ system.C.T
    f = np.geomspace(1e-4, 300.0, 60000)
    jolt, difference = (np.trapezoid(item, f) for item in densities(system, f))
    assert half[0, 0] == pytest.approx(jolt + difference, rel=2e-3)
    assert half[0, 1] == pytest.approx(jolt - difference, rel=2e-3)


def test_a_class_up_is_twice_the_filter_and_tracks_alike_do_not_yaw():
    f = np.geomspace(0.05, 5.0, 50)
    low, high = (bc.boom.track_filter(P, 2.5, road_class) for road_class in "CD")
    assert np.array(densities(high, f)) == pytest.approx(4.0 * np.array(densities(low, f)), rel=1e-3)
    even = bc.boom.track_filter(P, 2.5, "D", coherence="full")
    assert densities(even, f)[1].max() < 1e-12 * densities(even, f)[0].max()


@pytest.mark.parametrize("name", [field.name for field in fields(P)])
def test_a_parameter_that_cannot_be_is_refused(name):
    for wrong in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"{name} = {wrong!r}: expected"):
            replace(P, **{name: wrong})
    with pytest.raises(TypeError, match=f"{name} = '1': expected a real number"):
        replace(P, **{name: "1"})


def test_parameters_come_from_a_file(tmp_path):
    path = tmp_path / "tractor.toml"
    path.write_text("mass = 8000.0\ntrack_width = 2\n")
    assert bc.boom.TractorParameters.from_toml(path) == replace(P, mass=8000.0, track_width=2.0)
    path.write_text("mas = 8000.0\n")
    with pytest.raises(ValueError, match=r"tractor.toml: unknown key 'mas'; did you mean 'mass'"):
        bc.boom.TractorParameters.from_toml(path)


def test_a_drive_that_cannot_be_is_refused():
    track = bc.iso_track("C", 40.0)
    with pytest.raises(ValueError, match="centre_to_rear = 3: expected less than the wheelbase"):
        replace(P, centre_to_rear=3.0)
    with pytest.raises(ValueError, match=r"its sides are 1\.5 m apart; expected track_width, 1\.8 m"):
        bc.platform_motion(bc.iso_track("C", 40.0, width=1.5))
    with pytest.raises(ValueError, match=r"speed = 0\.0"):
        bc.platform_motion(track, P, 0.0)
    with pytest.raises(TypeError, match="tractor: expected TractorParameters, got dict"):
        bc.platform_motion(track, {})
    with pytest.raises(ValueError, match=r"duration = 30: expected at most .* s, where the track ends"):
        bc.platform_motion(bc.boom.bump_track(0.1, 0.4), P, 2.5, duration=30.0)
    with pytest.raises(ValueError, match="shorter than the wheelbase"):
        bc.platform_motion(bc.boom.bump_track(0.1, 0.4, position=1.0, length=2.0), P, 2.5)
    with pytest.raises(ValueError, match="sample_time = 100: expected less than the duration"):
        bc.platform_motion(track, P, 2.5, sample_time=100.0)
    with pytest.raises(ValueError, match=r"sample_time = 0\.1: expected at most 0\.04 s"):
        bc.platform_motion(track, P, 2.5, sample_time=0.1)
    with pytest.raises(ValueError, match="freq_hz: expected frequencies above zero"):
        bc.boom.platform_density([0.0, 1.0])
    with pytest.raises(ValueError, match="sections = 0"):
        bc.boom.track_filter(sections=0)


def test_slow_steering_costs_no_more_rounds_and_leaves_a_motion_that_repeats():
    """The time it takes to forget the start is 100 rounds; driven once more, the motion is the same."""
    p, track = (
        replace(P, steering_corner_hz=2e-4),
        bc.iso_track("C", 40.0, 3, step=0.04, band=(0.05, 3.0), periodic=True),
    )
    once = bc.platform_motion(track, p, 2.0, sample_time=0.02)
    twice = bc.platform_motion(track, p, 2.0, duration=40.0, sample_time=0.02)
    assert twice.left[: len(once.left)] == pytest.approx(once.left, abs=1e-9)
    assert twice.left[1000:] == pytest.approx(twice.left[:1001], abs=1e-6 * twice.left.std())
    assert once.yaw[-1] == pytest.approx(once.yaw[0], abs=1e-6 * once.yaw.std())


def test_slow_steering_between_samples_that_do_not_fit_into_a_round_is_the_limit_of_finer_ones():
    p, track = (
        replace(P, steering_corner_hz=2e-4),
        bc.iso_track("C", 40.0, 3, step=0.04, band=(0.05, 3.0), periodic=True),
    )
    coarse, fine = (bc.platform_motion(track, p, 2.0, 10.0, sample_time=h) for h in (0.01 / 0.97, 0.001 / 0.97))
    assert fine.yaw[::10][: len(coarse.yaw)] == pytest.approx(coarse.yaw, abs=3e-3 * np.abs(coarse.yaw).max())


def test_what_is_no_track_and_what_is_beyond_numbers_is_refused():
    with pytest.raises(TypeError, match="track = None: expected Track, got NoneType; iso_track"):
        bc.platform_motion(None)
    with pytest.raises(ValueError, match=r"duration = .*: expected at most 5e.07 steps of 1e-12 s"):
        bc.platform_motion(bc.iso_track("C", 40.0), sample_time=1e-12)
    for call in (bc.boom.platform_density, lambda f, **options: bc.boom.track_filter(**options)):
        with pytest.raises(ValueError, match=r"speed = 1e.300: expected a number of at most 1e.100 in size"):
            call([1.0], speed=1e300)
        with pytest.raises(ValueError, match=r"actuator_distance = 1e.300: expected a number of at most"):
            call([1.0], actuator_distance=1e300)


@pytest.mark.parametrize("sections", [1, 3, 8])
def test_the_slopes_of_the_fit_are_those_of_its_magnitude(sections):
    rng = np.random.default_rng(sections)
    omega = np.geomspace(0.2, 40.0, 50)
    x = np.log(rng.uniform(0.1, 20.0, 4 * sections - 1))
    found = _log_slopes(x, omega)
    for k, step in enumerate(1e-6 * np.eye(len(x))):
        high, low = (np.log(np.abs(_magnitude(x + side * step, 1j * omega)) ** 2) for side in (1.0, -1.0))
        np.testing.assert_allclose(found[:, k], (high - low) / 2e-6, atol=1e-6 * np.abs(found).max())


@pytest.mark.slow
def test_a_filter_of_many_sections_follows_the_density_better():
    f = np.geomspace(0.1, 4.0, 300)
    exact = bc.boom.platform_density(f, speed=2.5, band=(1e-9, 1e9)).jolt
    errors = []
    for sections in (3, 10):
        system = bc.boom.track_filter(sections=sections)
        response = np.asarray(system(2j * np.pi * f, squeeze=False))
        found = 2.0 * np.abs(0.5 * (response[0, 0] + response[1, 0])) ** 2
        errors.append(np.abs(np.log(found / exact)).mean())
    assert errors[1] < errors[0]
