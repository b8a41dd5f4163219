"""Where the search begins: quiet controllers, random ones, and what a lower order reached, with a state more."""

import numpy as np

from boomctl.arrays import Array
from boomctl.tunable.structures import (
    GAIN,
    PHYSICAL,
    ControllerForm,
    Decentralized,
    Gain,
    Ports,
    Series,
    StateSpace,
    Sum,
)

_LEVELS = (-2.0, 1.0)  # powers of ten between which gains are drawn, over their natural size (a choice)
_DAMPED = (0.1, 1.0)  # damping ratios of a drawn controller's modes (a choice)
_QUIET = 1e-2  # gains of the quiet start, over their natural size (a choice)


def drawn(structure: ControllerForm, ports: Ports, rng: np.random.Generator, *, quiet: bool) -> Array:
    """Return free numbers to begin with: gains of one size, drawn, rates within the plant's band."""
    level = _QUIET if quiet else float(10.0 ** rng.uniform(*_LEVELS))
    return _drawn(structure, ports, rng, level, quiet)


def _drawn(structure: ControllerForm, ports: Ports, rng: np.random.Generator, level: float, quiet: bool) -> Array:
    if isinstance(structure, Sum):
        return np.concatenate([_drawn(part, ports, rng, level, quiet) for part in structure.parts])
    if isinstance(structure, Decentralized):
        loops = structure._loops(ports)
        result = [_drawn(part, ports.part(rows, columns), rng, level, quiet) for rows, columns, part in loops]
        return result[0] if structure.shared else np.concatenate(result)
    if isinstance(structure, Series):
        behind, before = structure._ports(ports)
        root = level if structure.last.square or structure.first.square else level**0.5
        parts = (_drawn(structure.last, behind, rng, root, quiet), _drawn(structure.first, before, rng, root, quiet))
        return np.concatenate(parts)
    if isinstance(structure, StateSpace):
        return _state_space(structure, ports, rng, level)
    result = []
    band = np.log([ports.slowest, ports.fastest])
    for free in structure.free(ports):
        low, high = free.ends()
        if free.kind == GAIN:
            result.append(level * rng.normal())
        elif free.kind == PHYSICAL:
            result.append(0.0 if quiet else rng.uniform(low, high))
        else:
            inner = (max(low, band[0]), min(high, band[1])) if free.kind == "rate" else (low, high)
            ends = inner if inner[0] < inner[1] else (low, high)
            result.append(rng.uniform(*ends))
    return np.array(result)


def _state_space(structure: StateSpace, ports: Ports, rng: np.random.Generator, level: float) -> Array:
    (rows, columns), n = ports.shape, structure.order
    A = np.zeros((n, n))
    rates = np.exp(rng.uniform(np.log(ports.slowest), np.log(ports.fastest), n)) / ports.rate
    k = 0
    while k < n:
        if k + 1 < n and rng.random() < 0.7:
            damping = rng.uniform(*_DAMPED)
            swing = rates[k] * np.sqrt(1.0 - damping**2)
            A[k : k + 2, k : k + 2] = [[-damping * rates[k], swing], [-swing, -damping * rates[k]]]
            k += 2
        else:
            A[k, k] = -rates[k]
            k += 1
    size = np.sqrt(np.maximum(np.abs(A).sum(axis=1), 1e-3))  # so that a mode's own gain is about the level
    B, C = rng.normal(size=(n, columns)) * size[:, None], level * rng.normal(size=(rows, n)) * size
    parts = [A.ravel(), B.ravel(), C.ravel()]
    if not structure.strictly_proper:
        parts.append(level * rng.normal(size=rows * columns))
    return np.concatenate(parts)


def lower(structure: ControllerForm) -> ControllerForm | None:
    """Return the structure with a state less, where there is one."""
    if isinstance(structure, StateSpace):
        if structure.order == 1:
            return None if structure.strictly_proper else Gain()
        return StateSpace(structure.order - 1, structure.strictly_proper)
    if isinstance(structure, Sum):
        for i, part in enumerate(structure.parts):
            less = lower(part)
            if less is not None:
                return Sum((*structure.parts[:i], less, *structure.parts[i + 1 :]))
    return None


def grown(structure: ControllerForm, ports: Ports, x: Array, rng: np.random.Generator, size: float = _QUIET) -> Array:
    """Return what `lower` reached as numbers of the structure itself: a state more, which does next to nothing yet.

    Of ``size`` zero it is driven, but does not act: the controller is the same one.
    """
    if isinstance(structure, Sum):
        result, start = [], 0
        done = False
        for part in structure.parts:
            less = None if done else lower(part)
            count = len((part if less is None else less).free(ports))
            mine = x[start : start + count]
            result.append(mine if less is None else grown(part, ports, mine, rng, size))
            start, done = start + count, done or less is not None
        return np.concatenate(result)
    assert isinstance(structure, StateSpace)
    (rows, columns), n = ports.shape, structure.order
    old = n - 1
    A, B, C = np.zeros((n, n)), np.zeros((n, columns)), np.zeros((rows, n))
    A[:old, :old] = x[: old * old].reshape(old, old)
    B[:old] = x[old * old : old * (old + columns)].reshape(old, columns)
    C[:, :old] = x[old * (old + columns) : old * (old + columns + rows)].reshape(rows, old)
    rate = np.exp(rng.uniform(np.log(ports.slowest), np.log(ports.fastest))) / ports.rate
    A[-1, -1] = -rate
    B[-1] = rng.normal(size=columns) * np.sqrt(rate)
    C[:, -1] = size * rng.normal(size=rows) * np.sqrt(rate)
    parts = [A.ravel(), B.ravel(), C.ravel()]
    if not structure.strictly_proper:
        parts.append(x[old * (old + columns + rows) :])
    return np.concatenate(parts)
