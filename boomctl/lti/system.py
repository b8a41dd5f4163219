"""Linear systems ``x' = A x + B u``, ``y = C x + D u``: the record used by all computations.

python-control's types occur only at the interface: :func:`of` converts and checks user input to an :class:`Lti`, and
:meth:`Lti.statespace` returns a named ``control.StateSpace``.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeGuard

import numpy as np
from scipy import linalg

from boomctl.arrays import Array, balance, blocks, scaled_to_one
from boomctl.checks import finite_array, names, warn_user
from boomctl.exceptions import SingularFrequencyWarning
from boomctl.lti.rounding import ALIKE, CANCELLED, ROOT, SUMMED, TINY
from boomctl.lti.transfer_functions import realized
from boomctl.printing import compact

if TYPE_CHECKING:
    import control

    class Design(Protocol):
        """Result of a synthesis, with a controller."""

        @property
        def controller(
            self,
        ) -> Any: ...  # A StateSpace; pyright does not accept cached properties of frozen dataclasses.

    Controller: TypeAlias = control.StateSpace | control.TransferFunction | Design

BATCH = 2**16  # Number of entries of the pencils that are solved at once; they fit into the cache.
# Range of the largest matrix entry in which products of entries, and times of the poles, are finite.
_SIZES = (1e-250, 1e100)
_TIMES = (1e-30, 1e30)  # Range of sampling times [s] in which rates and frequencies are finite.
SLOWEST = 1e-12  # Frequencies up to this one count as zero [rad/s].


@dataclass(frozen=True, eq=False)
class Lti:
    """``x' = A x + B u``, ``y = C x + D u``; in discrete time ``x+`` in place of ``x'``.

    Attributes
    ----------
    A, B, C, D : ndarray
        Real, finite, of shapes (n, n), (n, m), (p, n), (p, m).
    input_labels, output_labels, state_labels : tuple of str
        Names; empty if not needed.
    dt : float
        Sampling time [s]; 0 in continuous time, ``nan`` in discrete time of unspecified step.
    scales : mapping from str to float, or None
        Amount of each signal that counts as one, 1 where a signal has no entry; empty for a system in the units of the
        machine, None if unknown. May name signals that the system does not have.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    input_labels: tuple[str, ...] = ()
    output_labels: tuple[str, ...] = ()
    state_labels: tuple[str, ...] = ()
    dt: float = 0.0
    scales: Mapping[str, float] | None = None

    __repr__ = compact

    def select(self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None) -> "Lti":
        """Return the system between the named signals, in that order; ``None`` means all.

        Raises
        ------
        ValueError
            If a name is unknown or requested twice.
        """
        ins, outs = names("input", inputs, self.input_labels), names("output", outputs, self.output_labels)
        return self.between(
            [self.input_labels.index(name) for name in ins], [self.output_labels.index(name) for name in outs]
        )

    def between(self, inputs: Sequence[int], outputs: Sequence[int]) -> "Lti":
        """Return the system between the signals of these numbers."""
        i, o = list(inputs), list(outputs)
        ins = tuple(self.input_labels[k] for k in i) if self.input_labels else ()
        outs = tuple(self.output_labels[k] for k in o) if self.output_labels else ()
        return replace(self, B=self.B[:, i], C=self.C[o], D=self.D[np.ix_(o, i)], input_labels=ins, output_labels=outs)

    def without_dots(self) -> "Lti":
        """Return the system with its signals named as in python-control: dots, which it does not allow, become ``_``."""
        inputs, outputs = (
            tuple(name.replace(".", "_") for name in names) for names in (self.input_labels, self.output_labels)
        )
        return replace(self, input_labels=inputs, output_labels=outputs)

    def balanced(self) -> "Lti":
        """Return the system with states scaled by powers of two, so that rows and columns of ``A`` have similar norms."""
        A, scale = balance(self.A)
        return replace(self, A=A, B=self.B / scale[:, None], C=self.C * scale)

    @cached_property
    def poles(self) -> Array:
        """Eigenvalues of ``A`` [rad/s]; in discrete time without a unit.

        If rounding error may make one unstable, they are computed in exact arithmetic, from the stored numbers.
        """
        cached = "eigensystem" in self.__dict__
        poles: Array = self.eigensystem[0] if cached else np.linalg.eigvals(self.A).astype(complex)
        growth = poles.real if self.dt == 0.0 else np.abs(poles) - 1.0
        if growth.max(initial=-np.inf) <= ROOT * np.abs(poles).max(initial=0.0):
            return poles
        inside, moved = self.distances
        if ((inside >= 0.0) | (moved < -inside)).all():
            return poles
        from boomctl.exact_roots import OPERATIONS, UndecidedError, Work, eigenvalues, rational_matrix

        try:
            return eigenvalues(rational_matrix(self.A), Work(OPERATIONS))
        except UndecidedError:
            return poles

    @cached_property
    def eigensystem(self) -> tuple[Array, Array, Array]:
        """Eigenvalues of ``A`` [rad/s], the inverse of the matrix of eigenvectors, and this: columns of length one.

        The inverse is NaN if there is none, as for equal poles in a chain.
        """
        A, power = scaled_to_one(self.A)
        poles, right = (item.astype(complex, copy=False) for item in np.linalg.eig(A))
        try:
            reads = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            reads = np.full_like(right, np.nan)
        return 2.0**power * poles, reads, right

    @property
    def distances(self) -> tuple[Array, Array]:
        """Distances of the poles inside the stability boundary, and first-order bounds on their rounding errors."""
        poles, reads, right = self.eigensystem
        with np.errstate(invalid="ignore", over="ignore"):
            moved = CANCELLED * np.einsum("ji,ij->j", np.abs(reads), np.abs(self.A) @ np.abs(right)) + TINY
        return -poles.real if self.dt == 0.0 else 1.0 - np.abs(poles), moved

    def response(self, omega: Array, *, quiet: bool = False) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies); in discrete time at ``exp(j omega dt)``.

        A pole exactly at one of the frequencies may be absent from the response.  The response at that frequency, and at no
        other, is evaluated a relative distance of 1e-9 above it.

        Parameters
        ----------
        omega : (n,) ndarray
            Angular frequencies [rad/s].
        quiet : bool
            Suppress warnings, for searches that choose their own frequencies.

        Warns
        -----
        SingularFrequencyWarning
            If the response at a frequency was evaluated near it.
        """
        step = max(1, BATCH // max(len(self.A), 1) ** 2)
        if len(omega) > step:
            parts = [self.response(omega[k : k + step], quiet=quiet) for k in range(0, len(omega), step)]
            return np.concatenate(parts, axis=2)
        pencil, diagonal = np.empty((len(omega), *self.A.shape), complex), np.arange(len(self.A))
        pencil[:] = -self.A.astype(complex)
        pencil[:, diagonal, diagonal] += self.boundary(omega)[:, None]
        try:
            states = np.linalg.solve(pencil, self.B.astype(complex))
        except np.linalg.LinAlgError:
            if len(omega) > 1:
                return np.concatenate([self.response(w, quiet=quiet) for w in omega[:, None]], axis=2)
            nearby = beside(omega)
            if not quiet:
                message = f"a pole lies at {omega[0]:.17g} rad/s: the response there is that at {nearby[0]:.17g} rad/s"
                warn_user(message, SingularFrequencyWarning)
            return self.response(nearby, quiet=quiet)
        return (self.C @ states + self.D).transpose(1, 2, 0)

    def boundary(self, omega: Any) -> Any:
        """Return where the response is that at ``omega``: ``s = j omega``, in discrete time ``z = exp(j omega dt)``."""
        return 1j * omega if self.dt == 0.0 else np.exp(1j * (omega * self.dt))

    @property
    def system(self) -> "Lti":
        """The system itself, as in :class:`ClosedLoop`."""
        return self

    @cached_property
    def magnitudes(self) -> "Lti":
        """Magnitudes of the numbers from which the entries were computed."""
        return Lti(np.abs(self.A), np.abs(self.B), np.abs(self.C), np.abs(self.D), dt=self.dt)

    @property
    def rates(self) -> Array:
        """Poles as rates [rad/s]: themselves in continuous time, ``log(z)/dt`` in discrete time, ``-inf`` for ``z = 0``."""
        return rates_of(self.poles, self.dt)

    @property
    def nyquist(self) -> float:
        """The highest frequency there is [rad/s]: ``pi/dt``, half the sampling rate; ``inf`` in continuous time."""
        return float("inf") if self.dt == 0.0 else float(np.pi / self.dt)

    def statespace(self, name: str) -> "control.StateSpace":
        """Return the system as python-control's, with all its names; a `ScaledStateSpace` if one of its signals is scaled.

        Dots in names of signals become ``_``.
        """
        from boomctl.lti.python_control import UNSCALED, ScaledStateSpace, control

        named = self.without_dots()
        labels = {"inputs": named.input_labels, "outputs": named.output_labels, "states": self.state_labels}
        arguments: dict[str, Any] = {kind: list(names) for kind, names in labels.items() if names} | {"name": name}
        if self.dt != 0.0:
            arguments["dt"] = True if np.isnan(self.dt) else self.dt
        signals = named.input_labels + named.output_labels
        scales = {label: value for label, value in (self.scales or {}).items() if label in signals}
        matrices = (self.A, self.B, self.C, self.D)
        if scales:
            return ScaledStateSpace(*matrices, scales=scales, **arguments)
        system = control.ss(*matrices, **arguments)
        if self.scales is not None:
            setattr(system, UNSCALED, True)
        return system


def rates_of(poles: Array, dt: float) -> Array:
    """Return poles as rates [rad/s]: in continuous time themselves, in discrete time ``log(z)/dt``, ``-inf`` for zero."""
    if dt == 0.0:
        return poles
    with np.errstate(divide="ignore"):
        return np.log(np.abs(poles)) / dt + 1j * (np.where(poles == 0.0, 0.0, np.angle(poles)) / dt)


def beside(omega: Array) -> Array:
    """Return the frequencies that replace those at a pole: a relative distance of 1e-9 above them [rad/s]."""
    return omega * (1.0 + ALIKE) + SLOWEST


def static(gain: Array, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> Lti:
    """Return a gain as a system without states."""
    rows, columns = gain.shape
    return Lti(np.zeros((0, 0)), np.zeros((0, columns)), np.zeros((rows, 0)), gain, tuple(inputs), tuple(outputs))


def append(first: Lti, *others: Lti) -> Lti:
    """Return systems side by side: the inputs, outputs and states of one after those of the other."""
    systems = (first, *others)
    A, B, C, D = (linalg.block_diag(*(getattr(system, letter) for system in systems)) for letter in "ABCD")
    inputs, outputs, states = (_labels(kind, *systems) for kind in ("input", "output", "state"))
    return Lti(A, B, C, D, inputs, outputs, states, first.dt)


def parallel(first: Lti, second: Lti, sign: int = 1) -> Lti:
    """Return the sum of two systems of the same signals, or with ``sign`` -1 their difference; states have no names."""
    corner = np.zeros((len(first.A), len(second.A)), int)
    A = blocks([[first.A, corner], [corner.T, second.A]])
    B, C = np.vstack([first.B, second.B]), np.hstack([first.C, sign * second.C])
    return replace(first, A=A, B=B, C=C, D=first.D + sign * second.D, state_labels=())


def series(first: Lti, second: Lti) -> Lti:
    """Return ``second`` driven by the outputs of ``first``, in their order; the states of ``first`` come first."""
    corner = np.zeros((len(first.A), len(second.A)))
    A = blocks([[first.A, corner], [second.B @ first.C, second.A]])
    B, C = np.vstack([first.B, second.B @ first.D]), np.hstack([second.D @ first.C, second.C])
    states = _labels("state", first, second)
    return Lti(A, B, C, second.D @ first.D, first.input_labels, second.output_labels, states, first.dt)


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A plant whose last signals are closed by ``u = K y``: its parts as they are stored, and its own matrices, rounded.

    Attributes
    ----------
    plant, controller : Lti
        As for :func:`lower_lft`.
    """

    plant: Lti
    controller: Lti

    @cached_property
    def system(self) -> Lti:
        """The loop, balanced, its states without names."""
        return replace(lower_lft(self.plant, self.controller).balanced(), state_labels=())

    @cached_property
    def magnitudes(self) -> Lti:
        """Magnitudes of the numbers from which the entries of ``system`` were computed."""
        plant, K = self.plant.magnitudes, self.controller.magnitudes
        scale, solved = (
            balance(lower_lft(self.plant, self.controller).A)[1],
            np.abs(_solved(self.plant, self.controller)),
        )
        # Rounding of I - D_K D22 is amplified twice by its inverse.
        D22 = plant.D[len(plant.D) - K.B.shape[1] :, plant.D.shape[1] - len(K.C) :]
        terms = closed(plant, K, solved @ (np.eye(len(K.D)) + K.D @ D22) @ solved)
        return replace(terms, A=terms.A / scale[:, None] * scale, B=terms.B / scale[:, None], C=terms.C * scale)


