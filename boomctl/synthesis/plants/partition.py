"""A generalized plant and its partition: disturbances and controls, performance signals and measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import exactly, whole
from boomctl.lti.sampled import same_time
from boomctl.lti.system import (
    Lti,
    check_scales,
    controller_of,
    is_statespace,
    is_transfer_function,
    lower_lft,
    of,
    rescale,
    static,
)
from boomctl.printing import compact, listed
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.lti.system import Controller


OUTSIDE = (
    "z_",
    "w_",
    "n_",
    "r_",
)  # what names of performance signals, and of disturbances, noises, references begin with


FEEDTHROUGH = 1e-10  # share of D11 that rounding may leave of a direct way that the controller cancels


@dataclass(frozen=True)
class GeneralizedPlant:
    """``x' = A x + B1 w + B2 u``, ``z = C1 x + D11 w + D12 u``, ``y = C2 x + D21 w + D22 u``.

    Attributes
    ----------
    system : Lti
        Its last inputs are the controls ``u``, its last outputs the measurements ``y``.
    nmeas, ncon : int
        Numbers of measurements and controls.
    """

    system: Lti
    nmeas: int
    ncon: int

    __repr__ = compact

    @property
    def dual(self) -> "GeneralizedPlant":
        """The transposed plant: controls become measurements, disturbances performance signals, and the other way."""
        s = self.system
        transposed = Lti(s.A.T, s.C.T, s.B.T, s.D.T, s.output_labels, s.input_labels, s.state_labels, s.dt)
        return GeneralizedPlant(transposed, self.ncon, self.nmeas)

    @property
    def nw(self) -> int:
        """Number of disturbances."""
        return self.system.B.shape[1] - self.ncon

    @property
    def nz(self) -> int:
        """Number of performance signals."""
        return len(self.system.C) - self.nmeas

    @property
    def A(self) -> Array:
        """Dynamics of the states."""
        return self.system.A

    @property
    def B1(self) -> Array:
        """States from disturbances."""
        return self.system.B[:, : self.nw]

    @property
    def B2(self) -> Array:
        """States from controls."""
        return self.system.B[:, self.nw :]

    @property
    def C1(self) -> Array:
        """Performance signals from states."""
        return self.system.C[: self.nz]

    @property
    def C2(self) -> Array:
        """Measurements from states."""
        return self.system.C[self.nz :]

    @property
    def D11(self) -> Array:
        """Performance signals from disturbances."""
        return self.system.D[: self.nz, : self.nw]

    @property
    def D12(self) -> Array:
        """Performance signals from controls."""
        return self.system.D[: self.nz, self.nw :]

    @property
    def D21(self) -> Array:
        """Measurements from disturbances."""
        return self.system.D[self.nz :, : self.nw]

    @property
    def D22(self) -> Array:
        """Measurements from controls."""
        return self.system.D[self.nz :, self.nw :]

    @property
    def disturbances(self) -> tuple[str, ...]:
        """Names of the first inputs."""
        return self.system.input_labels[: self.nw]

    @property
    def controls(self) -> tuple[str, ...]:
        """Names of the last inputs."""
        return self.system.input_labels[self.nw :]

    @property
    def performance(self) -> tuple[str, ...]:
        """Names of the first outputs."""
        return self.system.output_labels[: self.nz]

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of the last outputs."""
        return self.system.output_labels[self.nz :]


def partition(
    P: "control.StateSpace", nmeas: int | None, ncon: int | None, *, sampled: bool = False
) -> GeneralizedPlant:
    """Return a generalized plant whose last outputs are measured and whose last inputs are controls.

    In discrete time too if ``sampled``.  Counts that are None are told by the names that `generalized_plant` and
    `mixed_sensitivity` give.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; counts that leave no disturbance or no performance signal, that
        take one of these for a measurement or a control, or that names do not tell.
    """
    if not (isinstance(P, Lti) or is_statespace(P) or is_transfer_function(P)):
        raise TypeError(
            f"P: expected a generalized plant, a StateSpace, got {type(P).__name__}; boomctl.generalized_plant(system, "
            "performance={...}, measurements=[...], controls=[...], ...) makes one of a structure or a system"
        )
    system = of(P, "P", "StateSpace", sampled=sampled)
    p, m = system.D.shape
    nmeas = _count("nmeas", nmeas, system.output_labels, OUTSIDE[:1], "output", "performance signal")
    ncon = _count("ncon", ncon, system.input_labels, OUTSIDE[1:], "input", "disturbance")
    if whole("nmeas", nmeas) >= p:
        raise ValueError(f"nmeas = {nmeas}: P has {p} output(s), and at least one must be a performance signal")
    if whole("ncon", ncon) >= m:
        raise ValueError(f"ncon = {ncon}: P has {m} input(s), and at least one must be a disturbance")
    return GeneralizedPlant(system, nmeas, ncon)


