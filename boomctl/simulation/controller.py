"""A controller as it runs: discrete, its signals matched to the plant's, its state corrected where it saturates."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.analysis.loops import signals_of
from boomctl.arrays import Array
from boomctl.checks import exactly, known, up_to
from boomctl.lti.system import Lti, of
from boomctl.simulation.machine.machine import MachineModes
from boomctl.simulation.plant import ModalPlant

if TYPE_CHECKING:
    import control

DISCRETIZATIONS = ("tustin", "zoh")
_SAME = 1e-6  # relative difference of two sampling times that are meant to be the same: what a user types in
# share of the noise added everywhere, so that the Riccati equation is solvable; below all that is felt
_REGULAR = 1e-10


@dataclass(frozen=True)
class SampledController:
    """``x+ = A x + B y + L (applied - asked)``, ``asked = C x + D y``.

    Attributes
    ----------
    A, B, C, D, L : ndarray
        ``L`` is zero without anti-windup.
    measured, driven : ndarray of int
        Which outputs of the plant it reads, which inputs it drives.
    inputs, outputs : tuple of str
        Their names.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    L: Array
    measured: Array
    driven: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def sampled_controller(
    controller: "control.StateSpace | None",
    plant: "ModalPlant | MachineModes",
    sample_time: float,
    anti_windup: bool = True,
    discretization: str = "tustin",
) -> SampledController:
    """Return a controller ready to be stepped; ``None`` drives nothing.

    Raises
    ------
    TypeError, ValueError
        Not a state-space system, signals that the plant does not have, a sampling time of its own that is another, or
        poles beyond half the sampling rate.
    """
    if controller is None:
        none = np.zeros((0, 0))
        nothing = np.zeros(0, dtype=int)
        return SampledController(
            A=none, B=none, C=none, D=none, L=none, measured=nothing, driven=nothing, inputs=(), outputs=()
        )
    given = of(controller, "controller", expected="StateSpace or None", any_time=True)
    driven, measured = signals_of(given, plant.inputs, plant.outputs)
    found = _discrete(given, sample_time, known("discretization", discretization, DISCRETIZATIONS))
    A, B, C, D = found.A, found.B, found.C, found.D
    L = conditioning_gain(A, B, C, D) if anti_windup and len(A) else np.zeros((len(A), len(C)))
    return SampledController(
        A=A,
        B=B,
        C=C,
        D=D,
        L=L,
        measured=np.array(measured, dtype=int),
        driven=np.array(driven, dtype=int),
        inputs=given.inputs,
        outputs=given.outputs,
    )


def _discrete(controller: Lti, sample_time: float, method: str) -> Lti:
    """Return the controller at ``sample_time``."""
    if controller.dt != 0.0:
        if abs(controller.dt - sample_time) > _SAME * sample_time:
            raise ValueError(
                f"controller: its sampling time is {exactly(controller.dt)} s; expected sample_time = "
                f"{exactly(sample_time)} s"
            )
        return controller
    poles = np.linalg.eigvals(controller.A) if len(controller.A) else np.zeros(1)
    fastest = complex(poles[np.abs(poles).argmax()])
    limit = np.pi / sample_time
    if abs(fastest) > limit:
        raise ValueError(
            f"sample_time = {exactly(sample_time)} s is too long for the controller's pole at {fastest:.4g} rad/s: half the "
            f"sampling rate is {limit:.4g} rad/s; sample at least every {up_to(np.pi / abs(fastest))} s"
        )
    from boomctl.lti.python_control import (
        control,  # where a controller is sampled, and not to name what can be asked for
    )

    rule = "bilinear" if method == "tustin" else "zoh"
    return of(control.sample_system(controller.statespace("controller"), sample_time, rule), any_time=True)


def conditioning_gain(A: Array, B: Array, C: Array, D: Array, softening: float = 0.1) -> Array:
    """Return the gain through which the control that was applied corrects the controller's state.

    The controller is run as an observer of itself: its input is taken for white noise, what was applied for a
    measurement of what it asked for, itself noisy by ``softening`` of the variance that one sample adds.  Without
    softening the stationary Kalman gain is Hanus' conditioning ``B D^-1`` where ``D`` is invertible and the controller
    of minimum phase, and stabilising otherwise; but that is harsh where ``D`` is small, as it is in every controller
    that rolls off.  A stable controller for which none is found (its poles hardly seen at the output) is left as it is:
    its state fades by itself.

    Source: Hanus, Kinnaert & Henrotte (1987); Astrom & Rundqwist (1989).

    Raises
    ------
    ValueError
        The controller is not stable, and no gain was found.
    """
    own, gain = float(np.abs(np.linalg.eigvals(A)).max()), np.zeros((len(A), len(C)))
    if not B.any() or not C.any():
        return gain
    through = D @ D.T
    size = np.diag(through + C @ B @ B.T @ C.T)
    R = through + (softening + _REGULAR) * np.diag(np.where(size > 0.0, size, size.max() or 1.0))
    Q = B @ B.T
    Q = Q + _REGULAR * np.linalg.norm(Q) * np.eye(len(A))
    S = B @ D.T
    try:
        P = linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
        gain = np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T + S.T).T
        corrected = float(np.abs(np.linalg.eigvals(A - gain @ C)).max())
    except (linalg.LinAlgError, ValueError):
        corrected = np.inf
    if corrected < 1.0:
        return gain
    if own < 1.0:
        return np.zeros_like(gain)
    raise ValueError(
        f"anti_windup = True: no gain corrects the controller's state where it saturates (its largest pole, {own:.6g}, "
        f"lies on or outside the unit circle and is hardly seen at its output); pass anti_windup=False"
    )
