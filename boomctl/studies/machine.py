"""A controller for a machine of one's own: judged by certified peaks before and after, and by margins; a report."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.loops import joined
from boomctl.analysis.margins import Margins, margins
from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.checks import instance, names, positive, signal_name
from boomctl.lti.modal import side_of_axis
from boomctl.printing import compact
from boomctl.report import Section, Table
from boomctl.studies.findings import Finding, Judged, WithoutScene, facts, files_section, finite, stored, word_table
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True, eq=False)
class MachineDesign(WithoutScene):
    """A machine, such as `boomctl.structure` assembles, and a controller for it.

    Attributes
    ----------
    name, title : str
        A name in one word, and what it is in a line.
    plant : SecondOrderModel or control.StateSpace
        The machine, signals named.
    controller : control.StateSpace
        ``u = K y`` in continuous time; its inputs are outputs of the plant, its outputs inputs of it.
    inputs, outputs : str or sequence of str, optional
        Signals of the plant between which the loop is judged; by default from all inputs that the controller does not
        drive to all outputs.
    sample_time : float, optional
        Sampling time of C code of the controller [s]; without one, there is none.
    force_limit : float, optional
        Largest value of each control, for C code.
    facts : mapping of str to str
        What synthesis and reduction say of themselves.
    notes : tuple of str
        What a reader of the report should know.

    Raises
    ------
    TypeError, ValueError
        Other kinds of system; signals that do not meet.

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

    name: str
    title: str
    plant: SecondOrderModel | control.StateSpace
    controller: control.StateSpace
    inputs: str | Sequence[str] | None = None
    outputs: str | Sequence[str] | None = None
    sample_time: float | None = None
    force_limit: float | None = None
    facts: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    __repr__ = compact

    def __post_init__(self) -> None:
        signal_name("name", self.name)
        instance("title", self.title, str)
        loop = joined(self.plant, self.controller)
        names("input", self.inputs, loop.disturbances)
        names("output", self.outputs, loop.outputs)
        for what in ("sample_time", "force_limit"):
            if getattr(self, what) is not None:
                positive(what, getattr(self, what))

    @one_blas_thread
    def evaluate(self, scene: None = None) -> MachineResult:
        """Judge the design: peaks without and with the controller, stability, margins.

        Parameters
        ----------
        scene : None
            A machine of one's own has no scene.

        Returns
        -------
        MachineResult
            What was found, as text and for a report.

        Raises
        ------
        TypeError, ValueError
            As for :func:`boomctl.sigma` and :func:`boomctl.margins`.
        """
        loop = joined(self.plant, self.controller)
        inputs = names("input", self.inputs, loop.disturbances)
        outputs = names("output", self.outputs, loop.outputs)
        closed = loop.closed().select(inputs, outputs)
        whole = closed.statespace("closed loop")
        before, after = sigma(self.plant, inputs=inputs, outputs=outputs), sigma(whole)
        omega = np.union1d(before.omega, after.omega)  # both on one grid, with the peaks of either
        stable = bool((side_of_axis(loop.system.poles) < 0).all())
        return MachineResult(
            design=self,
            before=sigma(self.plant, omega, inputs, outputs),
            after=sigma(whole, omega),
            margins=margins(self.plant, self.controller) if stable else None,
            stable=stable,
        )


@dataclass(frozen=True, eq=False)
class MachineResult(Judged):
    """What a controller does for a machine.

    Attributes
    ----------
    design : MachineDesign
        The design that was judged.
    before, after : SigmaResult
        Singular values without and with the controller, with certified peaks.
    margins : Margins or None
        Margins of the loop; None where it is unstable.
    stable : bool
        Whether every pole of the closed loop decays, hidden ones included.
    """

    kind, about = "Machine: ", "the machine without and with its controller"

    design: MachineDesign
    before: SigmaResult
    after: SigmaResult
    margins: Margins | None
    stable: bool

    __repr__ = compact

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        peaks = [f"{s.peak:.4g}" if isfinite(s.peak) else "infinite" for s in (self.before, self.after)]
        proof = "certified" if self.after.certified else "NOT certified"
        held = "The loop is stable" if self.stable else "The loop is NOT stable"
        return f"{held}; largest singular value from {peaks[0]} to {peaks[1]}, {proof}."

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was found, in the order in which it is told."""
        peaks = [
            finite({"peak": found.peak, "peak_omega": found.peak_omega, "certified": bool(found.certified)})
            for found in (self.before, self.after)
        ]
        margin = self.margins.everywhere.alpha if self.margins else None
        return (
            *stored(design=self.design.name, stable=self.stable),
            *facts(self.design.facts),
            *stored(before=peaks[0], after=peaks[1], disk_margin=margin),
        )

    def __str__(self) -> str:
        """Return what a terminal shows."""
        return super().__str__() + (f"\n{self.margins.render()}" if self.margins else "")

    def _sections(self, tell: Callable[[str], None], files: tuple[str, ...]) -> Iterator[Section]:
        from boomctl.plotting.canvas import new_figure, picture, style
        from boomctl.plotting.sigma import plot_sigma

        tell("pictures")
        with style():
            figure = new_figure()
            ax = figure.add_subplot()
            plot_sigma(self.before, label="without controller", ax=ax)
            plot_sigma(self.after, label="with controller", ax=ax)
            ax.legend()
        caption = f"Singular values from {', '.join(self.after.inputs)} to {', '.join(self.after.outputs)}."
        tables = (word_table(self.design.facts),) if self.design.facts else ()
        yield Section("What it is worth", (self.verdict, *self.design.notes), tables)
        yield Section("Singular values", pictures=(picture("sigma", figure, caption),))
        if self.margins is not None:
            heads, *lines = self.margins._table()
            yield Section("Margins", tables=(Table(heads, tuple(lines)),))
        yield files_section(files)

    def controller_files(self) -> dict[str, bytes | str]:
        """Return the controller for other programs: JSON, MATLAB, and C99 where it is sampled.

        Returns
        -------
        dict of str to bytes or str
            What the files hold, by their names.
        """
        design = self.design
        suffixes = (".json", ".mat") if design.sample_time is None else (".json", ".mat", ".c")
        c = {"sample_time": design.sample_time, "force_limit": design.force_limit}
        return self._controller_files({"verdict": self.verdict}, suffixes, **c)
