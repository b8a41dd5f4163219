"""The hub-beam: modes, speeds, masses at the tip, the neighbourhood of a critical speed, units, motion."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi, sqrt

import numpy as np

from boomctl.lab.stress.case import Case, Seen, each_relative
from boomctl.lab.stress.references import clamped_free_frequencies, rotating_frequencies
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import hold, hub_profile, sine_torque, spin_up
from boomctl.rotating_beam.parameters import HubBeamParameters

_AREA = "Hub-beam"
_EPS = float(np.finfo(float).eps)
_MODELS = ("tlam", "sfoam", "foam")


def cases() -> Iterator[Case]:
    """Return the cases of the hub-beam."""
    yield from _frequencies()
    yield from _units_and_motion()


def _frequencies() -> Iterator[Case]:
    """Return the cases of frequencies."""
    for modes in (1, 5, 12, 20, 50, 100, 200):
        what, measure = "frequencies at rest", "relative, cos b cosh b = -1 in sixty digits"
        yield Case(_AREA, what, _modes(modes), 1e-10, measure, _at_rest, (modes,), answered=modes <= 20)
    for speed in (0.0, 1.0, 100.0, 1e4):
        for tip in (0.0, 0.5):
            what, measure = f"three modes of SFOAM turning, {tip:g} kg at the tip", "relative, sixty digits"
            yield Case(
                _AREA, what, f"{speed:g} rad/s", 1e-10, measure, _turning, (speed, tip), answered=True, seconds=40.0
            )
    for ratio in (1e-6, 1.0, 1e3, 1e6):
        what, measure = "three modes at 1 rad/s", "relative, sixty digits"
        # of a mass so heavy the first mode is a difference of terms as large as the mass itself
        promise = max(1e-10, 1e2 * _EPS * ratio)
        yield Case(_AREA, what, f"tip mass {ratio:g} times the beam's", promise, measure, _heavy, (ratio,))
    for delta in (1e-1, 1e-3, 1e-6, 1e-9, 1e-12):
        what, measure = "TLAM's frequency near its critical speed", "relative, sqrt(critical^2 - speed^2)"
        promise = max(1e-10, 20 * _EPS / delta)
        yield Case(_AREA, what, f"{delta:g} below it", promise, measure, _near_critical, (delta,))
    for delta in (0.0, 1e-12, 1e-3):
        what, measure = "TLAM's frequency beyond its critical speed", "a refusal"
        yield Case(_AREA, what, f"{delta:g} beyond it" if delta else "at it", None, measure, _beyond, (delta,))


def _units_and_motion() -> Iterator[Case]:
    """Return the cases of units and of motion."""
    for scale in (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9):
        for unit in ("length", "force", "time"):
            what, measure = f"frequencies in other units of {unit}", "relative, the law of scaling"
            yield Case(_AREA, what, f"{scale:g}", 1e-9, measure, _units, (unit, scale))
    for model in _MODELS:
        for rate in (1e-3, 1.0, 1e2):
            what, measure = f"{model}: energy without torque", "relative change of energy over ten periods"
            yield Case(_AREA, what, f"started at {rate:g} rad/s", 1e-6, measure, _energy, (model, rate), seconds=40.0)
    for speed in (1e-6, 1e-3, 0.1):
        what, measure = "deflection of a slow spin-up", "of the largest, TLAM against FOAM"
        # the models differ by the square of speed over first frequency, 2.9 rad/s
        promise = max(1e-6, 2.0 * (speed / 2.9) ** 2)
        yield Case(_AREA, what, f"to {speed:g} rad/s", promise, measure, _slow_spin_up, (speed,), seconds=60.0)
    for off in (1e-2, 1e-4, 1e-6, 1e-8, 1e-12):
        what, measure = "a profile whose acceleration is off", "of the largest deflection, the profile itself"
        yield Case(_AREA, what, f"by {off:g} of it", 1e-8, measure, _profile_off, (off,))
    for modes in (2, 4, 8, 16):
        what = "geometrically exact, a spin-up that leaves the tip behind"
        measure = "error of the tip over the one estimated, 24 polynomials"
        yield Case(_AREA, what, f"{modes} polynomials", 1.0, measure, _whip, (modes,), seconds=60.0, answered=True)
    for amplitude in (1e-6, 1e-2, 1.0):
        what, measure = "SFOAM under a sine of torque", "of the largest, python-control on its linear model"
        promise = max(1e-5, 1e-4 * amplitude**2)
        yield Case(
            _AREA,
            what,
            f"{amplitude:g} N m",
            promise,
            measure,
            _small_torque,
            (amplitude,),
            seconds=60.0,
            answered=True,
        )


def _modes(count: int) -> str:
    return f"{count} mode{'s' if count > 1 else ''}"


def _rate(p: HubBeamParameters) -> float:
    """Return the unit of a clamped beam's frequencies, rad/s."""
    return sqrt(p.bending_stiffness / p.mass_per_length) / p.length**2


