"""Families of structures over what measurements leave open: boxes that hold all parameters at once."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from boomctl.checks import instance, nonnegative, sequence
from boomctl.identification.blocks import confident, limits
from boomctl.identification.free import changed
from boomctl.structure.families import Family, PolynomialFamily
from boomctl.structure.matrices import Structure
from boomctl.structure.model import SecondOrderModel

Range = tuple[float, float]


def box(result: Any, probability: float, margin: float) -> dict[str, Range]:
    """Return ranges that hold all parameters at once with a probability, each widened by a share (Bonferroni)."""
    level = confident("probability", probability)
    share, found = nonnegative("margin", margin), {}
    intervals, freedoms = result.uncertain
    for name, (value, low, high) in intervals.items():
        if not np.isfinite([low, high]).all() or (low <= 0.0 < value):
            raise ValueError(
                f"family: expected parameters that the measurements bound, got {name} from {low:.4g} to {high:.4g};"
                " fit without it, or measure what shows it"
            )
        freedom = np.array(freedoms[name])
        each = 1.0 - (1.0 - level) / len(intervals)
        times = float(limits(each, freedom) / limits(result.confidence, freedom))
        if low > 0.0:
            ends = value * (low / value) ** times / (1.0 + share), value * (high / value) ** times * (1.0 + share)
        else:
            ends = (
                value + times * (low - value) - share * abs(value),
                value + times * (high - value) + share * abs(value),
            )
        if not ends[0] < ends[1]:
            raise ValueError(
                f"family: {name} has no width at {value:.6g}, as of exact data; expected a margin above zero"
            )
        found[name] = ends
    return found


def union(result: Any, others: Sequence[Any], probability: float, margin: float) -> dict[str, Range]:
    """Return the smallest ranges that contain the boxes of several results of one kind."""
    ranges = box(result, probability, margin)
    for other in sequence("union_with", others, type(result).__name__):
        beside = box(instance("union_with", other, type(result)), probability, margin)
        if set(beside) != set(ranges):
            raise ValueError(
                f"`union_with` must be results of the same parameters, {', '.join(ranges)}, got {', '.join(beside)}."
            )
        ranges = {name: (min(a, beside[name][0]), max(b, beside[name][1])) for name, (a, b) in ranges.items()}
    return ranges


def of_fit(make: Any, parameters: Any, values: Mapping[str, float], ranges: Mapping[str, Range]) -> Family:
    """Return the structures that a function makes of fitted parameters, over ranges of them."""
    if make is None:
        raise ValueError("build = None: expected a function, as that of the fit did not pickle")
    if isinstance(make, Family):
        given: Family = make
        return PolynomialFamily.through(ranges, lambda other: given.at(given.deltas({**values, **other})), 32)

    def at(values: Mapping[str, float]) -> Any:
        return make(changed(parameters, values))

    middle = at({})
    if hasattr(middle, "structure") and hasattr(middle, "family"):  # a hub-beam
        return middle.family(**ranges)
    if not isinstance(middle, SecondOrderModel):
        raise TypeError(
            f"build: expected a function that makes a SecondOrderModel or a hub-beam of the parameters, got one that makes"
            f" {type(middle).__name__}; say `build=` of the family"
        )
    return PolynomialFamily.through(ranges, at)


def of_modes(
    model: SecondOrderModel | None, modes: Sequence[tuple[float, float]], ranges: Mapping[str, Range]
) -> Family:
    """Return the structure of modes (frequency [Hz], damping) over ranges of these."""
    if model is None:
        raise ValueError(
            "family: expected an identification with a structure (`model`): of outputs that are displacements, and of modes"
            " that are real; where a delay of half a sample makes them complex, intersample='zoh' removes it"
        )

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        C, K = np.array(model.C), np.array(model.K)
        for k, mode in enumerate(modes):
            hz, damping = (values.get(name, value) for name, value in zip(names_of_mode(k), mode, strict=True))
            rate = 2.0 * np.pi * hz / np.sqrt(1.0 - damping**2)
            C[k, k], K[k, k] = 2.0 * damping * rate, rate**2
        return SecondOrderModel.of(Structure.of(model.M, C, K, model.coordinates), model.ports)

    return PolynomialFamily.through(ranges, make)


def names_of_mode(k: int) -> tuple[str, str]:
    """Return the names of frequency [Hz] and damping ratio of a mode, from zero."""
    return f"mode_{k + 1}_hz", f"mode_{k + 1}_damping"