System: TypeAlias = Lti | ClosedLoop
"""Systems accepted by the norm and pole functions."""


def lower_lft(plant: Lti, controller: Lti) -> Lti:
    """Return the lower linear fractional transformation: a plant whose last signals are closed by ``u = K y``.

    Parameters
    ----------
    plant : Lti
        Its last outputs are the controller's inputs, its last inputs the controller's outputs, in their order.
    controller : Lti

    Returns
    -------
    Lti
        Between the plant's other signals; the plant's states, then the controller's.

    Raises
    ------
    ValueError
        The loop is not well-posed: ``I - D_K D22`` is singular.
    """
    return closed(plant, controller, _solved(plant, controller))


def _solved(plant: Lti, K: Lti) -> Array:
    """Return the inverse of ``I - D_K D22``."""
    D22 = plant.D[len(plant.D) - K.B.shape[1] :, plant.D.shape[1] - len(K.C) :]
    return well_posed_inverse(np.eye(len(K.D)) - K.D @ D22)


def closed(plant: Lti, K: Lti, solved: Array) -> Lti:
    """Return a plant whose last signals are closed; ``solved`` is the inverse of ``I - D_K D22``."""
    m, p = plant.B.shape[1] - len(K.C), len(plant.C) - K.B.shape[1]
    B1, B2, C1, C2 = plant.B[:, :m], plant.B[:, m:], plant.C[:p], plant.C[p:]
    D11, D12, D21, D22 = plant.D[:p, :m], plant.D[:p, m:], plant.D[p:, :m], plant.D[p:, m:]
    direct, state = solved @ K.D, solved @ K.C
    read = K.B + K.B @ (D22 @ direct)
    A = blocks([[plant.A + B2 @ direct @ C2, B2 @ state], [read @ C2, K.A + K.B @ D22 @ state]])
    B = np.vstack([B1 + B2 @ direct @ D21, read @ D21])
    C = np.hstack([C1 + D12 @ direct @ C2, D12 @ state])
    states = _labels("state", plant, K)
    D = D11 + D12 @ direct @ D21
    return Lti(A, B, C, D, plant.input_labels[:m], plant.output_labels[:p], states, plant.dt, plant.scales)


