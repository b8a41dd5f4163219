"""Lines of the boom's benchmark that race: exact sigma, finite element sigma, the import."""

from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis import sigma
from boomctl.arrays import Array
from boomctl.benchmark.boom.scene import Progress, Scene, Settings
from boomctl.benchmark.report import Row, Sheet
from boomctl.benchmark.timing import Job, import_times, interleaved
from boomctl.boom import BoomParameters, exact_frequency_response
from boomctl.boom.model import ACTUATORS, TIPS

if TYPE_CHECKING:
    import control

_EXACT_TARGETS = {6: 4.0, 100: 150.0}
_EXACT_ERROR = 1e-9
_FINITE_TARGETS = {100: 40.0, 500: 300.0}
_IMPORT_TARGET = 1.5
_LONG = 500


def _rounds(settings: Settings, elements: int) -> int:
    """Return how often to measure beside python-control on a mesh: the longer a call, the fewer."""
    return 1 if elements >= _LONG else max(3, settings.rounds // (1 + elements // 25))


def _exact_sigma(parameters: BoomParameters, omega: Array) -> Array:
    return sigma(exact_frequency_response(parameters, omega, ACTUATORS, TIPS)).sigma


def _statespace(ground: Scene, elements: int) -> "control.StateSpace":
    return ground.model(elements).to_statespace(ACTUATORS, TIPS)


def exact_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
    """Race the exact beam against python-control's singular values of finite element models."""
    import control

    section = "Exact sigma; peer: control.singular_values_response"
    numbers = count(1)

    def varied() -> BoomParameters:  # the platform's mass is without influence where its motion is imposed
        mass = ground.parameters.platform_mass
        return replace(ground.parameters, platform_mass=mass * (1.0 + 1e-6 * next(numbers)))

    error = ground.error(_exact_sigma(ground.parameters, ground.omega))
    rows, anew = [], []
    for elements in (n for n in settings.peers if n < _LONG):
        tell(f"exact sigma beside python-control on {elements} elements")
        system = _statespace(ground, elements)
        jobs = {
            "ours": Job(lambda _: _exact_sigma(ground.parameters, ground.omega)),
            "anew": Job(lambda p: _exact_sigma(p, ground.omega), varied),
            "peer": Job(lambda _, system=system: control.singular_values_response(system, ground.omega)),
        }
        times = interleaved(jobs, _rounds(settings, elements))
        found = np.abs(np.asarray(control.singular_values_response(system, ground.omega).frdata)[:, 0])
        peer_error, wanted = ground.error(found), _EXACT_TARGETS.get(elements)
        met = None if wanted is None else times["peer"] >= wanted * times["ours"] and error <= _EXACT_ERROR
        target = "" if wanted is None else f">= {wanted:g}x, {_EXACT_ERROR:.0e}"
        job = f"peer: {elements} elements"
        rows.append(Row(section, job, times["ours"], times["peer"], target, error, peer_error, met))
        if wanted is not None:
            anew.append(Row(section, f"{job}, prepared anew", times["anew"], times["peer"], "", error, peer_error))
    return rows + anew, []


def finite_element_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
    """Race sigma of finite element models against python-control's response of the same models."""
    rows = [_finite_element_row(ground, settings, n, tell) for n in settings.peers]
    for elements in settings.skipped:
        tell(f"finite element sigma of {elements} elements")
        times = interleaved({"ours": _ours(ground, elements)}, max(3, settings.rounds // 3))
        error = ground.error(sigma(ground.model(elements), ground.omega).sigma)
        target = f">= {_FINITE_TARGETS[elements]:g}x, closer" if elements in _FINITE_TARGETS else ""
        job = f"{elements} elements"
        rows.append(Row(_FINITE, job, times["ours"], None, target, error, note="--full"))
    return rows, []


_FINITE = "Finite element sigma; peer: control.frequency_response"


def _ours(ground: Scene, elements: int) -> Job:
    return Job(lambda model: sigma(model, ground.omega).sigma, lambda: ground.model(elements))


def _finite_element_row(ground: Scene, settings: Settings, elements: int, tell: Progress) -> Row:
    import control

    tell(f"finite element sigma beside python-control on {elements} elements")
    system = _statespace(ground, elements)
    answers: list[control.FrequencyResponseData] = []

    def peer(_: object) -> None:
        answers[:] = [control.frequency_response(system, ground.omega)]

    ours = _ours(ground, elements)
    if elements < _LONG:
        times = interleaved({"ours": ours, "peer": Job(peer)}, _rounds(settings, elements))
    else:
        before = interleaved({"ours": ours}, 3)
        times = interleaved({"ours": ours, "peer": Job(peer)}, 1, warm=False)
        after = interleaved({"ours": ours}, 3, warm=False)
        times["ours"] = float(np.median([before["ours"], times["ours"], after["ours"]]))
    error = ground.error(sigma(ground.model(elements), ground.omega).sigma)
    response = np.moveaxis(np.asarray(answers[0].frdata), 2, 0)
    peer_error = ground.error(np.linalg.svd(response, compute_uv=False).T)
    wanted = _FINITE_TARGETS.get(elements)
    met = None if wanted is None else times["peer"] >= wanted * times["ours"] and error < peer_error
    target = "" if wanted is None else f">= {wanted:g}x, closer"
    return Row(_FINITE, f"{elements} elements", times["ours"], times["peer"], target, error, peer_error, met)


def import_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
    """Compare the import of the package with that of numpy."""
    if not settings.imports:
        return [], []
    tell("imports in fresh interpreters")
    times = import_times(("boomctl", "numpy"), settings.imports)
    met = times["boomctl"] < _IMPORT_TARGET * times["numpy"]
    target = f"< {_IMPORT_TARGET:g} x peer"
    return [Row("Import; peer: numpy", "import boomctl", times["boomctl"], times["numpy"], target, met=met)], []
