"""Lines of the benchmark that race reductions: the 200-element boom to order 10, actuators to tips."""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.benchmark.report import Row
from boomctl.benchmark.timing import Job, interleaved
from boomctl.boom import BoomParameters, spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.lti.system import Lti, state_matrices
from boomctl.reduction import reduce
from boomctl.reduction.core import structure_core
from boomctl.reduction.verify import verified_norm
from boomctl.structure import SecondOrderModel

if TYPE_CHECKING:
    import control

_SECTION = "Reduction of the boom, actuators -> tips, verification included; peers do not verify"
_TARGET = 50.0
_REFEREE_MODES = 60


def reduction_lines(
    rounds: int = 5, tell: Callable[[str], None] = lambda text: None, elements: int = 200, order: int = 10
) -> list[Row]:
    """Race ``reduce`` against ``control.balred`` and, where it is installed, pyMOR's balanced truncation.

    The error of each is the H-infinity norm of its difference from the full model, relative to that of the full model:
    verified against a core of more modes than ours reduces, whose own bound is added.
    """
    import control

    def fresh() -> SecondOrderModel:
        return spray_boom(BoomParameters(), elements=elements).select(ACTUATORS, TIPS)

    model = fresh()
    system = model.to_statespace()
    answers: dict[str, Any] = {}

    def ours(given: SecondOrderModel) -> None:
        answers["ours"] = reduce(given, order=order).system

    def balred(_: object) -> None:
        answers["control.balred"] = control.balred(system, order)

    jobs = {"ours": Job(ours, fresh), "control.balred": Job(balred)}
    if find_spec("pymor") is not None:
        jobs["pyMOR"] = Job(lambda given: answers.update({"pyMOR": _pymor(given, order)}), fresh)
    tell(f"reduction of {elements} elements to order {order}")
    times = interleaved(jobs, rounds)
    errors = {name: _error(model, answer) for name, answer in answers.items()}
    best = min(error for name, error in errors.items() if name != "ours")
    rows = []
    for name in (name for name in jobs if name != "ours"):
        wanted = name == "control.balred"
        met = times[name] >= _TARGET * times["ours"] and errors["ours"] <= best if wanted else None
        target = f">= {_TARGET:g}x, error" if wanted else ""
        job = f"{name}: {elements} elements to order {order}"
        rows.append(Row(_SECTION, job, times["ours"], times[name], target, errors["ours"], errors[name], met))
    return rows


def _error(model: SecondOrderModel, reduced: "control.StateSpace") -> float:
    """Return the verified error of a reduced system, relative to the norm of the full one."""
    core = structure_core(model, _REFEREE_MODES)
    if core is None:
        raise ValueError("the referee's core of the boom has no bound")
    nothing = Lti(core.kept.A[:0, :0], core.stable.B[:0], core.stable.C[:, :0], 0.0 * core.stable.D)
    size = verified_norm(core.stable, core.modal, nothing).lower
    return (verified_norm(core.stable, core.modal, state_matrices(reduced)).upper + core.tail) / size


def _pymor(model: SecondOrderModel, order: int) -> "control.StateSpace":
    """Return pyMOR's balanced truncation of the first-order form."""
    import control

    full = model.to_statespace()
    import_module("pymor.core.logger").set_log_levels({"pymor": "ERROR"})
    form = import_module("pymor.models.iosys").LTIModel.from_matrices(full.A, full.B, full.C, full.D)
    A, B, C, D, E = import_module("pymor.reductors.bt").BTReductor(form).reduce(order).to_matrices(format="dense")
    small = (A, B) if E is None else (np.linalg.solve(E, A), np.linalg.solve(E, B))
    return control.ss(*small, C, 0.0 * full.D if D is None else D)
