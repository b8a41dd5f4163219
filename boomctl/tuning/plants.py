"""Plants of a tuning problem: fixed ones, functions of plant parameters, or points of a family."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from boomctl.arrays import Array, balance, blocks
from boomctl.chebyshev import fitted, known_along, series, tried_points
from boomctl.checks import function_of
from boomctl.lti.rounding import COMPUTED
from boomctl.lti.system import of
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.synthesis.plants.partition import GeneralizedPlant, partition
from boomctl.tunable.structures import Physical
from boomctl.tuning.loops import ScaledPlant, without_jordan_blocks

_MOST_PARAMETERS = 6  # Uncertain parameters up to which tuning starts with all vertices of the box.
_MOST_DEGREE = 128  # largest degree of the polynomials by one parameter: 1 for springs, some tens for masses
_MOST = 2000  # plants evaluated for one polynomial at most
_CACHE_SIZE = 16  # cached sets of plants: the last few points of the search
_EXACT = 1e3  # largest error of a polynomial over rounding error: far below the tolerance of tuning

Maker = Callable[[dict[str, float]], GeneralizedPlant]


class PlantPolynomial:
    """Generalized plant whose matrices are Chebyshev series of plant parameters, normalized to -1 to 1.

    Parameters
    ----------
    make : function
        Maps normalized parameters to the plant.
    size : int
        Number of parameters.

    Raises
    ------
    ValueError
        If the plants are not polynomials.
    """

    def __init__(self, make: Callable[[Array], GeneralizedPlant], size: int) -> None:
        self._plant = make(np.zeros(size))
        self._scales = balance(self._plant.A)[1]
        matrices: dict[bytes, Array] = {}

        def at(points: Sequence[Array]) -> dict[str, Array]:
            for point in points:
                if point.tobytes() not in matrices:
                    if len(matrices) == _MOST:
                        raise ValueError(f"{_MOST} plants do not determine them")
                    s = make(point).system
                    rows = np.concatenate([1.0 / self._scales, np.ones(len(s.C))])[:, None]
                    columns = np.concatenate([self._scales, np.ones(s.B.shape[1])])
                    matrices[point.tobytes()] = rows * blocks([[s.A, s.B], [s.C, s.D]]) * columns
            return {"P": np.array([matrices[point.tobytes()] for point in points])}

        def rounding(values: Mapping[str, Array]) -> dict[str, Array | float]:
            return {"P": COMPUTED * np.abs(values["P"]).max(axis=(0, 2))[:, None]}

        wanted, middle = (
            at(tried_points(size)),
            np.random.default_rng(1).uniform(-0.5, 0.5, size),
        )  # nothing cancels there

        def count_along(axis: Array) -> int:
            """Return the number of coefficients above rounding along a parameter."""
            values = known_along(lambda places: at([np.where(axis, x, middle) for x in places]), rounding, _MOST_DEGREE)
            above = np.abs(series(values["P"])) > rounding(values)["P"]
            return int(np.flatnonzero(above.any(axis=(1, 2))).max(initial=0)) + 1

        counts = [count_along(axis) for axis in np.eye(size, dtype=bool)]
        for groups in ([[i] for i in range(size)], [range(size)]):  # sums of functions of one parameter, products
            terms, _, miss = fitted(at, counts, wanted, rounding, _EXACT, "P", groups, powers=False)
            if miss <= _EXACT:
                break
        else:
            raise ValueError(f"polynomials of degree {', '.join(str(count - 1) for count in counts)} miss them")
        p = ca.SX.sym("p", size)
        factors = [_chebyshev(p[i], count) for i, count in enumerate(counts)]
        products = ca.vertcat(
            *(ca.mtimes([ca.SX(1), *(factors[i][term.count(i)] for i in {*term})]) for term in terms["P"])
        )
        jacobian = ca.jacobian(products, p)
        self._products = ca.Function("products", [p], [products, jacobian, ca.jacobian(ca.vec(jacobian.T), p)])
        self._terms = np.array([*terms["P"].values()])
        self.degrees = tuple(max(term.count(i) for term in terms["P"]) for i in range(size))

    def scaled(self, numbers: Array, order: int) -> ScaledPlant:
        """Return the plant with balanced states, and its derivatives."""
        k, s, n, plant = len(numbers), self._plant.system, len(self._plant.A), self._plant
        products = [np.asarray(item) for item in self._products(numbers)]
        result, jacobian, hessian = (
            np.tensordot(item.reshape(len(self._terms), -1), self._terms, (0, 0)) for item in products
        )
        M = result[0]
        system = replace(s, A=without_jordan_blocks(M[:n, :n]), B=M[:n, n:], C=M[n:, :n], D=M[n:, n:])
        return ScaledPlant(system, plant.nmeas, plant.ncon, jacobian, hessian.reshape(k, k, *M.shape), order)


def _chebyshev(x: ca.SX, count: int) -> list[ca.SX]:
    """Return the first Chebyshev polynomials of a variable."""
    result = [ca.SX(1), x]
    while len(result) < count:
        result.append(2.0 * x * result[-1] - result[-2])
    return result


@dataclass(frozen=True)
class Model:
    """Plant as a function of plant parameters.

    Attributes
    ----------
    label : str
        Name of the model.
    make : function
        Maps parameter values to the plant.
    physical : tuple of Physical
        The parameters.
    """

    label: str
    make: Maker
    physical: tuple[Physical, ...]

    def original(self, numbers: Array) -> GeneralizedPlant:
        """Return the original plant for normalized parameters."""
        return self.make({item.name: item.number.value(x) for item, x in zip(self.physical, numbers, strict=True)})

    @cached_property
    def polynomial(self) -> PlantPolynomial:
        """The plant as a polynomial of the plant parameters.

        Raises
        ------
        ValueError
            If it is not a polynomial.
        """
        try:
            return PlantPolynomial(self.original, len(self.physical))
        except ValueError as error:
            names, where = ", ".join(item.name for item in self.physical), f" of {self.label}" if self.label else ""
            reason = " ".join(str(error).split())
            raise ValueError(
                f"`P` must return plants{where} whose matrices are close to polynomials of {names}, got others ({reason})."
                ' Give them the same states everywhere, as `model.to_statespace(states="coordinates")` does; or, if they have'
                " them, fewer parameters or narrower ranges."
            ) from None

    def scaled(self, numbers: Array, order: int) -> ScaledPlant:
        """Return the plant with balanced states, and its derivatives, for a controller of some order."""
        if self.physical:
            return self.polynomial.scaled(numbers, order)
        plant = self.original(numbers)
        system = plant.system.balanced()
        return ScaledPlant(replace(system, A=without_jordan_blocks(system.A)), plant.nmeas, plant.ncon, order=order)


@dataclass(frozen=True)
class Plants:
    """Generalized plants with the same signals, as functions of the same plant parameters."""

    models: tuple[Model, ...]
    physical: tuple[Physical, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the plants."""
        return tuple(model.label for model in self.models)

    def original(self, numbers: Array) -> tuple[GeneralizedPlant, ...]:
        """Return the original plants for normalized parameters."""
        return tuple(model.original(numbers) for model in self.models)

    @cached_property
    def middle(self) -> tuple[GeneralizedPlant, ...]:
        """The plants in the middle of the plant parameters' ranges.

        Raises
        ------
        ValueError
            If their signals or scales differ.
        """
        result = self.original(np.zeros(len(self.physical)))
        first = result[0].system
        for i, plant in enumerate(result[1:], 2):
            for kind in ("input", "output"):
                here, there = getattr(plant.system, f"{kind}_labels"), getattr(first, f"{kind}_labels")
                if here != there:
                    raise ValueError(
                        f"P: the {kind}s of model {i} are {', '.join(here)}; expected those of model 1:"
                        f" {', '.join(there)}"
                    )
            for label in (*plant.measurements, *plant.controls):
                here, there = ((item.scales or {}).get(label, 1.0) for item in (plant.system, first))
                if here != there:
                    raise ValueError(f"`P` must have one scale of {label!r} in all models, got {there:g} and {here:g}.")
        return result

    def scaled(self, numbers: Array, order: int) -> tuple[ScaledPlant, ...]:
        """Return the plants with balanced states, and their derivatives, for controllers of some order."""
        return self._scaled(tuple(numbers.tolist()), order)

    @cached_property
    def _scaled(self) -> Callable[[tuple[float, ...], int], tuple[ScaledPlant, ...]]:
        return lru_cache(_CACHE_SIZE)(lambda x, order: tuple(model.scaled(np.array(x), order) for model in self.models))

    @property
    def stages(self) -> tuple[str, ...]:
        """Stages on the derivatives by plant parameters."""
        if not self.physical:
            return ()
        degrees = zip(*(model.polynomial.degrees for model in self.models), strict=True)
        named = (f"{item.name} {max(degree)}" for item, degree in zip(self.physical, degrees, strict=True))
        return (f"plant parameters by polynomials of degree {', '.join(named)}",)


