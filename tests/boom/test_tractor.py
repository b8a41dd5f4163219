"""The tractor: Newton's law, statics, symmetry, and spectra of its motion."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
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
    ahead = np.array([1, 1, 0, 0]) * p.wheelbase - p.cg_to_rear_axle
    across = 0.5 * p.track_width * np.array([-1, 1, -1, 1])
    k, c = (
        np.repeat([getattr(p, f"tire_{what}_{axle}") for axle in ("front", "rear")], 2)
        for what in ("stiffness", "damping")
    )
    lift = (k + s * c) * (felt - z - ahead * pitch - across * roll)
    front = p.mass * GRAVITY * p.cg_to_rear_axle / p.wheelbase / 2
    load = np.repeat([front, p.mass * GRAVITY / 2 - front], 2)
    push = -load * s * felt / speed - p.rolling_resistance * lift
    below = p.cg_height - p.hub_height
    drive = -(p.drive_stiffness + s * p.drive_damping) * (x + below * pitch)
    side = 2 * (
        p.cornering_stiffness_front * (p.wheelbase - p.cg_to_rear_axle) ** 2
        + p.cornering_stiffness_rear * p.cg_to_rear_axle**2
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
    boom = x + (p.cg_height - p.boom_height) * pitch
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


def test_tractor_uphill_static_deflection():
    slope, step = 0.05, 0.01
    heights = slope * step * np.arange(6001)
    track = bc.boom.Track(step, heights, heights, P.track_width)
    motion = bc.platform_motion(track, P, 2.0)
    pitched = -(P.boom_height - P.hub_height) * slope
    assert motion.jolt[0] == pytest.approx(pitched)
    assert motion.jolt[-1] == pytest.approx(pitched - P.mass * GRAVITY * slope / P.drive_stiffness, rel=1e-6)
    assert np.abs(motion.yaw).max() < 1e-12


def test_tractor_mirror_symmetry():
    track = bc.iso_track("D", 60.0, 2)
    mirrored = replace(track, left=track.right, right=track.left)
    found, other = (bc.platform_motion(item, P, 2.5) for item in (track, mirrored))
    assert np.allclose(found.left, other.right, rtol=0.0, atol=1e-12)
    assert np.allclose(found.yaw, -other.yaw, rtol=0.0, atol=1e-12)
    even = bc.platform_motion(bc.iso_track("D", 60.0, 2, coherence="full"), P, 2.5)
    assert np.abs(even.yaw).max() < 1e-12
    assert even.jolt.std() > 1e-3


def test_a_stone_under_the_left_wheels_turns_the_left_side_back():
    """It holds the left side back when met, and lets go behind its top; front wheels first, rear ones a wheelbase later."""
    motion = bc.platform_motion(bc.bump_track(0.1, 0.5, "left", position=8.0, length=40.0), P, 2.0)
    met, again = (8.0 - P.wheelbase) / 2.0, 8.0 / 2.0
    before = motion.time < met - 0.01
    assert np.abs(motion.left[before]).max() < 1e-9
    for begin in (met, again):
        climbing = (motion.time > begin + 0.05) & (motion.time < begin + 0.12)
        assert (np.diff(motion.yaw[climbing]) > 0.0).all()
    assert np.abs(motion.yaw[motion.time > 18.0]).max() < 0.05 * np.abs(motion.yaw).max()


def test_tractor_without_steering_changes_heading():
    """Impulses alone count: half the weight times the step's slope, over the speed, at half the track width."""
    free, rise = replace(P, steering_corner_hz=0.0), 0.1
    s = np.clip((0.01 * np.arange(4001) - 8.0) / 0.5, 0.0, 1.0)
    left = rise * (s - np.sin(2 * np.pi * s) / (2 * np.pi))
    motion = bc.platform_motion(bc.boom.Track(0.01, left, 0.0 * left, P.track_width), free, 2.0)
    impulse = 0.5 * P.track_width * 0.5 * P.mass * GRAVITY * rise / 2.0
    assert motion.yaw[-1] == pytest.approx(impulse / P.yaw_damping(2.0), rel=1e-4)
    over = bc.platform_motion(bc.bump_track(0.1, 0.5), free, 2.0)
    assert abs(over.yaw[-1]) < 1e-4 * np.abs(over.yaw).max()


