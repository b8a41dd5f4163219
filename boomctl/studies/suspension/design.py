"""A suspension that is to be judged, and the judging: beside the boom as it is, with everything that vouches for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf, log10
from typing import TYPE_CHECKING, Any

from boomctl.analysis.box.worst_case import WorstCase
from boomctl.analysis.sigma import SigmaResult
from boomctl.boom.parameters import BoomParameters
from boomctl.exchange.controller_files import controller_contents
from boomctl.printing import compact
from boomctl.report import Report, Section
from boomctl.structure.families import AffineFamily
from boomctl.studies.suspension import sections
from boomctl.studies.suspension.assurance import Assurance, assure
from boomctl.studies.suspension.own_plant_assurance import OwnPlantAssurance, assure_own_plant
from boomctl.studies.suspension.passive_assurance import PassiveAssurance, assure_passive
from boomctl.studies.suspension.performance import Performance, performance
from boomctl.studies.suspension.sampled_assurance import SampledAssurance, assure_sampled
from boomctl.studies.suspension.scene import FieldScene

if TYPE_CHECKING:
    import control


_CONTROLLER = "controller"  # name of the files of a design's controller


@dataclass(frozen=True)
class SuspensionDesign:
    """A horizontal suspension: passive parts and, if it is an active one, its controller.

    Attributes
    ----------
    name, title : str
        A name in one word, and what it is in a line.
    parameters : BoomParameters
        The machine, passive parts of the suspension included.
    controller : control.StateSpace or None
        ``u = K y`` in SI units; inputs named as outputs of the machine (``stroke_left``, ``tip_left_acceleration``,
        ...), outputs ``suspension_left``, ``suspension_right``.  A discrete one runs at its own sampling time.
    plant : AffineFamily, control.StateSpace or None
        A machine of its own where the controller reads what the boom with its sensors does not offer, such as states.  A
        family is that machine over springs and masses, ``"spring"`` and ``"mass"``, the design's own in its middle:
        stability and the worst peak are then proved over it, of a controller in continuous time.
    facts : mapping from str to str
        What synthesis and reduction say of themselves: gamma and bounds, errors, orders.
    weights : mapping from str to control.StateSpace
        Weights of the design, to be drawn over frequency.
    notes : tuple of str
        What a reader of the report should know.
    delay : float or None
        Time between a sample and the moment its forces act [s]; by default that of the scene.

    Examples
    --------
    >>> import boomctl as bc
    >>> soft = bc.studies.SuspensionDesign("soft", "softer springs", bc.BoomParameters(spring_stiffness=550.0))
    >>> soft.controller is None  # a passive suspension
    True
    """

    name: str
    title: str
    parameters: BoomParameters = field(default_factory=BoomParameters)
    controller: control.StateSpace | None = None
    plant: AffineFamily | control.StateSpace | None = None
    facts: Mapping[str, str] = field(default_factory=dict)
    weights: Mapping[str, control.StateSpace] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    delay: float | None = None

    __repr__ = compact

    @property
    def own_plant(self) -> control.StateSpace | None:
        """The machine of its own as it is, that in the middle of a family; None where it is the boom with its sensors."""
        return self.plant.centre.to_statespace() if isinstance(self.plant, AffineFamily) else self.plant

    @staticmethod
    def scene(**options: Any) -> FieldScene:
        """Return the field with some of its properties changed; see :class:`FieldScene`.

        Parameters
        ----------
        options
            Properties of :class:`FieldScene` by name.

        Returns
        -------
        FieldScene
            The field, its other properties at their defaults.

        Raises
        ------
        TypeError, ValueError
            As for :class:`FieldScene`.
        """
        return FieldScene(**options)

    def evaluate(self, scene: FieldScene | None = None, passive: BoomParameters | None = None) -> SuspensionResult:
        """Judge the design beside a passive boom.

        Parameters
        ----------
        scene : FieldScene, optional
            The field that both are driven over; by default ``FieldScene()``.
        passive : BoomParameters, optional
            The boom to compare with; by default Table 2 of Anthonis & Ramon (2003).

        Returns
        -------
        SuspensionResult
            What was found, as text and for a report.

        Raises
        ------
        TypeError, ValueError
            As for :func:`boomctl.simulate_loop` and of the analyses.
        """
        where = FieldScene() if scene is None else scene
        base = BoomParameters() if passive is None else passive
        before = performance("passive, Table 2" if passive is None else "passive", where, base)
        family = self.plant if isinstance(self.plant, AffineFamily) else None
        after = performance(self.title, where, self.parameters, self.controller, self.own_plant, delay=self.delay)
        assured: Assurance | OwnPlantAssurance | SampledAssurance | PassiveAssurance | None = None
        if family is not None and self.controller is not None and self.controller.isctime():
            assured = assure_own_plant(self.parameters, family, self.controller, where)
        elif self.plant is None:
            if self.controller is None:
                assured = assure_passive(self.parameters, where)
            elif self.controller.isctime():
                assured = assure(self.parameters, self.controller, where)
            else:
                late = where.delay if self.delay is None else self.delay
                assured = assure_sampled(self.parameters, self.controller, where, late)
        return SuspensionResult(
            design=self, scene=where, passive_parameters=base, passive=before, active=after, assured=assured
        )


@dataclass(frozen=True)
class SuspensionResult:
    """What a suspension is worth.

    Attributes
    ----------
    design : SuspensionDesign
        The design that was judged.
    scene : FieldScene
        The field it was driven over.
    passive_parameters : BoomParameters
        The boom it is compared with.
    passive, active : Performance
        What that boom does, and what the design does.
    assured : Assurance, SampledAssurance, PassiveAssurance, OwnPlantAssurance or None
        Margins, uncertainty and the exact boom, or a finer mesh of a discrete controller's; without margins of a passive
        design; of one on a plant of its own the uncertainty alone, and None where that is no family or time is discrete.
    """

    design: SuspensionDesign
    scene: FieldScene
    passive_parameters: BoomParameters
    passive: Performance
    active: Performance
    assured: Assurance | OwnPlantAssurance | SampledAssurance | PassiveAssurance | None = field(repr=False)

    __repr__ = compact

    @property
    def yaw_reduction_db(self) -> float:
        """By how much the certified peak of the yaw comes down [dB]."""
        return 20.0 * log10(self.passive.yaw.lower / self.active.yaw.lower)

    @property
    def deposit_cv(self) -> float:
        """Coefficient of variation of the deposit."""
        return self.active.spray.cv

    @property
    def within_limits(self) -> bool:
        """Whether the run hit no end stop and no force limit."""
        return not self.active.run.stops and not any(self.active.run.saturation_share.values())

    @property
    def better(self) -> bool:
        """Whether certified peak and deposit CV are below those of the passive boom, within the limits."""
        lower = self.active.sigma.certified and self.active.sigma.peak < self.passive.sigma.peak
        return lower and self.deposit_cv < self.passive.spray.cv and self.within_limits

    @property
    def exact_sigma(self) -> SigmaResult | None:
        """Singular values on the exact boom, which designs in continuous time have."""
        return self.assured.exact_sigma if isinstance(self.assured, Assurance | PassiveAssurance) else None

    @property
    def family_sigma(self) -> tuple[SigmaResult, ...]:
        """Singular values of the closed loop at the corners of the uncertainty."""
        return () if self.assured is None else self.assured.family_sigma

    @property
    def assurance(self) -> Mapping[str, str]:
        """What was checked and found, in words."""
        return {} if self.assured is None else self.assured.statements

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        a, b, scene = self.active, self.passive, self.scene
        held = "within" if self.within_limits else "NOT within"
        return (
            f"Certified peak from {b.sigma.peak:.4g} to {a.sigma.peak:.4g} (the yaw by {self.yaw_reduction_db:.1f} dB),"
            f" deposit CV from {100 * b.spray.cv:.2f} to {100 * a.spray.cv:.2f} %, {held} the limits of"
            f" ±{1e3 * scene.stroke_limit:g} mm and {scene.force_limit:g} N."
        )

    def __str__(self) -> str:
        """Return what a terminal shows."""
        checks = "".join(f"\n  {name}: {found}" for name, found in {**self.design.facts, **self.assurance}.items())
        return f"{self.design.title}: {self.verdict}{checks}"

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Names, numbers and texts that JSON can hold.
        """
        return {
            "design": self.design.name,
            "better_than_passive": self.better,
            "yaw_reduction_db": self.yaw_reduction_db,
            "passive": _numbers(self.passive),
            "active": _numbers(self.active),
            "synthesis": dict(self.design.facts),
            "assurance": dict(self.assurance),
            "controller": None if self.design.controller is None else {"states": self.design.controller.nstates},
            "worst_case": self._worst_case(),
            "deposit_cv_found_over_box": None if self.assured is None else self.assured.deposit.cv,
        }

    @property
    def worst(self) -> Mapping[str, WorstCase]:
        """The worst peaks of jolt and yaw, or of both together, over the box, found and bounded; none where they are not."""
        if isinstance(self.assured, OwnPlantAssurance):
            return {"boom": self.assured.boom.worst}
        if self.assured is None:
            return {}
        return {"jolt": self.assured.jolt.worst, "yaw": self.assured.yaw.worst}

    def _worst_case(self) -> dict[str, Any] | None:
        """Return the worst peaks over the box, found and bounded; None where they were not looked for."""
        found = {}
        for name, worst in self.worst.items():
            bounded = worst.upper_bound < inf
            found[name] = {
                "found": worst.norm.lower,
                "upper_bound": worst.upper_bound if bounded else None,
                "gap": worst.gap if bounded else None,
            }
        return found or None

    def report(self, tell: Callable[[str], None] = lambda text: None) -> Report:
        """Return the report: pictures, tables, and the numbers of ``results.json``.

        Parameters
        ----------
        tell : callable, optional
            Is told in words what comes next.

        Returns
        -------
        Report
            ``.write(folder)`` writes it.
        """
        design, scene, before, after = self.design, self.scene, self.passive, self.active
        tell("pictures")
        summary = Section(
            "What it is worth", (self.verdict, *design.notes), (sections.comparison_table(before, after, self.worst),)
        )
        tables = (
            sections.parameter_table(before.title, self.passive_parameters, after.title, design.parameters),
            *([sections.fact_table(design.facts)] if design.facts else []),
        )
        synthesis = Section(
            "Plant and synthesis",
            (
                sections.plant_text(
                    design.parameters,
                    scene,
                    design.controller is not None,
                    None if design.own_plant is None else design.own_plant.nstates,
                ),
            ),
            tables,
        )
        parts = [
            summary,
            synthesis,
            *sections.weight_sections(design.weights),
            sections.sigma_section(before, after, self.exact_sigma, self.family_sigma),
            *sections.assurance_sections(self.assurance, scene, design.plant is not None),
            sections.run_section(before, after, scene),
            sections.spray_section(before, after),
        ]
        lead = f"{design.title}: what it does to the boom's motion and to the spray, beside the boom as it is."
        files = self.controller_files()
        if files:
            parts.append(sections.files_section(tuple(files), scene, after.run.sample_time))
        return Report(f"Suspension: {design.title}", (lead,), tuple(parts), self.as_dict(), files)

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 with its limits.

        A controller that is too fast for the scene's sampling has no C code.

        Returns
        -------
        dict of str to bytes or str
            What the files hold, by their names.
        """
        K, scene = self.design.controller, self.scene
        if K is None:
            return {}
        told = {"design": self.design.name, "title": self.design.title, **self.design.facts}
        shared: dict[str, Any] = {"certificate": dict(self.assurance), "provenance": told}
        found = controller_contents(K, _CONTROLLER, ".json", **shared)
        found |= controller_contents(K, _CONTROLLER, ".mat", **shared)
        try:
            found |= controller_contents(
                K, _CONTROLLER, ".c", sample_time=self.active.run.sample_time, force_limit=scene.force_limit, **shared
            )
        except ValueError:
            return found
        return found


def _numbers(p: Performance) -> dict[str, Any]:
    return {
        "title": p.title,
        "peak": p.sigma.peak,
        "peak_upper_bound": p.sigma.certificate.upper,
        "peak_omega": p.sigma.peak_omega,
        "yaw_peak": p.yaw.lower,
        "jolt_peak": p.jolt.lower,
        "deposit_cv": p.spray.cv,
        "deposit_cv_jolt": p.spray_by_jolt.cv,
        "deposit_cv_yaw": p.spray_by_yaw.cv,
        "share_outside_10": p.spray.share_outside_10,
        "share_outside_20": p.spray.share_outside_20,
        "worst_dose": p.spray.worst_dose,
        "rms_tip_speed": p.spray.rms_tip_speed,
        "stroke": p.stroke,
        "force": p.force,
        "force_rate": p.force_rate,
        "end_stops_hit": len(p.run.stops),
        "saturation_share": p.run.saturation_share,
    }
