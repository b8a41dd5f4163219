"""Structures whose matrices are affine in uncertain parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array, Matrix
from boomctl.checks import finite_array, instance, known, mapping, real, sequence, signal_name
from boomctl.printing import compact, listed, signals
from boomctl.structure.matrices import Structure, dense
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.ports import Ports

_EXACT = 1e-9  # share of an entry; what is missed by less is rounding of the assembly (a choice)
_INSIDE = 24  # points inside the box at which a family is checked besides its corners (a choice)


@dataclass(frozen=True)
class Slope:
    """How matrices change from the centre of a parameter's range to its upper end.

    Attributes
    ----------
    M, C, K : (n, n) ndarray or scipy.sparse array
        Changes of the mass, damping and stiffness matrix.
    B : ndarray
        Changes of the columns of the inputs.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    B: Array

    __repr__ = compact


@dataclass(frozen=True)
class AffineFamily:
    """A family of structures whose matrices depend on uncertain parameters in a straight line (affinely).

    With ``delta`` from -1 to 1 across the range of each parameter, ``M = M_0 + sum_i delta_i M_i``; ``C``, ``K`` and
    the columns of the inputs alike.  What the outputs read does not change.  `AffineFamily.through` makes one.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    low, high : (k,) ndarray
        Lower and upper ends of their ranges, in the parameters' units.
    centre : SecondOrderModel
        The structure in the middle of the box.
    slopes : tuple of Slope
        For each parameter, how the matrices change from the middle of its range to the upper end.

    Raises
    ------
    TypeError, ValueError
        Not as many ends and slopes as names; ends that do not ascend; a centre that is not a SecondOrderModel.

    Examples
    --------
    >>> import boomctl as bc
    >>> family = bc.boom_family(spring=(0.7, 1.3))
    >>> family.names, family.size
    (('spring', 'mass'), 2)
    >>> family.at([1.0, 0.0]).eigenfrequencies_hz(1).round(3)  # springs 1.3 times as stiff
    array([0.275])
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    centre: SecondOrderModel
    slopes: tuple[Slope, ...]

    def __post_init__(self) -> None:
        count = len([signal_name("parameter", name) for name in sequence("names", self.names, "names of parameters")])
        instance("centre", self.centre, SecondOrderModel)
        slopes = [instance("slope", slope, Slope) for slope in sequence("slopes", self.slopes, "Slope")]
        for name in ("low", "high"):
            ends = finite_array(name, getattr(self, name), ndim=1)
            if len(ends) != count:
                raise ValueError(f"{name}: expected {count} numbers, one a parameter, got {len(ends)}")
            object.__setattr__(self, name, ends)
        if len(slopes) != count:
            raise ValueError(f"slopes: expected {count}, one a parameter, got {len(slopes)}")
        if not (self.low < self.high).all():
            raise ValueError(f"low = {self.low.tolist()}, high = {self.high.tolist()}: expected low below high")

    def __repr__(self) -> str:
        box = (
            f"{name} {low:.6g} to {high:.6g}" for name, low, high in zip(self.names, self.low, self.high, strict=True)
        )
        ports = signals(self.centre.inputs, self.centre.outputs)
        return f"AffineFamily: {self.centre.n} coordinates; {listed(list(box), 50)}\n{ports}"

    @classmethod
    def through(
        cls, ranges: Mapping[str, tuple[float, float]], make: Callable[[Mapping[str, float]], SecondOrderModel]
    ) -> AffineFamily:
        """Return the family through the structures that a function makes.

        It is checked at every corner of the box and at points drawn inside it.

        Parameters
        ----------
        ranges : mapping from name to (low, high)
            The parameters and the ends of their ranges, ascending.
        make : function
            Makes a `SecondOrderModel` from a mapping of parameter values; its matrices must depend on them affinely.

        Returns
        -------
        AffineFamily
            The structures over that box.

        Raises
        ------
        TypeError, ValueError
            Empty or reversed ranges; structures of different signals; a corner or a point inside that the affine family
            misses, or outputs that change.
        """
        if not mapping("ranges", ranges, "parameters to pairs"):
            raise ValueError("ranges: expected at least one parameter")
        names = tuple(signal_name("parameter", name) for name in ranges)
        pairs = [interval(name, ranges[name]) for name in names]
        low, high = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])
        middle, width = 0.5 * (low + high), 0.5 * (high - low)

        def at(delta: Array) -> SecondOrderModel:
            return make({n: float(v) for n, v in zip(names, middle + delta * width, strict=True)})

        centre = at(np.zeros(len(names)))
        ends = [at(unit) for unit in np.eye(len(names))]
        family = cls(names, low, high, centre, tuple(_slope(centre, end) for end in ends))
        inside = np.random.default_rng(0).uniform(-1.0, 1.0, (_INSIDE, len(names)))
        for delta in (*np.array(list(product((-1.0, 1.0), repeat=len(names)))), *inside):
            family._check(delta, at(delta))
        return family

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.names)

    def deltas(self, values: Mapping[str, float]) -> Array:
        """Return parameter values as ``delta``, from -1 at the lower end of a range to 1 at the upper.

        Parameters
        ----------
        values : mapping from name to float
            Values of parameters, in their units; those left out are in the middle of their range.

        Returns
        -------
        (k,) ndarray
            In the order of ``names``.

        Raises
        ------
        TypeError, ValueError
            An unknown parameter; values that are not finite.
        """
        for name in mapping("values", values, "parameters to numbers"):
            known("parameter", name, self.names)
        middle, width = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        given = np.array([real(n, values.get(n, middle[i])) for i, n in enumerate(self.names)])
        return (given - middle) / width

    def values(self, delta: ArrayLike) -> dict[str, float]:
        """Return ``delta`` as parameter values.

        Parameters
        ----------
        delta : (k,) array_like
            Place in the box, from -1 to 1 across each range, in the order of ``names``.

        Returns
        -------
        dict of str to float
            Values by name, in the parameters' units.

        Raises
        ------
        TypeError, ValueError
            Not as many numbers as parameters, or not finite.
        """
        d = self._delta(delta)
        found = 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * d
        return {name: float(value) for name, value in zip(self.names, found, strict=True)}

    def at(self, delta: ArrayLike) -> SecondOrderModel:
        """Return the structure at one point of the box.

        Parameters
        ----------
        delta : (k,) array_like
            Place in the box, from -1 to 1 across each range; beyond these the family is extrapolated.

        Returns
        -------
        SecondOrderModel
            With the signals of ``centre``.

        Raises
        ------
        TypeError, ValueError
            Not as many numbers as parameters, or not finite.
        """
        d, c = self._delta(delta), self.centre
        M, C, K = (
            sum((x * getattr(s, name) for x, s in zip(d, self.slopes, strict=True)), getattr(c, name))
            for name in ("M", "C", "K")
        )
        B = sum((x * s.B for x, s in zip(d, self.slopes, strict=True)), c.ports.B)
        ports = replace(c.ports, B=B)
        return SecondOrderModel.of(Structure.of(M, C, K, c.coordinates, c.mirror), ports)

    def _delta(self, delta: ArrayLike) -> Array:
        d = finite_array("delta", delta, ndim=1)
        if len(d) != len(self.names):
            raise ValueError(f"delta has {len(d)} entries; expected {len(self.names)}: {', '.join(self.names)}")
        return d

    def _check(self, delta: Array, exact: SecondOrderModel) -> None:
        mine = self.at(delta)
        pairs = [(name, getattr(mine, name), getattr(exact, name)) for name in ("M", "C", "K")]
        for group in ("B", "L", "E"):
            mine_3, exact_3 = getattr(mine.ports, group), getattr(exact.ports, group)
            pairs += [(f"{group}{k}", mine_3[k], exact_3[k]) for k in range(3)]
        for name, a, b in pairs:
            a, b = dense(a), dense(b)
            size = np.maximum(np.abs(a), np.abs(b))
            if name in ("M", "C", "K"):  # an entry may cancel, and is then as exact as the diagonals beside it
                along = np.sqrt(np.diag(size))
                size = np.maximum(size, np.outer(along, along))
            else:
                size = np.full_like(size, size.max(initial=0.0))
            if (np.abs(a - b) > _EXACT * size).any():
                where = ", ".join(f"{key} = {value:.6g}" for key, value in self.values(delta).items())
                raise ValueError(
                    f"{name} is not affine in {', '.join(self.names)}, or an output changes with them: the family misses"
                    f" what was made at {where}"
                )


def interval(name: str, given: object) -> tuple[float, float]:
    """Return the ends of a parameter's range, refused unless they are two ascending numbers."""
    if not isinstance(given, (tuple, list, np.ndarray)) or getattr(given, "ndim", 1) == 0 or len(given) != 2:
        raise TypeError(f"range of {name} = {given!r}: expected two ascending numbers")
    low, high = real(f"range of {name}", given[0]), real(f"range of {name}", given[1])
    if low >= high:
        raise ValueError(f"range of {name} = ({low:g}, {high:g}): expected two ascending numbers")
    return low, high


def _slope(centre: SecondOrderModel, end: SecondOrderModel) -> Slope:
    before: Ports = centre.ports
    if end.inputs != centre.inputs or end.outputs != centre.outputs or end.n != centre.n:
        raise ValueError("the structures of a family must have the same coordinates, inputs and outputs")
    return Slope(end.M - centre.M, end.C - centre.C, end.K - centre.K, end.ports.B - before.B)
