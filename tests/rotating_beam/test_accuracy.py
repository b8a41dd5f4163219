"""Models chosen by accuracy: as near to the geometrically exact beam as asked for."""

import numpy as np
import pytest

import boomctl as bc

SPIN_UP = bc.spin_up(final_speed=2.8, duration=30.0)
EXACT = "geometrically-exact"


def _switched(amplitude, duration):
    """Return a torque that jumps three times."""
    half = 0.5 * duration
    return bc.torque(lambda t: amplitude * (1.0 * (t < half) - 1.0 * ((t >= half) & (t < duration))), (half, duration))


def _machine(rng):
    """Return a beam of 0.5 to 20 m, slender to stocky, steel or aluminium, a manoeuvre, its end, and an accuracy.

    The manoeuvre lasts from half a period of the slowest mode to six, and bends the beam by 1e-4 to about 0.3 of its
    length; it ends at up to three times the speed at which a linear beam loses its stiffness.
    """
    length = rng.uniform(0.5, 20.0)
    depth = length * 10.0 ** rng.uniform(-3.0, -1.3)
    width = depth * 10.0 ** rng.uniform(0.0, 1.0)
    density, modulus = (7800.0, 2.1e11) if rng.random() < 0.5 else (2700.0, 7e10)
    mass = density * depth * width * length
    tip_mass = 0.0 if rng.random() < 0.4 else mass * 10.0 ** rng.uniform(-2.0, 0.5)
    p = bc.HubBeamParameters(
        length=length,
        density=density,
        area=depth * width,
        youngs_modulus=modulus,
        second_moment=width * depth**3 / 12.0,
        hub_inertia=mass * length**2 / 3.0 * 10.0 ** rng.uniform(-1.5, 2.0),
        hub_radius=0.0 if rng.random() < 0.2 else length * rng.uniform(0.0, 0.5),
        tip_mass=tip_mass,
        tip_position=None if tip_mass == 0.0 or rng.random() < 0.6 else length * rng.uniform(0.3, 1.0),
        damping_ratio=0.0 if rng.random() < 0.5 else 10.0 ** rng.uniform(-3.0, -1.3),
    )
    slowest = 2.0 * np.pi * bc.hub_beam(p, "sfoam", 3).frequencies_hz()[0]
    period = 2.0 * np.pi / slowest
    duration = period * 10.0 ** rng.uniform(-0.3, 0.8)
    wanted = length * 10.0 ** rng.uniform(-4.0, -0.75)
    turning = wanted * slowest**2 / (1.6 * (p.hub_radius + length))  # hub acceleration that bends a beam so
    turning = min(turning, 6.0 * slowest / duration)
    torque = turning * p.rigid_inertia
    kind = rng.choice(["spin-up", "sine", "switch"], p=[0.45, 0.45, 0.1])
    manoeuvre = {
        "spin-up": bc.spin_up(0.5 * turning * duration, duration),
        "sine": bc.sine_torque(torque, duration * rng.choice([1.0, 2.0]), duration),
        "switch": _switched(0.7 * torque, duration),
    }[kind]
    # a jump excites modes without end, for which the reference takes minutes
    least = -3.0 if kind == "switch" else -5.0
    return p, manoeuvre, duration + period * rng.uniform(0.0, 4.0), float(10.0 ** rng.uniform(least, -1.0))


def _finer(p, manoeuvre, chosen, t):
    """Return the tip of a beam with more polynomials and shorter steps than any that the choice was made with."""
    finer = bc.hub_beam(p, EXACT, min(chosen.reference[1] + 3, 60))
    return finer.simulate(manoeuvre, t, rtol=2e-2 * chosen.accuracy, atol=1e-15 * p.length).tip_displacement


def _error(found, true):
    return float(np.abs(found - true).max() / np.abs(true).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 7, 12, 20])