def signal_scales(A: Array, B: Array, C: Array) -> Array:
    """Return scales of states, powers of two, with which rows and columns of ``[A, B; C, 0]`` have similar norms."""
    n = len(A)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n], bordered[:n, n], bordered[n, :n] = A, np.abs(B).sum(axis=1), np.abs(C).sum(axis=0)
    scale = balance(bordered)[1]
    return scale[:n] / scale[n]


def well_posed_inverse(matrix: Array) -> Array:
    """Return the inverse of ``I - D_K D22``, accurate to four digits or more.

    Raises
    ------
    ValueError
        If the loop is not well-posed.
    """
    message = "the loop is not well-posed: the feedthroughs of plant and controller cancel one another"
    return balanced_inverse(matrix, SUMMED, message)


def balanced_inverse(matrix: Array, rounding: float, message: str) -> Array:
    """Return the inverse of a matrix, tested and computed after balancing, so that units do not matter.

    Raises
    ------
    ValueError
        With ``message``, if the smallest singular value is below rounding error of one or of the largest.
    """
    if not len(matrix):
        return matrix
    balanced, scale = balance(matrix)
    values = linalg.svdvals(balanced)
    if values[-1] <= rounding * max(1.0, values[0]):
        raise ValueError(message)
    result = linalg.inv(balanced)
    # To componentwise accuracy: zeros of a chain stay zero.
    result += result @ (np.eye(len(matrix)) - balanced @ result)
    return result * scale[:, None] / scale


