"""The plants that one controller is tuned for: given ones, made from physical parameters, or points of a family."""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import function_of
from boomctl.lti.system import of
from boomctl.progress import Deadline
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.plants.partition import GeneralizedPlant, partition
from boomctl.tunable.structures import Physical
from boomctl.tuning.problem import ScaledPlant
from boomctl.tuning.series import PlantSeries, plant_series

_REMEMBERED = 256  # sets of plants that are kept for when they are asked for again (a choice)
_MOVING = 16  # of those that are polynomials, quickly evaluated: the last few points of the search (a choice)
_MOST_PARAMETERS = 6  # Uncertain parameters up to which tuning begins from all corners of the box.
_ENDLESS = Deadline()

Maker = Callable[[dict[str, float]], GeneralizedPlant]


@dataclass
class Plants:
    """Generalized plants as a function of physical parameters.

    Attributes
    ----------
    makers : tuple of function
        Each returns a generalized plant from values of the physical parameters.
    labels : tuple of str
        What the plants are called.
    physical : tuple of Physical
    settled : tuple of function
        The same plants, with the same states at all values as far as that can be.
    deadline : Deadline
        Until when polynomials of the plants are looked for.
    """

    makers: tuple[Maker, ...]
    labels: tuple[str, ...]
    physical: tuple[Physical, ...]
    settled: tuple[Maker, ...]
    deadline: Deadline = _ENDLESS
    _series: "list[PlantSeries | None]" = field(default_factory=list, repr=False)
    _scaled: "OrderedDict[bytes, tuple[ScaledPlant, ...]]" = field(default_factory=OrderedDict, repr=False)

    def values(self, numbers: Array) -> dict[str, float]:
        """Return physical parameters from numbers between -1 and 1."""
        return {item.name: item.number.value(x) for item, x in zip(self.physical, numbers, strict=True)}

    def given(self, numbers: Array) -> tuple[GeneralizedPlant, ...]:
        """Return the plants as the user means them."""
        values = self.values(numbers)
        return tuple(make(values) for make in self.makers)

    def scaled(self, numbers: Array) -> tuple[ScaledPlant, ...]:
        """Return the plants with balanced states."""
        key = np.asarray(numbers, float).tobytes()
        if key not in self._scaled:
            self._scaled[key] = self._made(numbers)
            while len(self._scaled) > (_MOVING if all(self.series) else _REMEMBERED):
                self._scaled.popitem(last=False)
        self._scaled.move_to_end(key)
        return self._scaled[key]

    @property
    def series(self) -> "tuple[PlantSeries | None, ...]":
        """Polynomials of the physical parameters, None where a plant is none; found when asked for, once."""
        for maker, settled in list(zip(self.makers, self.settled, strict=True))[len(self._series) :]:
            given, make = (lambda x, each=item: each(self.values(x)) for item in (maker, settled))
            size = len(self.physical)
            self._series.append(plant_series(make, given, size, lambda: self.deadline.over) if size else None)
        return tuple(self._series)

    @property
    def stages(self) -> tuple[str, ...]:
        """How derivatives by physical parameters are known."""
        result = [item.degrees for item in self.series if item is not None]
        if not self.physical:
            return ()
        if len(result) < len(self.labels):
            return ("physical parameters by differences",)
        degrees = ", ".join(
            f"{item.name} {max(d)}" for item, d in zip(self.physical, zip(*result, strict=True), strict=True)
        )
        return (f"physical parameters by polynomials of degree {degrees}",)

    def _made(self, numbers: Array) -> tuple[ScaledPlant, ...]:
        values, both = self.values(numbers), zip(self.makers, self.series, strict=True)
        return tuple(
            ScaledPlant.of(make(values)) if series is None else series.scaled(numbers) for make, series in both
        )

    def with_more(self, maker: Maker, settled: Maker, label: str) -> "Plants":
        """Return the plants and one more."""
        makers, all_settled = (*self.makers, maker), (*self.settled, settled)
        return Plants(makers, (*self.labels, label), self.physical, all_settled, self.deadline, list(self._series))


def partitioned(P: Any, nmeas: int | None, ncon: int | None) -> GeneralizedPlant:
    """Return a generalized plant; without measurements and controls, all of it is between disturbances and performance.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time, not finite; counts out of range.
    """
    if nmeas == 0 and ncon == 0:
        return GeneralizedPlant(of(P, "P", "StateSpace"), 0, 0)
    return partition(P, nmeas, ncon)


