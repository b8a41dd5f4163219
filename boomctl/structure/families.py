"""Structures whose matrices depend on uncertain parameters: in straight lines, or as polynomials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.chebyshev import fitted, points_along, tried_points
from boomctl.checks import finite_array, instance, known, mapping, real, sequence, shown, signal_name, whole
from boomctl.lti.rounding import ALIKE, SUMMED
from boomctl.printing import compact, listed, signals
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

_EXACT = 0.1  # Largest error of the fitted polynomials, as a fraction of the tolerance of the check.


@dataclass(frozen=True)
class Slope:
    """Change of the matrices from the center of a parameter's range to its upper limit.

    Attributes
    ----------
    M, C, K : (n, n) ndarray
        Changes of the mass, damping and stiffness matrix.
    B, L : ndarray
        Changes of the columns of the inputs and the rows of the outputs; zero by default.
    """

    M: Array
    C: Array
    K: Array
    B: Array
    L: Array = field(default_factory=lambda: np.zeros(()))

    __repr__ = compact


@dataclass(frozen=True, repr=False)
class Family:
    """Structures over a parameter box: the nominal structure, and polynomials of the parameters that change its matrices."""

    _made_by = "boom_family(), AffineFamily.from_function(...) or .family(...) of a hub-beam"
    _no: ClassVar[str]

    names: tuple[str, ...]
    low: Array
    high: Array
    nominal: SecondOrderModel
    coefficients: tuple[tuple[tuple[int, ...], Slope], ...]
    ignorable_coordinates: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len([signal_name("parameter", name) for name in sequence("names", self.names, "names of parameters")])
        instance("nominal", self.nominal, SecondOrderModel)
        for name in ("low", "high"):
            ends = finite_array(name, getattr(self, name), ndim=1)
            if len(ends) != count:
                raise ValueError(f"{name}: expected {count} numbers, one a parameter, got {len(ends)}")
            object.__setattr__(self, name, ends)
        if not (self.low < self.high).all():
            raise ValueError(f"low = {self.low.tolist()}, high = {self.high.tolist()}: expected low below high")
        for entry in sequence("coefficients", self.coefficients, "pairs of factors and Slope"):
            pair = sequence("coefficients", entry, "pairs of factors and Slope")
            if len(pair) != 2 or not sequence("factors", pair[0], "int"):
                raise ValueError(f"coefficients: expected pairs of factors, one or more, and Slope, got {shown(pair)}")
            instance("change", pair[1], Slope)
            for factor in pair[0]:
                whole("factor", factor, 0, count - 1)
        for name in sequence("ignorable_coordinates", self.ignorable_coordinates, "str"):
            known("coordinate", name, self.nominal.coordinates)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the fields without cached results."""
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def __repr__(self) -> str:
        box = (
            f"{name} {low:.6g} to {high:.6g}" for name, low, high in zip(self.names, self.low, self.high, strict=True)
        )
        ports = signals(self.nominal.input_labels, self.nominal.output_labels)
        return f"{type(self).__name__}: {self.nominal.ncoordinates} coordinates; {listed(list(box), 50)}\n{ports}"

    @property
    def _unfelt(self) -> tuple[int, ...]:
        """Indices of the ignorable coordinates, which are omitted from a loop that does not read them."""
        return tuple(self.nominal.coordinates.index(name) for name in self.ignorable_coordinates)

    @property
    def nparameters(self) -> int:
        """Number of parameters."""
        return len(self.names)

    @cached_property
    def _often(self) -> Array:
        """Exponent of each parameter in each term."""
        often = [[power.count(i) for i in range(self.nparameters)] for power, _ in self.coefficients]
        return np.array(often).reshape(len(often), self.nparameters)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Minimum and maximum of each parameter."""
        return {name: (float(a), float(b)) for name, a, b in zip(self.names, self.low, self.high, strict=True)}

    def normalize(self, values: Mapping[str, float]) -> Array:
        """Return parameter values as ``delta``, from -1 at the lower limit of a range to 1 at the upper limit.

        Parameters
        ----------
        values : mapping from name to float
            Values of parameters, in their units; the default is the center of the range.

        Returns
        -------
        (k,) ndarray
            In the order of ``names``.

        Raises
        ------
        TypeError, ValueError
            If a parameter is unknown or a value is not finite.
        """
        for name in mapping("values", values, "parameters to numbers"):
            known("parameter", name, self.names)
        middle, width = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        point = np.array([real(n, values.get(n, middle[i])) for i, n in enumerate(self.names)])
        return (point - middle) / width

    def denormalize(self, delta: ArrayLike) -> dict[str, float]:
        """Return ``delta`` as parameter values.

        Parameters
        ----------
        delta : (k,) array_like
            Point in the box, from -1 to 1 across each range, in the order of ``names``.

        Returns
        -------
        dict of str to float
            Values by name, in the parameters' units.

        Raises
        ------
        TypeError, ValueError
            If the number of values differs from that of the parameters, or if a value is not finite.
        """
        d = self._delta(delta)
        result = 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * d
        return {name: float(value) for name, value in zip(self.names, result, strict=True)}

    @one_blas_thread
    def at(self, delta: ArrayLike) -> SecondOrderModel:
        """Return the structure at one point of the box.

        Parameters
        ----------
        delta : (k,) array_like
            Point in the box, from -1 to 1 across each range; beyond these the family is extrapolated.

        Returns
        -------
        SecondOrderModel
            With the signals of ``nominal``.

        Raises
        ------
        TypeError, ValueError
            If the number of values differs from that of the parameters, or if a value is not finite.
        """
        c, products = self.nominal, products_of(self, self._delta(delta)).tolist()
        middle, changes = self._entries
        entries = middle + sum(product * change for product, change in zip(products, changes, strict=True) if product)
        n, m, p = c.ncoordinates, len(c.input_labels), len(c.output_labels)
        M, C, K = entries[: 3 * n * n].reshape(3, n, n)
        B, L = entries[3 * n * n : 3 * n * (n + m)].reshape(3, n, m), entries[3 * n * (n + m) :].reshape(3, p, n)
        structure = Structure.of(M, C, K, c.coordinates, c.structure.mirror, c.structure.outline)
        return SecondOrderModel.of(structure, replace(c.ports, B=B, L=L))

    @cached_property
    def _entries(self) -> tuple[Array, Array]:
        """Entries of ``M, C, K, B, L``, one after another: at the center, and their change by each term."""
        c = self.nominal
        matrices = {"M": c.M, "C": c.C, "K": c.K, "B": c.ports.B, "L": c.ports.L}
        changes = [
            [np.broadcast_to(getattr(slope, letter), X.shape).ravel() for letter, X in matrices.items()]
            for _, slope in self.coefficients
        ]
        middle = np.concatenate([X.ravel() for X in matrices.values()])
        return middle, np.array([np.concatenate(change) for change in changes]).reshape(-1, len(middle))

    def _delta(self, delta: ArrayLike) -> Array:
        d = finite_array("delta", delta, ndim=1)
        if len(d) != len(self.names):
            raise ValueError(f"delta has {len(d)} entries; expected {len(self.names)}: {', '.join(self.names)}")
        return d

    def _check(self, items: Sequence[SecondOrderModel]) -> None:
        """Raise if the family differs from ``items`` at a vertex of the box or a random point inside it."""
        points = tried_points(self.nparameters)
        exact, own = (_matrices(items[0], models, "MCKBLE") for models in (items, [self.at(delta) for delta in points]))
        sizes = _sizes(exact)
        for letter in "MCKBLE":
            # An entry of a signal is compared with the largest of its derivative.
            size = sizes[letter] if letter in "MCK" else sizes[letter].max(axis=(1, 2), initial=0.0)[:, None, None]
            off = np.argwhere(np.abs(own[letter] - exact[letter]) > ALIKE * size)
            if len(off):
                name = letter if letter in "MCK" else f"{letter}{off[0][1]}"
                where = ", ".join(f"{key} = {value:.6g}" for key, value in self.denormalize(points[off[0][0]]).items())
                raise ValueError(
                    f"{name} is {self._no} {', '.join(self.names)}: the family differs from the structure at {where}"
                )


@dataclass(frozen=True, repr=False)
class AffineFamily(Family):
    """A family of structures whose matrices are affine in uncertain parameters.

    With ``delta`` from -1 to 1 across the range of each parameter, ``M = M_0 + sum_i delta_i M_i``, and equally for ``C``,
    ``K``, the columns of the inputs and the rows of the outputs.  See `AffineFamily.from_function`.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    low, high : (k,) ndarray
        Lower and upper limits of their ranges, in the parameters' units.
    nominal : SecondOrderModel
        The structure at the center of the box.
    coefficients : tuple of (tuple of int, Slope)
        For each parameter its index from zero, as ``(0,)``, and the change of the matrices from the center of its range to
        the upper limit.
    ignorable_coordinates : tuple of str
        See `PolynomialFamily`.

    Raises
    ------
    TypeError, ValueError
        If the numbers of limits and names differ, if limits do not ascend, if a parameter or coordinate is unknown, or if
        the center is not a SecondOrderModel.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.boom_family(spring_factor=(0.7, 1.3))
    >>> family.names, family.nparameters
    (('spring_factor', 'mass_factor'), 2)
    >>> family.at([1.0, 0.0]).eigenfrequencies_hz(1).round(3)  # springs 1.3 times as stiff
    array([0.275])
    """

    _no: ClassVar[str] = "not affine in"

    @classmethod
    @one_blas_thread
    def from_function(
        cls, ranges: Mapping[str, tuple[float, float]], function: Callable[[Mapping[str, float]], SecondOrderModel]
    ) -> AffineFamily:
        """Return the family through the structures that a function returns.

        It is checked at every vertex of the box (for more than ten parameters at a thousand random ones), and inside.

        Parameters
        ----------
        ranges : mapping from name to (low, high)
            The parameters and the limits of their ranges, ascending.
        function : function
            Returns a `SecondOrderModel` for a mapping of parameter values; its matrices must be affine in them.

        Returns
        -------
        AffineFamily
            The structures over the box.

        Raises
        ------
        TypeError, ValueError
            If ranges are empty or reversed, if structures have different signals, if the affine family differs from the
            structure at a vertex or a point inside, or if a feedthrough from an input to an output varies.
        """
        names, low, high, at = _box(ranges, function)
        center = at(np.zeros(len(names)))
        stacks = _matrices(center, [center, *(at(unit) for unit in np.eye(len(names)))])
        changes = tuple(((i,), Slope(*(X[i + 1] - X[0] for X in stacks.values()))) for i in range(len(names)))
        family = cls(names, low, high, center, changes)
        family._check([at(delta) for delta in tried_points(len(names))])
        return family


@dataclass(frozen=True, repr=False)
class PolynomialFamily(Family):
    """A family of structures whose matrices are polynomials of uncertain parameters, as of the speed of a rotating beam.

    With ``delta`` from -1 to 1 across the range of each parameter, ``M = M_0 + sum_p delta^p M_p`` over products
    ``delta^p`` of them, and equally for ``C``, ``K``, the columns of the inputs and the rows of the outputs.
    See `PolynomialFamily.from_function`.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    low, high : (k,) ndarray
        Lower and upper limits of their ranges, in the parameters' units.
    nominal : SecondOrderModel
        The structure at the center of the box.
    coefficients : tuple of (tuple of int, Slope)
        Products of parameters, each specified by its factors, ``(0, 0, 1)`` for the square of the first times the second,
        and their coefficients.
    ignorable_coordinates : tuple of str
        Coordinates whose position does not enter the equations, such as a hub's angle.  Proofs omit the integrator if
        the controller does not read them.

    Raises
    ------
    TypeError, ValueError
        If the numbers of limits and names differ, if limits do not ascend, if a product has an unknown parameter, if a
        coordinate is unknown, or if the center is not a SecondOrderModel.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.hub_beam(model="sfoam", modes=2).family(hub_speed=(0.0, 6.0))
    >>> [power for power, _ in family.coefficients]  # the speed and its square
    [(0,), (0, 0)]
    """

    _no: ClassVar[str] = "no polynomial of"

    @classmethod
    @one_blas_thread
    def from_function(
        cls,
        ranges: Mapping[str, tuple[float, float]],
        function: Callable[[Mapping[str, float]], SecondOrderModel],
        degree: int = 16,
        free: Sequence[str] = (),
    ) -> PolynomialFamily:
        """Return the family through the structures that a function returns, by least squares.

        Coefficients below rounding are omitted.  The family is checked to 1e-9 at every vertex of the box (for more than
        ten parameters at a thousand random ones), and at random points inside it.

        Parameters
        ----------
        ranges : mapping from name to (low, high)
            The parameters and the limits of their ranges, ascending.
        function : function
            Returns a `SecondOrderModel` for a mapping of parameter values; its matrices must be polynomials of them, or
            equally smooth.
        degree : int
            Limit on the power of a parameter; the required power is determined automatically.
        free : sequence of str
            Ignorable coordinates of the family.

        Returns
        -------
        PolynomialFamily
            The structures over the box.

        Raises
        ------
        TypeError, ValueError
            If ranges are empty or reversed, if structures have different signals, if the family differs from the structure at
            a vertex or a point inside, if a feedthrough from an input to an output varies, or if there are too many terms.
        """
        names, low, high, at = _box(ranges, function)
        structures, most = [at(delta) for delta in tried_points(len(names))], whole("degree", degree)
        center = at(np.zeros(len(names)))

        def matrices(points: Sequence[Array]) -> dict[str, Array]:
            return _matrices(structures[0], [at(delta) for delta in points])

        counts = [points_along(matrices, axis, _negligible, most) for axis in np.eye(len(names))]
        samples, what = _matrices(structures[0], structures), f"family of {listed(names)}"
        result, _, _ = fitted(matrices, counts, samples, _negligible, _EXACT * ALIKE / SUMMED, what)
        powers = sorted({power for X in result.values() for power in X if power}, key=lambda power: (len(power), power))
        changes = tuple(
            (power, Slope(*(result[letter].get(power, np.zeros_like(result[letter][()])) for letter in "MCKBL")))
            for power in powers
        )
        family = cls(names, low, high, center, changes, tuple(free))
        family._check(structures)
        return family


def _matrices(first: SecondOrderModel, items: Sequence[SecondOrderModel], letters: str = "MCKBL") -> dict[str, Array]:
    """Return the stacked matrices of structures and signals; raise ValueError if signals differ from those of ``first``."""
    for item in items:
        same_signals = (item.input_labels, item.output_labels) == (first.input_labels, first.output_labels)
        if not same_signals or item.ncoordinates != first.ncoordinates:
            raise ValueError("the structures of a family must have the same coordinates, inputs and outputs")
    return {
        letter: np.array([getattr(item if letter in "MCK" else item.ports, letter) for item in items])
        for letter in letters
    }


def _negligible(stacks: Mapping[str, Array]) -> dict[str, Array]:
    return {letter: SUMMED * size for letter, size in _sizes(stacks).items()}


def _sizes(stacks: Mapping[str, Array]) -> dict[str, Array]:
    """Return the magnitude of each entry as a reference for rounding; for entries that may cancel that of related entries.

    Masses and stiffnesses are related to the diagonals of their row and column, where a coordinate without stiffness has the
    least rate of the others.  Dampings and gyroscopic terms are related to the largest rate.
    """
    result = {letter: np.abs(stack).max(axis=0) for letter, stack in stacks.items()}
    mass, stiffness = np.diag(result["M"]), np.diag(result["K"])
    squares = np.divide(stiffness, mass, out=np.zeros_like(mass), where=mass > 0.0)
    stiffness = np.maximum(stiffness, mass * squares[squares > 0.0].min(initial=np.inf if squares.any() else 0.0))
    reference: dict[str, Any] = {"M": np.sqrt(np.outer(mass, mass)), "K": np.sqrt(np.outer(stiffness, stiffness))}
    rates = np.divide(result["C"], reference["M"], out=np.zeros_like(result["C"]), where=reference["M"] > 0.0)
    reference["C"] = rates.max(initial=0.0) * reference["M"]
    reference["L"] = result["L"].max(axis=-1, keepdims=True) if "L" in result else 0.0  # Of the same output.
    return {letter: np.maximum(size, reference.get(letter, 0.0)) for letter, size in result.items()}


def _box(
    ranges: Mapping[str, tuple[float, float]], make: Callable[[Mapping[str, float]], SecondOrderModel]
) -> tuple[tuple[str, ...], Array, Array, Callable[[Array], SecondOrderModel]]:
    """Return names and limits of a parameter box passed by the user, and the function from a point in it to a structure."""
    if not mapping("ranges", ranges, "parameters to pairs"):
        raise ValueError("ranges: expected at least one parameter")
    names = tuple(signal_name("parameter", name) for name in ranges)
    pairs = [interval(name, ranges[name]) for name in names]
    low, high = (np.array(ends) for ends in zip(*pairs, strict=True))
    middle, width = 0.5 * (low + high), 0.5 * (high - low)

    def at(delta: Array) -> SecondOrderModel:
        return make({n: float(v) for n, v in zip(names, middle + delta * width, strict=True)})

    return names, low, high, at


def products_of(family: Family, delta: Array) -> Array:
    """Return the products of ``delta`` that multiply the terms of a family at a point of its box."""
    return np.asarray((delta**family._often).prod(axis=1))


def interval(name: str, limits: object) -> tuple[float, float]:
    """Return the checked limits of a parameter's range, two ascending numbers."""
    if not isinstance(limits, (tuple, list, np.ndarray)) or getattr(limits, "ndim", 1) == 0 or len(limits) != 2:
        raise TypeError(f"range of {name} = {limits!r}: expected two ascending numbers")
    low, high = real(f"range of {name}", limits[0]), real(f"range of {name}", limits[1])
    if low >= high:
        raise ValueError(f"range of {name} = ({low:g}, {high:g}): expected two ascending numbers")
    return low, high
