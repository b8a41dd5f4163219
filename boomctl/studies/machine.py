"""A controller for a machine of one's own: verified peaks before and after, margins, stability over a family; a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from boomctl.analysis.box.robustness import RobustStability, robust_stability
from boomctl.analysis.box.scheduled import ScheduledController
from boomctl.analysis.loops import joined
from boomctl.analysis.margins import Margins, margins
from boomctl.analysis.sigma import SigmaComparison, SigmaResult, sigma
from boomctl.checks import instance, known, names, positive, signal_name
from boomctl.lti.modal import side_of_axis
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.report import Section, Table
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.studies.evaluation import (
    Design,
    Evaluation,
    Finding,
    finding_table,
    peak_finding,
    stability_finding,
    word_table,
)
from boomctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class MachineDesign(Design):
    """A machine, such as `boomctl.structure` assembles, and a controller for it.

    Attributes
    ----------
    plant : SecondOrderModel, control.StateSpace or Family
        The machine, signals named.  For a family, peaks and margins are evaluated at its center, stability over its box.
    controller : control.StateSpace or ScheduledController
        ``u = K y`` in continuous time; its inputs are outputs of the plant, its outputs inputs of it.  A scheduled controller
        needs a family, one of whose parameters is its signal.
    inputs, outputs : str or sequence of str, optional
        Signals of the plant for the evaluation of the loop. If None, all inputs that the controller does not drive, and
        all outputs.
    sample_time : float, optional
        Sampling time of C code of the controller [s]; without one, there is none.
    control_limit : float, optional
        Largest value of each control, for C code.
    name, title, synthesis_info, notes, results, sections
        See `Design`.

    Raises
    ------
    TypeError, ValueError
        If a system has the wrong type, or the signal names of plant and controller do not match.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> boom = bc.spray_boom().select(["actuator_left", "suspension_left"], ["tip_left", "stroke_left"])
    >>> signals = {"inputs": "stroke_left", "outputs": "suspension_left"}
    >>> damper = control.ss([[-30.0]], [[30.0]], [[3000.0]], [[-3000.0]], **signals)
    >>> design = bc.studies.MachineDesign("damper", "a damper at the left spring", boom, damper)
    >>> design.controller.input_labels
    ['stroke_left']
    """

    plant: SecondOrderModel | control.StateSpace | Family
    controller: control.StateSpace | ScheduledController
    inputs: str | Sequence[str] | None = None
    outputs: str | Sequence[str] | None = None
    sample_time: float | None = None
    control_limit: float | None = None

    __repr__ = compact

    def __post_init__(self) -> None:
        signal_name("name", self.name)
        instance("title", self.title, str)
        loop = joined(*self._nominal)
        names("input", self.inputs, loop.disturbances)
        names("output", self.outputs, loop.outputs)
        for what in ("sample_time", "control_limit"):
            if getattr(self, what) is not None:
                positive(what, getattr(self, what))

    @property
    def _nominal(self) -> tuple[SecondOrderModel | control.StateSpace, control.StateSpace]:
        """The plant and the controller, those in the center of a family."""
        plant, K = self.plant, self.controller
        family = instance("plant", plant, Family) if isinstance(K, ScheduledController) else plant
        if not isinstance(family, Family):
            return plant, K  # type: ignore[return-value]
        middle = {name: (low + high) / 2.0 for name, (low, high) in family.ranges.items()}
        if isinstance(K, ScheduledController):
            K = K.at(middle[known("parameter of plant", K.signal, middle)])
        return family.nominal, K

    @one_blas_thread
    def evaluate(self) -> MachineResult:
        """Evaluate the design: peaks without and with the controller, stability, margins.

        Returns
        -------
        MachineResult
            Results, as text and as a report.

        Raises
        ------
        TypeError, ValueError
            See :func:`boomctl.sigma`, :func:`boomctl.margins` and :func:`boomctl.robust_stability`.
        """
        plant, K = self._nominal
        loop = joined(plant, K)
        inputs = names("input", self.inputs, loop.disturbances)
        outputs = names("output", self.outputs, loop.outputs)
        closed = loop.closed().select(inputs, outputs)
        whole = closed.statespace("closed loop")
        before, after = sigma(plant, inputs=inputs, outputs=outputs), sigma(whole)
        omega = np.union1d(before.omega, after.omega)  # both on one grid, with the peaks of either
        stable = bool((side_of_axis(loop.system.poles) < 0).all())
        return MachineResult(
            design=self,
            before=sigma(plant, omega, inputs, outputs),
            after=sigma(whole, omega),
            margins=margins(plant, K) if stable else None,
            stable=stable,
            robust=robust_stability(self.plant, self.controller) if isinstance(self.plant, Family) else None,
        )


@dataclass(frozen=True, eq=False)
class MachineResult(Evaluation):
    """The evaluation of a machine with its controller.

    Attributes
    ----------
    design : MachineDesign
        The design that was evaluated.
    before, after : SigmaResult
        Singular values without and with the controller, with verified peaks.
    margins : Margins or None
        Margins of the loop; None where it is unstable.
    stable : bool
        True if the closed loop is stable, including uncontrollable and unobservable modes.
    robust : RobustStability or None
        Stability over the box of a family; None without one.
    """

    design: MachineDesign
    before: SigmaResult
    after: SigmaResult
    margins: Margins | None
    stable: bool
    robust: RobustStability | None = None

    __repr__ = compact

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        peaks = [f"{s.peak:.4g}" if isfinite(s.peak) else "infinite" for s in (self.before, self.after)]
        proof = "verified" if self.after.verified else "NOT verified"
        held = "The loop is stable" if self.stable else "The loop is NOT stable"
        text = f"{held}; largest singular value from {peaks[0]} to {peaks[1]}, {proof}."
        if self.robust is None:
            return text
        ranges = [f"{name} {low:g} to {high:g}" for name, (low, high) in self.design.plant.ranges.items()]  # type: ignore[union-attr]
        return f"{text} {'Proved' if self.robust.proved else 'NOT proved'} stable at every {' and '.join(ranges)}."

    @property
    def words(self) -> dict[str, str]:
        """The findings by name."""
        box = {} if self.robust is None else {"stability over the family": self.robust.summary}
        return {**self.design.synthesis_info, **box}

    def __str__(self) -> str:
        """Return the evaluation as text."""
        return super().__str__() + (f"\n{self.margins}" if self.margins else "")

    def _results(self) -> dict[str, Any]:
        design, box = self.design, self.robust
        return {
            "design": design.name,
            "stable": self.stable,
            "synthesis": dict(design.synthesis_info),
            "before": _peak(self.before),
            "after": _peak(self.after),
            "disk_margin": self.margins.multiloop_io.alpha if self.margins else None,
            **({} if box is None else {"proved": box.proved, "spectral_abscissa": box.spectral_abscissa}),
        }

    def _sections(self) -> Iterator[Section]:
        from boomctl.plotting.canvas import figure_of, picture

        caption = f"Singular values from {', '.join(self.after.input_labels)} to {', '.join(self.after.output_labels)}."
        yield Section("Synthesis", self.design.notes, (word_table(self.words),) if self.words else ())
        held = Finding("closed loop", "stable" if self.stable else "NOT stable", method="poles of the loop")
        peaks = {"without controller": self.before, "with controller": self.after}
        checked = [
            held,
            *(peak_finding(f"largest singular value {name}", item.certificate) for name, item in peaks.items()),
        ]
        if self.robust is not None:
            checked.append(stability_finding("stability over the family", self.robust, self.design.controller))
        yield Section("Verification", tables=(finding_table(checked),))
        drawn = picture("sigma", figure_of(SigmaComparison(peaks).plot), caption)
        yield Section("Singular values", pictures=(drawn,))
        if self.margins is not None:
            heads, *lines = self.margins._table()
            yield Section("Margins", tables=(Table(heads, tuple(lines)),))

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 where it is sampled.

        Returns
        -------
        dict of str to bytes or str
            Contents of the files by name; none of a scheduled controller.
        """
        return self._controller_files({"verdict": self.verdict}, self.design.sample_time, self.design.control_limit)


def _peak(result: SigmaResult) -> dict[str, Any]:
    """Return a peak; values that are not finite are None."""
    peaks = {"peak": result.peak, "peak_omega": result.peak_omega}
    finite = {name: value if isfinite(value) else None for name, value in peaks.items()}
    return {**finite, "verified": result.verified}
