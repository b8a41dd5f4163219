"""``h_infinity``: controllers whose closed loop was verified, and a bound that tells how far from the best they are."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.norm import matrices_norm
from boomctl.analysis.prove import Claim
from boomctl.analysis.sigma import sigma
from boomctl.checks import positive, within
from boomctl.exceptions import SynthesisError
from boomctl.lti.bilinear import continuous_image, discrete_image, omega_of_image
from boomctl.lti.modal import sides
from boomctl.lti.system import ClosedLoop, Lti, rates_of
from boomctl.printing import Summarized, system
from boomctl.progress import Deadline, Listener, OutOfTimeError, computing
from boomctl.reduction.result import ReductionResult
from boomctl.synthesis.assumptions import check_modes, check_ranks, check_zeros
from boomctl.synthesis.certificate import Design, DesignCertificate
from boomctl.synthesis.hinf.bounds import Bounds, lowest_level
from boomctl.synthesis.hinf.candidates import Candidate, Task, first_accepted, largest_pole
from boomctl.synthesis.hinf.normal_form import normalized
from boomctl.synthesis.plants.full_plant import ReducedPlant, judged_on_full_plant, origin_of
from boomctl.synthesis.plants.partition import GeneralizedPlant, partition
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_LEVELS = (1e-100, 1e100)  # between which a wanted level lies: squares of them are numbers still (a choice)
_MORE = 1e-4  # share by which the norm on the unit circle may exceed that of the image: rounding of the map (a choice)
_BAND = 1000.0  # poles so many times faster than plant and H2 loop cannot be implemented (a choice)


@dataclass(frozen=True)
class HInfinityResult(Summarized, Design):
    """A controller and the closed loop it was verified in.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, from the measurements to the controls, labeled as in the generalized plant, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        The loop from the disturbances to the performance signals, named likewise.
    gamma : float
        The closed loop's H-infinity norm, verified.
    certificate : DesignCertificate
        What vouches for the controller, and how far from the best possible one it is.
    gamma_bounds : Bounds
        What no controller beats, at one frequency and by the two Riccati equations; and the level that these say can be
        reached.  Of a discrete plant those of its continuous image, ``omega`` mapped back.
    elapsed : float
        Time that the design took, its verification included [s].
    """

    _controller: Lti = field(repr=False)
    _closed_loop: Lti = field(repr=False)
    gamma: float
    certificate: DesignCertificate
    gamma_bounds: Bounds
    _plant: Lti | None = field(default=None, repr=False, compare=False)
    _rtol: float = field(default=np.inf, repr=False, compare=False)
    elapsed: float = field(default=0.0, repr=False, compare=False)

    @property
    def success(self) -> bool:
        """Whether the norm is as low as asked for, and a loop on a full plant is proved stable."""
        c = self.certificate
        near = c.lower_bound == 0.0 or c.optimality_gap <= self._rtol
        return bool(near) and (c.full_plant is None or c.full_plant.stable is True)

    def __claims__(self) -> Iterator[Claim]:
        """Yield what can be proved: of the loop of the plant that was handed in."""
        if self._plant is not None:
            yield replace(
                self.certificate.norm_bounds._claim("the closed loop", self._plant, self._controller), stable=True
            )

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Any:
        """Draw the singular values of the closed loop below its norm, and the bound that no controller goes below.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis, by default that of the curves that are there already.
        **style
            Of the curves, as matplotlib's lines take it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        curves = sigma(self.closed_loop)
        plotting = import_module("boomctl.plotting.design")
        return plotting.plot_h_infinity(self, curves, ax, frequency_unit=frequency_unit, **style)

    def __repr__(self) -> str:
        least = f"no controller goes below {self.certificate.lower_bound:.6g}"
        verified = f"norm of the closed loop {self.gamma:.6g}, verified; {least}"
        return (
            f"HInfinityResult: controller of {system(self._controller)}\n  {verified}{self.certificate._on_full_plant}"
        )


