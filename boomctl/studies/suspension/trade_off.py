"""The points of a trade-off: each design made and judged by itself, in processes side by side; what fails is told."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from boomctl.analysis.box.worst_case import WorstCase
from boomctl.checks import instance, whole
from boomctl.progress import Listener, computing
from boomctl.studies.catalogue import design_file
from boomctl.studies.suspension.assurance import box_worst, split_halves
from boomctl.studies.suspension.design import SuspensionDesign
from boomctl.studies.suspension.passive_assurance import no_controller
from boomctl.studies.suspension.performance import half_norm, loop_between, performance
from boomctl.studies.suspension.scene import CONTROLS, FieldScene, suspension_model
from boomctl.studies.suspension.trade_curves import HALVES, HalfNumbers, TradeCurve, TradeLine, TradePoint
from boomctl.studies.sweeps.sweep import SweepWarning, sweep


@dataclass(frozen=True)
class _Asked:
    """A point before it is made: the design itself, the name of one, or a value of a curve."""

    label: str
    design: SuspensionDesign | str | None = None
    curve: str = ""
    value: float | None = None


def trade_off(
    name: str,
    design: SuspensionDesign,
    scene: FieldScene | None = None,
    workers: int = 1,
    *,
    progress: "Listener | None" = None,
) -> tuple[TradeLine, ...]:
    """Return the trade-off that a design's file offers by its function ``trade_off()``.

    Parameters
    ----------
    name : str
        Of the design, or of its file.
    design : SuspensionDesign
        The design itself, which the curves go through at their chosen values.
    scene : FieldScene, optional
        The field that all are driven over; by default ``FieldScene()``.
    workers : int
        Processes side by side; 1: this one.
    progress : callable, optional
        Is told a `Progress` at each stage.

    Returns
    -------
    tuple of TradeLine
        One for each curve; points that failed are named there.

    Raises
    ------
    TypeError, ValueError
        No such design or function; one that returns something else.
    RuntimeError
        Every point failed.

    Examples
    --------
    >>> import boomctl as bc
    >>> from boomctl.studies.suspension import trade_off
    >>> made = bc.load_design("tuned_suspension")  # doctest: +SKIP
    >>> order, force = trade_off("tuned_suspension", made, workers=2)  # doctest: +SKIP
    >>> [round(point.of(None).peak, 1) for point in order.points]  # doctest: +SKIP
    """
    where = FieldScene() if scene is None else instance("scene", scene, FieldScene)
    path, count = design_file(name, "suspension").path.resolve(), whole("workers", workers)
    judge = _Judge(str(path), path.stat().st_mtime_ns, where)
    curves = judge.curves()
    asked = _asked(curves, instance("design", design, SuspensionDesign))
    with computing("trade-off", progress), warnings.catch_warnings():
        warnings.simplefilter("ignore", SweepWarning)  # what fails is told beside what was found
        found = sweep(judge, {"point": asked}, None if count == 1 else min(count, len(asked)))
    failures = {str(each.point["point"]): each.error for each in found.failures}
    points = {label: row["value"] for label, row in zip(asked, found.values, strict=True) if row is not None}
    return tuple(_line(curve, design, points, failures) for curve in curves.values())


@dataclass(frozen=True)
class _Judge:
    """Makes and judges a point, in any process: curves are read from the file of the design there."""

    path: str
    written: int
    scene: FieldScene

    def curves(self) -> Mapping[str, TradeCurve]:
        """Return the curves of the design's file by name."""
        return _curves(self.path, self.written)

    def __call__(self, point: _Asked) -> TradePoint:
        made = point.design
        if made is None:
            assert point.value is not None
            made = self.curves()[point.curve].make(point.value)
        elif isinstance(made, str):
            made = design_file(made, "suspension").made()
        expected = instance(f"design of {point.label}", made, SuspensionDesign)
        return judged(point.label, point.value, expected, self.scene)


@cache
def _curves(path: str, written: int) -> Mapping[str, TradeCurve]:
    """Return the curves of a file as it was written then; what it keeps for itself serves all points of a process."""
    del written
    found = design_file(path, "suspension").trade_off()
    return {curve.name: curve for curve in found}


def _label(curve: TradeCurve, value: float) -> str:
    return f"{curve.name} {value:g}"


def _asked(curves: Mapping[str, TradeCurve], design: SuspensionDesign) -> dict[str, _Asked]:
    """Return what is to be made and judged, each once; the design itself is already made."""
    asked = {design.name: _Asked(design.name, design)}
    for curve in curves.values():
        for value in curve.values:
            if value != curve.chosen:
                asked[_label(curve, value)] = _Asked(_label(curve, value), None, curve.name, value)
    for curve in curves.values():
        asked |= {name: _Asked(name, name) for name in curve.beside if name != design.name}
    return asked


def _line(
    curve: TradeCurve, design: SuspensionDesign, points: Mapping[str, TradePoint], failures: Mapping[str, str]
) -> TradeLine:
    labels = {value: design.name if value == curve.chosen else _label(curve, value) for value in curve.values}
    p = design.parameters
    static = 1.0 if curve.half == "jolt" else p.length / p.actuator_distance
    return TradeLine(
        name=curve.name,
        title=curve.title,
        asked=curve.asked,
        half=curve.half,
        over=curve.over,
        chosen=curve.chosen,
        points=tuple(
            replace(points[label], label=f"{value:g}", asked=value)
            for value, label in labels.items()
            if label in points
        ),
        beside=tuple(points[name] for name in curve.beside if name in points),
        failures={label: failures[label] for label in (*labels.values(), *curve.beside) if label in failures},
        static=static,
    )


def judged(label: str, asked: float | None, design: SuspensionDesign, scene: FieldScene) -> TradePoint:
    """Return what a suspension is worth: driven over the field, and over the box where it can be bounded there."""
    p, K = design.parameters, design.controller
    own = design.own_plant
    seen = performance(design.title, scene, p, K, own, delay=design.delay)
    usual = suspension_model(p, scene.elements, scene.accelerometer_hz)
    model = usual if own is None else own
    late = scene.delay if design.delay is None else design.delay
    worst: Mapping[str, WorstCase] = {}
    if own is None:
        parts = [no_controller(half) for half in HALVES] if K is None else split_halves(usual, K)[:2]
        band = None if K is None else scene.accelerometer_hz
        held = 0.0 if K is None or K.isctime() else late
        worst = {half: box_worst(half, p, part, band, held)[1] for half, part in zip(HALVES, parts, strict=True)}
    effort = dict.fromkeys(HALVES, 0.0)
    if K is not None:
        asked_for = loop_between(model, K, CONTROLS, delay=late)
        effort = {half: half_norm(asked_for, half).lower for half in HALVES}
    peaks = {"jolt": seen.jolt.lower, "yaw": seen.yaw.lower}
    left, right = (seen.run.controls.get(name, np.zeros(1)) for name in CONTROLS)
    forces = {"jolt": 0.5 * np.abs(right + left).max(), "yaw": 0.5 * np.abs(right - left).max()}
    halves = {}
    for half in HALVES:
        found = worst.get(half)
        bounds = (None, None) if found is None else (found.norm.lower, found.upper_bound)
        halves[half] = HalfNumbers(peaks[half], *bounds, effort[half], float(forces[half]))
    return TradePoint(
        label=label,
        asked=asked,
        states=0 if K is None else K.nstates,
        **halves,
        deposit_cv=seen.spray.cv,
        force=seen.force,
        stroke=seen.stroke,
    )
