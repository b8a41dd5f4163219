"""SecondOrderModel: mass, damping and stiffness with named inputs and outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import (
    finite_array,
    frequencies,
    instance,
    mapping,
    positive,
    sequence,
    shown,
    signal_name,
    some_names,
    whole,
)
from boomctl.lti.hold import zero_order_hold
from boomctl.lti.system import Lti
from boomctl.printing import count, signals
from boomctl.structure.matrices import Structure, check_size, halves
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import respond
from boomctl.structure.response.modal_form import COORDINATES, MODES, modal_form, user_state_space
from boomctl.structure.response.mode_shapes import ModeShapes, mode_shapes
from boomctl.structure.response.poles import damped_poles
from boomctl.threads import one_blas_thread
from boomctl.units import warn_of_units

if TYPE_CHECKING:
    import control

_MODES = 5  # Default number of eigenfrequencies and mode shapes.


@dataclass(frozen=True, init=False, eq=False)
class SecondOrderModel:
    """A linear structure ``M q'' + C q' + K q = inputs`` with named coordinates, inputs and outputs.

    Parameters
    ----------
    M, C, K : (n, n) array_like or scipy.sparse array
        Mass, damping and stiffness matrix, stored dense; at most 1,000 coordinates.
    force_inputs : mapping from name to (n,) array
        Column through which each force acts.
    outputs : mapping from name to (n,) array
        Row with which each output reads the coordinates.
    coordinates : sequence of str, optional
        Names of the coordinates; by default ``q0, q1, ...``.

    Attributes
    ----------
    structure : Structure
        The matrices and the names of the coordinates.
    ports : Ports
        The inputs and outputs.
    selection : record or None
        Selection of the mesh if an accuracy was requested, with the tested meshes.

    Raises
    ------
    TypeError, ValueError
        If the matrices are not square, not finite or of different sizes, or if a row or column has the wrong length.

    Examples
    --------
    >>> import boomctl as bc
    >>> mass = bc.structure.SecondOrderModel([[1.0]], [[0.1]], [[4.0]], {"force": [1.0]}, {"place": [1.0]})
    >>> mass.eigenfrequencies_hz(1).round(4)
    array([0.3182])
    """

    _made_by = "spray_boom(), .assemble() of an Assembly or .at(...) of a family"

    structure: Structure
    ports: Ports
    selection: Any

    def __init__(
        self,
        M: ArrayLike,
        C: ArrayLike,
        K: ArrayLike,
        force_inputs: Mapping[str, ArrayLike] | None = None,
        outputs: Mapping[str, ArrayLike] | None = None,
        coordinates: Sequence[str] | None = None,
    ) -> None:
        matrices = {name: _square(name, value) for name, value in (("M", M), ("C", C), ("K", K))}
        n = matrices["M"].shape[0]
        for name, matrix in matrices.items():
            if matrix.shape != (n, n):
                raise ValueError(f"{name} has shape {matrix.shape}; expected that of M, {(n, n)}")
        columns, lines = _lines("force input", force_inputs, n), _lines("output", outputs, n)
        labels = (
            sequence("coordinates", coordinates, "names")
            if coordinates is not None
            else tuple(f"q{i}" for i in range(n))
        )
        for label in labels:
            instance("name of a coordinate", label, str)
        if len(labels) != n or len(set(labels)) != n:
            raise ValueError(f"coordinates: expected {n} different names, got {len(labels)}")
        L = np.array([lines, np.zeros_like(lines), np.zeros_like(lines)])
        ports = Ports.of_forces(tuple(force_inputs or {}), columns.T, tuple(outputs or {}), L)
        structure = Structure.of(matrices["M"], matrices["C"], matrices["K"], labels)
        self.__dict__.update(structure=structure, ports=ports, selection=None)

    def __repr__(self) -> str:
        chosen = "" if self.selection is None else f"\n  {self.selection}"
        return (
            f"SecondOrderModel: "
            f"{count(self.ncoordinates, 'coordinate')}\n{signals(self.input_labels, self.output_labels)}{chosen}"
        )

    @classmethod
    def of(cls, structure: Structure, ports: Ports, selection: Any = None) -> SecondOrderModel:
        """Return the model of a structure, which may be shared, with separate inputs and outputs.

        Parameters
        ----------
        structure : Structure
            The matrices.
        ports : Ports
            The inputs and outputs.
        selection : record, optional
            Which mesh was chosen for the model, and why.

        Returns
        -------
        SecondOrderModel
            The model; no matrix is copied.
        """
        model = cls.__new__(cls)
        model.__dict__.update(structure=structure, ports=ports, selection=selection)
        return model

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the fields without cached results."""
        return {"structure": self.structure, "ports": self.ports, "selection": self.selection}

    @property
    def M(self) -> Array:
        """Mass matrix."""
        return self.structure.M

    @property
    def C(self) -> Array:
        """Damping matrix."""
        return self.structure.C

    @property
    def K(self) -> Array:
        """Stiffness matrix."""
        return self.structure.K

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.structure.coordinates

    @property
    def ncoordinates(self) -> int:
        """Number of coordinates."""
        return self.structure.n

    @property
    def input_labels(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.ports.inputs

    @property
    def output_labels(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.ports.outputs

    @property
    def units(self) -> dict[str, str]:
        """Units of the inputs and outputs by name, ``""`` where only whoever gave the matrices knows them."""
        return {name: self.ports.units.get(name, "") for name in (*self.input_labels, *self.output_labels)}

    def select(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> SecondOrderModel:
        """Return the model with only the named inputs and outputs, in that order.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names; by default all.

        Returns
        -------
        SecondOrderModel
            The same structure, which shares cached results.

        Raises
        ------
        TypeError, ValueError
            If a name is unknown or requested twice.
        """
        for what, wanted, available in (("input", inputs, self.ports.inputs), ("output", outputs, self.ports.outputs)):
            if wanted is not None:
                some_names(what, wanted, available)
        return SecondOrderModel.of(self.structure, self.ports.select(inputs, outputs), self.selection)

    @cached_property
    def _primary(self) -> SecondOrderModel:
        return self.select(*(self.ports.primary or ()))

    def between(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> SecondOrderModel:
        """Return the model between signals, as :meth:`select`; by default platform actuators and tips of a boom.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names; by default the primary signals of the model.

        Returns
        -------
        SecondOrderModel
            The same structure, which shares cached results.

        Raises
        ------
        TypeError, ValueError
            If a name is unknown or requested twice.
        """
        first = self.ports.primary or (None, None)
        if inputs is None and outputs is None:  # a model that stored itself would stay until garbage is collected
            return self if first in ((None, None), (self.input_labels, self.output_labels)) else self._primary
        return self.select(first[0] if inputs is None else inputs, first[1] if outputs is None else outputs)

    @cached_property
    def _halves(self) -> tuple[SecondOrderModel, ...] | None:
        """Symmetric and antisymmetric subsystems that have inputs and outputs; None if the model does not decouple."""
        result = halves(self.structure, self.ports)
        return None if result is None else tuple(SecondOrderModel.of(*part[:2]) for part in result)

    @cached_property
    def _modal_form(self) -> Lti:
        """The balanced state space over undamped modes, or without such modes over the coordinates: matrices alone.

        Raises
        ------
        ValueError
            If an output needs a derivative of an input.
        """
        return modal_form(self.structure, self.ports)

    def __getitem__(self, signals: tuple[Any, Any]) -> SecondOrderModel:
        """Return the model between signals, outputs first, as systems of python-control take them: ``m["tip", "force"]``."""
        if not isinstance(signals, tuple) or len(signals) != 2:
            raise TypeError(f"expected model[outputs, inputs] with names of signals, got model[{shown(signals)}]")
        return self.select(signals[1], signals[0])

    def _ipython_key_completions_(self) -> list[tuple[str, str]]:
        """Return the pairs that consoles complete in brackets."""
        return [(output, name) for output in self.output_labels for name in self.input_labels]

    @property
    def _name(self) -> str:
        """Name in comparisons; the two subsystems have different names."""
        return {"sym": "jolt", "anti": "yaw"}.get(
            "".join(self.structure.coordinates[:1]).rpartition("_")[2], "structure"
        )

    def __getattr__(self, name: str) -> Any:
        """Raise AttributeError with a hint for attributes of state-space systems."""
        said = f"{type(self).__name__!r} object has no attribute {name!r}"
        hint = "; its .to_statespace() has those of systems, and boomctl.sigma, bode, step, ... take the model"
        raise AttributeError(said if name.startswith("_") else f"{said}{hint}", name=name, obj=self)

    def _combined(self, *others: Any) -> NoReturn:
        """Raise TypeError with a hint for arithmetic with systems."""
        raise TypeError(
            "a structure is not combined by +, -, * and /: its .to_statespace() is, as python-control does it"
        )

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __neg__ = _combined

    @one_blas_thread
    def poles(self) -> Array:
        """Return the poles of the model's state space.

        Returns
        -------
        (k,) complex ndarray
            [rad/s], those of python-control's ``model.to_statespace().poles()``.

        Raises
        ------
        ValueError
            If an output needs a derivative of an input.
        """
        return self.__lti__().poles

    @one_blas_thread
    def eigenfrequencies_hz(self, count: int | None = None) -> Array:
        """Return the lowest damped eigenfrequencies, ``Im(lambda)/2 pi > 0``, ascending [Hz].

        If no mode is overdamped, number ``k``, from 1, belongs to mode ``k`` of :meth:`mode_shapes`; rigid-body motions are
        not counted.

        Parameters
        ----------
        count : int, optional
            Number of eigenfrequencies.  If None, 5, or all of a model that has fewer.

        Returns
        -------
        (count,) ndarray
            The lowest damped eigenfrequencies, ascending [Hz].

        Raises
        ------
        TypeError, ValueError
            If ``count`` is not a whole number above zero, or if the model has fewer eigenfrequencies.

        Warns
        -----
        AccuracyWarning
            If the relative rounding error may exceed 1e-8, as with very different elements or very fast modes.
        BoomctlWarning
            If the lowest is below 1e-4 Hz and none is above 0.01 Hz, or if the lowest is above 1e5 Hz: units are not SI.
        """
        wanted, least = (_MODES, 0) if count is None else (whole("count", count), None)
        result = damped_poles(self.structure, wanted, least=least).imag / (2.0 * np.pi)
        warn_of_units(result)
        return result

    @one_blas_thread
    def mode_shapes(self, count: int | None = None) -> ModeShapes:
        """Return the lowest undamped modes and their shapes.

        Parameters
        ----------
        count : int, optional
            Number of modes, from the lowest; rigid-body motions come first, and are not numbered.  If None, 5, or all of a
            model that has fewer.

        Returns
        -------
        ModeShapes
            Frequencies and mass-normalized shapes, with jolt and yaw distinguished for a symmetric machine.  ``.plot()``
            draws deflected beams, and other bodies as lines through their attachments.

        Raises
        ------
        TypeError, ValueError
            If ``count`` is not a whole number up to that of the coordinates, or if the matrices have no real modes.

        Warns
        -----
        BoomctlWarning
            If the units seem not to be SI; see :meth:`eigenfrequencies_hz`.
        """
        result = mode_shapes(self.structure, min(_MODES, self.ncoordinates) if count is None else count)
        warn_of_units(result.eigenfrequencies_hz)
        return result

    @one_blas_thread
    def frequency_response(
        self,
        omega: ArrayLike,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
    ) -> control.FrequencyResponseData:
        """Return the frequency response between the inputs and outputs named, from ``M, C, K``, without a state space.

        Parameters
        ----------
        omega : array_like
            Angular frequencies [rad/s].
        inputs, outputs : str or sequence of str, optional
            Names of the inputs and outputs; by default all.

        Returns
        -------
        control.FrequencyResponseData
            Outputs by inputs by frequencies, signals named.

        Raises
        ------
        TypeError, ValueError
            If a frequency is negative or not finite, or a name is unknown.
        """
        from boomctl.lti.python_control import control

        grid, ports = frequencies("omega", omega), self.select(inputs, outputs).ports
        values = respond(self.structure, ports, grid, available=self.ports)
        return control.frd(values, grid, inputs=list(ports.inputs), outputs=list(ports.outputs), name=self._name)

    @one_blas_thread
    def to_statespace(
        self,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
        *,
        states: str | None = None,
        dt: float | None = None,
    ) -> control.StateSpace:
        """Return a state-space system with named inputs, outputs and states.

        Each coordinate, or mode, has two states: ``NAME.x1 = q - G d`` and ``NAME.x2 = x1' - H d``, for a displacement
        input ``d``; without one, position and velocity.  Source: Anthonis & Ramon (2003), Eqs. (9), (10), (12), with
        corrected signs.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names of the inputs and outputs; by default all.
        states : str, optional
            ``"modes"``: over undamped modes, ``mode1``, ``mode2``, ..., slowest first, each state scaled by a power of
            two so that the state matrix is balanced, which keeps computations accurate on fine meshes.
            ``"coordinates"``: over the coordinates, not scaled.  By default modes for assembled models, such as the boom;
            for matrices passed by the user, coordinates if they are balanced, else modes.  A model without real modes is
            over its coordinates, scaled.
        dt : float, optional
            Time between samples [s]: a discrete system, exact at the samples for held inputs.  If None, in continuous time.
            For sampled controllers with delay see :func:`boomctl.analysis.sample_plant`.

        Returns
        -------
        control.StateSpace
            ``A, B, C, D`` with two states for each coordinate or mode, and those of output filters; named "jolt" or "yaw"
            for a subsystem, else "structure".

        Raises
        ------
        TypeError, ValueError
            If a name or ``states`` is unknown, if the mass matrix is singular, if an output needs an unavailable derivative
            of an input, or if ``dt`` is not above zero.

        Warns
        -----
        AccuracyWarning
            If the rounding error of a response below the lowest frequency exceeds 1e-6, as with dampers far beyond critical,
            or 1e-4 over coordinates.  `frequency_response` does not use these matrices.

        Examples
        --------
        >>> import boomctl as bc
        >>> mass = bc.structure.SecondOrderModel([[1.0]], [[0.1]], [[4.0]], {"force": [1.0]}, {"place": [1.0]})
        >>> mass.to_statespace().state_labels
        ['q0.x1', 'q0.x2']
        >>> mass.to_statespace(states="modes").state_labels
        ['mode1.x1', 'mode1.x2']
        """
        if states is not None and not (isinstance(states, str) and states in (MODES, COORDINATES)):
            raise ValueError(f"states = {states!r}: expected {MODES!r}, {COORDINATES!r} or None")
        result = user_state_space(self.structure, self.select(inputs, outputs).ports, states)
        if dt is not None:
            Phi, G = zero_order_hold(result.A, result.B, positive("dt", dt))
            result = replace(result, A=Phi, B=G, dt=float(dt))
        return result.statespace(self._name)

    def __lti__(self) -> Lti:
        """Return the state-space form for computations with a model, without python-control."""
        return user_state_space(self.structure, self.ports, None)


@one_blas_thread
def split_symmetric(model: SecondOrderModel) -> tuple[SecondOrderModel, SecondOrderModel]:
    """Split a mirror-symmetric model into its symmetric (jolt) and antisymmetric (yaw) subsystem.

    Signals that come in pairs become ``stem_sym = (right + left)/sqrt 2`` and ``stem_anti = (right - left)/sqrt 2``;
    the transformation is orthonormal, so the singular values of the two subsystems are those of the machine.

    A signal of a subsystem is the square root of two times the mean, or half the difference, of the signals of the
    machine: 150 N of each actuator in opposite directions are 212 N of ``suspension_anti``.  ``.units`` of a
    subsystem documents this, ``PlatformMotion.symmetric`` and ``.antisymmetric`` are its inputs, and
    :func:`boomctl.join_symmetric` joins its controllers.

    Parameters
    ----------
    model : SecondOrderModel
        A machine that is symmetric about ``x = 0``, mesh and signals included.

    Returns
    -------
    jolt, yaw : SecondOrderModel
        The two decoupled subsystems, which together have all modes of the machine.

    Raises
    ------
    TypeError, ValueError
        If `model` has another type, or if the mesh or the machine is not symmetric about ``x = 0``.

    Examples
    --------
    >>> import boomctl as bc
    >>> jolt, yaw = bc.split_symmetric(bc.spray_boom())
    >>> yaw.output_labels
    ('tip_anti', 'stroke_anti')
    >>> jolt.eigenfrequencies_hz(1).round(3), yaw.eigenfrequencies_hz(1).round(3)
    (array([0.587]), array([0.245]))
    """
    instance("model", model, SecondOrderModel)
    structure = model.structure.mirrored(model.structure.mirror)
    if structure.mirror is None:
        raise ValueError("the model is not symmetric about x = 0 (mesh or machine), so it does not split")
    parts = halves(structure, model.ports, empty=True)
    if parts is None:
        raise ValueError(f"inputs {model.input_labels} or outputs {model.output_labels} are not pairs of mirror images")
    jolt, yaw = (SecondOrderModel.of(*part[:2]) for part in parts)
    return jolt, yaw


def _square(name: str, value: ArrayLike) -> Array:
    stored = getattr(value, "toarray", None)  # of SciPy's sparse arrays
    if stored is not None:
        check_size(max(value.shape))  # type: ignore[union-attr]
        value = stored()
    matrix = finite_array(name, value, ndim=2)
    check_size(len(matrix))
    if matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise ValueError(f"{name} has shape {matrix.shape}; expected a square matrix")
    return matrix


def _lines(what: str, rows: Mapping[str, ArrayLike] | None, n: int) -> Array:
    entries = {} if rows is None else mapping(f"{what}s", rows, "names to arrays")
    stacked = np.zeros((len(entries), n))
    for i, (name, row) in enumerate(entries.items()):
        signal_name(f"name of a {what}", name)
        line = finite_array(f"{what} {name!r}", row).ravel()
        if line.shape != (n,):
            raise ValueError(f"{what} {name!r} has {line.size} entries; expected {n}, one a coordinate")
        stacked[i] = line
    return stacked