@one_blas_thread
def h_infinity(
    P: "control.StateSpace | ReductionResult",
    nmeas: int | None = None,
    ncon: int | None = None,
    *,
    gamma: float | None = None,
    rtol: float = 0.01,
    fastest_pole: float | None = None,
    time_limit: float = 60.0,
    progress: "Listener | None" = None,
) -> HInfinityResult:
    """Return a controller ``u = K y`` that holds the H-infinity norm of the closed loop near the lowest possible.

    The assumptions are checked first.  Each controller tried is verified: closed loop stable, norm certified and not
    above 1.01 times the level it was computed for.  Controllers whose poles can be implemented come first, even where
    that costs more than ``rtol``; the certificate says so.

    Parameters
    ----------
    P : control.StateSpace or ReductionResult
        Generalized plant: the last ``nmeas`` outputs are measured, the last ``ncon`` inputs are
        controls (`generalized_plant` makes one).  Where it, or the plant that `generalized_plant` was given, is what
        `reduce` returned, the design is judged on the full plant too: ``certificate.full_plant``.  A discrete one is
        designed for as its continuous image by the bilinear map, which has the same loops and norms; controller and loop
        are mapped back, and the loop is verified anew on the unit circle.
    nmeas, ncon : int, optional
        Numbers of measurements and controls; not needed of what `generalized_plant` or `mixed_sensitivity` made, whose
        names tell them.
    gamma : float, optional
        A level that is enough: the closed loop's norm will not exceed it, and nothing lower is sought.
    rtol : float
        How far above the lower bound the norm may lie, relative to it.
    fastest_pole : float, optional
        No pole of the controller has a larger magnitude [rad/s].  By default that is 1,000 times the band, the fastest
        pole of the plant and of its H2-optimal state feedback and filter, and only given up, and said so, where it
        would cost more than twice the lowest norm.  Not for a discrete plant.
    time_limit : float
        Seconds after which it gives up.
    progress : callable, optional
        Is told a `Progress` at each stage.  Without one, after three seconds a line on a terminal or in a notebook says
        what goes on; `progress_callback` hears whatever runs within it.

    Returns
    -------
    HInfinityResult
        The controller, the closed loop it was verified in, its norm ``gamma``, and a certificate.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, discrete time that does not say its sampling time or with a pole at ``z = -1``, not
        finite, counts or numbers out of range.
    SynthesisError
        An assumption fails, at the signal or mode named; ``gamma`` lies below what any controller reaches; no
        controller could be verified; out of time.

    Warns
    -----
    ReductionWarning
        The controller was designed on a reduced plant, and the loop is unstable on the full one, is not proved stable
        there, or its norm there is worse by more than a tenth.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    >>> design = bc.h_infinity(P, nmeas=1, ncon=1)
    >>> bool(design.gamma <= 1.01 * design.certificate.lower_bound)  # no controller does better by more than 1 %
    True
    """
    given = partition(P.system if isinstance(P, ReductionResult) else P, nmeas, ncon, sampled=True)
    discrete = given.system.dt != 0.0
    if discrete and fastest_pole is not None:
        raise ValueError("fastest_pole: expected none for a discrete plant, whose controller runs once a sample")
    wanted = None if gamma is None else within("gamma", gamma, *_LEVELS) * (1.0 - _MORE if discrete else 1.0)
    plant = replace(given, system=continuous_image(given.system))
    share, limit = positive("rtol", rtol), positive("time_limit", time_limit)
    allowed = None if fastest_pole is None else positive("fastest_pole", fastest_pole)
    check_ranks(plant)
    ready = normalized(plant)
    check_modes(plant, ready)
    check_zeros(plant, ready)
    with computing("H-infinity synthesis", progress):
        deadline = Deadline(limit)
        try:
            bounds, reached = lowest_level(ready, share, deadline, wanted)
            if wanted is not None and wanted < bounds.lower:
                raise SynthesisError(f"gamma = {wanted:.6g} cannot be reached: {bounds.why}")
            task = Task(
                plant=plant,
                ready=ready,
                bounds=bounds,
                reached=reached,
                fastest=allowed if allowed is not None else (_BAND * bounds.band or np.inf),
                tolerance=share,
                deadline=deadline,
                wanted=wanted,
            )
            result = first_accepted(task, strict=allowed is not None)
        except OutOfTimeError as over:
            raise SynthesisError(
                f"the time limit of {limit:g} s ran out while {over}; no controller is returned"
            ) from None
        design = _result(task, result, None if discrete else origin_of(P))
        design = _on_circle(given, design, origin_of(P)) if discrete else design
        return replace(design, elapsed=deadline.elapsed, _rtol=share if wanted is None else np.inf)