def test_tractor_invariant_to_track_sampling():
    track = bc.iso_track("C", 40.0, 1, spacing=0.04, wave_number_range=(0.05, 3.0))
    coarse, fine = (bc.platform_motion(track, P, 2.0, sample_time=h) for h in (0.02, 0.005))
    assert np.allclose(fine.left[::4], coarse.left, rtol=0.0, atol=1e-7 * coarse.left.std())
    assert np.allclose(fine.right[::4], coarse.right, rtol=0.0, atol=1e-7 * coarse.right.std())


def test_tractor_harmonics_match_frequency_response():
    """Straight lines between points weigh a harmonic with sinc^2."""
    speed, count = 2.0, 2000
    track = bc.iso_track("C", 80.0, 7, spacing=0.04, periodic=True)
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
def test_platform_motion_random_tracks_have_expected_density(periodic):
    """Mean square displacement and velocity of jolt and yaw over many tracks against integrals of their densities.

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
    H = bc.boom.tractor_system(P, 2.5)(2j * np.pi * f, squeeze=False)
    left, right = (H[:, side] * np.exp(2j * np.pi * f * P.wheelbase / 2.5) + H[:, 2 + side] for side in (0, 1))
    ground = bc.boom.road_psd("D", f / 2.5) / 2.5 * ((f / 2.5 >= 0.01) & (f / 2.5 <= 3.0))
    common = bc.boom.track_coherence(f / 2.5, P.track_width)
    jolt = 0.5 * np.abs(0.5 * (left + right).sum(axis=0)) ** 2 * ground * (1.0 + common)
    difference = 0.5 * np.abs(0.5 * ((left - right)[0] - (left - right)[1])) ** 2 * ground * (1.0 - common)
    expected = [np.sum(item * weight) * f[0] for item in (jolt, difference) for weight in (1.0, (2 * np.pi * f) ** 2)]
    error = found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - expected) < 5.0 * error).all()
    assert (error < 0.1 * np.array(expected)).all()


SLOW = replace(P, steering_corner_hz=2e-4)
ROUND = bc.iso_track("C", 40.0, 3, spacing=0.04, wave_number_range=(0.05, 3.0), periodic=True)


def test_tractor_coarse_samples():
    """At a crawl, on tires that feel every wave, the motion is that of a track with ends."""
    track = bc.iso_track("C", 40.0, 3, spacing=0.04, wave_number_range=(0.05, 3.0), periodic=True)
    sharp = replace(P, contact_length=0.0)
    motion = bc.platform_motion(track, sharp, speed=1e-4, sample_time=200.0)
    ended = bc.platform_motion(replace(track, periodic=False), sharp, speed=1e-4, sample_time=200.0)
    count = len(ended.left) - 1
    assert np.allclose(motion.left[1:count], ended.left[1:count], rtol=0.0, atol=1e-3 * motion.left.std())


def test_slow_steering_motion_is_periodic():
    """The time it takes to forget the start is 100 rounds; driven once more, the motion is the same."""
    once = bc.platform_motion(ROUND, SLOW, 2.0, sample_time=0.02)
    twice = bc.platform_motion(ROUND, SLOW, 2.0, duration=40.0, sample_time=0.02)
    assert np.allclose(twice.left[: len(once.left)], once.left, rtol=0.0, atol=1e-9)
    assert np.allclose(twice.left[1000:], twice.left[:1001], rtol=0.0, atol=1e-6 * twice.left.std())
    assert once.yaw[-1] == pytest.approx(once.yaw[0], abs=1e-6 * once.yaw.std())


def test_slow_steering_converges_with_sampling():
    coarse, fine = (bc.platform_motion(ROUND, SLOW, 2.0, 10.0, sample_time=h) for h in (0.01 / 0.97, 0.001 / 0.97))
    assert np.allclose(fine.yaw[::10][: len(coarse.yaw)], coarse.yaw, rtol=0.0, atol=3e-3 * np.abs(coarse.yaw).max())
