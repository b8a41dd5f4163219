"""Gain-scheduled LQG controller for the spin-up of the beam to 5 rad/s, with an unknown tip mass of up to 0.1 kg.

The controller is scheduled over the hub speed. LQG controllers are designed at seven constant speeds for the beam without tip
mass, including its centrifugal stiffening; the weight of the tip displacement increases with speed, because the stiffer beam
deflects less. Their matrices are interpolated linearly. The closed loop is proved stable at every constant speed up to
6 rad/s with 0 to 0.1 kg. The proof does not cover a changing speed: the spin-up is simulated at the intended rate and at
three times that rate.
"""

from functools import partial
from typing import Any

import numpy as np

from boomctl import HubBeamParameters, gain_schedule, hub_beam, lqg, simulate_loop, spin_up
from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.plotting.canvas import figure_of, panels, picture
from boomctl.report import Section, Table
from boomctl.rotating_beam import HubBeam
from boomctl.simulation import LoopResult
from boomctl.studies import MachineDesign
from boomctl.studies.machine import MachineResult

SPEEDS, MASSES = np.linspace(0.0, 6.0, 7), (0.0, 0.1)  # rad/s, kg
SENSORS = {"hub_angle": 1e-5, "hub_speed": 1e-4, "root_moment": 0.1}  # measurements, with noise intensities of the LQG
NOISE = {"hub_angle": 1e-5, "hub_speed": 1e-3, "root_moment": 0.05}  # standard deviation of a sample: rad, rad/s, N m
SPEED, DURATION, FASTER = 5.0, 15.0, 3.0  # rad/s, s; rate of the second spin-up relative to the first
STEP, LIMIT = 0.01, 200.0  # s, N m
GUST, GUST_TIME, SETTLED = 2.0, 0.5, 3.0  # N, s; s from the end of the gust to the evaluation of residual vibration
SCHEDULED, FIXED, OPEN = "scheduled", "LQG at zero speed", "open loop"
COLUMNS = {  # column head, unit, value of the unit in SI, digits
    "tip": ("largest tip displacement", "m", 1.0, 3),
    "left": ("residual vibration after the spin-up", "mm", 1e-3, 1),
    "after_gust": ("residual vibration after the gust", "mm", 1e-3, 1),
    "speed_error": ("speed error", "mrad/s", 1e-3, 1),
    "torque": ("largest torque", "N m", 1.0, 0),
}


def drive(beam: HubBeam) -> ScheduledController:
    """Design the gain-scheduled controller of a beam."""
    made = [
        lqg(
            beam.linearize(speed, sensors=()),
            None,
            1.0,
            {"disturbance_torque": 100.0, "tip_force": 0.1},
            SENSORS,
            list(SENSORS),
            ["torque"],
            output_weight={"hub_angle": 2e4, "hub_speed": 2e5, "tip_displacement": 2e4 * (1.0 + speed**2 / 4.0)},
        ).controller
        for speed in SPEEDS
    ]
    return gain_schedule(made, SPEEDS, "hub_speed")


def spun_up(beam: HubBeam, K: ScheduledController, way: str, mass: float, duration: float = DURATION) -> LoopResult:
    """Simulate a spin-up, Eq. (43) of Bai et al., followed by a gust at the tip, with noise and the torque limit."""
    maneuver, begin = spin_up(SPEED, duration), 1.5 * duration
    last = max(2.0 * duration, begin + 2.0 * (GUST_TIME + SETTLED))
    time = STEP * np.arange(int(np.ceil(last / STEP)) + 1)
    within = (time >= begin) & (time <= begin + GUST_TIME)
    gust = {"tip_force": np.where(within, GUST * np.sin(np.pi * (time - begin) / GUST_TIME), 0.0)}
    torque = beam.parameters.rigid_body_inertia * np.array(maneuver.acceleration(time))
    loaded = beam.with_tip_mass(mass)
    if way == OPEN:
        return simulate_loop(loaded, None, time, {**gust, "torque": torque}, sample_time=STEP)
    return simulate_loop(
        loaded,
        K if way == SCHEDULED else K.at(0.0),
        time,
        gust,
        sample_time=STEP,
        control_limit=LIMIT,
        noise=NOISE,
        reference={"hub_angle": maneuver.angle(time), "hub_speed": maneuver.speed(time)},
        feedforward={"torque": torque},
    )


def numbers(run: LoopResult, duration: float = DURATION) -> dict[str, float]:
    """Return largest tip displacements [m], largest hub speed error [rad/s] and largest torque [N m] of a run."""
    tip, gust = np.abs(run["tip_displacement"]), 1.5 * duration
    left = (run.time > duration) & (run.time < gust)
    found = {
        "tip": tip,
        "left": tip[left],
        "after_gust": tip[run.time > gust + GUST_TIME + SETTLED],
        "speed_error": np.abs(run["hub_speed"] - SPEED)[left],
        "torque": np.abs(applied(run)),
    }
    return {key: float(values.max()) for key, values in found.items()}


