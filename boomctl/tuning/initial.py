"""Starts of the user's own: free numbers by name, or a controller whose matrices are all free."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array, balance
from boomctl.checks import known, mapping, real, within
from boomctl.lti.system import Lti, check_scales, controller_of, is_statespace
from boomctl.tunable.structures import GAIN, Physical, StateSpace, terms
from boomctl.tuning.problem import Problem

if TYPE_CHECKING:
    from boomctl.lti.system import Controller

_QUIET = 1e-2  # gains of a state more, over their natural size (a choice)


def initial_numbers(
    problem: Problem, given: "Mapping[str, float] | Controller", scales: Mapping[str, float] | None
) -> Array:
    """Return a start that is given by name or as a controller; what is left out is in the middle or zero.

    ``scales`` are those of the plant, and of the controller.

    Raises
    ------
    TypeError, ValueError
        Unknown names, numbers out of range; a controller of another structure, of too high an order, or with other signals
        or scales.
    """
    if is_statespace(given) or hasattr(given, "controller"):
        K = controller_of(given, "a mapping of free numbers or a StateSpace", what="initial_controller", scales=scales)
        check_scales(K, scales)
        return _of_controller(problem, K)
    names = [item.name for item in problem.free]
    for name in mapping("initial_controller", given, "free numbers to values, or a StateSpace"):
        known("free number", name, names)
    numbers: Mapping[str, float] = given  # type: ignore[assignment]
    x = []
    for item, low, high in zip(problem.free, problem.low, problem.high, strict=True):
        if item.name not in numbers:
            x.append(0.0 if item.kind == GAIN else 0.5 * (low + high))
            continue
        value = real(f"initial_controller {item.name}", numbers[item.name])
        if item.kind != GAIN:
            within(f"initial_controller {item.name}", value, item.low, item.high)
        x.append(item.number(value))
    return np.array(x)


def _of_controller(problem: Problem, K: Lti) -> Array:
    parts = terms(problem.structure)
    free = [part for part in parts if isinstance(part, StateSpace)]
    if len(free) != 1 or any(not isinstance(part, (StateSpace, Physical)) for part in parts):
        raise ValueError(
            f"initial_controller = a StateSpace: expected a structure tunable.state_space, got {problem.structure.text};"
            " give its free numbers by name"
        )
    K = _signals(problem, K)
    wanted, n = free[0], len(K.A)
    if n > wanted.order:
        raise ValueError(f"initial_controller: expected a controller of at most {wanted.order} states, got {n}")
    if wanted.strictly_proper and K.D.any():
        raise ValueError(
            "initial_controller: expected a strictly proper controller, as the structure is, got a feedthrough"
        )
    result, start = [], 0
    for part in parts:
        size = len(part.free(problem.ports))
        ends = slice(start, start + size)
        middle = 0.5 * (problem.low[ends] + problem.high[ends])
        result.append(_numbers(problem, K, wanted) if part is wanted else middle)
        start += size
    return np.concatenate(result)


def _signals(problem: Problem, K: Lti) -> Lti:
    """Return the controller with its signals in the plant's order; those that were never named are in order already."""
    ports, result = problem.ports, []
    for kind, mine, theirs in (
        ("input", K.input_labels, ports.measurements),
        ("output", K.output_labels, ports.controls),
    ):
        if len(mine) != len(theirs):
            raise ValueError(
                f"initial_controller: expected {len(theirs)} {kind}(s), {', '.join(theirs)}, got {len(mine)}: "
                f"{', '.join(mine)}"
            )
        unnamed = tuple(f"{'u' if kind == 'input' else 'y'}[{i}]" for i in range(len(mine)))
        if set(mine) == set(theirs):
            result.append([mine.index(name) for name in theirs])
        elif mine == unnamed:
            result.append(list(range(len(mine))))
        else:
            other = next(name for name in mine if name not in theirs)
            raise ValueError(
                f"initial_controller: {kind} {other!r} is none of the plant's: expected {', '.join(theirs)}"
            )
    columns, rows = result
    return Lti(K.A, K.B[:, columns], K.C[rows], K.D[np.ix_(rows, columns)])


def _numbers(problem: Problem, K: Lti, wanted: StateSpace) -> Array:
    """Return the free numbers of a controller, its states balanced, and further ones that do next to nothing yet."""
    ports = problem.ports
    A, B, C = K.A / ports.rate, K.B * ports.reads / ports.rate, K.C / ports.acts[:, None]
    states = balance(A)[1]
    parts = [(A * states / states[:, None]).ravel(), (B / states[:, None]).ravel(), (C * states).ravel()]
    if not wanted.strictly_proper:
        parts.append((K.D * ports.reads / ports.acts[:, None]).ravel())
    x, rng = np.concatenate(parts), np.random.default_rng(0)
    for order in range(len(A) + 1, wanted.order + 1):
        x = StateSpace(order, wanted.strictly_proper).grown(x, ports, rng, _QUIET)
    return x
