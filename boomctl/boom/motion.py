"""Motion of the platform: of a tractor on a track, sine sweeps, measured motions and their files."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.tracks import SPEEDS, Track, step_count
from boomctl.boom.tractor import TractorParameters, tractor_lti
from boomctl.checks import exactly, finite_array, instance, known, positive, real, truth, up_to, within
from boomctl.checks import path as checked_path
from boomctl.files import read_numbers, write_whole
from boomctl.lti.hold import linear_hold, linear_hold_response, recursion
from boomctl.lti.system import Lti
from boomctl.lti.time_series import TimeSeries
from boomctl.parameters import or_default
from boomctl.threads import one_blas_thread

_DISTANCE = BoomParameters.actuator_distance
_SETTLED = 1e-6  # Remaining fraction of the initial motion when the record begins.
_DRIFTING = 1e-9  # Decay rate [1/s] below which the heading counts as free.
_SIDES, _MOTIONS = ("time_s", "left_m", "right_m"), ("time_s", "jolt_m", "yaw_rad")  # Columns of a file of motion.
# Amplitudes of the left and the right actuator.
_SWEPT = {"jolt": (1.0, 1.0), "yaw": (-1.0, 1.0), "left": (1.0, 0.0), "right": (0.0, 1.0)}
_STATED = "actuator_distance_m"  # the comment "# actuator_distance_m = 1.78" of a file of motion
_MEANT = re.compile(rf"{_STATED}|(?=.*actuator)(?=.*distance)(?=.*\d)", re.IGNORECASE)  # A comment on that distance.
_COMMENT = re.compile(rf"{_STATED}\s*=\s*((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class PlatformMotion(TimeSeries):
    """Motion of the two platform actuators: forward displacements from uniform driving, equally spaced in time.

    Attributes
    ----------
    time : (n,) ndarray
        Times, equally spaced [s].
    left, right : (n,) ndarray
        Displacements of ``actuator_left`` and ``actuator_right`` [m].
    actuator_distance : float
        Distance between the actuators [m].

    Raises
    ------
    TypeError, ValueError
        If there are fewer than two samples, if lengths differ, if a value is not finite, or if times are not equally spaced.

    Examples
    --------
    >>> import boomctl as bc
    >>> motion = bc.boom.PlatformMotion([0.0, 0.1, 0.2], left=[0.0, 0.0, 0.0], right=[0.0, 0.01, 0.02])
    >>> motion.jolt, motion.yaw.round(5)  # m, rad
    (array([0.   , 0.005, 0.01 ]), array([0.     , 0.00562, 0.01124]))
    """

    _made_by = "platform_motion(...), sine_sweep(...) or read_motion(...)"

    time: Array
    left: Array
    right: Array
    actuator_distance: float = _DISTANCE

    def __post_init__(self) -> None:
        positive("actuator_distance", self.actuator_distance)
        for name in ("time", "left", "right"):
            object.__setattr__(self, name, finite_array(name, getattr(self, name), ndim=1))
        if len(self.time) < 2 or not len(self.time) == len(self.left) == len(self.right):
            raise ValueError(
                "time, left, right: expected two samples or more, equally many, got"
                f" {len(self.time)}, {len(self.left)} and {len(self.right)}"
            )
        check_even(self.time)

    def __repr__(self) -> str:
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s, {len(self.time)} samples"
        left, right = (f"{side.min():.4g} to {side.max():.4g} m" for side in (self.left, self.right))
        return f"PlatformMotion: {span}\n  left {left}, right {right}; actuators {self.actuator_distance:.4g} m apart"

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw jolt and yaw over time.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes for jolt and yaw.  If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.  ``label`` is prefixed to the line labels.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.spray").plot_motion(self, ax, **style)

    def _outputs(self) -> dict[str, Array]:
        return {
            "actuator_left": self.left, "actuator_right": self.right, "jolt": self.jolt, "yaw": self.yaw,
            "actuator_sym": self.symmetric, "actuator_anti": self.antisymmetric,
        }  # fmt: skip

    @property
    def sample_time(self) -> float:
        """Time between samples [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def symmetric(self) -> Array:
        """Input ``actuator_sym`` of a symmetric subsystem: ``(right + left)/sqrt 2``, root of two times the jolt [m]."""
        return (self.right + self.left) / np.sqrt(2.0)

    @property
    def antisymmetric(self) -> Array:
        """Input ``actuator_anti`` of an antisymmetric subsystem: ``(right - left)/sqrt 2`` [m]; the yaw is an angle."""
        return (self.right - self.left) / np.sqrt(2.0)

    @property
    def jolt(self) -> Array:
        """Forward displacement of the platform's center [m]."""
        return 0.5 * (self.left + self.right)

    @property
    def yaw(self) -> Array:
        """Rotation of the platform, positive with the right side ahead [rad]."""
        return (self.right - self.left) / self.actuator_distance


def check_even(time: Array, label: Callable[[int], str] = "time[{}]".format) -> None:
    """Raise ``ValueError`` for the first sample, with its label, at which times are not equally spaced."""
    steps = np.diff(time)
    usual, step = float(np.median(steps)), (time[-1] - time[0]) / len(steps)
    deviation = np.abs(time[1:] - (time[0] + step * np.arange(1, len(time))))
    for wrong, reason in (
        (steps <= 0.0, "expected times to ascend"),
        (steps > 1.5 * usual, f"a gap, samples are missing before it (usual step {usual:g} s)"),
        (deviation > 0.05 * step, f"expected equal steps, of {step:g} s in the mean; resample the motion"),
    ):
        if wrong.any():
            first = int(np.argmax(wrong)) + 1
            raise ValueError(f"{label(first)} = {time[first]:g}: {reason}")


@one_blas_thread
def platform_motion(
    track: Track,
    tractor: TractorParameters | None = None,
    speed: float = 2.5,
    duration: float | None = None,
    sample_time: float = 1e-3,
    actuator_distance: float = _DISTANCE,
) -> PlatformMotion:
    """Return the motion of the platform of a tractor that drives over a track.

    Parameters
    ----------
    track : Track
        The ground.  The tractor starts from equilibrium, with its rear axle at the beginning of the track; the motion of
        the default tractor is stationary after one second.  On a periodic track the record begins after the motion has
        become stationary.
    tractor : TractorParameters, optional
        The tractor; by default a typical one.
    speed : float
        Driving speed [m/s].
    duration : float, optional
        Duration of the motion [s]; by default once over the track, until the front axle is at its end.
    sample_time : float
        Time between the samples of the result [s].
    actuator_distance : float
        Distance between the actuators [m].

    Returns
    -------
    PlatformMotion
        Exact for ground that is straight between the positions at the samples.

    Raises
    ------
    TypeError, ValueError
        If the width of the track differs from that of the tractor, if the track is too short, if a time, speed or distance
        is not above zero, or if the distance per sample exceeds both a quarter of a tire's contact length and the spacing
        of the track.

    Examples
    --------
    >>> import boomctl as bc
    >>> stone = bc.bump_track(0.05, bump_length=0.4, side="left", length=20.0)
    >>> motion = bc.platform_motion(stone, speed=2.0, sample_time=0.01)
    >>> round(1000.0 * float(abs(motion.jolt).max()), 1)  # mm
    5.9
    """
    instance("track", track, Track)
    p, V = or_default(TractorParameters, "tractor", tractor), within("speed", speed, *SPEEDS, "m/s")
    system = tractor_lti(p, V, positive("actuator_distance", actuator_distance))
    if not np.isclose(track.width, p.track_width, rtol=1e-6):
        raise ValueError(
            f"track: its sides are {exactly(track.width)} m apart; expected track_width, "
            f"{exactly(p.track_width)} m, of the tractor"
        )
    reach = track.length if track.periodic else track.length - p.wheelbase  # Driving distance of the rear axle.
    if reach <= 0.0:
        raise ValueError(f"track: {track.length:g} m are shorter than the wheelbase, {p.wheelbase:g} m")
    wanted = reach / V if duration is None else positive("duration", duration)
    if not track.periodic:
        within("duration", wanted, 0.0, reach / V * (1.0 + 1e-9), "s")
    h, longest = positive("sample_time", sample_time), max(0.25 * p.contact_length, track.spacing)
    if V * h > longest * (1.0 + 1e-9):
        raise ValueError(
            f"`sample_time` must be at most {up_to(longest / V)} s, a quarter of a tire's contact length at speed ="
            f" {exactly(V)}, or a speed of at most {up_to(longest / h)} m/s, got {exactly(h)} s."
        )
    count = step_count("duration", wanted, h, "s")
    before, rest = _driven_before(system, track, V, h, p.wheelbase) if track.periodic else (0, None)
    ground = _ground(track, V * h * np.arange(-before, count + 1), p.wheelbase)
    if rest is None:
        rest = -np.linalg.lstsq(system.A, system.B @ ground[:, 0], rcond=None)[0]
    moved = linear_hold_response(system, ground, h, rest)[:, before:]
    return PlatformMotion(h * np.arange(count + 1), moved[0], moved[1], float(actuator_distance))


def _ground(track: Track, distance: Array, wheelbase: float) -> Array:
    """Return the height of the ground under the four wheels [m]; ``distance`` is that of the rear axle."""
    return np.vstack([track.heights(distance + wheelbase), track.heights(distance)])


def _driven_before(system: Lti, track: Track, speed: float, h: float, wheelbase: float) -> tuple[int, Array | None]:
    """Return the number of samples before the record until the motion is stationary, and the initial state.

    If that takes more than one round, the initial state is that of the periodic motion, computed with a whole number of steps
    per round.  There is none if the heading is free.
    """
    slowest = -float(np.linalg.eigvals(system.A).real.max())
    if slowest <= _DRIFTING:
        return 0, None
    settling, once = -np.log(_SETTLED) / slowest, track.length / speed
    step_count("run-in", max(min(settling, once), h), h, "s")
    if settling <= once:
        return int(np.ceil(settling / h)), None
    steps = int(np.ceil(once / h))
    step = track.length / (speed * steps)
    ground = _ground(track, -steps * speed * h + speed * step * np.arange(steps + 1), wheelbase)
    Phi, G, H = linear_hold(system.A, system.B, step)
    reached = recursion(Phi, G @ ground[:, :-1] + H @ np.diff(ground), np.zeros(len(Phi)))[:, -1]
    return steps, np.linalg.solve(np.eye(len(Phi)) - np.linalg.matrix_power(Phi, steps), reached)


def sine_sweep(
    start_hz: float,
    stop_hz: float,
    duration: float,
    amplitude: float,
    motion: str = "jolt",
    *,
    logarithmic: bool = True,
    sample_time: float = 1e-3,
    actuator_distance: float = _DISTANCE,
) -> PlatformMotion:
    """Return a sine sweep (chirp) as motion of the platform actuators.

    Parameters
    ----------
    start_hz, stop_hz : float
        Frequency at the beginning and at the end [Hz], in any order.
    duration : float
        Duration of the sweep [s].
    amplitude : float
        Amplitude of the actuators that move [m].
    motion : "jolt", "yaw", "left" or "right"
        Both actuators in phase, both in antiphase (the right one forward first), or a single actuator.
    logarithmic : bool
        If True, logarithmic sweep (constant time per octave). If False, linear sweep (constant time per hertz).
    sample_time : float
        Time between samples [s].
    actuator_distance : float
        Distance between the actuators [m].

    Returns
    -------
    PlatformMotion
        Displacements of both actuators [m], from time 0 to ``duration``.

    Raises
    ------
    TypeError, ValueError
        If a value is not positive, there are fewer than two samples per period, or the motion is unknown.

    Examples
    --------
    >>> import boomctl as bc
    >>> sweep = bc.sine_sweep(0.1, 2.0, duration=30.0, amplitude=0.02, motion="yaw")
    >>> round(float(sweep.time[-1]), 3), float(abs(sweep.jolt).max())
    (30.0, 0.0)
    """
    low, high = positive("start_hz", start_hz), positive("stop_hz", stop_hz)
    T, size, half_period = positive("duration", duration), real("amplitude", amplitude), 0.5 / max(low, high)
    h = within("sample_time", positive("sample_time", sample_time), 0.0, half_period, "s")
    left, right = _SWEPT[known("motion", motion, _SWEPT)]
    time = h * np.arange(step_count("duration", T, h, "s") + 1)
    if truth("logarithmic", logarithmic) and low != high:
        rate = (np.log(high) - np.log(low)) / T
        cycles = low * np.expm1(rate * time) / rate
    else:
        cycles = (low + 0.5 * (high - low) * time / T) * time
    wave = size * np.sin(2.0 * np.pi * cycles)
    return PlatformMotion(time, left * wave, right * wave, positive("actuator_distance", actuator_distance))


def read_motion(path: str | Path, actuator_distance: float | None = None) -> PlatformMotion:
    r"""Read a measured motion from a CSV file.

    The first line names the columns, ``time_s, left_m, right_m`` or ``time_s, jolt_m, yaw_rad``, in any order.  Lines
    that begin with ``#`` are comments; the comment ``# actuator_distance_m = 1.78`` specifies the distance of the
    actuators, in lower or upper case.  A comment that specifies it in another form or unit raises ValueError.

    Parameters
    ----------
    path : str or Path
        The CSV file to read.
    actuator_distance : float, optional
        Distance between the actuators [m].  If None, the value in the file, or else the default of `BoomParameters`.

    Returns
    -------
    PlatformMotion
        Displacements of both actuators [m].

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        If a column is missing, unknown or duplicate, if a value is missing or not finite, if times do not ascend, have a
        gap or are not equally spaced, if `actuator_distance` differs from that of the file, or if a comment specifies the
        distance of the actuators in another form; the message includes file and line.

    Examples
    --------
    >>> import boomctl as bc
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "shaker.csv"
    ...     _ = path.write_text("time_s,jolt_m,yaw_rad\n0.0,0.00,0.0\n0.1,0.01,0.0\n0.2,0.02,0.0\n")
    ...     motion = bc.read_motion(path, actuator_distance=2.0)
    >>> motion.left, motion.right
    (array([0.  , 0.01, 0.02]), array([0.  , 0.01, 0.02]))
    """
    requested = None if actuator_distance is None else positive("actuator_distance", actuator_distance)
    table = read_numbers(path)
    distance = _distance_of(path, table.comments, requested)
    column = dict(zip(table.header, table.values.T, strict=True))
    if len(column) != len(table.header) or set(column) not in (set(_SIDES), set(_MOTIONS)):
        raise ValueError(
            f"{path}, line {table.header_line}: expected columns {', '.join(_SIDES)} or {', '.join(_MOTIONS)},"
            f" got {', '.join(table.header)}"
        )
    if len(table.values) < 2:
        raise ValueError(f"{path}: expected at least two samples")
    time = column["time_s"]
    check_even(time, lambda sample: f"{path}, line {table.lines[sample]}: time_s")
    if "left_m" in column:
        return PlatformMotion(time, column["left_m"], column["right_m"], distance)
    half = 0.5 * distance * column["yaw_rad"]
    return PlatformMotion(time, column["jolt_m"] - half, column["jolt_m"] + half, distance)


def _distance_of(path: str | Path, comments: tuple[tuple[int, str], ...], distance: float | None) -> float:
    """Return the distance of the actuators [m] specified by the user, or that the comments of a file state."""
    stated = [(line, text, _COMMENT.fullmatch(text)) for line, text in comments if _MEANT.match(text)]
    for line, text, match in stated[-1:]:
        if len(stated) > 1 or match is None or not float(match[1]) > 0.0:
            raise ValueError(f"{path}, line {line}: expected one '# {_STATED} = ...', above zero, got {text[:50]!r}")
        if distance not in (None, float(match[1])):
            raise ValueError(
                f"actuator_distance = {exactly(distance)}: expected {match[1]} m, as line {line} of {path} says, or"
                " leave it out"
            )
        distance = float(match[1])
    return _DISTANCE if distance is None else distance


def write_motion(path: str | Path, motion: PlatformMotion) -> None:
    """Write a motion as a CSV file that :func:`read_motion` reads back exactly; the file is complete or not written.

    The distance between the actuators is written in a comment above the columns.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced.
    motion : PlatformMotion
        The motion.

    Returns
    -------
    None
        The file has the columns ``time_s, left_m, right_m``.

    Raises
    ------
    OSError
        If the file cannot be written.
    TypeError, ValueError
        If `motion` is not a `PlatformMotion`, or if `path` is a folder.

    Examples
    --------
    >>> import boomctl as bc
    >>> import tempfile
    >>> from pathlib import Path
    >>> sweep = bc.sine_sweep(0.1, 1.0, duration=2.0, amplitude=0.02)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     bc.boom.write_motion(Path(folder) / "sweep.csv", sweep)
    ...     again = bc.read_motion(Path(folder) / "sweep.csv")
    >>> bool((again.left == sweep.left).all())
    True
    """
    instance("motion", motion, PlatformMotion)
    file = checked_path("path", path)
    if file.is_dir():
        raise ValueError(f"path = {str(file)!r}: expected a file, got a folder")
    rows = np.column_stack([motion.time, motion.left, motion.right]).tolist()
    distance = f"# {_STATED} = {float(motion.actuator_distance)!r}"
    lines = [distance, ",".join(_SIDES), *(",".join(map(repr, row)) for row in rows)]
    write_whole(file, "\n".join(lines) + "\n")
