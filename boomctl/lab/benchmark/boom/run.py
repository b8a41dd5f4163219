"""The boom's benchmark: run time and error of every job in one run, beside python-control where it can do the same."""

import warnings
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np

from boomctl.analysis.model_norm import SplitModel
from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.boom.high_precision import mesh_response, sigma_of
from boomctl.lab.benchmark.boom.new_parameters import new_parameters_lines
from boomctl.lab.benchmark.boom.scene import Scene, Settings, scene
from boomctl.lab.benchmark.report import BenchmarkReport, Measured, Row, Sheet, Tell, measured, race
from boomctl.lab.benchmark.timing import Job, fresh_processes, interleaved, peak_memory
from boomctl.lti.python_control import control
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.core import build_core, rounding_estimate
from boomctl.structure.response.rounding import AccuracyWarning

# targets are what this package promised itself; ratios are the peer's processor time over ours
_EXACT_TARGETS = {6: 4.0, 100: 150.0}  # ratios, by the peer's number of elements
_EXACT_ERROR = 1e-9  # of the exact beam
_FINITE_TARGETS = {100: 40.0, 500: 300.0}  # ratios, by the number of elements
_LONG = 500  # elements from which a call of the peer takes half a minute, so that it is timed once
_ROUNDING_TARGET = 2e-5  # distance to the same mesh in 50 digits
_TOTAL_TARGET, _TOTAL_AT = 1e-4, 500  # total error, at this number of elements
_WARN = 1e-4  # estimate of rounding from which the response is to warn, as it says
_LINEAR = 1.15  # largest exponent of growth that counts as linear
_HIGH_ORDER_ERROR, _HIGH_ORDER_UNKNOWNS = 1e-9, 60  # error to be reached with fewer unknowns than this
_SPANS = 4  # high-order elements: one between each two of tip, spring, hinge, spring, tip
_FINITE = "Finite element sigma; peer: control.frequency_response"
_LINALG = "import numpy, scipy.linalg"
_COMMAND = """import sys
sys.argv[1:] = {!r}.split()
from boomctl.cli import main
try:
    main()
except SystemExit:
    pass"""

# job, its lines of Python, those it stands beside, and how many times as long it may take: what this package promised itself
_COLD = (
    ("import boomctl", "import boomctl", "import numpy", 1.5),
    ("first BoomParameters()", "import boomctl as bc; bc.BoomParameters()", _LINALG, 1.0),
    ("first spray_boom()", "import boomctl as bc; bc.spray_boom()", _LINALG, 2.0),
    ("first sigma(boom), peak", "import boomctl as bc; bc.sigma(bc.spray_boom()).peak", _LINALG, 2.5),
    ("boomctl sigma --json", _COMMAND.format("sigma --json"), _LINALG, 2.5),
    ("boomctl parameters", _COMMAND.format("parameters"), _COMMAND.format("--version"), 1.3),
)
_PEERS = {_LINALG: _LINALG, "import numpy": "import numpy", _COMMAND.format("--version"): "boomctl --version"}


def run(full: bool = False, progress: Tell | None = None) -> BenchmarkReport:
    """Measure the boom's jobs.

    Parameters
    ----------
    full : bool
        Also time python-control on 500 elements (some minutes), and judge meshes at every frequency.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    return run_settings(Settings.of(full), progress)


def run_settings(settings: Settings, tell: Tell | None = None) -> BenchmarkReport:
    """Measure the boom's jobs to the given extent; see :func:`run`."""
    if tell is not None:
        tell("exact solution in 50 digits")
    ground = scene(settings)
    return measured("boom", [partial(lines, ground, settings) for lines in _SUBJECTS], _notes(ground, settings), tell)


def _notes(ground: Scene, settings: Settings) -> tuple[str, ...]:
    notes = [
        f"Time: median processor time of jobs that take turns in one process, one BLAS thread, {len(ground.omega)} "
        "frequencies a call. Ratio: peer over ours.",
        "Error: largest relative error of any singular value, actuators -> tips, against the exact beam in 50 digits; "
        f"{settings.points} points from 0.1 to 10 Hz and {settings.cluster} around each of the first five resonances.",
        "Models and state spaces are built beforehand, a symmetric model with its two halves and their bands; each call "
        "gets a model of its own, so that no modes or responses are cached. The exact beam keeps, for each set of "
        "parameters, what does not depend on frequency; the lines 'prepared anew' and 'Cold: a new spring' use new "
        "parameters in every call and build everything in it.",
        "'Cold: first calls': median processor time of whole processes that take turns, from the start of Python to the "
        "end of the call, with bytecode compiled as in an installed package.",
        f"In 50 digits meshes are solved at {len(ground.judged)} of the {len(ground.omega)} frequencies.",
    ]
    if settings.skipped:
        meshes = " and ".join(f"{n:,}" for n in settings.skipped)
        notes.append(f"python-control on {meshes} elements takes half a minute a call; --full measures it.")
    elif max(settings.peers, default=0) >= 500:
        notes.append("python-control on 500 elements is timed once, without a call before to warm up.")
    return tuple(notes)


