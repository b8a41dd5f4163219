"""What a sweep over parameters pays for each of its points: models are made anew in every call."""

from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.boom.scene import Scene, Settings
from boomctl.lab.benchmark.report import Measured, Row, Sheet, Tell, race
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.lti.python_control import control

_SECTION = "Cold: a new spring in each call, model included; peer: control, state space included"
_FINITE_TARGETS = {6: 3.0, 20: 7.0, 100: 40.0}  # ratios, by the number of elements
_EXACT_TARGET, _EXACT_PEER = 3.0, 6  # ratio of the exact beam, and elements of the peer
_AS_EXACT = 1e-3  # share by which our error may be larger than the peer's: both are that of the same mesh (a choice)
_MODEL_TARGETS = {6: 2e-3, 1000: 10e-3}  # s, that a model may take, by the number of elements


def new_parameters_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Race new parameters to singular values against python-control, and time the model alone."""
    numbers = count(1)

    def varied() -> BoomParameters:
        stiffness = ground.parameters.spring_stiffness
        return replace(ground.parameters, spring_stiffness=stiffness * (1.0 + 1e-6 * next(numbers)))

    def finite(elements: int) -> Callable[[BoomParameters], Array]:
        return lambda p: sigma(spray_boom(p, elements=elements), ground.omega).sigma

    def exact(p: BoomParameters) -> Array:
        return sigma(exact_frequency_response(p, ground.omega, ACTUATORS, TIPS)).sigma

    rows: list[Row | Sheet] = []
    for elements in (n for n in settings.peers if n in _FINITE_TARGETS):
        tell(f"new parameters beside python-control on {elements} elements")
        system = ground.model(elements).to_statespace(ACTUATORS, TIPS)

        def peer(_: object, system: control.StateSpace = system) -> Array:
            made = control.ss(system.A, system.B, system.C, system.D)
            return np.asarray(control.singular_values_response(made, ground.omega).frdata)[:, 0]

        jobs = {"ours": Job(finite(elements), varied), "exact": Job(exact, varied), "peer": Job(peer)}
        times = interleaved(jobs, max(3, settings.rounds // (1 + elements // 25)))
        theirs = Measured(times["peer"], ground.error(peer(None)))
        lines = [(f"{elements} elements", "ours", finite(elements), _FINITE_TARGETS[elements])]
        if elements == _EXACT_PEER:
            lines.append((f"exact; peer: {elements} elements", "exact", exact, _EXACT_TARGET))
        for job, name, answer, wanted in lines:
            ours = Measured(times[name], ground.error(answer(ground.parameters)))
            met = theirs.seconds >= wanted * ours.seconds and ours.error <= theirs.error * (1.0 + _AS_EXACT)
            rows.append(race(_SECTION, job, ours, theirs, f">= {wanted:g}x", met))
    for elements, limit in _MODEL_TARGETS.items():
        tell(f"model of {elements} elements")
        job = Job(lambda p, elements=elements: spray_boom(p, elements=elements), varied)
        time = interleaved({"ours": job}, settings.rounds)["ours"]
        target, name = f"<= {1e3 * limit:g} ms", f"spray_boom alone, {elements:,} elements"
        rows.append(Row(_SECTION, name, ours=time, target=target, met=time <= limit))
    return rows