def test_a_random_machine_is_as_exact_as_asked_for(seed):
    """Choose, simulate as a user would, and compare with a reference of the test's own."""
    rng = np.random.default_rng(seed)
    p, manoeuvre, end, accuracy = _machine(rng)
    t = np.linspace(0.0, end, int(rng.integers(200, 1500)))
    beam = bc.hub_beam(p, accuracy=accuracy, manoeuvre=manoeuvre, time=t)
    assert beam.chosen.tried
    assert beam.chosen.error + beam.chosen.reference[2] <= accuracy
    found = beam.simulate(manoeuvre, t).tip_displacement
    assert _error(found, _finer(p, manoeuvre, beam.chosen, t)) <= accuracy, (seed, beam)


@pytest.fixture(scope="module")
def spun_up():
    return bc.hub_beam(accuracy=1e-3, manoeuvre=SPIN_UP)


@pytest.mark.slow
def test_what_was_chosen_is_said_and_is_what_is_built(spun_up):
    chosen = spun_up.chosen
    assert (spun_up.model, spun_up.modes) == (chosen.model, chosen.modes) == ("sfoam", 3)
    assert [each[:2] for each in chosen.tried] == [("sfoam", 1), ("sfoam", 2), ("sfoam", 3)]
    errors = [each[2] for each in chosen.tried]
    assert errors[2] == chosen.error <= 1e-3 < errors[1] < errors[0]
    assert "3 modes of sfoam: error 3.3e-04" in repr(spun_up)
    assert spun_up == bc.hub_beam(model="sfoam", modes=3)
    assert chosen.time == pytest.approx(30.0 + 5.0 / 0.46326, rel=1e-4)
    assert chosen.largest == pytest.approx(0.2043, abs=1e-4)  # of a geometrically exact beam, in THEORY's derivation


@pytest.mark.slow
def test_an_accuracy_beyond_all_assumed_modes_takes_the_exact_beam():
    short = bc.HubBeamParameters(length=2.0, hub_inertia=2.0, tip_mass=0.2)
    turn = bc.spin_up(6.0, 0.6)
    beam = bc.hub_beam(short, accuracy=1e-5, manoeuvre=turn, time=0.7)
    assert isinstance(beam, bc.rotating_beam.GeometricallyExactBeam)
    least = {}
    for model, _, error in beam.chosen.tried:
        least[model] = min(error, least.get(model, error))
    assert all(error > 1e-5 for model, error in least.items() if model != EXACT)
    assert {"sfoam", EXACT} == set(least)
    t = np.linspace(0.0, 0.7, 300)
    found = beam.simulate(turn, t).tip_displacement
    assert _error(found, _finer(short, turn, beam.chosen, t)) <= 1e-5


@pytest.mark.slow
def test_tolerances_are_those_of_the_choice_in_its_manoeuvre_alone(spun_up):
    chosen, t = spun_up.chosen, np.linspace(0.0, 40.0, 50)
    assert (chosen.rtol, chosen.atol) == pytest.approx((1e-5, 1e-5 * chosen.largest))
    usual, start = (1e-8, 1e-10), {"initial": np.zeros(8)}
    for final_speed, more, (rtol, atol) in (
        (2.8, {}, (chosen.rtol, chosen.atol)),
        (2.7, {}, usual),
        (2.8, start, usual),
    ):
        manoeuvre = bc.spin_up(final_speed, 30.0)  # an equal one is the same
        found, known = (spun_up.simulate(manoeuvre, t, **more, **given) for given in ({}, {"rtol": rtol, "atol": atol}))
        np.testing.assert_array_equal(found.tip_displacement, known.tip_displacement)


def test_those_around_are_told():
    heard = []
    with bc.listening(heard.append):
        bc.hub_beam(accuracy=0.1, manoeuvre=bc.spin_up(1.1, 2.0), time=2.5)
    assert {told.task for told in heard} == {"choice of a model"}
    assert {"geometrically exact beam with 5 polynomials", "sfoam with 1 mode"} <= {told.stage for told in heard}
