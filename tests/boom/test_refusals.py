"""Booms, tracks, motions and runs that cannot be are refused in words that name the parameter and a remedy."""

from dataclasses import replace

import numpy as np

import boomctl as bc
from tests.refusals import assert_refused, refusals

P, TRACTOR = bc.BoomParameters(), bc.boom.TractorParameters()
STILL = replace(P, cradle_damping=0.0, hinge_damping=0.0, stiffness_damping=0.0)
HEAVY = {"boom_mass": 1e15, "boom_inertia": 1e15}
TIME, MOVED, PLACES = np.arange(0.0, 10.0, 0.01), np.zeros((24, 1000)), bc.nozzle_positions()
BENDS = r"would bend at .* expected 1e-05 to 1e\+06 rad/s, in SI units"
TRACK = bc.iso_track("C", 40.0)


def chosen(accuracy=1e-3, max_frequency_hz=5.0, **options):
    return bc.spray_boom(accuracy=accuracy, max_frequency_hz=max_frequency_hz, **options)


def sprayed(**changes):
    usual = {"time": TIME, "displacement": MOVED, "positions": PLACES, "speed": 2.0}
    return bc.spray_deposit(**(usual | changes))


def road(road_class="C", length=200.0, **options):
    return bc.iso_track(road_class, length, **options)