def partitioned(P: Any, nmeas: int | None, ncon: int | None) -> GeneralizedPlant:
    """Return a generalized plant; without measurements and controls, all of it is between disturbances and performance.

    Raises
    ------
    TypeError, ValueError
        If `P` is not a continuous, finite system, or a count is out of range.
    """
    if nmeas == 0 and ncon == 0:
        return GeneralizedPlant(of(P, "P", "StateSpace"), 0, 0)
    return partition(P, nmeas, ncon)


def build_plants(P: Any, nmeas: int | None, ncon: int | None, physical: tuple[Physical, ...]) -> Plants:
    """Return the plants, from one or several systems or functions of the plant parameters."""
    many = tuple(P) if isinstance(P, (list, tuple)) else (P,)
    if not many:
        raise ValueError("P: expected at least one generalized plant")
    if physical and not any(callable(item) and not hasattr(item, "ninputs") for item in many):
        function_of("P", many[0], f"the plant parameters ({', '.join(p.name for p in physical)})")

    def maker(item: Any) -> Maker:
        if not physical or not callable(item) or hasattr(item, "ninputs"):
            plant = partitioned(item, nmeas, ncon)
            return lambda values: plant
        make = function_of("P", item, "a mapping of plant parameters to a generalized plant")
        return lambda values: partitioned(make(values), nmeas, ncon)

    labels = ("",) if len(many) == 1 else tuple(f"model {i + 1}" for i in range(len(many)))
    return Plants(
        tuple(Model(label, maker(item), physical) for label, item in zip(labels, many, strict=True)), physical
    )


