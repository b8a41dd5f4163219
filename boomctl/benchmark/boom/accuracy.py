"""Lines of the boom's benchmark about accuracy and size: rounding, memory, high order, where each mesh ends."""

import warnings

import numpy as np

from boomctl.analysis import sigma
from boomctl.analysis.model_norm import orthonormal_parts
from boomctl.arrays import Array
from boomctl.benchmark.boom.high_precision import mesh_response, sigma_of
from boomctl.benchmark.boom.scene import Progress, Scene, Settings
from boomctl.benchmark.report import Row, Sheet
from boomctl.benchmark.timing import Job, interleaved, peak_memory
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.core import build_core, rounding_estimate
from boomctl.structure.response.direct import AccuracyWarning

_ROUNDING_TARGET = 2e-5
_TOTAL_TARGET = 1e-4
_TOTAL_AT = 500
_WARN = 1e-4
_LINEAR = 1.15
_HIGH_ORDER_ERROR = 1e-9
_HIGH_ORDER_UNKNOWNS = 60
_SPANS = 4


def _sigma(model: SecondOrderModel, omega: Array) -> Array:
    """Return singular values, without the warning that the lines here show as a number."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        return sigma(model, omega).sigma


def _distance(a: Array, b: Array) -> float:
    return float(np.abs(a / b - 1.0).max())


def rounding_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
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
            Row(section, f"{elements} elements", None, None, target, rounding, met=rounding <= _ROUNDING_TARGET)
        )
        if elements == _TOTAL_AT:
            job, target = f"{elements} elements, total error", f"<= {_TOTAL_TARGET:.0e}"
            rows.append(Row(section, job, None, None, target, total, met=total <= _TOTAL_TARGET))
        lines.append((elements, rounding, mesh, total))
    columns = ("elements", "rounding", "discretisation", "total")
    title = f"Error of finite elements in parts ({len(omega)} frequencies; total: {len(ground.omega)})"
    return rows, [Sheet(title, columns, tuple(lines))] if lines else []


def _estimate(model: SecondOrderModel, omega: Array) -> float:
    """Return the rounding estimate of a model's halves, actuators -> tips; not a number where it has no cores."""
    parts = orthonormal_parts(model.select(ACTUATORS, TIPS))
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


def memory_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
    """Show what fine meshes take: time, memory, digits."""
    section = "Fine meshes"
    if len(settings.memory) < 2:
        return [], []
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
        Row(section, f"memory grows as n^{memory:.2f}", None, None, target, met=memory <= _LINEAR),
        Row(section, f"time grows as n^{time:.2f}", None, None, target, met=time <= _LINEAR),
        Row(section, f"{last[0]:,} elements", last[1] / 1e3, None, "run, warn > 1e-4", last[4], met=honest),
    ]
    columns = ("elements", "time [ms]", "peak memory [MB]", "rounding estimate", "error", "warned")
    return rows, [Sheet("Fine meshes, finite elements", columns, tuple(lines))]


def high_order_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
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
        return [], []
    best = min(good) if good else (lines[-1][1], lines[-1][0], lines[-1][2], 1e-3 * lines[-1][3])
    job = f"order {best[1]}, {best[0]} unknowns"
    target = f"{_HIGH_ORDER_ERROR:.0e}, n < {_HIGH_ORDER_UNKNOWNS}"
    met = bool(good) and best[0] < _HIGH_ORDER_UNKNOWNS
    row = Row(section, job, best[3], None, target, best[2], met=met)
    return [row], [Sheet(section, ("order", "unknowns", "error", "time [ms]"), tuple(lines))]


def accuracy_lines(ground: Scene, settings: Settings, tell: Progress) -> tuple[list[Row], list[Sheet]]:
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
    return rows, [Sheet("Error over the number of elements", ("elements", *meshes), lines)] if lines else []