REFUSED = r"""
# parameters
replace(P, inner_width=0.03) -> `inner_width` must be less than `outer_width`, 0\.02, got 0\.03
replace(P, spring_distance=12.5) -> `spring_distance` must be less than `length`, 12, got 12\.5
replace(P, boom_mass=20.0) -> `boom_mass` must be at least that of the tube, .* got 20
bc.BoomParameters(length=1e4, **HEAVY) -> would bend at .* expected 1e-05 to 1e\+06 rad/s, in SI units
bc.BoomParameters(length=1e-6, spring_distance=1e-7) -> would bend at .* expected 1e-05 to 1e\+06 rad/s, in SI units
bc.BoomParameters(density=1e16) -> density = 1e\+16: expected a number from 0 to 1e\+15 in SI units
replace(TRACTOR, cg_to_rear_axle=3.0) -> cg_to_rear_axle = 3.0: expected a number from 0 to 2.6 m
# meshes
bc.spray_boom(elements=[-6, 1, 0, 6]) -> `elements` must have at least 2 positions along the boom, ascending
bc.spray_boom(elements=[-6, 0, 5]) -> `elements` must be node positions from tip to tip, -6 to 6 m, got -6 to 5 m
bc.spray_boom(discretization="discrete-hermite", elements=7) -> elements = 7: expected an even number, at
bc.spray_boom(discretization="discrete-hermite", elements=[-6, 0, 6]) -> not a mass allocation point
bc.spray_boom(excitation="force", reaction_forces=True) -> reaction_forces = True
bc.spray_boom(nozzles=[1.0, 0.0]) -> `nozzles` must have at least 1 positions along the boom, ascending
bc.spray_boom(nozzles=[0.0, 6.5]) -> `nozzles` must be within 6 m of the hinge, got 0 to 6.5
chosen(max_frequency_hz=None) -> max_frequency_hz = None: expected a real number
chosen(elements=8) -> `elements` must be None with `accuracy`, which chooses the mesh, got 8
chosen(discretization="finite") -> `discretization` must be None .*, got 'finite'
chosen(accuracy=1e-12) -> accuracy = 1e-12: expected a number from 1e-07 to 1
chosen(parameters=STILL, max_frequency_hz=2.0) -> below the undamped resonance at 0\.\d+ Hz, .* infinite, got 2
boom_family(spring_factor=(1.2, 0.8)) -> range of spring.*ascending
boom_family(mass_factor=(-0.5, 1.2)) -> mass_factor = -0.5: expected a number greater than zero
boom_family(mass_factor=(0.8, 1.0, 1.2)) -> range of mass
boom_family(subsystem="pitch") -> unknown subsystem 'pitch'
yaw_family(replace(P, hinge_damping=700.0), subsystem="yaw") -> frequency_hz
# tracks
road("I") -> unknown road_class 'I'
road(8) -> road_class = 8: expected a whole number of at most 7
road(length=0.2, periodic=True) -> `wave_number_range` must contain a multiple of 5 /m, got 0\.01 to 3 /m
road(spacing=0.5) -> spacing = 0\.5: expected less than 0\.16
road(wave_number_range=(3.0, 1.0)) -> `wave_number_range` must be two nonnegative numbers, ascending, got .3.0, 1.0.
road(wave_number_range=(0.01, 1.0, 2.0)) -> `wave_number_range` must be two nonnegative numbers
road(length=12e3) -> `length` must be at most 10000 m, got 12000 m\. Use periodic=True
road(wave_number_range=(0.01, 600.0), spacing=5e-4) -> wave_number_range = 600\.0: expected a number from 0 to 500 /m
road(wave_number_range=(0.10001, 0.10002)) -> `wave_number_range` must contain a multiple of 0\.0001 /m
road(wave_number_range=(0.011, 0.014), periodic=True) -> `wave_number_range` must contain a multiple of 0\.005 /m
road(length=1e12, periodic=True) -> `length` must be 1 to 5e\+07 steps of 0.02 m long, got 1e\+12 m
bump_track(0.1, 0.4, position=49.9) -> position = 49\.9: expected a number from 0 to 49\.6 m
bump_track(0.1, 0.01) -> bump_length = 0\.01: expected a number from 0\.05 to 50 m
bump_track(0.1, 0.4, spacing=1e-12) -> `length` must be 1 to
bc.boom.Track(0.1, np.zeros(3), np.zeros(2), 1.8) -> equally many, got 3 and 2
# motions
bc.platform_motion("C") -> expected Track, got str; iso_track\(\.\.\.\)
bc.platform_motion(road(width=1.5)) -> its sides are 1\.5 m apart; expected track_width, 1\.8 m
bc.platform_motion(TRACK, duration=30.0) -> duration = 30\.0: expected a number from 0 to 14\.96 s
bc.platform_motion(bump_track(0.1, 0.4, position=1.0, length=2.0)) -> shorter than the wheelbase
bc.platform_motion(TRACK, duration=0.01, sample_time=0.03) -> `duration` must be 1 to .* steps of 0.03 s
bc.platform_motion(TRACK, sample_time=0.1) -> `sample_time` must be at most 0\.04 s
bc.platform_motion(TRACK, sample_time=1e-12) -> `duration` must be 1 to 5e.07 steps of 1e-12 s
tractor_system(TRACTOR, 1e300) -> speed = 1e.300: expected a number of at most 1e.100 in size
tractor_system(TRACTOR, 2.5, 1e300) -> actuator_distance = 1e.300: expected a number of at most
bc.sine_sweep(0.1, 600.0, 5.0, 0.02) -> sample_time = 0\.001: expected a number from 0 to 0\.000833333 s
bc.sine_sweep(1.0, 1.0, 0.01, 1.0, sample_time=0.1) -> `duration` must be 1 to .* steps of 0\.1 s
bc.sine_sweep(1.0, 1.0, 1e12, 1.0) -> `duration` must be 1 to 5e.07 steps of 0.001 s long, got 1e.12 s
bc.boom.PlatformMotion([0.0, 1.0, 2.0, 9.0], np.zeros(4), np.zeros(4)) -> time\[3\] = 9: a gap
bc.boom.PlatformMotion(np.arange(4.0), np.zeros(3), np.zeros(4)) -> equally many, got 4, 3 and 4
# spray
sprayed(displacement=MOVED[:20]) -> displacement: expected 24 positions by 1000 times
sprayed(time=np.r_[TIME[:-1], 12.0]) -> time\[999\] = 12: a gap
sprayed(positions=PLACES[::-1]) -> positions: expected at least two points, ascending
sprayed(speed=0.0) -> speed = 0\.0: expected a number from 1e-06 to 1e\+06 m/s
sprayed(speed=0.001) -> too short to evaluate a cell
sprayed(displacement=1e6 * TIME * np.ones((24, 1))) -> displacement: nozzles travel 9\.99e.06 m over
sprayed(cell_size=(0.1,)) -> `cell_size` must be one size, or those along the boom
sprayed(cell_size=(1e-9, 0.1)) -> too much for cells of 1e-09 by 0.1 m
sprayed(footprint=bc.boom.Footprint(14.0)) -> footprint: no cell of 0.1 m between the nozzles
sprayed(nozzles=[-6.0, 0.0, 6.0]) -> `nozzles` must be between the points given
sprayed(nozzles=[-5.0, 0.0, 4.0]) -> `nozzles` must be at least two positions, ascending
bc.boom.split_jolt_yaw(MOVED, PLACES + 0.1) -> symmetrically about x = 0
bc.nozzle_positions(spacing=20.0) -> spacing = 20.0: expected a number from 6e-07 to 12 m
bc.nozzle_positions(spacing=1e-12) -> spacing = 1e-12: expected a number from
bc.read_motion("none.csv") -> OSError: none\.csv
# pictures
one.track().plot(colour="red") -> unexpected keyword argument 'colour', .*; did you mean 'color'
one.track().plot(dB=True) -> 'dB', .*; bode\(\.\.\.\)\.response\.plot\(\.\.\.\) is python-control's
"""


@refusals(REFUSED)
def test_what_cannot_be_is_refused(call, words):
    assert_refused(call, words, globals())
