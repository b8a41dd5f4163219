"""The plants that one controller is tuned for: given ones, made from physical parameters, or points of a family."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import function_of
from boomctl.structure.families import Family
from boomctl.synthesis.plants.partition import GeneralizedPlant, partition
from boomctl.synthesis.tuning.parts.structures import Physical
from boomctl.synthesis.tuning.problem import ScaledPlant

_REMEMBERED = 256  # sets of plants that are kept for when they are asked for again (a choice)
_MOST_PARAMETERS = 6  # of a family that may be uncertain: its corners are all tuned for (a choice)


@dataclass
class Plants:
    """Generalised plants as a function of physical parameters.

    Attributes
    ----------
    makers : tuple of function
        Each returns a generalised plant from values of the physical parameters.
    labels : tuple of str
        What the plants are called.
    nmeas, ncon : int
    physical : tuple of Physical
    """

    makers: tuple[Callable[[dict[str, float]], GeneralizedPlant], ...]
    labels: tuple[str, ...]
    physical: tuple[Physical, ...]
    _scaled: "OrderedDict[bytes, tuple[ScaledPlant, ...]]" = field(default_factory=OrderedDict, repr=False)

    def values(self, numbers: Array) -> dict[str, float]:
        """Return physical parameters from numbers between -1 and 1."""
        return {
            each.name: 0.5 * (each.low + each.high) + 0.5 * (each.high - each.low) * float(number)
            for each, number in zip(self.physical, numbers, strict=True)
        }

    def given(self, numbers: Array) -> tuple[GeneralizedPlant, ...]:
        """Return the plants as the user means them."""
        values = self.values(numbers)
        return tuple(make(values) for make in self.makers)

    def scaled(self, numbers: Array) -> tuple[ScaledPlant, ...]:
        """Return the plants with balanced states."""
        key = np.asarray(numbers, float).tobytes()
        if key not in self._scaled:
            self._scaled[key] = tuple(ScaledPlant.of(plant) for plant in self.given(numbers))
            while len(self._scaled) > _REMEMBERED:
                self._scaled.popitem(last=False)
        self._scaled.move_to_end(key)
        return self._scaled[key]

    def with_more(self, maker: Callable[[dict[str, float]], GeneralizedPlant], label: str) -> "Plants":
        """Return the plants and one more."""
        return Plants((*self.makers, maker), (*self.labels, label), self.physical)


def partitioned(P: Any, nmeas: int, ncon: int, what: str = "P") -> GeneralizedPlant:
    """Return a generalised plant; without measurements and controls, all of it is between disturbances and performance.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; counts out of range.
    """
    from boomctl.lti.system import of

    if nmeas == 0 and ncon == 0:
        return GeneralizedPlant(of(P, what, "StateSpace"), 0, 0)
    return partition(P, nmeas, ncon)


def fixed_plants(P: Sequence[Any], nmeas: int, ncon: int) -> Plants:
    """Return plants that do not depend on anything."""
    found = [partitioned(each, nmeas, ncon) for each in P]
    _alike(found)
    labels = ("",) if len(found) == 1 else tuple(f"model {i + 1}" for i in range(len(found)))
    return Plants(tuple(lambda values, plant=plant: plant for plant in found), labels, ())


def made_plants(P: Sequence[Any], nmeas: int, ncon: int, physical: tuple[Physical, ...]) -> Plants:
    """Return plants that functions of the physical parameters make."""

    def maker(each: Any) -> Callable[[dict[str, float]], GeneralizedPlant]:
        if not callable(each) or hasattr(each, "ninputs"):
            plant = partitioned(each, nmeas, ncon)
            return lambda values: plant
        make = function_of("P", each, "a mapping of physical parameters to a generalised plant")
        return lambda values: partitioned(make(values), nmeas, ncon)

    labels = ("",) if len(P) == 1 else tuple(f"model {i + 1}" for i in range(len(P)))
    plants = Plants(tuple(maker(each) for each in P), labels, physical)
    _alike(list(plants.given(np.zeros(len(physical)))))
    return plants


@dataclass(frozen=True)
class FamilyPlants:
    """A family, and what makes a generalised plant of each of its structures.

    Attributes
    ----------
    family : Family
    make : function
        From a structure of the family to a generalised plant.
    nmeas, ncon : int
    physical : tuple of Physical
        Parameters of the family that are tuned; the others are uncertain.
    """

    family: Family
    make: Callable[[Any], Any]
    nmeas: int
    ncon: int
    physical: tuple[Physical, ...]

    @property
    def uncertain(self) -> list[int]:
        """Places of the family's uncertain parameters."""
        tuned = {each.name for each in self.physical}
        return [i for i, name in enumerate(self.family.names) if name not in tuned]

    def delta(self, values: dict[str, float], point: Array) -> Array:
        """Return the family's own coordinates of a point of the uncertain box, at values of the physical parameters."""
        found = self.family.deltas(values)
        found[self.uncertain] = point
        return found

    def plant(self, values: dict[str, float], point: Array) -> GeneralizedPlant:
        """Return the generalised plant at a point of the uncertain box."""
        return partitioned(self.make(self.family.at(self.delta(values, point))), self.nmeas, self.ncon)

    def label(self, point: Array) -> str:
        """Return what a point is called."""
        f = self.family
        found = (
            f"{f.names[i]} = {0.5 * (f.low[i] + f.high[i]) + 0.5 * (f.high[i] - f.low[i]) * d:.5g}"
            for i, d in zip(self.uncertain, point, strict=True)
        )
        return ", ".join(found)

    def points(self) -> list[Array]:
        """Return the middle of the uncertain box and its corners."""
        size = len(self.uncertain)
        if size > _MOST_PARAMETERS:
            raise ValueError(f"family has {size} uncertain parameters; expected at most {_MOST_PARAMETERS}")
        corners = [np.array(point) for point in product((-1.0, 1.0), repeat=size)]
        return [np.zeros(size), *corners] if size else [np.zeros(0)]

    def maker(self, point: Array) -> Callable[[dict[str, float]], GeneralizedPlant]:
        """Return the function that makes the plant at a point from the physical parameters."""
        if not self.physical:
            plant = self.plant({}, point)
            return lambda values: plant
        return lambda values: self.plant(values, point)

    def plants(self) -> Plants:
        """Return the plants in the middle and at the corners."""
        points = self.points()
        labels = tuple(self.label(point) for point in points)
        found = Plants(tuple(self.maker(point) for point in points), labels, self.physical)
        _alike(list(found.given(np.zeros(len(self.physical)))))
        return found


def _alike(plants: Sequence[GeneralizedPlant]) -> None:
    """Refuse plants with different signals."""
    first = plants[0].system
    for i, plant in enumerate(plants[1:], 2):
        for kind in ("inputs", "outputs"):
            here, there = getattr(plant.system, kind), getattr(first, kind)
            if here != there:
                raise ValueError(
                    f"P: the {kind} of model {i} are {', '.join(here)}; expected those of model 1: {', '.join(there)}"
                )
