"""The boom reduced: order and method against the error that is left."""

from collections.abc import Iterator
from functools import cache, partial
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.boom import our_boom, pymor_model
from boomctl.lab.benchmark.promise import Who, no_less_exact, times_as_fast
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, asked, missing, there
from boomctl.lti.python_control import control
from boomctl.lti.system import Lti, of
from boomctl.reduction.core import structure_core
from boomctl.reduction.reduce import reduce
from boomctl.reduction.verify import verified_norm
from boomctl.structure.model import SecondOrderModel

_ELEMENTS: dict[Extent, int] = {"quick": 50, "whole": 100}  # of the boom that is reduced
_REFEREE_MODES: dict[Extent, int] = {"quick": 30, "whole": 60}  # of the core that judges; the bound of others is added
_METHODS: dict[Extent, tuple[str, ...]] = {
    "quick": ("balanced", "modal"),
    "whole": ("balanced", "singular-perturbation", "hankel", "modal", "second-order"),
}
# of ours; below 4 nothing of the yaw and the jolt is left, above 30 all errors are rounding (measured)
_ORDERS: dict[Extent, tuple[int, ...]] = {"quick": (6, 10), "whole": (4, 6, 8, 10, 14, 20, 30)}
_PEER_ORDERS: dict[Extent, tuple[int, ...]] = {"quick": (10,), "whole": (4, 6, 10, 20, 30)}
_FINE: dict[Extent, int] = {"quick": 60, "whole": 200}  # elements of the fine mesh
_FINE_ORDER = 10  # to which it is reduced
_RATIO, _RACED = 50.0, 200  # of balred's run time over ours, and the elements from which on that was promised
_AS_EXACT = 1.01  # times balred's error that ours may have: the bound of what the referee leaves out is in both
_IRKA_STEPS = 30  # of IRKA at most: where it has not converged by then, its answer counts as it is


def boom_reduction(extent: Extent) -> Scene:
    """Return the scene of the boom's reduction."""
    return _scene("boom-reduction", extent, _ELEMENTS[extent], _METHODS[extent], _ORDERS[extent], _PEER_ORDERS[extent])


def boom_reduction_fine(extent: Extent) -> Scene:
    """Return the scene of a fine mesh reduced to one order, by balancing."""
    return _scene("boom-reduction-fine", extent, _FINE[extent], ("balanced",), (_FINE_ORDER,), (_FINE_ORDER,), few=True)


def _scene(
    key: str,
    extent: Extent,
    elements: int,
    methods: tuple[str, ...],
    orders: tuple[int, ...],
    peer_orders: tuple[int, ...],
    few: bool = False,
) -> Scene:
    p = BoomParameters()
    judge = cache(lambda: referee(_full(p, elements, 0.0), _REFEREE_MODES[extent]))
    ours, balred = Who("reduce, balanced", "order 10"), Who("control.balred, truncate", "order 10")
    return Scene(
        key=key,
        title=f"The spray boom of {elements} elements reduced",
        question=f"From the boom's parameters, by {elements} finite elements, to a small system, actuators -> tips.",
        measure="H-infinity norm of the difference from the full model over that of the full model, verified against a core"
        f" of {_REFEREE_MODES[extent]} modes, the bound of all others added.",
        settings=(*_ours(p, elements, methods, orders), *_others(p, elements, peer_orders, few or extent == "quick")),
        error=lambda reduced: judge()(reduced),
        missing=missing(pyMOR="pymor", slycot="slycot"),
        remarks=(
            "Ours verifies the error of what it returns within the time shown; the others do not.",
            "Where others are ahead, at high orders: what a small core leaves out is no longer small beside the error then,"
            " and ours balances one of more modes anew.",
            "Others are given the dense first-order matrices of our model; in cold calls with their making.",
        ),
        promises=(
            *((times_as_fast(ours, balred, _RATIO, "cold"),) if elements >= _RACED else ()),
            no_less_exact(ours, balred, _AS_EXACT),
        ),
        shows="promises" if few else "front",
    )


def referee(model: SecondOrderModel, modes: int) -> Any:
    """Return what judges a reduced system: its verified error, relative to the norm of the full one.

    Raises
    ------
    ValueError
        The model has no core with a bound.
    """
    core = structure_core(model, modes)
    if core is None:
        raise ValueError("the referee's core of the boom has no bound")
    nothing = Lti(core.kept.A[:0, :0], core.stable.B[:0], core.stable.C[:, :0], 0.0 * core.stable.D)
    size = verified_norm(core.stable, core.modal, nothing).lower

    def error(reduced: Any) -> float:
        return (verified_norm(core.stable, core.modal, of(reduced).balanced()).upper + core.tail) / size

    return error


def _full(p: BoomParameters, elements: int, change: float) -> SecondOrderModel:
    return our_boom(p, change, elements=elements).select(ACTUATORS, TIPS)


def _ours(p: BoomParameters, elements: int, methods: tuple[str, ...], orders: tuple[int, ...]) -> Iterator[Setting]:
    def answer(order: int, method: str, model: SecondOrderModel) -> Any:
        found = reduce(model, order, method).system
        return found.to_statespace() if isinstance(found, SecondOrderModel) else found

    for method in methods:
        for order in orders:
            call = f'bc.reduce(bc.spray_boom(p, elements={elements}).select(actuators, tips), {order}, "{method}")'
            made, ask = partial(_full, p, elements), partial(answer, order, method)
            yield asked(f"reduce, {method}", f"order {order}", made, ask, ours=True, call=call)


def _others(p: BoomParameters, elements: int, orders: tuple[int, ...], few: bool) -> Iterator[Setting]:
    def peer(name: str, order: int, answer: Any) -> Setting:
        def system(change: float) -> Any:
            return _full(p, elements, change).to_statespace()

        return asked(name, f"order {order}", system, lambda full: answer(full, order))

    for order in orders:
        if there("slycot"):
            yield peer("control.balred, truncate", order, control.balred)
        if there("pymor"):
            yield peer("pyMOR, balanced truncation", order, balanced_by_pymor)
            if not few:
                yield peer("pyMOR, IRKA", order, _irka)
    if there("slycot") and not few:
        for order in orders:
            yield peer(
                "control.balred, matchdc", order, lambda system, order: control.balred(system, order, method="matchdc")
            )


def balanced_by_pymor(full: Any, order: int) -> Any:
    """Return pyMOR's balanced truncation of the first-order form."""
    form = pymor_model(full.A, full.B, full.C, full.D)
    return _plain(import_module("pymor.reductors.bt").BTReductor(form).reduce(order), full.D)


def _irka(full: Any, order: int) -> Any:
    form = pymor_model(full.A, full.B, full.C, full.D)
    reductor = import_module("pymor.reductors.h2").IRKAReductor(form)
    return _plain(reductor.reduce(order, maxit=_IRKA_STEPS), full.D)


def _plain(reduced: Any, through: Array) -> Any:
    A, B, C, D, E = reduced.to_matrices(format="dense")
    small = (A, B) if E is None else (np.linalg.solve(E, A), np.linalg.solve(E, B))
    return control.ss(*small, C, 0.0 * through if D is None else D)