def made_plants(
    P: Sequence[Any], nmeas: int | None, ncon: int | None, physical: tuple[Physical, ...], deadline: Deadline = _ENDLESS
) -> Plants:
    """Return given plants, or those that functions of the physical parameters make, where there are such."""

    def maker(each: Any) -> Maker:
        if not physical or not callable(each) or hasattr(each, "ninputs"):
            plant = partitioned(each, nmeas, ncon)
            return lambda values: plant
        make = function_of("P", each, "a mapping of physical parameters to a generalized plant")
        return lambda values: partitioned(make(values), nmeas, ncon)

    labels = ("",) if len(P) == 1 else tuple(f"model {i + 1}" for i in range(len(P)))
    makers = tuple(maker(item) for item in P)
    plants = Plants(makers, labels, physical, makers, deadline)
    _alike(list(plants.given(np.zeros(len(physical)))))
    return plants


@dataclass(frozen=True)
class FamilyPlants:
    """A family, and what makes a generalized plant of each of its structures.

    Attributes
    ----------
    family : Family
    make : function
        From a structure of the family to a generalized plant.
    nmeas, ncon : int or None
    physical : tuple of Physical
        Parameters of the family that are tuned; the others are uncertain.
    """

    family: Family
    make: Callable[[Any], Any]
    nmeas: int | None
    ncon: int | None
    physical: tuple[Physical, ...]

    @property
    def uncertain(self) -> list[int]:
        """Places of the family's uncertain parameters."""
        tuned = {item.name for item in self.physical}
        return [i for i, name in enumerate(self.family.names) if name not in tuned]

    def delta(self, values: dict[str, float], point: Array) -> Array:
        """Return the family's own coordinates of a point of the uncertain box, at values of the physical parameters."""
        result = self.family.normalize(values)
        result[self.uncertain] = point
        return result

    def plant(self, values: dict[str, float], point: Array, settled: bool = False) -> GeneralizedPlant:
        """Return the generalized plant at a point of the uncertain box, if ``settled`` over the family's coordinates."""
        model = self.family.at(self.delta(values, point))
        if settled:
            model = SecondOrderModel.of(replace(model.structure, settled=True), model.ports)
        return partitioned(self.make(model), self.nmeas, self.ncon)

    def label(self, point: Array) -> str:
        """Return what a point is called."""
        f = self.family
        result = (
            f"{f.names[i]} = {0.5 * (f.low[i] + f.high[i]) + 0.5 * (f.high[i] - f.low[i]) * d:.5g}"
            for i, d in zip(self.uncertain, point, strict=True)
        )
        return ", ".join(result)

    def points(self) -> list[Array]:
        """Return the middle of the uncertain box and its corners; of many parameters the middle alone."""
        size = len(self.uncertain)
        corners = product((-1.0, 1.0), repeat=size) if 0 < size <= _MOST_PARAMETERS else ()
        return [np.zeros(size), *(np.array(point) for point in corners)]

    def maker(self, point: Array, settled: bool = False) -> Maker:
        """Return the function that makes the plant at a point from the physical parameters."""
        if not self.physical:
            plant = self.plant({}, point)
            return lambda values: plant
        return lambda values: self.plant(values, point, settled)

    def plants(self, deadline: Deadline = _ENDLESS) -> Plants:
        """Return the plants in the middle and at the corners."""
        points = self.points()
        labels = tuple(self.label(point) for point in points)
        makers, settled = (tuple(self.maker(point, item) for point in points) for item in (False, True))
        result = Plants(makers, labels, self.physical, settled, deadline)
        _alike(list(result.given(np.zeros(len(self.physical)))))
        return result


def _alike(plants: Sequence[GeneralizedPlant]) -> None:
    """Check that plants have the same signals and scales."""
    first = plants[0].system
    for i, plant in enumerate(plants[1:], 2):
        for kind in ("input", "output"):
            here, there = getattr(plant.system, f"{kind}_labels"), getattr(first, f"{kind}_labels")
            if here != there:
                raise ValueError(
                    f"P: the {kind}s of model {i} are {', '.join(here)}; expected those of model 1: {', '.join(there)}"
                )
        for label in (*plant.measurements, *plant.controls):
            here, there = ((item.scales or {}).get(label, 1.0) for item in (plant.system, first))
            if here != there:
                raise ValueError(f"`P` must have one scale of {label!r} in all models, got {there:g} and {here:g}.")
