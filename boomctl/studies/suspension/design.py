"""A suspension that is to be judged, and the judging: beside the boom as it is, with everything that vouches for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import inf, log10
from typing import TYPE_CHECKING

from boomctl.analysis.box.worst_case import WorstCase
from boomctl.boom.parameters import BoomParameters
from boomctl.printing import compact
from boomctl.report import Section
from boomctl.structure.families import AffineFamily
from boomctl.studies.findings import Finding, Judged, facts, numbers, stored, words
from boomctl.studies.suspension.assurance import Assurance, Examined
from boomctl.studies.suspension.performance import Performance, performance
from boomctl.studies.suspension.scene import FieldScene
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


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

    @one_blas_thread
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
        p, K, delay = self.parameters, self.controller, where.delay if self.delay is None else self.delay
        before = performance("passive, Table 2" if passive is None else "passive", where, base)
        after = performance(self.title, where, p, K, self.own_plant, delay=delay)
        family = self.plant if isinstance(self.plant, AffineFamily) else None
        examined, assured = Examined(p, K, where, delay, family), None
        if self.plant is None or (family is not None and K is not None and K.isctime()):
            assured = examined.assured()
        return SuspensionResult(self, where, base, before, after, assured)


@dataclass(frozen=True)
class SuspensionResult(Judged):
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
    assured : Assurance or None
        What vouches for the design, apart from its synthesis; None of one on a plant of its own that is no family, or with
        a discrete controller.
    """

    kind = "Suspension: "
    about = "what it does to the boom's motion and to the spray, beside the boom as it is"

    design: SuspensionDesign
    scene: FieldScene
    passive_parameters: BoomParameters
    passive: Performance
    active: Performance
    assured: Assurance | None = field(repr=False)

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
    def assurance(self) -> Mapping[str, str]:
        """What was checked and found, in words."""
        return {} if self.assured is None else words(self.assured.findings)

    @property
    def worst(self) -> Mapping[str, WorstCase]:
        """The worst peaks of jolt and yaw, or of both together, over the box, found and bounded; none where they are not."""
        return {} if self.assured is None else self.assured.of(WorstCase)

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        a, b, scene = self.active, self.passive, self.scene
        peak = "Certified peak" if a.sigma.certified and b.sigma.certified else "Peak, NOT certified,"
        held = "within" if self.within_limits else "NOT within"
        return (
            f"{peak} from {b.sigma.peak:.4g} to {a.sigma.peak:.4g} (the yaw by {self.yaw_reduction_db:.1f} dB),"
            f" deposit CV from {100 * b.spray.cv:.2f} to {100 * a.spray.cv:.2f} %, {held} the limits of"
            f" ±{1e3 * scene.stroke_limit:g} mm and {scene.force_limit:g} N."
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order in which it is told."""
        K, assured = self.design.controller, () if self.assured is None else self.assured.findings
        worst = {}
        for name, found in self.worst.items():
            bound, gap = (found.upper_bound, found.gap) if found.upper_bound < inf else (None, None)
            worst[name] = {"found": found.norm.lower, "upper_bound": bound, "gap": gap}
        states = None if K is None else {"states": K.nstates}
        return (
            *stored(design=self.design.name, better_than_passive=self.better, yaw_reduction_db=self.yaw_reduction_db),
            *stored(passive=numbers(self.passive.findings), active=numbers(self.active.findings)),
            *facts(self.design.facts),
            *stored(assurance=words(assured), controller=states, worst_case=worst or None),
            *stored(deposit_cv_found_over_box=None),  # unless the next ones say it
            *assured,
        )

    def _sections(self, files: tuple[str, ...]) -> Iterator[Section]:
        from boomctl.studies.suspension import sections  # it draws

        design, scene, before, after = self.design, self.scene, self.passive, self.active
        tables = (sections.comparison_table(before, after, self.worst),)
        yield Section("What it is worth", (self.verdict, *design.notes), tables)
        yield sections.plant_section((before.title, after.title), self.passive_parameters, design, scene)
        if design.weights:
            yield sections.weight_section(design.weights)
        yield sections.sigma_section(before, after, self.assured)
        if self.assured is not None:
            yield sections.assurance_section(self.assurance, scene, design.plant is not None)
        yield sections.run_section(before, after, scene)
        yield sections.spray_section(before, after)
        if files:
            yield sections.controller_section(files, scene, after.run.sample_time)

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 with its limits.

        A controller that is too fast for the scene's sampling has no C code.

        Returns
        -------
        dict of str to bytes or str
            What the files hold, by their names.
        """
        if self.design.controller is None:
            return {}
        c = {"sample_time": self.active.run.sample_time, "force_limit": self.scene.force_limit}
        found = self._controller_files(self.assurance, (".json", ".mat"))
        with suppress(ValueError):
            found |= self._controller_files(self.assurance, (".c",), **c)
        return found
