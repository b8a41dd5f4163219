"""Controllers prepared for simulation: discretized, signals matched to the plant's, with anti-windup correction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.analysis.loops import signals_of
from boomctl.arrays import Array, blocks
from boomctl.checks import exactly, known, up_to
from boomctl.lti.bilinear import discretized
from boomctl.lti.machine_modes import MachineModes
from boomctl.lti.sampled import same_time
from boomctl.lti.system import Lti, controller_of
from boomctl.simulation.conditioning import bounded_correction, correction
from boomctl.simulation.plant import ModalPlant
from boomctl.simulation.time_varying import TimeVaryingController

if TYPE_CHECKING:
    from boomctl.lti.system import Controller as Fixed

    Controller: TypeAlias = Fixed | ScheduledController | TimeVaryingController

DISCRETIZATIONS = ("tustin", "zoh")


@dataclass(frozen=True)
class Laws:
    """Matrices of a controller that change from sample to sample.

    Attributes
    ----------
    law : (k, controls + n, measurements + n) ndarray
        ``[[D, C], [B, A]]`` of each.
    correction : (k, n, controls) ndarray
        ``L`` of each.
    index : int or None
        Index of the scheduling measurement, with linear interpolation between ``values``; None: the i-th matrices apply at
        sample i, and the last stay.
    values : (k,) ndarray
        Values of that measurement, ascending; empty if there is none.
    """

    law: Array
    correction: Array
    index: int | None
    values: Array

    def at(self, sample: int, measured: Array) -> tuple[Array, Array]:
        """Return the matrices at a sample with these measurements (references not subtracted)."""
        if self.index is None:
            i = min(sample, len(self.law) - 1)
            return self.law[i], self.correction[i]
        i = min(max(int(np.searchsorted(self.values, measured[self.index])) - 1, 0), len(self.values) - 2)
        fraction = (measured[self.index] - self.values[i]) / (self.values[i + 1] - self.values[i])
        t = min(max(float(fraction), 0.0), 1.0)
        both = ((1.0 - t) * item[i] + t * item[i + 1] for item in (self.law, self.correction))
        return next(both), next(both)


@dataclass(frozen=True)
class SampledController:
    """Discrete controller ``x+ = A x + B y + L (applied - commanded)``, ``commanded = C x + D y``.

    Attributes
    ----------
    A, B, C, D, L : ndarray
        ``L`` is zero without anti-windup.
    measured, driven : ndarray of int
        Indices of the plant's outputs that it reads, and of the inputs that it drives.
    inputs, outputs : tuple of str
        Their names.
    laws : Laws or None
        Matrices that change; ``A`` to ``L`` are then the first ones.
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
    laws: Laws | None = None

    @classmethod
    def of(
        cls, K: Lti, L: Array, driven: Sequence[int], measured: Sequence[int], laws: Laws | None = None
    ) -> "SampledController":
        """Return the controller of a discrete system, or of the first system if its matrices change."""
        read, moved = (np.array(item, dtype=int) for item in (measured, driven))
        return cls(K.A, K.B, K.C, K.D, L, read, moved, K.input_labels, K.output_labels, laws)


def sampled_controller(
    controller: "Controller | None",
    plant: "ModalPlant | MachineModes",
    sample_time: float,
    discretization: str = "tustin",
) -> SampledController:
    """Return a discrete controller with signals matched to the plant's; ``None`` drives nothing.

    It has no anti-windup correction yet, except a time-varying controller, which has its gains.

    Raises
    ------
    TypeError, ValueError
        If the controller is not a state-space system, its signals do not match the plant's, its sampling time is not
        ``sample_time``, or its poles are beyond half the sampling rate.
    """
    if controller is None:
        none = np.zeros((0, 0))
        return SampledController.of(Lti(none, none, none, none), none, (), ())
    known("discretization", discretization, DISCRETIZATIONS)
    if isinstance(controller, TimeVaryingController):
        return _time_varying(controller, plant, sample_time)
    states, scales = (plant.state_labels, plant.scales) if isinstance(plant, ModalPlant) else ((), None)
    scheduled = controller if isinstance(controller, ScheduledController) else None
    if scheduled is None:
        systems = (controller_of(controller, "StateSpace, ScheduledController or None", any_time=True, scales=scales),)
    else:
        systems = scheduled.systems
    driven, measured = signals_of(systems[0], plant.input_labels, plant.output_labels, states, scales)
    result = [_discrete(item, sample_time, discretization) for item in systems]
    none = np.zeros((len(result), len(result[0].A), len(result[0].C)))
    laws = None
    if scheduled is not None:
        law = np.array([blocks([[item.D, item.C], [item.B, item.A]]) for item in result])
        laws = Laws(law, none, scheduled._signal_index, scheduled.values)
    return SampledController.of(result[0], none[0], driven, measured, laws)


def corrected(K: SampledController, force: Array, rate: Array, anti_windup: bool) -> SampledController:
    """Return a controller with anti-windup correction for limits of force and rate; ``inf`` for none."""
    u, p, result = len(K.C), len(K.measured), K.laws
    matrices = (
        [(K.A, K.B, K.C, K.D)] if result is None else [(X[u:, p:], X[u:, :p], X[:u, p:], X[:u, :p]) for X in result.law]
    )
    laws = [Lti(*item, K.inputs, K.outputs) for item in matrices]
    if not anti_windup or not len(K.A):
        L = np.zeros((len(laws), *K.L.shape))
    elif result is not None and result.index is None:
        L = bounded_correction(laws[-1], result.correction, force, rate)
    else:
        L = correction(laws, force, rate)
    return replace(K, L=L[0], laws=None if result is None else replace(result, correction=L))


def _time_varying(
    controller: TimeVaryingController, plant: "ModalPlant | MachineModes", sample_time: float
) -> SampledController:
    """Return a controller whose matrices change from sample to sample."""
    _check_time(controller.dt, sample_time)
    A, B, C, D, L = controller.A, controller.B, controller.C, controller.D, np.asarray(controller.anti_windup_gain)
    first = Lti(A[0], B[0], C[0], D[0], tuple(controller.input_labels), tuple(controller.output_labels))
    driven, measured = signals_of(first, plant.input_labels, plant.output_labels)
    laws = Laws(np.block([[D, C], [B, A]]), L, None, np.zeros(0))
    return SampledController.of(first, L[0], driven, measured, laws)


def _check_time(own: float, sample_time: float) -> None:
    if not same_time(own, sample_time):
        raise ValueError(
            f"controller: its sampling time is {exactly(own)} s; expected sample_time = {exactly(sample_time)} s"
        )


def _discrete(controller: Lti, sample_time: float, method: str) -> Lti:
    """Return the controller at ``sample_time``."""
    if controller.dt != 0.0:
        _check_time(controller.dt, sample_time)
        return controller
    poles = np.linalg.eigvals(controller.A) if len(controller.A) else np.zeros(1)
    fastest = complex(poles[np.abs(poles).argmax()])
    limit = np.pi / sample_time
    if abs(fastest) > limit:
        raise ValueError(
            f"sample_time = {exactly(sample_time)} s is too long for the controller's pole at {fastest:.4g} rad/s: half the "
            f"sampling rate is {limit:.4g} rad/s; sample at least every {up_to(np.pi / abs(fastest))} s, or take faster poles"
            f" out: reduce_controller(P, K, fastest_pole={limit:.4g})"
        )
    return discretized(controller, sample_time, method)