def _labels(kind: str, *systems: Lti) -> tuple[str, ...]:
    """Return the names of systems one after the other; none where one of them does not name its own."""
    matrix, axis = {"input": ("B", 1), "output": ("C", 0), "state": ("A", 0)}[kind]
    labels = [getattr(system, f"{kind}_labels") for system in systems]
    sizes = [getattr(system, matrix).shape[axis] for system in systems]
    return tuple(chain(*labels)) if [len(names) for names in labels] == sizes else ()


def is_statespace(system: object) -> bool:
    """Return whether this is a ``control.StateSpace``, without importing python-control to find out."""
    control = sys.modules.get("control")
    return control is not None and isinstance(system, control.StateSpace)


def is_frequency_response(system: object) -> "TypeGuard[control.FrequencyResponseData]":
    """Return whether these are ``control.FrequencyResponseData``, without importing python-control to find out."""
    control = sys.modules.get("control")
    return control is not None and isinstance(system, control.FrequencyResponseData)


def is_transfer_function(system: object) -> "TypeGuard[control.TransferFunction]":
    """Return whether this is a ``control.TransferFunction``, without importing python-control to find out."""
    control = sys.modules.get("control")
    return control is not None and isinstance(system, control.TransferFunction)


def of(
    system: object,
    what: str = "system",
    expected: str = "SecondOrderModel or StateSpace",
    *,
    discrete: bool = False,
    any_time: bool = False,
    sampled: bool = False,
) -> Lti:
    """Return the matrices and names of a user's system: a python-control system, a structural model or an ``Lti``.

    Parameters
    ----------
    system : StateSpace, TransferFunction, SecondOrderModel or Lti
    what : str
        Name of the parameter in messages.
    expected : str
        Expected types in messages.  If "SecondOrderModel" is among them, any object is accepted that has a method
        ``__lti__``, which returns an :class:`Lti` without python-control, or ``to_statespace``.
    discrete : bool, optional
        If True, discrete time is required, otherwise continuous time.
    any_time : bool, optional
        If True, both are accepted.
    sampled : bool, optional
        If True, discrete time with a specified sampling time is accepted as well.

    Raises
    ------
    TypeError
        If `system` has another type.
    ValueError
        If time is discrete or continuous contrary to the requirement, if a matrix is not finite, or if signals have the
        same name.
    """
    if isinstance(system, Lti):
        return system
    source: Any = system
    models = "SecondOrderModel" in expected
    if models and hasattr(system, "__lti__"):
        result: Lti = source.__lti__().without_dots()
    else:
        if models and hasattr(system, "to_statespace"):
            source = source.to_statespace()
        if not (is_transfer_function(source) or is_statespace(source)):
            raise TypeError(f"{what}: expected {expected}, got {type(system).__name__}{_instead(system, models)}")
        result = _plain(source, what)
    if not any_time:
        _check_time(what, result.dt, discrete, sampled)
    for letter in "ABCD":
        matrix = getattr(result, letter)
        largest = float(np.abs(matrix).max(initial=0.0))
        if not largest <= _SIZES[1] or (letter == "A" and 0.0 < largest < _SIZES[0]):
            row, column = np.unravel_index(int(np.abs(matrix).argmax()), matrix.shape)
            raise ValueError(
                f"{what}: expected finite numbers, the largest from {_SIZES[0]:g} to {_SIZES[1]:g} in the units chosen, got"
                f" {letter}[{row}, {column}] = {matrix[row, column]}"
            )
    for kind, labels, count in (
        ("input", result.input_labels, result.D.shape[1]),
        ("output", result.output_labels, len(result.D)),
    ):
        if labels and len(set(labels)) < count:  # python-control stores duplicate names once.
            got = f"{len(set(labels))}: {', '.join(labels)}"
            raise ValueError(f"{what}: expected a name of its own for each of {count} {kind}s, got {got}")
    return result