def applied(run: LoopResult) -> np.ndarray:
    """Return the torque of a run, from the controller or prescribed [N m]."""
    return run.controls["torque"] if "torque" in run.controls else run.disturbances["torque"]


def drawn(runs: dict[str, LoopResult], duration: float, ax: Any = None) -> Any:
    """Plot speed error, tip displacement and torque of the runs over time."""
    maneuver, last = spin_up(SPEED, duration), max(run.time[-1] for run in runs.values())
    panes = ["speed error [rad/s]", "tip displacement [m]", "tip after the spin-up [mm]", "torque [N m]"]
    with panels(ax, panes, (7.4, 7.6)) as axes:
        for way, run in runs.items():
            tip, late = run["tip_displacement"], run.time > duration
            axes[0].plot(run.time, run["hub_speed"] - maneuver.speed(run.time), label=way, linewidth=1.0)
            axes[1].plot(run.time, tip, linewidth=1.0)
            axes[2].plot(run.time[late], 1e3 * tip[late], linewidth=1.0)
            axes[3].plot(run.time, applied(run), linewidth=1.0)
        for axis, label in zip(axes, panes, strict=True):
            axis.set(ylabel=label, xlim=(0.0, last))
        axes[3].set_xlabel("time [s]")
        axes[0].legend()
    return axes


def section(title: str, words: str, runs: dict[tuple[str, float], LoopResult], duration: float, name: str) -> Section:
    """Return a report section with a table of the runs and a plot of those with the larger tip mass."""
    lines = []
    for (way, mass), run in runs.items():
        found = numbers(run, duration)
        cells = (f"{found[key] / size:.{digits}f} {unit}" for key, (_, unit, size, digits) in COLUMNS.items())
        lines.append((way, f"{mass:g} kg", *cells))
    heavy = {way: run for (way, mass), run in runs.items() if mass == MASSES[-1]}
    caption = f"Spin-up with a tip mass of {MASSES[-1]:g} kg, unknown to the controller, followed by a gust."
    shown = picture(name, figure_of(partial(drawn, heavy, duration)), caption)
    table = Table(("controller", "tip mass", *(head for head, *_ in COLUMNS.values())), tuple(lines))
    return Section(title, (words,), (table,), (shown,))


def design(modes: int = 3) -> MachineDesign:
    """Design the controller and simulate the spin-up with it."""
    beam = hub_beam(HubBeamParameters(damping_ratio=0.005), "sfoam", modes)
    K, fast = drive(beam), DURATION / FASTER
    runs = {(way, mass): spun_up(beam, K, way, mass) for mass in MASSES for way in (SCHEDULED, FIXED, OPEN)}
    faster = {(way, mass): spun_up(beam, K, way, mass, fast) for mass in MASSES for way in (SCHEDULED, FIXED)}
    intended, rate = (2.0 * SPEED / time for time in (DURATION, fast))  # largest acceleration of Eq. (43)
    return MachineDesign(
        "scheduled_spin_up",
        "LQG controller scheduled over the hub speed",
        beam.family((float(SPEEDS[0]), float(SPEEDS[-1])), MASSES),
        K,
        inputs="tip_force",
        outputs="tip_displacement",
        notes=(
            "The controller measures hub angle, hub speed and bending moment at the root every 10 ms. The references of "
            "angle and speed are those of Eq. (43); the torque of a rigid beam without tip mass is the feedforward.",
            "The proof covers the loop linearized about steady rotation at every constant hub speed, not a changing "
            "speed. The spin-ups below are simulated with the nonlinear beam, sampling, noise and torque limit.",
        ),
        results={
            "rate_asked": intended,
            "runs": [{"way": way, "tip_mass": mass, **numbers(run)} for (way, mass), run in runs.items()],
            "faster_rate": rate,
            "faster_runs": [{"way": w, "tip_mass": mass, **numbers(run, fast)} for (w, mass), run in faster.items()],
        },
        sections=(
            section("Spin-up", f"The largest acceleration is {intended:.3g} rad/s².", runs, DURATION, "spin_up"),
            section(
                f"Spin-up at {FASTER:g} times the rate",
                f"The largest acceleration is {rate:.3g} rad/s²; the torque is limited to {LIMIT:g} N m.",
                faster,
                fast,
                "spin_up_faster",
            ),
        ),
    )


def main(modes: int = 3) -> MachineResult:
    """Evaluate the drive."""
    return design(modes).evaluate()


if __name__ == "__main__":
    print(main())