def _at_rest(modes: int) -> Seen:
    p = HubBeamParameters()
    found = 2 * pi * hub_beam(p, "sfoam", modes).frequencies_hz()
    return Seen(each_relative(found, _rate(p) * clamped_free_frequencies(modes)))


def _true(p: HubBeamParameters, speed: float) -> Seen:
    found = 2 * pi * hub_beam(p, "sfoam", 3).frequencies_hz(speed)
    true = rotating_frequencies(
        3,
        speed,
        length=p.length,
        mass=p.mass_per_length,
        stiffness=p.bending_stiffness,
        radius=p.hub_radius,
        tip_mass=p.tip_mass,
    )
    return Seen(each_relative(found, true))


def _turning(speed: float, tip: float) -> Seen:
    return _true(HubBeamParameters(tip_mass=tip), speed)


def _heavy(ratio: float) -> Seen:
    p = HubBeamParameters()
    return _true(replace(p, tip_mass=ratio * p.mass_per_length * p.length), 1.0)


def _critical(p: HubBeamParameters) -> float:
    return _rate(p) * float(clamped_free_frequencies(1)[0])


def _near_critical(delta: float) -> Seen:
    p = HubBeamParameters()
    critical, speed = _critical(p), _critical(p) * (1.0 - delta)
    found = 2 * pi * hub_beam(p, "tlam", 1).frequencies_hz(speed)[0]
    return Seen(abs(found / sqrt((critical - speed) * (critical + speed)) - 1.0))


def _beyond(delta: float) -> Seen:
    p = HubBeamParameters()
    beam = hub_beam(p, "tlam", 1)
    speed = beam.critical_speed() * (1.0 + delta)
    return Seen(float(beam.frequencies_hz(speed)[0]))


# powers of length, force and time in the unit of each parameter
_UNITS = {
    "length": (1, 0, 0),
    "density": (-4, 1, 2),
    "area": (2, 0, 0),
    "youngs_modulus": (-2, 1, 0),
    "second_moment": (4, 0, 0),
    "hub_inertia": (1, 1, 2),
    "hub_radius": (1, 0, 0),
    "tip_mass": (-1, 1, 2),
}


def _units(unit: str, scale: float) -> Seen:
    place = ("length", "force", "time").index(unit)
    p = HubBeamParameters(tip_mass=0.1)
    changed = {name: getattr(p, name) * scale ** float(powers[place]) for name, powers in _UNITS.items()}
    slower = scale if unit == "time" else 1.0
    found = hub_beam(replace(p, **changed), "sfoam", 3).frequencies_hz(1.0 / slower) * slower
    return Seen(each_relative(found, hub_beam(p, "sfoam", 3).frequencies_hz(1.0)))


def _energy(model: str, rate: float) -> Seen:
    """The first mode is set moving, the hub held still: its energy stays."""
    beam = hub_beam(HubBeamParameters(), model, 1)
    names = list(beam.state_names)
    state = np.zeros(len(names))
    state[-1] = rate
    run = beam.simulate(hold(), np.linspace(0.0, 20.0, 101), initial=state)
    return Seen(float(np.ptp(run.energy) / np.abs(run.energy).max()))


def _slow_spin_up(speed: float) -> Seen:
    grid = np.linspace(0.0, 40.0, 201)
    runs = [hub_beam(model=m, modes=2).simulate(spin_up(speed, 30.0), grid).tip_displacement for m in ("tlam", "foam")]
    return Seen(float(np.abs(runs[0] - runs[1]).max() / np.abs(runs[1]).max()))


def _profile_off(off: float) -> Seen:
    beam, grid = hub_beam(modes=2), np.linspace(0.0, 20.0, 201)
    exact, other = (
        beam.simulate(
            hub_profile(lambda t: 1.0 - np.cos(t), np.sin, lambda t, z=z: z * np.cos(t)), grid
        ).tip_displacement
        for z in (1.0, 1.0 + off)
    )
    return Seen(float(np.abs(other - exact).max() / np.abs(exact).max()))


def _whip(modes: int) -> Seen:
    grid = np.linspace(0.0, 0.9, 31)
    beams = (hub_beam(model="geometrically-exact", modes=n) for n in (modes, 24))
    few, true = (beam.simulate(spin_up(5.0, 0.7), grid, rtol=1e-4) for beam in beams)
    error = float(np.abs(few.tip_displacement - true.tip_displacement).max())
    return Seen(error / (few.error_estimate + true.error_estimate))


def _small_torque(amplitude: float) -> Seen:
    from boomctl.lti.python_control import control

    beam = hub_beam(modes=1)
    grid = np.linspace(0.0, 20.0, 4001)
    run = beam.simulate(sine_torque(amplitude, 10.0, 10.0), grid)
    torque = np.where(grid <= 10.0, amplitude * np.sin(2 * pi * grid / 10.0), 0.0)
    system = beam.linearize()
    linear = control.forced_response(system, grid, torque)
    true = np.asarray(linear.outputs)[list(system.output_labels).index("tip_displacement")]
    return Seen(float(np.abs(run.tip_displacement - true).max() / np.abs(true).max()))
