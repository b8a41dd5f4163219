"""User-defined starts: free parameters by name, or a controller whose matrices are all free."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import known, mapping, real, within
from boomctl.lti.system import Lti, check_scales, controller_of, is_statespace
from boomctl.tunable.structures import GAIN, Physical, StateSpace, terms
from boomctl.tuning.problem import Problem

if TYPE_CHECKING:
    from boomctl.lti.system import Controller


QUIET = 1e-2  # gains of the low-gain start, and of an additional state, over their natural size


def initial_numbers(problem: Problem, initial: "Mapping[str, float] | Controller") -> Array:
    """Return a start from parameters by name or a controller; other parameters are in the middle of their ranges or zero.

    Raises
    ------
    TypeError, ValueError
        Unknown names, numbers out of range; a controller of another structure, of too high an order, or with other signals
        or scales.
    """
    result, scales = problem.middle, problem.plants.middle[0].system.scales
    if is_statespace(initial) or hasattr(initial, "controller"):
        K = controller_of(
            initial, "a mapping of free numbers or a StateSpace", what="initial_controller", scales=scales
        )
        check_scales(K, scales)
        start, x = _of_controller(problem, K)
        result[start : start + len(x)] = x
        return result
    numbers = mapping("initial_controller", initial, "free numbers to values, or a StateSpace")
    for name in numbers:
        known("free number", name, [item.name for item in problem.free])
    for i, item in enumerate(problem.free):
        if item.name in numbers:
            value = real(f"initial_controller {item.name}", numbers[item.name])
            if item.kind != GAIN:
                within(f"initial_controller {item.name}", value, item.low, item.high)
            result[i] = item.number(value)
    return result


def _of_controller(problem: Problem, K: Lti) -> tuple[int, Array]:
    """Return the offset of a controller's free parameters, and their values; additional states have small gains."""
    parts, ports, n = terms(problem.structure), problem.ports, len(K.A)
    indices = [i for i, part in enumerate(parts) if isinstance(part, StateSpace)]
    if len(indices) != 1 or any(not isinstance(part, (StateSpace, Physical)) for part in parts):
        raise ValueError(
            f"initial_controller = a StateSpace: expected a structure tunable.state_space, got {problem.structure.text};"
            " give its free numbers by name"
        )
    wanted = parts[indices[0]]
    assert isinstance(wanted, StateSpace)
    if n > wanted.order:
        raise ValueError(f"initial_controller: expected a controller of at most {wanted.order} states, got {n}")
    if wanted.strictly_proper and K.D.any():
        raise ValueError(
            "initial_controller: expected a strictly proper controller, as the structure is, got a feedthrough"
        )
    columns = _in_order("input", K.input_labels, ports.measurements)
    K = K.between(columns, _in_order("output", K.output_labels, ports.controls)).balanced()
    numbers = [item.number(1.0) for item in StateSpace(n, wanted.strictly_proper).free(ports)]
    through = np.zeros(0) if wanted.strictly_proper else K.D.ravel()
    x, rng = np.concatenate([K.A.ravel(), K.B.ravel(), K.C.ravel(), through]) * numbers, np.random.default_rng(0)
    for order in range(n + 1, wanted.order + 1):
        x = StateSpace(order, wanted.strictly_proper).grown(x, ports, rng, QUIET)
    return sum(len(part.free(ports)) for part in parts[: indices[0]]), x


def _in_order(kind: str, mine: tuple[str, ...], theirs: tuple[str, ...]) -> list[int]:
    """Return the indices of a controller's signals in the plant's order; default names are in order already."""
    if set(mine) == set(theirs):
        return [mine.index(name) for name in theirs]
    if mine != tuple(f"{'u' if kind == 'input' else 'y'}[{i}]" for i in range(len(theirs))):
        raise ValueError(
            f"initial_controller: expected {len(theirs)} {kind}(s), {', '.join(theirs)}, got {', '.join(mine)}"
        )
    return list(range(len(mine)))
