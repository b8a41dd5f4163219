"""Sampled plants for discrete controllers, exact at the samples, with delays of any length.

Each control is held between its changes; a delay shifts the changes by whole samples and a fraction of one.  Over a sample
with one change the motion of the plant consists of two consecutive holds, which is exact.  Pending controls and
measurements are states.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.checks import MOST, exactly, names, nonnegative, positive
from boomctl.lti.hold import changing, zero_order_hold
from boomctl.lti.rounding import ALIKE, LEVEL
from boomctl.lti.system import Lti, of
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


def same_time(own: float, wanted: float) -> bool:
    """Return whether two sampling times [s] are equal; an unspecified one equals any."""
    return not abs(own - wanted) > LEVEL * wanted


def whole_samples(delay: float, dt: float) -> tuple[int, float]:
    """Return a delay as whole samples and the remainder [s]."""
    whole = int(np.floor(delay / dt + ALIKE))  # To within this fraction of a sample.
    rest = delay - whole * dt
    return whole, rest if rest > ALIKE * dt else 0.0


def time_of_loop(plant: Lti, controller: Lti, delay: float) -> tuple[float, float]:
    """Return the sampling time of a loop, 0 for a continuous one, and its delay, checked.

    Raises
    ------
    TypeError, ValueError
        If the delay is negative, longer than 1000 samples, nonzero with a continuous controller, or not a whole number of
        samples for a discrete plant, or if plant and controller have different sampling times.
    """
    late, dt = nonnegative("delay", delay), controller.dt
    if plant.dt != 0.0 and not (dt and same_time(plant.dt, dt)):
        got = f"{exactly(dt)} s" if dt else "continuous time; boomctl.discretize samples it"
        raise ValueError(f"controller: expected the plant's sampling time, {exactly(plant.dt)} s, got {got}")
    if late and not dt:
        raise ValueError(
            f"delay = {exactly(late)}: expected 0 with a controller in continuous time; boomctl.discretize samples it"
        )
    _check_samples(late, dt)
    if plant.dt != 0.0 and whole_samples(late, dt)[1]:
        raise ValueError(
            f"delay = {exactly(late)}: expected whole samples of {exactly(dt)} s, as the plant is discrete: "
            "between its samples it is not known"
        )
    return dt, late


@one_blas_thread
def sample_plant(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
    sample_time: float,
    controls: str | Sequence[str] | None = None,
    *,
    delay: float = 0.0,
) -> "control.StateSpace":
    """Return the sampled plant, exact at the samples, with held and delayed controls.

    A discrete controller is designed for it (:func:`boomctl.lqg`, :func:`boomctl.h_infinity`, :func:`boomctl.h2`) and then
    runs on the plant itself with the same delay: poles and margins are the same.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        The plant in continuous time, signals named.
    sample_time : float
        Time between samples [s].
    controls : str or sequence of str, optional
        Inputs that a controller drives; by default all.  The others are held from sample to sample, without delay.
    delay : float, optional
        Time between a sample and the change of the controls [s]; need not be a whole number of samples.

    Returns
    -------
    control.StateSpace
        In discrete time, with the plant's signals.  Outputs are the values just before the controls change.  Delayed
        controls, and controls with direct feedthrough, are states after the plant's, ``NAME_held_1`` and so on.

    Raises
    ------
    TypeError, ValueError
        If `plant` has another type or is discrete, if `sample_time` is not above zero, if a name is unknown, or if
        `delay` is negative or longer than 1000 samples.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="force", outputs="speed", states="v")
    >>> sampled = bc.analysis.sample_plant(lag, 0.1, delay=0.14)
    >>> sampled.state_labels, sampled.dt
    (['v', 'force_held_1', 'force_held_2'], 0.1)
    """
    plant_lti, dt = of(plant, "plant"), positive("sample_time", sample_time)
    acting = [plant_lti.input_labels.index(name) for name in names("control", controls, plant_lti.input_labels)]
    late = nonnegative("delay", delay)
    _check_samples(late, dt)
    name = getattr(plant, "name", None)
    result = sampled_plant(plant_lti, acting, dt, [late] * len(acting))
    return result.statespace(name if isinstance(name, str) else "plant")


def _check_samples(late: float, dt: float) -> None:
    if late > MOST * dt:
        raise ValueError(f"delay = {exactly(late)}: expected at most {MOST} samples of {exactly(dt)} s")


@dataclass(frozen=True)
class Held:
    """A plant with held controls, whose values between two samples are states of a queue or current inputs.

    Every sampled loop is built from it: its sampled system (``sampled``, or ``matrices`` for a motion that is already known),
    closed by the controller.

    Attributes
    ----------
    plant : Lti
        In continuous time; in discrete time it moves by its own ``A`` and ``B``, and its outputs are those after its
        controls change.
    controls : (m,) ndarray of bool
        Which inputs are controls; the others change at each sample.
    changes : (m,) ndarray
        How long after a sample each input changes [s].
    starts : (m + 1,) ndarray of int
        Where the queue of each control begins among all states, the plant's first; the last is their number.
    before, after : (m, states) ndarray
        Which state each input is before and after it changes; a row of zeros for an input that is none.
    direct : (m, m) ndarray
        One for each input that has its current value after it changes.
    """

    plant: Lti
    controls: Array
    changes: Array
    starts: Array
    before: Array
    after: Array
    direct: Array

    @classmethod
    def of(
        cls, plant: Lti, acting: Sequence[int], late: Sequence[tuple[int, float]], remembered: bool = False
    ) -> "Held":
        """Return a plant with queues: pending control values, and those before a sample if an output depends on them.

        Parameters
        ----------
        plant : Lti
        acting : sequence of int
            The inputs that are controls.
        late : sequence of (int, float)
            Delay of each control: number of whole samples, and remainder [s].
        remembered : bool
            If True, the last control value is always a state.
        """
        n, m = plant.B.shape
        wholes, changes, controls = np.zeros(m, dtype=int), np.zeros(m), np.zeros(m, dtype=bool)
        for i, (whole, rest) in zip(acting, late, strict=True):
            wholes[i], changes[i], controls[i] = whole, rest, True
        previous = (plant.D.any(axis=0) | (changes > 0.0) | remembered) & (plant.dt == 0.0)
        lengths = np.where(controls, wholes + previous, 0)
        starts = n + np.concatenate([[0], np.cumsum(lengths)])
        before, after = np.zeros((m, starts[-1])), np.zeros((m, starts[-1]))
        queued, waiting = np.flatnonzero(controls & previous), np.flatnonzero(wholes)
        before[queued, (starts[:-1] + wholes)[queued]] = 1.0
        after[waiting, (starts[:-1] + wholes)[waiting] - 1] = 1.0
        return cls(plant, controls, changes, starts, before, after, np.diag(np.where(wholes, 0.0, 1.0)))

    def motion(self, duration: float) -> tuple[Array, Array, Array]:
        """Return the maps of the plant's state, and of its inputs before and after they change, over a duration."""
        A, B = self.plant.A, self.plant.B
        if self.plant.dt != 0.0:
            return A, np.zeros_like(B), B
        Phi, whole = zero_order_hold(A, B, duration)
        return Phi, *changing(A, B, whole, duration, self.changes)

    def state(self, Phi: Array, before: Array, after: Array) -> tuple[Array, Array]:
        """Return the plant's state after a motion as a map of all states and the inputs at the sample."""
        rows = before @ self.before + after @ self.after
        rows[:, : len(Phi)] += Phi
        return rows, after @ self.direct

    def answers(self, duration: float) -> tuple[Array, Array]:
        """Return the outputs after a duration, just before any change at that time; at the sample itself for 0."""
        n, m = self.plant.B.shape
        rows, inputs = (
            self.state(*self.motion(duration)) if duration else (np.eye(n, self.starts[-1]), np.zeros((n, m)))
        )
        changed = ~self.controls | (self.changes < duration) | (self.plant.dt != 0.0)
        late, now = np.where(changed, 0.0, self.plant.D), np.where(changed, self.plant.D, 0.0)
        C = self.plant.C
        return C @ rows + late @ self.before + now @ self.after, C @ inputs + now @ self.direct

    def matrices(self, Phi: Array, before: Array, after: Array) -> tuple[Array, Array]:
        """Return all states one sample later as a map of all states and inputs, from the motion over a sample."""
        n, m, size = len(Phi), after.shape[1], int(self.starts[-1])
        A, B = np.zeros((size, size)), np.zeros((size, m))
        A[:n], B[:n] = self.state(Phi, before, after)
        A[n:, n:] = np.eye(size - n, k=-1)
        queued = np.flatnonzero(np.diff(self.starts))  # Nothing moves into the first position of a queue.
        A[self.starts[queued]], B[self.starts[queued], queued] = 0.0, 1.0
        return A, B

    def sampled(self, dt: float) -> Lti:
        """Return the plant from sample to sample."""
        lengths = zip(self.plant.input_labels, np.diff(self.starts), strict=False)
        queues = [f"{name}_held_{k + 1}" for name, length in lengths for k in range(length)]
        (A, B), (C, D) = self.matrices(*self.motion(dt)), self.answers(0.0)
        return replace(self.plant, A=A, B=B, C=C, D=D, state_labels=(*self.plant.state_labels, *queues), dt=dt)