@dataclass(frozen=True)
class FamilyPlants:
    """Family of structures, and the function from a structure to a generalized plant.

    Attributes
    ----------
    family : Family
    make : function
        Maps a structure of the family to a generalized plant.
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
        """Indices of the family's uncertain parameters."""
        tuned = {item.name for item in self.physical}
        return [i for i, name in enumerate(self.family.names) if name not in tuned]

    def plant(self, values: dict[str, float], point: Array) -> GeneralizedPlant:
        """Return the generalized plant at values of the plant parameters and a point of the uncertain box."""
        delta = self.family.normalize(values)
        delta[self.uncertain] = point
        model = self.family.at(delta)
        if self.physical:  # over the same coordinates at all values
            model = SecondOrderModel.of(replace(model.structure, settled=True), model.ports)
        return partitioned(self.make(model), self.nmeas, self.ncon)

    def model(self, point: Array) -> Model:
        """Return the plant at a point of the uncertain box."""
        f = self.family
        label = ", ".join(
            f"{f.names[i]} = {0.5 * (f.low[i] + f.high[i]) + 0.5 * (f.high[i] - f.low[i]) * d:.5g}"
            for i, d in zip(self.uncertain, point, strict=True)
        )
        return Model(label, lambda values: self.plant(values, point), self.physical)

    def plants(self) -> Plants:
        """Return the plants at the center and the vertices of the uncertain box; for many parameters at the center only."""
        size = len(self.uncertain)
        corners = product((-1.0, 1.0), repeat=size) if 0 < size <= _MOST_PARAMETERS else ()
        points = [np.zeros(size), *map(np.array, corners)]
        return Plants(tuple(map(self.model, points)), self.physical)
