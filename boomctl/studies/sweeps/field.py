"""Runs over the field, to be swept: designs, speeds, seeds of tracks, classes of roads, parameters of the machine."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

from boomctl.boom.parameters import BoomParameters
from boomctl.checks import instance, known
from boomctl.printing import compact
from boomctl.studies.suspension.design import SuspensionDesign
from boomctl.studies.suspension.performance import performance
from boomctl.studies.suspension.scene import FieldScene

_SCENE = tuple(each.name for each in fields(FieldScene))
_MACHINE = tuple(each.name for each in fields(BoomParameters))


@dataclass(frozen=True)
class FieldStudy:
    """A suspension driven over a field, as a function of design, scene and machine; for :func:`boomctl.sweep`.

    Called with a ``design``, properties of the `FieldScene` and of `BoomParameters` by name; it returns certified peaks, what
    the spray leaves and what the suspension needs: the numbers of :func:`boomctl.studies.performance`.

    Attributes
    ----------
    scene : FieldScene
        The field where nothing else is said.

    Raises
    ------
    TypeError
        Another kind of scene.

    Examples
    --------
    >>> import boomctl as bc
    >>> study = bc.studies.FieldStudy(bc.studies.FieldScene(run_in=5.0, duration=10.0))
    >>> runs = bc.sweep(study, over={"speed": [2.0, 3.0], "seed": 1})
    >>> runs["stroke"].round(3)  # m
    array([0.023, 0.026])
    """

    scene: FieldScene = field(default_factory=FieldScene)

    units: ClassVar[Mapping[str, str]] = {
        "speed": "m/s", "peak": "", "yaw_peak": "", "jolt_peak": "", "deposit_cv": "", "share_outside_10": "",
        "worst_dose": "", "rms_tip_speed": "m/s", "stroke": "m", "force": "N", "end_stops_hit": "", "saturation_share": "",
    }  # fmt: skip

    __repr__ = compact

    def __post_init__(self) -> None:
        instance("scene", self.scene, FieldScene)

    def __call__(self, design: SuspensionDesign | None = None, **changes: Any) -> dict[str, float]:
        """Return what a design does, with changes of scene and machine; without a design the boom of Table 2."""
        for name in changes:
            known("property of scene or machine", name, (*_SCENE, *_MACHINE))
        judged = SuspensionDesign("passive", "passive, Table 2") if design is None else design
        instance("design", judged, SuspensionDesign)
        scene = replace(self.scene, **{name: changes[name] for name in changes if name in _SCENE})
        machine = {name: changes[name] for name in changes if name in _MACHINE}
        if machine and judged.plant is not None:
            raise ValueError(
                f"{', '.join(machine)}: design {judged.name!r} brings a plant of its own; expected no changes"
            )
        run = performance(judged.title, scene, replace(judged.parameters, **machine), judged.controller, judged.plant)
        return {
            "peak": run.sigma.peak,
            "yaw_peak": run.yaw.lower,
            "jolt_peak": run.jolt.lower,
            "deposit_cv": run.spray.cv,
            "share_outside_10": run.spray.share_outside_10,
            "worst_dose": run.spray.worst_dose,
            "rms_tip_speed": run.spray.rms_tip_speed,
            "stroke": run.stroke,
            "force": run.force,
            "end_stops_hit": len(run.run.stops),
            "saturation_share": max(run.run.saturation_share.values(), default=0.0),
        }
