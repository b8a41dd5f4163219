"""Families of structures over confidence boxes of parameters."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import instance, nonnegative, sequence, warn_user
from boomctl.identification.free import changed, function_of_parameters
from boomctl.identification.intervals import confident, limits
from boomctl.identification.modal.search import MOST_DAMPED
from boomctl.structure.families import Family, PolynomialFamily, Slope
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel

Range = tuple[float, float]

_SAME_MODE = 0.1  # Relative difference of frequencies below which modes of two records may be one.


def box(result: Any, probability: float, margin: float) -> dict[str, Range]:
    """Return simultaneous confidence ranges of all parameters (Bonferroni), widened by a fraction."""
    level = confident("probability", probability)
    fraction, ranges = nonnegative("margin", margin), {}
    intervals, dofs = result._uncertain
    for name, (value, low, high) in intervals.items():
        if not np.isfinite([low, high]).all() or (low <= 0.0 < value):
            advice = "fit without it, or measure what shows it" if dofs[name] else "with dof = 0, set error_std"
            raise ValueError(
                f"family: expected parameters that the measurements bound, got {name} from {low:.4g} to {high:.4g};"
                f" {advice}"
            )
        dof = np.array(dofs[name])
        item = 1.0 - (1.0 - level) / len(intervals)
        times = float(limits(item, dof) / limits(result.confidence_level, dof))
        if low > 0.0:
            ends = value * (low / value) ** times / (1.0 + fraction), value * (high / value) ** times * (1.0 + fraction)
        else:
            ends = (
                value + times * (low - value) - fraction * abs(value),
                value + times * (high - value) + fraction * abs(value),
            )
        if not ends[0] < ends[1]:
            raise ValueError(
                f"family: {name} has no width at {value:.6g}, as of exact data; expected a margin above zero"
            )
        ranges[name] = ends
    return ranges


def union(
    result: Any,
    others: Sequence[Any],
    probability: float,
    margin: float,
    paired: Callable[[Any, Any], Mapping[str, str]] | None = None,
) -> dict[str, Range]:
    """Return the smallest ranges that contain the boxes of several results of one kind.

    ``paired`` returns which parameter of another result each parameter is, where results need not have the same ones.
    """
    ranges = box(result, probability, margin)
    for other in sequence("union_with", others, type(result).__name__):
        limits_there = box(instance("union_with", other, type(result)), probability, margin)
        if paired is None and set(limits_there) != set(ranges):
            raise ValueError(
                f"`union_with` must be results of the same parameters, {', '.join(ranges)}, got {', '.join(limits_there)}."
            )
        partners = dict.fromkeys(ranges) if paired is None else paired(result, other)
        for name, partner in partners.items():
            low, high = limits_there[partner or name]
            ranges[name] = min(ranges[name][0], low), max(ranges[name][1], high)
    return ranges


def paired_modes(result: Any, other: Any) -> dict[str, str]:
    """Return the names that parameters of modes have in another identification, whose modes are paired by frequency.

    Warns
    -----
    BoomctlWarning
        Modes of the other one without a partner: the family does not have them.
    """
    own, there = (np.log([mode.frequency_hz for mode in item.modes]) for item in (result, other))
    difference = np.abs(own[:, None] - there)
    pairs = [
        (k, j)
        for k, j in enumerate(difference.argmin(axis=1).tolist())
        if difference[:, j].argmin() == k and difference[k, j] < _SAME_MODE
    ]
    alone = [mode.frequency_hz for j, mode in enumerate(other.modes) if j not in {j for _, j in pairs}]
    if alone:
        warn_user(
            f"The family has no mode for those of `union_with` at {', '.join(f'{hz:.5g}' for hz in alone)} Hz."
            " Identify all records with the same modes."
        )
    paired = {a: b for k, j in pairs for a, b in zip(names_of_mode(k), names_of_mode(j), strict=True)}
    both = min(len(result.real_poles), len(other.real_poles))
    return paired | {name: name for name in map(name_of_real_pole, range(both))}


def of_fit(make: Any, parameters: Any, ranges: Mapping[str, Range]) -> Family:
    """Return the structures that a function makes of fitted parameters, over ranges of them."""
    if make is None:
        raise ValueError("model = None: expected a function, as that of the fit did not pickle")
    build = function_of_parameters(make)

    def at(values: Mapping[str, float]) -> Any:
        return build(changed(parameters, values))

    middle = at({})
    if hasattr(middle, "to_second_order") and hasattr(middle, "family"):  # a hub-beam
        return middle.family(**ranges)
    if not isinstance(middle, SecondOrderModel):
        raise TypeError(
            f"model: expected a function that makes a SecondOrderModel or a hub-beam of the parameters, got one that makes"
            f" {type(middle).__name__}; say `model=` of the family"
        )
    return PolynomialFamily.from_function(ranges, at, 32)


def of_modes(
    model: SecondOrderModel,
    modes: Sequence[tuple[float, float]],
    ranges: Mapping[str, Range],
    real_poles: Sequence[float] = (),
) -> PolynomialFamily:
    """Return a modal structure over ranges of its modes (frequency [Hz], damping) and of the rates of its real poles [rad/s].

    A coordinate depends on the parameters of its own poles alone: the polynomials of each are found by themselves, so that
    their number grows as that of the modes.  What acts on coordinates and what outputs read of them stays.
    """
    dampings = {names_of_mode(k)[1] for k in range(len(modes))}
    ranges = {name: (low, min(high, MOST_DAMPED) if name in dampings else high) for name, (low, high) in ranges.items()}
    known = {name: value for k, mode in enumerate(modes) for name, value in zip(names_of_mode(k), mode, strict=True)}
    known |= {name_of_real_pole(k): -pole for k, pole in enumerate(real_poles)}
    groups: dict[tuple[str, ...], list[int]] = {}
    for position, name in enumerate(model.coordinates):
        groups.setdefault(_parameters_of(name), []).append(position)
    names, C, K = tuple(ranges), np.array(model.C), np.array(model.K)
    terms: dict[tuple[int, ...], Array] = {}
    for parameters, positions in groups.items():
        own = {name: ranges[name] for name in parameters if name in ranges}
        if not own:
            continue
        block = PolynomialFamily.from_function(own, _alone(parameters, known, float(C[positions[0], positions[0]])))
        C[positions, positions], K[positions, positions] = block.nominal.C[0, 0], block.nominal.K[0, 0]
        at = [names.index(name) for name in own]
        for power, change in block.coefficients:
            total = terms.setdefault(tuple(sorted(at[i] for i in power)), np.zeros((2, model.ncoordinates)))
            total[:, positions] += np.array([[change.C[0, 0]], [change.K[0, 0]]])
    low, high = np.array(list(ranges.values()), float).T
    center = SecondOrderModel.of(Structure.of(model.M, C, K, model.coordinates), model.ports)
    still, unmoved = np.zeros_like(C), np.zeros_like(model.ports.B)
    changes = [(power, Slope(still, np.diag(terms[power][0]), np.diag(terms[power][1]), unmoved)) for power in terms]
    return PolynomialFamily(names, low, high, center, tuple(sorted(changes, key=lambda term: (len(term[0]), term[0]))))


def _alone(
    parameters: Sequence[str], known: Mapping[str, float], damping: float
) -> Callable[[Mapping[str, float]], SecondOrderModel]:
    """Return the function that makes a coordinate of mass one with given poles, damped as much at the known ones."""
    second = damping - sum(known[name] for name in parameters)  # Rate of the second pole of a single real pole.

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        point = [values.get(name, known[name]) for name in parameters]
        if parameters[0].startswith("mode"):
            rate = 2.0 * np.pi * point[0] / np.sqrt(1.0 - point[1] ** 2)
            K, C = rate**2, 2.0 * point[1] * rate
        else:
            first, last = point if len(point) == 2 else (*point, second)
            K, C = first * last, first + last
        return SecondOrderModel([[1.0]], [[C]], [[K]])

    return make


def names_of_mode(k: int) -> tuple[str, str]:
    """Return the names of frequency [Hz] and damping ratio of a mode, from zero."""
    return f"mode_{k + 1}_hz", f"mode_{k + 1}_damping"


def name_of_real_pole(k: int) -> str:
    """Return the name of the rate of a real pole [rad/s], from zero."""
    return f"real_pole_{k + 1}"


def _parameters_of(coordinate: str) -> tuple[str, ...]:
    """Return the names of the parameters of a coordinate of a modal structure; "outside" and a rigid body have none."""
    base = coordinate.partition(".")[0]
    if base.startswith("mode_"):
        return names_of_mode(int(base.removeprefix("mode_")) - 1)
    if base.startswith("real_pole_"):
        return tuple(name_of_real_pole(int(number) - 1) for number in base.removeprefix("real_pole_").split("_"))
    return ()
