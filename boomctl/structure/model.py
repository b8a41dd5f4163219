"""SecondOrderModel: mass, damping and stiffness with named inputs and outputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from boomctl.arrays import Array, Matrix
from boomctl.checks import finite_array, frequencies, signal_name, whole
from boomctl.structure.ports import Ports
from boomctl.structure.prepared import Prepared

if TYPE_CHECKING:
    import control

    from boomctl.structure.symmetry import Mirror

DENSE_LIMIT = 64


@dataclass(frozen=True)
class ElasticRows:
    """Stiffness and damping as sums over rows: ``K = R^T diag(k) R``, ``C = R^T diag(c) R``.

    Kept beside the matrices because ``R v`` loses no digits where ``K v`` does: the strain of a fine mesh that moves
    as a whole is a difference of near-equal displacements, its stiffness a difference of huge near-equal forces.
    """

    R: sparse.csr_array
    k: Array
    c: Array

    def _sum(self, weight: Array) -> sparse.csr_array:
        total = self.R.T @ sparse.diags_array(weight) @ self.R
        return sparse.csr_array(0.5 * (total + total.T))

    @property
    def K(self) -> sparse.csr_array:
        """Stiffness matrix."""
        return self._sum(self.k)

    @property
    def C(self) -> sparse.csr_array:
        """Damping matrix."""
        return self._sum(self.c)

    def congruent(self, T: sparse.csr_array | Array) -> "ElasticRows":
        """Return the rows over coordinates ``z`` with ``q = T z``."""
        return ElasticRows(sparse.csr_array(self.R @ sparse.csr_array(T)), self.k, self.c)


@dataclass(frozen=True, init=False, eq=False)
class SecondOrderModel:
    """A linear structure ``M q'' + C q' + K q = inputs`` with named coordinates, inputs and outputs.

    Parameters
    ----------
    M, C, K : (n, n) ndarray or scipy.sparse array
        Mass, damping and stiffness matrix.
    force_inputs : mapping from name to (n,) array
        Column through which each force acts.
    outputs : mapping from name to (n,) array
        Row with which each output reads the coordinates.
    coordinates : sequence of str, optional
        Names of the coordinates; by default ``q0, q1, ...``.

    Raises
    ------
    TypeError, ValueError
        Not square, of different sizes, not finite, or a row or column of the wrong length.

    Examples
    --------
    >>> m = SecondOrderModel([[1.0]], [[0.1]], [[4.0]], {"force": [1.0]}, {"position": [1.0]})
    >>> m.eigenfrequencies_hz(1).round(4)
    array([0.3182])
    """

    M: Array | sparse.csr_array
    C: Array | sparse.csr_array
    K: Array | sparse.csr_array
    coordinates: tuple[str, ...]
    ports: Ports
    elastic: ElasticRows | None
    mirror: "Mirror | None"
    primary: tuple[tuple[str, ...], tuple[str, ...]] | None
    prepared: Prepared

    def __init__(
        self,
        M: ArrayLike | sparse.sparray,
        C: ArrayLike | sparse.sparray,
        K: ArrayLike | sparse.sparray,
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
        labels = tuple(coordinates) if coordinates is not None else tuple(f"q{i}" for i in range(n))
        if len(labels) != n or len(set(labels)) != n:
            raise ValueError(f"coordinates: expected {n} different names, got {len(labels)}")
        zero = np.zeros_like(lines)
        ports = Ports.of_forces(tuple(force_inputs or ()), columns.T, tuple(outputs or ()), (lines, zero, zero))
        built = SecondOrderModel.build(matrices["M"], matrices["C"], matrices["K"], ports, labels)
        p = built.prepared
        self._set(matrices["M"], matrices["C"], matrices["K"], labels, ports, None, None, None, p)

    def _set(self, *values: object) -> None:
        names = ("M", "C", "K", "coordinates", "ports", "elastic", "mirror", "primary", "prepared")
        for name, value in zip(names, values, strict=True):
            object.__setattr__(self, name, value)

    @classmethod
    def build(
        cls,
        M: Matrix,
        C: Matrix,
        K: Matrix,
        ports: Ports,
        coordinates: tuple[str, ...],
        elastic: ElasticRows | None = None,
        mirror: "Mirror | None" = None,
        primary: tuple[tuple[str, ...], tuple[str, ...]] | None = None,
    ) -> "SecondOrderModel":
        """Return a model from matrices known to be sound; small ones are stored dense, large ones sparse."""
        M, C, K = _store(M), _store(C), _store(K)
        return cls.of_prepared(Prepared(M, C, K, coordinates, elastic, mirror), ports, primary)

    @classmethod
    def of_prepared(
        cls, prepared: Prepared, ports: Ports, primary: tuple[tuple[str, ...], tuple[str, ...]] | None
    ) -> "SecondOrderModel":
        """Return a model of a structure that others may share, with inputs and outputs of its own."""
        model, p = cls.__new__(cls), prepared
        model._set(p.M, p.C, p.K, p.coordinates, ports, p.elastic, p.mirror, primary, p)
        return model

    def with_ports(self, ports: Ports) -> "SecondOrderModel":
        """Return the same structure with other inputs and outputs."""
        return SecondOrderModel.of_prepared(self.prepared, ports, self.primary)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.ports.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.ports.outputs

    def select(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> "SecondOrderModel":
        """Return the model with only the inputs and outputs named, in that order."""
        for what, wanted in (("inputs", inputs), ("outputs", outputs)):
            if wanted is not None and not len(wanted):
                raise ValueError(f"{what}: expected at least one name, got none")
        return self.with_ports(self.ports.select(inputs, outputs))

    def eigenfrequencies_hz(self, count: int = 5) -> Array:
        """Return the lowest damped eigenfrequencies, ``Im(lambda)/2 pi > 0``, ascending [Hz].

        Raises
        ------
        ValueError
            The model has fewer than ``count`` of them.
        """
        from boomctl.structure.response.poles import damped_poles

        poles = damped_poles(self, whole("count", count))
        return np.sort(poles.imag)[:count] / (2.0 * np.pi)

    def frequency_response(
        self,
        omega: ArrayLike,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
    ) -> "control.FrequencyResponseData":
        """Return the frequency response of the inputs and outputs named, from ``M, C, K``, without a state space.

        Parameters
        ----------
        omega : array_like
            Angular frequencies [rad/s].
        inputs, outputs : str or sequence of str, optional
            By default all.
        """
        from boomctl.structure.response.direct import respond_selected, to_frd

        grid = frequencies("omega", omega)
        selected = self.select(inputs, outputs)
        return to_frd(respond_selected(self, selected.ports, grid), grid, selected.ports)

    def to_statespace(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> "control.StateSpace":
        """Return a state-space system with named inputs, outputs and states.

        Source: Anthonis & Ramon (2003), Eqs. (9), (10), (12), with the signs mended.

        Raises
        ------
        ValueError
            The mass matrix is singular, or an output needs a derivative of an input that is not there.
        """
        from boomctl.structure.response.realisation import realize

        return realize(self.select(inputs, outputs))


def _square(name: str, value: ArrayLike | sparse.sparray) -> Matrix:
    if sparse.issparse(value):
        given = sparse.csr_array(value)
        if given.dtype.kind not in "iuf":
            raise TypeError(f"{name}: expected real numbers, got an array of {given.dtype}")
        matrix = given.astype(float)
        if not np.isfinite(matrix.data).all():
            raise ValueError(f"{name}: expected finite numbers")
    else:
        matrix = finite_array(name, value, ndim=2)  # type: ignore[arg-type]
    if matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise ValueError(f"{name} has shape {matrix.shape}; expected a square matrix")
    return matrix


def _lines(what: str, rows: Mapping[str, ArrayLike] | None, n: int) -> Array:
    stacked = np.zeros((len(rows or {}), n))
    for i, (name, row) in enumerate((rows or {}).items()):
        signal_name(f"name of a {what}", name)
        line = finite_array(f"{what} {name!r}", row).ravel()
        if line.shape != (n,):
            raise ValueError(f"{what} {name!r} has {line.size} entries; expected {n}, one a coordinate")
        stacked[i] = line
    return stacked


def _store(matrix: Matrix) -> Matrix:
    if sparse.issparse(matrix):
        return matrix.toarray() if matrix.shape[0] <= DENSE_LIMIT else sparse.csr_array(matrix)
    return np.asarray(matrix)