def _on_circle(plant: GeneralizedPlant, found: HInfinityResult, origin: ReducedPlant | None) -> HInfinityResult:
    """Return a design for the image of a discrete plant as one for the plant itself, its loop verified anew.

    Raises
    ------
    SynthesisError
        The loop on the unit circle is not that of the image.
    """
    dt = plant.system.dt
    try:
        K = discrete_image(replace(found._controller, state_labels=()), dt)
        parts = ClosedLoop(plant.system, K)
        loop = parts.system
    except ValueError as error:
        raise SynthesisError(f"the controller of the image has no counterpart in discrete time: {error}") from None
    poles, norm = loop.poles, matrices_norm(parts)
    if (sides(poles, dt) >= 0).any() or not norm.upper_bound <= found.certificate.norm_bounds.upper_bound * (
        1.0 + _MORE
    ):
        raise SynthesisError(
            f"the loop in discrete time is not that of its image: norm from {norm.lower_bound:.6g} to "
            f"{norm.upper_bound:.6g} for "
            f"{found.gamma:.6g}, largest pole {np.abs(poles).max(initial=0.0):.7g}"
        )
    c = found.certificate
    bounds = replace(found.gamma_bounds, omega=float(omega_of_image(found.gamma_bounds.omega, dt)))
    certificate = replace(
        c,
        norm_bounds=norm,
        spectral_abscissa=float(rates_of(poles, dt).real.max(initial=-np.inf)),
        fastest_pole=largest_pole(K),
        lower_bound_source=bounds.why,
        stages=(*c.stages, "mapped to the unit circle"),
        summary=f"{c.summary}; verified anew on the unit circle",
        full_plant=judged_on_full_plant(origin, plant, K, norm),
    )
    return HInfinityResult(K, loop, norm.lower_bound, certificate, bounds, plant.system)


def _result(task: Task, found: Candidate, origin: ReducedPlant | None) -> HInfinityResult:
    task = replace(task, bounds=task.bounds.below(found.norm.upper_bound))
    plant, bounds = task.plant, task.bounds
    certificate = DesignCertificate(
        norm_bounds=found.norm,
        spectral_abscissa=found.slowest,
        fastest_pole=largest_pole(found.K),
        lower_bound=bounds.lower,
        lower_bound_source=bounds.why,
        stages=found.stages,
        summary=_statement(task, found),
        full_plant=judged_on_full_plant(origin, plant, found.K, found.norm),
    )
    K = replace(found.K, input_labels=plant.measurements, output_labels=plant.controls, scales=plant.system.scales)
    return HInfinityResult(K, found.loop, found.norm.lower_bound, certificate, bounds, plant.system)


def _statement(task: Task, found: Candidate) -> str:
    """Say how far the norm lies above the bound and, where that is farther than wanted or poles are fast, why."""
    bounds, gamma, fast = task.bounds, found.norm.upper_bound, largest_pole(found.K)
    told = f"verified norm {gamma:.6g}"
    if bounds.lower > 0.0:
        above = gamma / bounds.lower - 1.0
        told += f", at most {100.0 * above:.2g} % above {bounds.lower:.6g}, which no controller beats"
        if task.wanted is None and above > task.tolerance:
            told += f"; the {100.0 * task.tolerance:.3g} % wanted could not be had "
            out_of_reach = bounds.reached > bounds.lower * (1.0 + task.tolerance)
            told += "for rounding" if out_of_reach else f"with poles below {task.fastest:.3g} rad/s"
    if fast > task.fastest:
        told += f"; the controller has a pole at {fast:.3g} rad/s, no slower one passed below {task.fastest:.3g} rad/s"
    return told