def controller_of(
    controller: object,
    expected: str = "StateSpace",
    *,
    what: str = "controller",
    scales: Mapping[str, float] | None = None,
    **time: bool,
) -> Lti:
    """Return the matrices and names of a controller, or of the controller of a design; see :func:`of`.

    ``scales`` are those of the plant: with a scaled plant the scaled controller of a design is used.
    """
    held = "scaled_controller" if scales and hasattr(controller, "scaled_controller") else "controller"
    return of(getattr(controller, held, controller), what, expected, **time)


def rescale(system: Lti, scales: Mapping[str, float]) -> Lti:
    """Return a system in other scales of its signals; empty scales are the units of the machine.

    Raises
    ------
    ValueError
        If an entry overflows.
    """
    before = system.scales or {}
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        entry = np.array([scales.get(label, 1.0) / before.get(label, 1.0) for label in system.input_labels])
        leave = np.array([before.get(label, 1.0) / scales.get(label, 1.0) for label in system.output_labels])
        B, C, D = system.B * entry, leave[:, None] * system.C, leave[:, None] * system.D * entry
    for name, matrix in (("B", B), ("C", C), ("D", D)):
        finite_array(f"{name} in these scales", matrix)
    return replace(system, B=B, C=C, D=D, scales=scales)


def unscaled(system: Lti) -> Lti:
    """Return a system in the units of the machine; unchanged if its scales are unknown."""
    return rescale(system, {}) if system.scales else system