def _count(
    what: str, count: int | None, signals: Sequence[str], prefixes: tuple[str, ...], kind: str, other: str
) -> int:
    """Return how many signals stand last: as they are named, where no count is given; else the count, held against names."""
    outside = next((i for i, name in enumerate(signals) if not name.startswith(prefixes)), len(signals))
    told = outside > 0 and not any(name.startswith(prefixes) for name in signals[outside:])
    if count is None:
        if not told:
            raise ValueError(
                f"{what}: expected a number, since the names of P do not tell it: as {kind}s, those of generalized_plant"
                f" that begin with {' or '.join(prefixes)} come first, got {listed(signals)}"
            )
        return len(signals) - outside
    if told and whole(what, count) > len(signals) - outside:
        raise ValueError(
            f"{what} = {count}: P has {len(signals) - outside} ({listed(signals[outside:])}), its {signals[outside - 1]!r} is"
            f" a {other}"
        )
    return count


def matched(
    P: "control.StateSpace", controller: "Controller", *, sampled: bool = False, convert: bool = False
) -> tuple[GeneralizedPlant, Lti]:
    """Return a plant partitioned as a controller demands, and the controller with the plant's signals, in their order.

    In discrete time too if ``sampled``. If ``convert``, a controller in the units of the machine is scaled as the plant.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, another kind of time, sampling times or scales that differ, not finite, too many signals.
    """
    scales = getattr(P, "scales", None)
    K = controller_of(controller, sampled=sampled, scales=scales)
    if convert and scales and K.scales == {}:
        K = rescale(K, scales)
    check_scales(K, scales)
    plant = partition(P, K.B.shape[1], len(K.C), sampled=sampled)
    if not same_time(K.dt, plant.system.dt):
        wanted, got = (
            f"a sampling time of {exactly(dt)} s" if dt else "continuous time" for dt in (plant.system.dt, K.dt)
        )
        raise ValueError(f"controller: expected {wanted}, as P has it, got {got}")
    columns = _places("output", plant.measurements, K.input_labels, plant.system.output_labels)
    rows = _places("input", plant.controls, K.output_labels, plant.system.input_labels)
    names = {"input_labels": plant.measurements, "output_labels": plant.controls, "state_labels": ()}
    return plant, replace(K.between(columns, rows), **names)


def _places(what: str, wanted: Sequence[str], names: Sequence[str], there: Sequence[str]) -> list[int]:
    """Return where the wanted names stand; in their order where all names are strange to the plant."""
    listed = list(names)
    if set(listed) == set(wanted):
        return [listed.index(name) for name in wanted]
    for name in listed:
        if name in there:
            raise ValueError(
                f"controller: its signal {name!r} is an {what} of P, but the last {len(wanted)} {what}(s) of P are "
                f"{', '.join(wanted)}, and its own are {', '.join(listed)}; name all of them, or none"
            )
    return list(range(len(listed)))


@one_blas_thread
def lft(P: "control.StateSpace", controller: "Controller") -> "control.StateSpace":
    """Return a generalized plant closed by a controller from its measurements to its controls.

    The controller's inputs are the last outputs of ``P`` and its outputs the last inputs: found by name where the
    controller bears their names, in that order where all of its names are strange to ``P``.

    Parameters
    ----------
    P : control.StateSpace
        Generalized plant: its last inputs are controls, its last outputs measurements.
    controller : control.StateSpace, control.TransferFunction, or a design, which holds one
        ``u = K y``, of the same sampling time if there is one. For a scaled ``P`` in its scaled signals or, if designed
        by boomctl, in the units of the machine.

    Returns
    -------
    control.StateSpace
        From the disturbances to the performance signals, named as in ``P``.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system, sampling times or scales that differ, too many signals; names of which some are signals of
        ``P`` but not those last ones; the loop is not well-posed.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    >>> P = bc.mixed_sensitivity(lag, W1=1.0)
    >>> gain = control.ss([], [], [], [[9.0]], inputs="error_y", outputs="u")
    >>> loop = bc.lft(P, gain)
    >>> loop.output_labels, round(float(loop.dcgain()), 3)  # the error that is left: 1/(1 + 9)
    (['z_error_y'], 0.1)
    """
    plant, K = matched(P, controller, sampled=True, convert=True)
    return lower_lft(plant.system, K).statespace("closed_loop")


def with_feedthrough(K: Lti, D22: Array) -> Lti:
    """Return the controller that does with ``D22`` what ``K`` does without it: ``K`` reads ``y - D22 u``.

    Raises
    ------
    ValueError
        That loop is not well-posed.
    """
    if not D22.any():
        return K
    twice = Lti(
        K.A,
        np.hstack([K.B, K.B]),
        np.vstack([K.C, K.C]),
        np.tile(K.D, (2, 2)),
        K.input_labels * 2,
        K.output_labels * 2,
        K.state_labels,
        K.dt,
        K.scales,
    )
    return lower_lft(twice, static(-D22))


def cancelled(loop: Lti, D11: Array) -> Lti:
    """Return a loop in continuous time without what rounding leaves of a direct way that the controller cancels."""
    left = np.abs(loop.D).max(initial=0.0)
    if loop.dt == 0.0 and left <= 10.0 * FEEDTHROUGH * np.abs(D11).max(initial=0.0):
        return replace(loop, D=np.zeros_like(loop.D))
    return loop
