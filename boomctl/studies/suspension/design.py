"""A suspension and its evaluation: comparison with the passive boom, margins, proofs, a simulation on the field.

From command to report: ``boomctl design`` runs the ``design()`` of a file (``load_design``), which makes a
:class:`SuspensionDesign`; its ``evaluate`` compares it with the passive boom (``evaluate_suspension``) and examines it over
springs and masses and on the exact boom (``SuspensionVerification``), one ``Finding`` a claim;
``SuspensionResult.report`` writes them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import inf, log10
from typing import Any

import numpy as np

from boomctl.analysis.box.worst_case import WorstCase
from boomctl.analysis.sigma import SigmaResult
from boomctl.arrays import Array
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import Footprint
from boomctl.checks import from_on
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.report import Section, Table, number
from boomctl.structure.families import AffineFamily
from boomctl.studies.evaluation import (
    PEAK_DIGITS,
    Design,
    Evaluation,
    Finding,
    finding_table,
    numbers,
    word_table,
    words,
)
from boomctl.studies.suspension.performance import Performance, evaluate_suspension
from boomctl.studies.suspension.scenario import FAMILY_ELEMENTS, FieldScenario
from boomctl.studies.suspension.verification import SuspensionVerification
from boomctl.threads import one_blas_thread

_PASSIVE = ("spring_stiffness", "cradle_damping", "hinge_damping", "boom_mass")  # in the report's table
_SPAN = 15.0  # Part of the simulation that is drawn [s]: some periods of the slowest motion.
_FIELD = 60.0  # Length of field that is drawn [m], in cells of 0.1 m.


@dataclass(frozen=True, eq=False)
class SuspensionDesign(Design):
    """A horizontal suspension: passive parts and, if it is an active one, its controller.

    Attributes
    ----------
    name, title, synthesis_info, notes, results, sections
        See `Design`.
    parameters : BoomParameters
        The machine, passive parts of the suspension included.
    controller : control.StateSpace or None
        ``u = K y`` in SI units; inputs named as outputs of the machine (``stroke_left``, ``tip_left_acceleration``,
        ...), outputs ``suspension_left``, ``suspension_right``.  A discrete one runs at its own sampling time.
    plant : AffineFamily, control.StateSpace or None
        A machine of its own where the controller reads what the boom with its sensors does not offer, such as states.  A
        family is that machine over factors on springs and masses, ``"spring_factor"`` and ``"mass_factor"``, the design's
        own in its middle: stability and the worst peak are then proved over it, of a controller in continuous time.
    weights : mapping from str to control.StateSpace
        Weights of the design, to be drawn over frequency.
    delay : float or None
        Computation delay [s]; by default that of the scenario.

    Examples
    --------
    >>> import boomctl as bc
    >>> soft = bc.studies.SuspensionDesign("soft", "softer springs", bc.BoomParameters(spring_stiffness=550.0))
    >>> soft.controller is None  # a passive suspension
    True
    """

    parameters: BoomParameters = field(default_factory=BoomParameters)
    controller: control.StateSpace | None = None
    plant: AffineFamily | control.StateSpace | None = None
    weights: Mapping[str, control.StateSpace] = field(default_factory=dict)
    delay: float | None = None

    __repr__ = compact

    @one_blas_thread
    def evaluate(self, scenario: FieldScenario | None = None) -> "SuspensionResult":
        """Evaluate the design and the passive boom of Table 2 of Anthonis & Ramon (2003).

        Parameters
        ----------
        scenario : FieldScenario, optional
            The field that both are driven over; by default ``FieldScenario()``.

        Returns
        -------
        SuspensionResult
            Results, as text and as a report.

        Raises
        ------
        TypeError, ValueError
            See :func:`boomctl.simulate_loop` and the analyses.
        """
        where = FieldScenario() if scenario is None else scenario
        p, K, delay = self.parameters, self.controller, where.delay if self.delay is None else self.delay
        family = self.plant if isinstance(self.plant, AffineFamily) else None
        plant = self.plant if family is None else family.nominal.to_statespace()
        before = evaluate_suspension("passive, Table 2", where, BoomParameters())
        after = evaluate_suspension(self.title, where, p, K, plant, delay=delay)  # type: ignore[arg-type]
        findings: Any = ((), None, ())
        if self.plant is None or (family is not None and K is not None and K.isctime()):
            findings = SuspensionVerification(p, K, where, delay, family).verify()
        return SuspensionResult(self, where, before, after, *findings)


@dataclass(frozen=True, eq=False)
class SuspensionResult(Evaluation):
    """The evaluation of a suspension.

    Attributes
    ----------
    design : SuspensionDesign
        The design that was evaluated.
    scenario : FieldScenario
        The field it was driven over.
    passive, active : Performance
        Performance of the boom of Table 2, and of the design.
    findings : tuple of Finding
        Of jolt and yaw, or of the whole boom where it is a plant of its own: margins, stability and the largest peak from
        platform to tips over springs of 70 to 130 % and a beam mass of 80 to 120 %; stability of the yaw at its measured
        frequency; the least even deposit; stability with the exact beam, or on a finer mesh.  Empty of a plant of its own
        that is no family, or has a discrete controller.
    exact_sigma : SigmaResult or None
        Singular values with the exact beam; None of sampled loops and of plants of their own.
    family_sigma : tuple of SigmaResult
        Singular values at corners and middles of the edges of the uncertainty.
    """

    design: SuspensionDesign
    scenario: FieldScenario
    passive: Performance
    active: Performance
    findings: tuple[Finding, ...] = field(repr=False)
    exact_sigma: SigmaResult | None = field(repr=False)
    family_sigma: tuple[SigmaResult, ...] = field(repr=False)

    __repr__ = compact

    @property
    def yaw_reduction_db(self) -> float:
        """Reduction of the verified peak of the yaw [dB]."""
        return 20.0 * log10(self.passive.yaw.lower_bound / self.active.yaw.lower_bound)

    @property
    def within_limits(self) -> bool:
        """True if no end stop and no force limit was reached."""
        return not self.active.run.stop_contacts and not any(self.active.run.saturation_fraction.values())

    @property
    def better(self) -> bool:
        """True if peak and deposit CV are below those of the passive boom, within the limits."""
        lower = self.active.sigma.verified and self.active.sigma.peak < self.passive.sigma.peak
        return lower and self.active.spray.cv < self.passive.spray.cv and self.within_limits

    @property
    def robust(self) -> bool:
        """True if the loop is proved robustly stable, and is stable with the exact boom or a finer mesh.

        False if it is not examined: with an own state-space plant, or a sampled controller of an own family.
        """
        claims = [item.proved for item in self.findings if item.proved is not None]
        return bool(claims) and all(claims)

    def of(self, kind: type) -> dict[str, Any]:
        """Return the results of jolt and yaw, or of the full boom if it is not decoupled.

        Parameters
        ----------
        kind : type
            `Margins` or `WorstCase`.

        Returns
        -------
        dict
            By "jolt" and "yaw", or by "boom".
        """
        return {_part(item): item.value for item in self.findings if isinstance(item.value, kind)}

    @property
    def worst(self) -> Mapping[str, WorstCase]:
        """Worst-case peaks of jolt and yaw, or of the full boom, over the box; empty if not computed."""
        return self.of(WorstCase)

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        a, b, scenario = self.active, self.passive, self.scenario
        peak = "Verified peak" if a.sigma.verified and b.sigma.verified else "Peak, NOT verified,"
        held = "within" if self.within_limits else "NOT within"
        return (
            f"{peak} from {b.sigma.peak:.4g} to {a.sigma.peak:.4g} (the yaw by {self.yaw_reduction_db:.1f} dB),"
            f" deposit CV from {100 * b.spray.cv:.2f} to {100 * a.spray.cv:.2f} %, {held} the limits of"
            f" ±{1e3 * scenario.end_stop:g} mm and {scenario.control_limit:g} N."
        )

    @property
    def words(self) -> dict[str, str]:
        """The findings by name."""
        return {**self.design.synthesis_info, **words(self.findings)}

    def _results(self) -> dict[str, Any]:
        K, worst = self.design.controller, {}
        for name, result in self.worst.items():
            bound, gap = (result.upper_bound, result.relative_gap) if result.upper_bound < inf else (None, None)
            worst[name] = {"found": result.worst_norm.lower_bound, "upper_bound": bound, "relative_gap": gap}
        return {
            "design": self.design.name,
            "better_than_passive": self.better,
            "yaw_reduction_db": self.yaw_reduction_db,
            "passive": self.passive.to_dict(),
            "active": self.active.to_dict(),
            "synthesis": dict(self.design.synthesis_info),
            "verification": words(self.findings),
            "controller": None if K is None else {"states": K.nstates},
            "worst_case": worst or None,
            "deposit_cv_found_over_box": None,
            **numbers(self.findings),
        }

    def _sections(self) -> Iterator[Section]:
        from boomctl.plotting.canvas import new_figure, picture
        from boomctl.plotting.suspension import draw_run, draw_suspension_sigma, draw_weights

        design, scenario, before, after = self.design, self.scenario, self.passive, self.active
        p, base, titles = design.parameters, BoomParameters(), (before.title, after.title)
        run, bounds = [item.key for item in before.findings].index("stroke"), [*self._bounds()]
        blank, look = [replace(item, text="-", method="") for item in bounds], {"heads": titles, "align": "lrrl"}
        columns = ((*x.findings[:3], *more, *x.findings[3:run]) for x, more in ((before, blank), (after, bounds)))
        yield Section("Passive and active boom", design.notes, (finding_table(*columns, **look),))
        text = (
            f"The boom of Anthonis & Ramon (2003): {scenario.elements} finite elements, accelerometers of"
            f" {scenario.accelerometer_bandwidth_hz:g} Hz. The static gain from yaw of the platform to the tips is"
            f" {p.length / p.actuator_distance:.3f}, a lower bound of the peak of every suspension that centers the boom."
        )
        parts = ((name.replace("_", " "), *(f"{getattr(x, name):g}" for x in (base, p))) for name in _PASSIVE)
        synthesis = (word_table(design.synthesis_info),) if design.synthesis_info else ()
        yield Section(
            "Plant and synthesis", (text,), (Table(("passive parts, SI units", *titles), tuple(parts)), *synthesis)
        )
        if design.weights:
            drawn = draw_weights(design.weights, np.geomspace(0.05, 500.0, 400))
            formulas = word_table({k: _formula(W) for k, W in design.weights.items()}, ("weight", "transfer function"))
            shown = picture("weights", drawn, "Weights, in the units of the design.")
            yield Section("Weights", ("Frequencies in rad/s.",), (formulas,), (shown,))
        caption = (
            "Singular values from platform actuators to tips; circles: verified peaks. Dots: the exact Euler-Bernoulli boom."
            " Faint: other springs and boom masses of the box. A sampled loop is shown at its samples."
        )
        drawn = draw_suspension_sigma(before.sigma, after.sigma, titles, self.exact_sigma, self.family_sigma)
        yield Section("Singular values", pictures=(picture("sigma", drawn, caption),))
        if self.findings:
            text = (
                "Each line is computed independently of the synthesis. Springs and boom mass are relative to those of the"
                f" design; over them the boom has {FAMILY_ELEMENTS} elements unless the design has a plant of its own."
            )
            yield Section("Verification", (text,), (finding_table(self.findings),))
        text = (
            f"All of the field is assumed: {' '.join(repr(scenario).split())}. The tractor has {scenario.tractor.mass:g} kg,"
            f" a wheelbase of {scenario.tractor.wheelbase:g} m and a track of {scenario.tractor.track_width:g} m; a"
            f" controller is sampled every {1e3 * after.run.sample_time:g} ms, its forces {1e3 * after.run.delay:g} ms late."
        )
        start, length = scenario.warmup_time + 0.25 * scenario.duration, min(_SPAN, 0.75 * scenario.duration)
        limits, span = (scenario.control_limit, scenario.end_stop), (start, start + length)
        drawn = draw_run(before.run, after.run, labels=titles, limits=limits, span=span)
        shown = picture("run", drawn, f"Platform, left tip, left stroke and forces, {length:g} s of it.")
        driven = finding_table(before.findings[run:], after.findings[run:], **look)
        yield Section("Simulation on the field", (text,), (driven,), (shown,))
        drawn = new_figure(9.0, 5.1)
        for ax, item in zip(drawn.subplots(2, 1), (before, after), strict=True):
            item.spray.plot(ax, label=item.title, length=_FIELD)
        text = f"Deposit relative to the nominal dose, in cells of 0.1 m by 0.1 m. Assumed of each nozzle: {Footprint()!r}."
        # So many cells are shown as PNG.
        shown = picture("deposit", drawn, "Deposit of the passive and the active boom.", "png", "svg")
        yield Section("Spray on the field", (text,), pictures=(shown,))

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 with its limits.

        Returns
        -------
        dict of str to bytes or str
            Contents of the files by name; no C code of a controller that is too fast for the sampling of the field run.
        """
        return self._controller_files(words(self.findings), self.active.run.sample_time, self.scenario.control_limit)

    def _bounds(self) -> Iterator[Finding]:
        """Yield the worst peaks over the box where they are bounded."""
        for item in self.findings:
            if isinstance(item.value, WorstCase) and item.value.upper_bound < inf:
                bound = number(
                    float(from_on(item.value.upper_bound, PEAK_DIGITS)), PEAK_DIGITS
                )  # not rounded downwards
                text = f"{bound} at most (gap {100 * item.value.relative_gap:.2g} %)"
                name = f"worst peak of the {_part(item)}, springs ±30 %, boom mass ±20 %: proved"
                yield replace(item, name=name, text=text)


def _part(item: Finding) -> str:
    """Return the part of the boom that a finding is of."""
    return item.name.split(": ")[0] if ": " in item.name else "boom"


def _formula(weight: control.StateSpace) -> str:
    """Return the transfer function of a weight of one signal as gain, zeros and poles."""
    zeros, poles = weight.zeros(), weight.poles()
    gain = np.real(weight(1.0) * np.prod(1.0 - poles) / np.prod(1.0 - zeros))
    return f"{gain:.4g} {_factors(zeros)} / ({_factors(poles) or 1})".replace("  ", " ")


def _factors(roots: Array) -> str:
    pairs = [f"(s² + {-2.0 * root.real:.4g} s + {abs(root) ** 2:.4g})" for root in roots if root.imag > 0.0]
    return " ".join([*pairs, *(f"(s + {-root.real:.4g})" for root in roots if root.imag == 0.0)])
