"""Result of tuning."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

from boomctl.analysis.claim import Claim
from boomctl.analysis.sigma import sigma
from boomctl.lti.system import Lti
from boomctl.printing import Summarized, count, listed, system
from boomctl.synthesis.certificate import Design, DesignCertificate
from boomctl.synthesis.plants.channels import channel_of
from boomctl.synthesis.plants.partition import GeneralizedPlant
from boomctl.tuning.solver.search import TuneStart

if TYPE_CHECKING:
    import control

_UNFINISHED = ("stopped", "worse by", "found nothing")  # first words of stages that end a search early


@dataclass(frozen=True)
class TuneResult(Summarized, Design):
    """Tuned controller of a given structure, with its verified closed loops.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, from the measurements to the controls, labeled as in the generalized plant, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        Loop from the disturbances to the performance signals, for the model with the largest norm.
    closed_loops : tuple of control.StateSpace
        Loops of all models.
    gamma : float
        Verified largest objective over all models.
    certificate : DesignCertificate
        Verified norms, and a lower bound for controllers of any order.
    values : dict of str to float
        Free parameters by name, in the units of the signals and rad/s.
    plant_parameters : dict of str to float
        Physical parameters among them.
    starts : tuple of TuneStart
        Result of each start.
    models : tuple of str
        Names of the models.
    elapsed : float
        Run time of the search, including verification [s].
    """

    _controller: Lti = field(repr=False)
    _loops: tuple[Lti, ...] = field(repr=False)
    _worst: int = field(repr=False)
    gamma: float
    certificate: DesignCertificate
    values: dict[str, float]
    plant_parameters: dict[str, float]
    starts: tuple[TuneStart, ...]
    models: tuple[str, ...]
    _plants: tuple[GeneralizedPlant, ...] = field(default=(), repr=False, compare=False)
    elapsed: float = field(default=0.0, repr=False, compare=False)

    @property
    def success(self) -> bool:
        """True if the search terminated normally, without a worse point in the family; False after the time limit."""
        return not any(stage.startswith(_UNFINISHED) for stage in self.certificate.stages)

    @property
    def nit(self) -> int:
        """Steps taken from all starts."""
        return sum(start.nit for start in self.starts)

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims to be proved: stability of the loops with the original plants, and norms of the channels."""
        for name, plant in zip(self.models, self._plants, strict=False):
            what = f"the closed loop of {name}" if name else "the closed loop"
            controller = self._controller if plant.ncon else None
            yield Claim(what, plant.system, controller, stable=True)
            for item in self.certificate.channel_norms:
                if item.model == name:
                    part = channel_of(plant, item.channel).system
                    yield item.norm._claim(f"{what}, {item.channel.text}", part, controller)

    @cached_property
    def closed_loop(self) -> "control.StateSpace":
        """Loop as a system of python-control. Computed on first access."""
        return self._loops[self._worst].statespace("closed_loop")

    @cached_property
    def closed_loops(self) -> "tuple[control.StateSpace, ...]":
        """Loops as systems of python-control. Computed on first access."""
        return tuple(loop.statespace(f"closed_loop_{i + 1}") for i, loop in enumerate(self._loops))

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Any:
        """Draw the singular values of the loops in which peaks are active, and these peaks.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        frequency_unit : {"Hz", "rad/s"}, optional
            Unit of the frequency axis. If None, the unit of existing axes.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        shown = [m for m in self.models if any(peak.model == m for peak in self.certificate.active_peaks)]
        chosen = {name: self._loops[self.models.index(name)] for name in shown or [self.models[self._worst]]}
        curves = {name: sigma(loop.statespace("loop")) for name, loop in chosen.items()}
        return import_module("boomctl.plotting.design").plot_tune(
            self, curves, ax, frequency_unit=frequency_unit, **style
        )

    def __str__(self) -> str:
        """Return the result as text.

        Returns
        -------
        str
            Certificate, active peaks, starts and stages.
        """
        c = self.certificate
        lines = [f"TuneResult: controller of {system(self._controller)}", c.summary]
        lines += [f"  {name} = {value:.6g}" for name, value in self.plant_parameters.items()]
        lines.append("norms:")
        lines += [f"  {repr(item).removeprefix('ChannelNorm: ')}" for item in c.channel_norms]
        lines.append("active peaks:")
        lines += [
            f"  {p.value:.6g} at {p.omega:.5g} rad/s, {p.channel.text}" + (f", {p.model}" if p.model else "")
            for p in c.active_peaks
        ]
        lines.append("starts:")
        lines += [f"  {s.origin}: {s.objective:.6g} after {count(s.nit, 'step')}" for s in self.starts]
        lines += ["stages:", *(f"  {stage}" for stage in c.stages)] if c.stages else []
        return "\n".join(lines)

    def __figures__(self) -> dict[str, float]:
        """Return the metrics of a comparison."""
        result = {"norm, verified": self.gamma}
        if self.certificate.lower_bound > 0.0:
            result["lower bound for all controllers"] = self.certificate.lower_bound
        if self.certificate.worst_case is not None:
            result["worst norm found over the family"] = self.certificate.worst_case.value
        return result

    def __repr__(self) -> str:
        lower = self.certificate.lower_bound
        least = f"; lower bound for any order {lower:.6g}" if lower > 0.0 else ""
        many = f" over {len(self.models)} models" if len(self.models) > 1 else ""
        lines = [
            f"TuneResult: controller of {system(self._controller)}",
            f"  largest norm{many} {self.gamma:.6g}, verified{least}",
        ]
        if self.plant_parameters:
            lines.append("  " + listed([f"{name} = {value:.6g}" for name, value in self.plant_parameters.items()], 90))
        if self.certificate.active_constraints:
            lines.append("  active constraints: " + listed(list(self.certificate.active_constraints), 80))
        return "\n".join(lines)
