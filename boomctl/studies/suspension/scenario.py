"""Scenario of the evaluation: track, tractor, sensors and limits, the boom, uncertain springs and masses."""

from dataclasses import dataclass, field, fields

from boomctl.boom.factory import spray_boom
from boomctl.boom.motion import PlatformMotion, platform_motion
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import nozzle_positions
from boomctl.boom.tracks import GROUND_LENGTH, iso_track
from boomctl.boom.tractor import TractorParameters
from boomctl.checks import nonnegative, positive, up_to, whole
from boomctl.printing import compact
from boomctl.structure.model import SecondOrderModel

CONTROLS = ("suspension_left", "suspension_right")
STROKES = ("stroke_left", "stroke_right")
ACCELERATIONS = ("tip_left_acceleration", "tip_right_acceleration")
SPRING = (0.7, 1.3)  # springs over those of Table 2; an assumption, for the paper gives no spread
MASS = (0.8, 1.2)  # boom's mass over that of Table 2; an assumption, for hoses and liquid are not weighed there
FAMILY_ELEMENTS = 6  # of the paper's own mesh, whose frequencies are within 0.4 %: far less than the family spans
_MAY_BE_ZERO = ("warmup_time", "delay", "stroke_resolution", "acceleration_resolution")
_RUNOUT = 1.0  # track length beyond the final position of the front wheels [m]


@dataclass(frozen=True)
class FieldScenario:
    """A run over a field, on which suspensions are compared.

    All of it is assumed; the papers give none of it but the stroke of the shaker's cylinders.

    Attributes
    ----------
    road_class : str
        Road class of the track, ISO 8608; ``"E"`` is a rough field track.
    tractor : TractorParameters
        The tractor that carries the boom.
    speed : float
        Driving speed [m/s].
    warmup_time, duration : float
        Time driven before the record begins, until lightly damped modes have built up, and length of the record [s].
    seed : int
        Seed of the random track.
    sample_time, delay : float
        Sampling time of the controller, and time between a sample and the force it leads to [s].
    control_limit, end_stop : float
        Largest force of each actuator of the suspension [N], and its end stops [m].
    stroke_resolution, acceleration_resolution : float
        Resolution of the sensors [m], [m/s^2].
    accelerometer_bandwidth_hz : float
        Bandwidth of the accelerometers [Hz].
    elements : int
        Finite elements of the boom that is driven over the field.

    Raises
    ------
    TypeError, ValueError
        If a value is out of range.

    Examples
    --------
    >>> import boomctl as bc
    >>> scenario = bc.studies.FieldScenario(speed=2.0, warmup_time=5.0, duration=10.0)
    >>> round(float(scenario.motion().time[-1]), 3)  # s, run-in included
    15.0
    """

    road_class: str = "E"
    tractor: TractorParameters = field(default_factory=TractorParameters)
    speed: float = 3.0
    warmup_time: float = 60.0
    duration: float = 60.0
    seed: int = 1
    sample_time: float = 0.002
    delay: float = 0.002
    control_limit: float = 150.0
    end_stop: float = 0.05
    stroke_resolution: float = 1e-4
    acceleration_resolution: float = 5e-3
    accelerometer_bandwidth_hz: float = 20.0
    elements: int = 20

    __repr__ = compact

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in ("seed", "elements"):
                whole(item.name, value, 0 if item.name == "seed" else 1)
            elif item.name not in ("road_class", "tractor"):
                (nonnegative if item.name in _MAY_BE_ZERO else positive)(item.name, value)

    def motion(self) -> PlatformMotion:
        """Return the motion of the platform on the track, including run-in; a longer run begins with the shorter one.

        Returns
        -------
        PlatformMotion
            Displacements of the platform's actuators [m], at the controller's samples.

        Raises
        ------
        ValueError
            A longer way than the 10 km of ground that a seed has.
        """
        duration = self.warmup_time + self.duration
        most = (GROUND_LENGTH - self.tractor.wheelbase - _RUNOUT) / self.speed
        if duration > most:
            raise ValueError(
                f"warmup_time, duration = {self.warmup_time:g}, {self.duration:g}: expected at most {up_to(most)} s together"
                f" at speed = {self.speed:g} m/s; the ground of a seed is {GROUND_LENGTH:g} m long"
            )
        length = self.speed * duration + self.tractor.wheelbase + _RUNOUT
        track = iso_track(self.road_class, length=length, seed=self.seed, width=self.tractor.track_width)
        return platform_motion(track, self.tractor, self.speed, duration, self.sample_time)


def suspension_model(
    parameters: BoomParameters | None = None,
    elements: int = 20,
    accelerometer_hz: float = 20.0,
    nozzles: bool = False,
) -> SecondOrderModel:
    """Return the boom with the sensors of an active suspension.

    Parameters
    ----------
    parameters : BoomParameters, optional
    elements : int
        Finite elements.
    accelerometer_hz : float
        Bandwidth of the tip accelerometers [Hz].
    nozzles : bool
        Adds the displacements of the nozzles, ``nozzle_01``, ... [m].

    Returns
    -------
    SecondOrderModel
        Inputs ``actuator_*`` [m], ``suspension_*`` [N]; outputs ``tip_*``, ``stroke_*`` [m], ``tip_*_acceleration``
        [m/s^2] and the nozzles.
    """
    p = BoomParameters() if parameters is None else parameters
    positions = nozzle_positions(p) if nozzles else None
    model = spray_boom(p, elements=elements, accelerometer_bandwidth_hz=accelerometer_hz, nozzles=positions)
    outputs = [name for name in model.output_labels if name != "cradle_slip"]
    return model.select(["actuator_left", "actuator_right", *CONTROLS], outputs)