def sampled_plant(
    plant: Lti, acting: Sequence[int], dt: float, delays: Sequence[float], readings: Sequence[float] = ()
) -> Lti:
    """Return a plant from sample to sample, exactly.

    Parameters
    ----------
    plant : Lti
        In continuous time; a discrete plant is unchanged except for delays of whole samples.
    acting : sequence of int
        The inputs that are controls: each is held, and changes after its delay.  The other inputs are held from sample to
        sample.
    dt : float
        Sampling time [s].
    delays : sequence of float
        Of each control [s].
    readings : sequence of float, optional
        Age of each output at the sample at which it is read [s]; by default 0.

    Returns
    -------
    Lti
        In discrete time, inputs and outputs as the plant's.  Outputs are those just before the controls change.
    """
    held = Held.of(plant, acting, [whole_samples(delay, dt) for delay in delays])
    result = held.sampled(plant.dt or dt)
    for output, age in enumerate(readings):
        whole, rest = whole_samples(age, dt)
        if samples := whole + (rest > 0.0):  # Read between two samples, known at the later one.
            rows, inputs = held.answers(dt - rest if rest else 0.0)
            result = _late(result, output, rows[output], inputs[output], samples)
    return result


def _late(system: Lti, output: int, states: Array, inputs: Array, samples: int) -> Lti:
    """Return a system with one output delayed by a number of samples, as a map of states and inputs."""
    n, line = len(system.A), np.eye(samples, k=-1)
    A = linalg.block_diag(system.A, line)
    B, C = np.pad(system.B, ((0, samples), (0, 0))), np.pad(system.C, ((0, 0), (0, samples)))
    A[n, : len(states)], B[n] = states, inputs
    C[output], D = np.eye(len(A))[-1], np.where(np.arange(len(C))[:, None] == output, 0.0, system.D)
    return replace(system, A=A, B=B, C=C, D=D, state_labels=())