def check_scales(controller: Lti, plant: Mapping[str, float] | None = None) -> None:
    """Check that a controller is in the scales of the plant's signals; one of unknown scales is accepted.

    Parameters
    ----------
    controller : Lti
    plant : mapping from str to float, optional
        Scales of the plant. None or empty for a plant in the units of the machine.

    Raises
    ------
    ValueError
        If a signal of the controller has another scale than that of the plant.
    """
    others = plant or {}
    own = others if controller.scales is None else controller.scales
    for label in (*controller.input_labels, *controller.output_labels):
        if own.get(label, 1.0) != others.get(label, 1.0):
            wanted, got = (
                f"scaled signals ({label!r} by {scales.get(label, 1.0):g})" if scales else "the units of the machine"
                for scales in (others, own)
            )
            raise ValueError(
                f"`controller` must be in {wanted}, got one in {got}. A design's `.controller` is in the units of the"
                " machine, its `.scaled_controller` in the scaled signals of its plant; boomctl.unscale_controller converts."
            )


def _instead(system: object, models: bool) -> str:
    """Return a hint for objects that are not systems with poles; ``models`` is True if structural models are accepted."""
    if is_frequency_response(system):
        return (
            ", which does not tell its poles: boomctl.fit finds a model for it, boomctl.sigma shows it, and "
            "boomctl.analysis.closed_loop_response closes a loop around it"
        )
    if hasattr(system, "linearize"):
        return ", which is not linear: its .linearize(hub_speed) is one"
    to_states = "" if models else ".to_statespace()"
    for held, words in (("controller", ".controller"), ("system", ".system")):
        if is_statespace(getattr(system, held, None)):
            return f"; its {words} is one"
    for method, words in (("to_statespace", ""), ("assemble", ".assemble()"), ("normalize", ".at(...)")):
        if hasattr(system, method):
            return f"; its {words}{to_states} is one"
    ready = "boomctl.spray_boom(), .assemble() of an Assembly or " if models else ""
    return f"; {ready}control.ss(A, B, C, D) makes one"


def _check_time(what: str, dt: float, discrete: bool, sampled: bool) -> None:
    """Raise ``ValueError`` where a system has the wrong kind of time."""
    continuous = dt == 0.0
    if (continuous or _TIMES[0] <= dt <= _TIMES[1]) if sampled else continuous != discrete:
        return
    in_range = f"continuous time or a sampling time in seconds from {_TIMES[0]:g} to {_TIMES[1]:g}"
    wanted = in_range if sampled else "a sampling time" if discrete else "continuous time"
    length = "dt = True, which names no sampling time" if np.isnan(dt) else f"a sampling time of {dt:g} s"
    raise ValueError(f"{what}: expected {wanted}, got {'continuous time' if continuous else length}")


def _plain(system: Any, what: str) -> Lti:
    """Return the matrices, names and time of a python-control system."""
    from boomctl.lti.python_control import UNSCALED

    if is_statespace(system):
        A, B, C, D = (np.asarray(getattr(system, letter), dtype=float) for letter in "ABCD")
        states = tuple(system.state_labels)
    else:
        A, B, C, D = realized(system, what)
        states = tuple(f"x[{i}]" for i in range(len(A)))
    dt = 0.0 if system.isctime() else float("nan") if system.dt is True else float(system.dt)
    scales = getattr(system, "scales", {} if hasattr(system, UNSCALED) else None)
    if scales:
        scales = {label: value for label, value in scales.items() if value != 1.0}
    return Lti(A, B, C, D, tuple(system.input_labels), tuple(system.output_labels), states, dt, scales)