def _rounds(settings: Settings, elements: int) -> int:
    """Return how often to measure beside python-control on a mesh: the longer a call, the fewer."""
    return 1 if elements >= _LONG else max(3, settings.rounds // (1 + elements // 25))


def _exact_sigma(parameters: BoomParameters, omega: Array) -> Array:
    return sigma(exact_frequency_response(parameters, omega, ACTUATORS, TIPS)).sigma


def _statespace(ground: Scene, elements: int) -> control.StateSpace:
    return ground.model(elements).to_statespace(ACTUATORS, TIPS)


def exact_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Race the exact beam against python-control's singular values of finite element models."""
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
        rows.append(
            race(section, job, Measured(times["ours"], error), Measured(times["peer"], peer_error), target, met)
        )
        if wanted is not None:
            ours, peer = Measured(times["anew"], error), Measured(times["peer"], peer_error)
            anew.append(race(section, f"{job}, prepared anew", ours, peer))
    return [*rows, *anew]


def finite_element_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Race sigma of finite element models against python-control's response of the same models."""
    rows = [_finite_element_row(ground, settings, n, tell) for n in settings.peers]
    for elements in settings.skipped:
        tell(f"finite element sigma of {elements} elements")
        times = interleaved({"ours": _ours(ground, elements)}, max(3, settings.rounds // 3))
        error = ground.error(sigma(ground.model(elements), ground.omega).sigma)
        target = f">= {_FINITE_TARGETS[elements]:g}x, closer" if elements in _FINITE_TARGETS else ""
        job = f"{elements} elements"
        rows.append(Row(_FINITE, job, ours=times["ours"], target=target, error=error, note="--full"))
    return [*rows]


def _ours(ground: Scene, elements: int) -> Job:
    return Job(lambda model: sigma(model, ground.omega).sigma, lambda: ground.model(elements))


def _finite_element_row(ground: Scene, settings: Settings, elements: int, tell: Tell) -> Row:
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
    mine, theirs = Measured(times["ours"], error), Measured(times["peer"], peer_error)
    return race(_FINITE, f"{elements} elements", mine, theirs, target, met)


def _sigma(model: SecondOrderModel, omega: Array) -> Array:
    """Return singular values, without the warning that the lines here show as a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        return sigma(model, omega).sigma


def _distance(a: Array, b: Array) -> float:
    return float(np.abs(a / b - 1.0).max())


def rounding_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Compare finite element sigma with the same meshes in fifty digits."""
    section = "Distance to the same mesh in 50 digits"
    omega, exact = ground.omega[ground.judged], ground.exact[:, ground.judged]
    rows, lines = [], []
    for elements in settings.rounding:
        tell(f"mesh of {elements} elements in 50 digits")
        true = sigma_of(mesh_response(ground.parameters, omega, elements))
        ours = _sigma(ground.model(elements), ground.omega)
        rounding, total, mesh = _distance(ours[:, ground.judged], true), ground.error(ours), _distance(true, exact)
        target = f"<= {_ROUNDING_TARGET:.0e}"
        rows.append(
            Row(section, f"{elements} elements", target=target, error=rounding, met=rounding <= _ROUNDING_TARGET)
        )
        if elements == _TOTAL_AT:
            job, target = f"{elements} elements, total error", f"<= {_TOTAL_TARGET:.0e}"
            rows.append(Row(section, job, target=target, error=total, met=total <= _TOTAL_TARGET))
        lines.append((elements, rounding, mesh, total))
    columns = ("elements", "rounding", "discretisation", "total")
    title = f"Error of finite elements in parts ({len(omega)} frequencies; total: {len(ground.omega)})"
    return [*rows, Sheet(title, columns, tuple(lines))] if lines else []


def _estimate(model: SecondOrderModel, omega: Array) -> float:
    """Return the rounding estimate of a model's halves, actuators -> tips; not a number where it has no cores."""
    parts = SplitModel.of(model.select(ACTUATORS, TIPS)).parts
    cores = [(part, build_core(part.structure, part.ports, omega)) for part in parts]
    return max(np.nan if core is None else rounding_estimate(part.structure, core, omega) for part, core in cores)


def _warned(model: SecondOrderModel, omega: Array) -> bool:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sigma(model, omega)
        sigma(model, omega).sigma  # noqa: B018
    return any(issubclass(item.category, AccuracyWarning) for item in caught)


def _growth(sizes: tuple[int, ...], values: list[float]) -> float:
    """Return the exponent with which values grow with size."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def memory_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Show what fine meshes take: time, memory, digits."""
    section = "Fine meshes"
    if len(settings.memory) < 2:
        return []
    lines: list[tuple[int, float, float, float, float, str]] = []
    for elements in settings.memory:
        tell(f"finite element sigma of {elements:,} elements: time, memory, rounding")
        job = Job(lambda model: _sigma(model, ground.omega), lambda n=elements: ground.model(n))
        seconds = interleaved({"": job}, 3)[""]
        peak = peak_memory(job) / 1e6
        model = ground.model(elements)
        warned = "yes" if _warned(model, ground.omega) else "no"
        error, estimate = ground.error(_sigma(model, ground.omega)), _estimate(model, ground.omega)
        lines.append((elements, 1e3 * seconds, peak, estimate, error, warned))
    memory, time = (_growth(settings.memory, [float(line[k]) for line in lines]) for k in (2, 1))
    last = lines[-1]
    honest = all((line[5] == "yes") == (line[3] > _WARN) for line in lines)
    target = f"<= {_LINEAR:g}"
    rows = [
        Row(section, f"memory grows as n^{memory:.2f}", target=target, met=memory <= _LINEAR),
        Row(section, f"time grows as n^{time:.2f}", target=target, met=time <= _LINEAR),
        Row(section, f"{last[0]:,} elements", ours=last[1] / 1e3, target="run, warn > 1e-4", error=last[4], met=honest),
    ]
    columns = ("elements", "time [ms]", "peak memory [MB]", "rounding estimate", "error", "warned")
    return [*rows, Sheet("Fine meshes, finite elements", columns, tuple(lines))]


def high_order_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Show elements of high order: digits for unknowns."""
    section = f"High-order elements, {_SPANS} spans"
    lines, good = [], []
    for order in settings.orders:
        tell(f"high-order elements, order {order}")
        model = ground.model(_SPANS, "high-order", order)
        fresh = Job(lambda m: _sigma(m, ground.omega), lambda p=order: ground.model(_SPANS, "high-order", p))
        seconds = interleaved({"": fresh}, max(3, settings.rounds // 3))[""]
        error = ground.error(_sigma(model, ground.omega))
        lines.append((order, model.n, error, 1e3 * seconds))
        good += [(model.n, order, error, seconds)] if error <= _HIGH_ORDER_ERROR else []
    if not lines:
        return []
    best = min(good) if good else (lines[-1][1], lines[-1][0], lines[-1][2], 1e-3 * lines[-1][3])
    job = f"order {best[1]}, {best[0]} unknowns"
    target = f"{_HIGH_ORDER_ERROR:.0e}, n < {_HIGH_ORDER_UNKNOWNS}"
    met = bool(good) and best[0] < _HIGH_ORDER_UNKNOWNS
    row = Row(section, job, ours=best[3], target=target, error=best[2], met=met)
    return [row, Sheet(section, ("order", "unknowns", "error", "time [ms]"), tuple(lines))]


def accuracy_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Show where the accuracy of each discretisation ends."""
    section = "Where accuracy ends: the best mesh"
    meshes = {"finite": settings.finite, "discrete-hermite": settings.discrete, "discrete-geometric": settings.discrete}
    found: dict[str, dict[int, float]] = {}
    for name, sizes in meshes.items():
        tell(f"error of {name} elements over their number")
        found[name] = {n: ground.error(_sigma(ground.model(n, name), ground.omega)) for n in sizes}
    rows = []
    for name, errors in found.items():
        if errors:
            best = min(errors, key=lambda n: errors[n])
            rows.append(Row(section, f"{name}, {best:,} elements", error=errors[best]))
    sizes = sorted(set(settings.finite) | set(settings.discrete))
    lines = tuple((n, *(found[name].get(n) for name in meshes)) for n in sizes)
    return [*rows, Sheet("Error over the number of elements", ("elements", *meshes), lines)] if lines else []


def cold_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Compare first calls and commands, each in a new process, with the import or command that each stands on."""
    del ground  # each process makes its own
    if not settings.processes:
        return []
    tell("first calls and commands in new processes")
    times = fresh_processes([*dict.fromkeys(code for line in _COLD for code in line[1:3])], settings.processes)
    return [
        race(
            f"Cold, new process; peer: {_PEERS[peer]}",
            f"cold: {job}",
            Measured(times[code]),
            Measured(times[peer]),
            f"<= {limit:g} x peer",
            times[code] <= limit * times[peer],
        )
        for job, code, peer, limit in _COLD
    ]


_SUBJECTS = (
    exact_lines,
    finite_element_lines,
    new_parameters_lines,
    rounding_lines,
    memory_lines,
    high_order_lines,
    accuracy_lines,
    cold_lines,
)
