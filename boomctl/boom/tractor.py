"""The tractor that carries the boom: from the ground under its wheels to jolt and yaw.

The paper specifies no tractor.  This linear model is an assumption; its parameters are typical of a six-tonne tractor with a
mounted sprayer and are not fitted to any result.

- The body is rigid on four tires (spring and damper, vertical).  It bounces, pitches, rolls, moves fore and aft, and yaws
  about a uniform, straight drive.  Lateral motion is neglected, because it moves no nozzle along the driving direction;
  its contribution to yaw is neglected too.
- A tire filters waves shorter than its contact patch: the height under it is filtered by ``1/(1 + s tau)^2`` with
  ``tau = contact_length/(2 sqrt(6) V)``, which has the second moment of the mean over the patch.
- The retarding force on each wheel at its hub is ``N z'/V + f dN``: its static load ``N`` times the slope of the
  ground, and the rolling resistance ``f`` of its dynamic load ``dN``.  Their sum moves the tractor fore and aft and,
  through its lever, pitches it; the difference between right and left yaws it.
- Fore and aft the driven rear wheels are held to uniform rolling through spring and damper (tire, soil and drive line)
  at hub height.
- Yaw is resisted by the side forces of rolling tires, a damping ``sum C_alpha a^2/V``; slow deviations are corrected by
  steering, a first-order high pass with the corner frequency ``steering_corner_hz``.
- The boom is driven at the height ``boom_height``, where pitch counts as fore-and-aft motion.

On ground of class D to E at 2 to 3 m/s it leaves the passive boom of Table 2 with a coefficient of variation of the
deposit of 1.0 to 5.4 % (twelve grounds, 1.2 to 3.5 % in their mean); field runs gave 3.5 to 5.2 % (Ooms et al. 2003).
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from boomctl.boom.model import ACTUATORS
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.tracks import SPEEDS
from boomctl.checks import nonnegative, positive, within
from boomctl.lti.system import Lti
from boomctl.parameters import Parameters, or_default
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

GRAVITY = 9.81  # m/s^2, the standard acceleration of free fall to three digits
_BODY = ("x", "z", "pitch", "roll", "yaw")
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
_MAY_BE_ZERO = ("contact_length", "rolling_resistance", "tire_damping_front", "tire_damping_rear", "steering_corner_hz")


@dataclass(frozen=True, repr=False)
class TractorParameters(Parameters):
    """A tractor with mounted sprayer; SI units; typical values, an assumption.

    Attributes
    ----------
    mass : float
        Mass of tractor and sprayer [kg].
    pitch_inertia, roll_inertia, yaw_inertia : float
        Moments of inertia about the center of mass [kg m^2].
    wheelbase, cg_to_rear_axle : float
        Distances from rear to front axle, and from rear axle to center of mass [m].
    track_width : float
        Distance between left and right wheels [m].
    cg_height, hub_height, boom_height : float
        Heights of the center of mass, of the wheels' hubs, and of the points that drive the boom [m].
    tire_stiffness_front, tire_stiffness_rear, tire_damping_front, tire_damping_rear : float
        Vertical stiffness [N/m] and damping [N s/m] of one tire.
    contact_length : float
        Length of a tire's contact patch [m].
    rolling_resistance : float
        Resisting force over load, on soil.
    drive_stiffness, drive_damping : float
        Stiffness [N/m] and damping [N s/m] of the drive relative to uniform rolling.
    cornering_stiffness_front, cornering_stiffness_rear : float
        Side force over slip angle, of one tire [N/rad].
    steering_corner_hz : float
        Frequency below which the driver corrects deviations of the heading [Hz].

    Raises
    ------
    TypeError, ValueError
        If a value is not a finite number or not above zero (for damping, resistance, contact length and corner frequency:
        negative), or if the center of mass is not between the axles.

    Examples
    --------
    >>> import boomctl as bc
    >>> heavy = bc.boom.TractorParameters(mass=9000.0)
    >>> [round(load) for load in heavy.wheel_loads]  # of a front and of a rear wheel [N]
    [17828, 26317]
    """

    mass: float = 6000.0
    pitch_inertia: float = 8000.0
    roll_inertia: float = 3500.0
    yaw_inertia: float = 9000.0
    wheelbase: float = 2.6
    cg_to_rear_axle: float = 1.05
    track_width: float = 1.8
    cg_height: float = 1.0
    hub_height: float = 0.8
    boom_height: float = 1.2
    tire_stiffness_front: float = 3.2e5
    tire_stiffness_rear: float = 4.0e5
    tire_damping_front: float = 3.0e3
    tire_damping_rear: float = 4.0e3
    contact_length: float = 0.4
    rolling_resistance: float = 0.08
    drive_stiffness: float = 9.0e5
    drive_damping: float = 2.2e4
    cornering_stiffness_front: float = 6.0e4
    cornering_stiffness_rear: float = 9.0e4
    steering_corner_hz: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            check = nonnegative if field.name in _MAY_BE_ZERO else positive
            check(field.name, getattr(self, field.name))
        self._plain()
        within("cg_to_rear_axle", self.cg_to_rear_axle, 0.0, self.wheelbase, "m")

    @property
    def axle_positions(self) -> tuple[float, float]:
        """Front and rear axle, ahead of the center of mass [m]."""
        return self.wheelbase - self.cg_to_rear_axle, -self.cg_to_rear_axle

    @property
    def wheel_loads(self) -> tuple[float, float]:
        """Static load of one front and of one rear wheel [N]."""
        front = 0.5 * self.mass * GRAVITY * self.cg_to_rear_axle / self.wheelbase
        return front, 0.5 * self.mass * GRAVITY - front

    def yaw_damping(self, speed: float) -> float:
        """Return how much the rolling tires' side forces damp the tractor's yaw.

        Parameters
        ----------
        speed : float
            Driving speed [m/s].

        Returns
        -------
        float
            Moment over yaw rate [N m s/rad].
        """
        ahead, behind = self.axle_positions
        return (2.0 * (self.cornering_stiffness_front * ahead**2 + self.cornering_stiffness_rear * behind**2)) / within(
            "speed", speed, *SPEEDS, "m/s"
        )


@one_blas_thread
def tractor_system(
    tractor: TractorParameters, speed: float, actuator_distance: float = BoomParameters.actuator_distance
) -> "control.StateSpace":
    """Return the tractor as a system from the ground under its wheels to the platform's actuators.

    Parameters
    ----------
    tractor : TractorParameters
        The tractor.
    speed : float
        Driving speed [m/s].
    actuator_distance : float
        Distance between the two points that drive the boom [m].

    Returns
    -------
    control.StateSpace
        Inputs ``front_left``, ``front_right``, ``rear_left``, ``rear_right``: height of the ground under each wheel
        [m]. Outputs ``actuator_left``, ``actuator_right``: forward displacement from uniform driving [m].

    Raises
    ------
    TypeError, ValueError
        If `tractor` is invalid, or a speed or distance is not positive.

    Examples
    --------
    >>> import boomctl as bc
    >>> tractor = bc.boom.tractor_system(bc.boom.TractorParameters(), speed=2.5)
    >>> tractor.input_labels, tractor.output_labels
    (['front_left', 'front_right', 'rear_left', 'rear_right'], ['actuator_left', 'actuator_right'])
    """
    return tractor_lti(
        or_default(TractorParameters, "tractor", tractor),
        within("speed", speed, *SPEEDS, "m/s"),
        positive("actuator_distance", actuator_distance),
    ).statespace("tractor")


def tractor_lti(p: TractorParameters, V: float, span: float) -> Lti:
    """Return the system of :func:`tractor_system`, its speed and its actuators' distance checked."""
    ahead, across = np.repeat(p.axle_positions, 2), 0.5 * p.track_width * np.array([-1.0, 1.0, -1.0, 1.0])
    stiffness = np.repeat([p.tire_stiffness_front, p.tire_stiffness_rear], 2)
    damping = np.repeat([p.tire_damping_front, p.tire_damping_rear], 2)
    none, ones = np.zeros(4), np.ones(4)
    # Rows over x, z, pitch (nose up), roll (right side up) and yaw (right side ahead), one for each wheel.
    up = np.array([none, ones, ahead, across, none]).T
    forward = np.array([ones, none, (p.cg_height - p.hub_height) * ones, none, across]).T
    pushed = up - p.rolling_resistance * forward
    hub, turn = forward.mean(axis=0), np.eye(5)[4]
    turning = p.yaw_damping(V)
    steering = 2.0 * np.pi * p.steering_corner_hz * turning
    M = np.diag([p.mass, p.mass, p.pitch_inertia, p.roll_inertia, p.yaw_inertia])
    # Summed wheel by wheel, so that the contributions of left and right cancel exactly.
    K, C = (np.einsum("w,wi,wj->ij", tire, pushed, up) for tire in (stiffness, damping))
    K += p.drive_stiffness * np.outer(hub, hub) + steering * np.outer(turn, turn)
    C += p.drive_damping * np.outer(hub, hub) + turning * np.outer(turn, turn)
    height, height_rate = pushed.T * stiffness, pushed.T * damping - forward.T * np.repeat(p.wheel_loads, 2) / V
    tau = max(p.contact_length, 1e-3) / (2.0 * np.sqrt(6.0) * V)
    inverse = np.linalg.inv(M)
    A, B, Cy = np.zeros((18, 18)), np.zeros((18, 4)), np.zeros((2, 18))
    A[:5, 5:10] = np.eye(5)
    A[5:10, :10] = -inverse @ np.hstack([K, C])
    A[5:10, 10:] = inverse @ np.hstack([height, height_rate])
    A[10:14, 14:] = np.eye(4)
    A[14:, 10:] = np.hstack([-np.eye(4) / tau**2, -2.0 * np.eye(4) / tau])
    B[14:] = np.eye(4) / tau**2
    Cy[:, [0, 2, 4]] = [[1.0, p.cg_height - p.boom_height, side * span] for side in (-0.5, 0.5)]
    states = (
        *_BODY,
        *(f"{name}_rate" for name in _BODY),
        *(f"{w}_felt" for w in WHEELS),
        *(f"{w}_rate" for w in WHEELS),
    )
    return Lti(A, B, Cy, np.zeros((2, 4)), input_labels=WHEELS, output_labels=ACTUATORS, state_labels=states)
