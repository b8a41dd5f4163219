"""H-infinity controllers with a verified closed loop and a lower bound for all controllers.

From call to certificate: `h_infinity`, `partition`, `checked`, `lowest_level`, `level_of`, `suboptimal_controller`,
`verified_candidate`, `matrices_norm`, `Bounds.below`, `DesignCertificate`.
"""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.analysis.claim import Claim
from boomctl.analysis.sigma import sigma
from boomctl.checks import positive
from boomctl.exceptions import SynthesisError
from boomctl.lti.bilinear import continuous_image, discrete_image, omega_of_image
from boomctl.lti.rounding import SOLVED
from boomctl.printing import Summarized, percent, system
from boomctl.progress import Deadline, Listener, OutOfTimeError, computing
from boomctl.reduction.result import ReductionResult
from boomctl.synthesis.assumptions import checked
from boomctl.synthesis.certificate import Candidate, DesignCertificate, LoopDesign, largest_pole, verified_candidate
from boomctl.synthesis.hinf.bounds import FIRST_LEVEL, Bounds, Level, level_of, lowest_level, suboptimal_controller
from boomctl.synthesis.plants.full_plant import evaluate_on_full_plant, origin_of
from boomctl.synthesis.plants.partition import GeneralizedPlant, NormalizedPlant, partition
from boomctl.synthesis.reduce_controller import without_fast_poles
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

_MAP_RTOL = 1e-4  # Excess of the norm on the unit circle over that of the image, by rounding of the bilinear map.
_NORM_RTOL = 0.01  # Excess of the norm of a loop over the level of its controller, by rounding of the solver.
_WANTED_LEVELS = (0.99999, 0.99)  # Levels below a wanted norm; the second one leaves more for rounding.
# Excess of the first levels over the lower bound, relative to rtol. The nearer one has faster poles, further from those
# that are retained if they are residualized.
_FIRST_LEVELS = (FIRST_LEVEL, 0.5)
# Largest excess over the lower bound with poles below the default limit, and with no limit or one that the user set.
_MAX_EXCESS, _MAX_EXCESS_STRICT = 1.0, 100.0
_LEVELS = 255  # Between rtol and the largest excess; bisection takes eight of them.
_MAX_SPEED = 1000.0  # Default limit of the controller's poles, relative to those of the plant and of the H2 loop.
_NOT_COMPUTED = Bounds(0.0, 0.0, np.inf, 0.0, "not computed for a given `gamma`", 0.0)


@dataclass(frozen=True)
class HInfinityResult(Summarized, LoopDesign):
    """Result of an H-infinity synthesis.

    Attributes
    ----------
    controller : control.StateSpace
        ``u = K y``, from the measurements to the controls, labeled as in the generalized plant, in the units of the machine.
    scaled_controller : control.StateSpace
        The same in the scaled signals of the plant; equal to `controller` if the plant has no scales.
    closed_loop : control.StateSpace
        Closed loop from the disturbances to the performance outputs, labeled as in the generalized plant.
    gamma : float
        H-infinity norm of the closed loop, verified.
    certificate : DesignCertificate
        Verification of the closed loop, and its distance from the optimum.
    gamma_bounds : Bounds
        Lower bounds for all controllers, at one frequency and by the two Riccati equations, and the lowest level reached.
        The bounds are zero if a given ``gamma`` is reached.
        For a discrete plant those of its continuous image, with ``omega`` mapped back.
    elapsed : float
        Time of the design and its verification [s].
    """

    gamma: float
    certificate: DesignCertificate
    gamma_bounds: Bounds
    _rtol: float = field(repr=False, compare=False)
    elapsed: float = field(repr=False, compare=False)

    @property
    def success(self) -> bool:
        """True if the norm is as low as requested, and a loop on a full plant is proved stable."""
        c = self.certificate
        optimal = c.lower_bound == 0.0 or c.optimality_gap <= self._rtol
        return bool(optimal) and (c.full_plant is None or c.full_plant.stable is True)

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims about the loop of the plant that can be proved."""
        claim = self.certificate.norm_bounds._claim("the closed loop", self._plant, self._controller)
        yield replace(claim, stable=True)

    def plot(self, ax: Any = None, *, frequency_unit: str | None = None, **style: Any) -> Any:
        """Plot the singular values of the closed loop, its norm and the lower bound for all controllers.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        frequency_unit : {"Hz", "rad/s"}, optional
            Unit of the frequency axis. If None, the unit of the existing axes, or Hz.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        curves = sigma(self.closed_loop)
        plotting = import_module("boomctl.plotting.design")
        return plotting.plot_h_infinity(self, curves, ax, frequency_unit=frequency_unit, **style)

    def __repr__(self) -> str:
        norms, lower = f"norm of the closed loop {self.gamma:.6g}, verified", self.gamma_bounds.lower
        norms += f"; lower bound {lower:.6g}" if lower > 0.0 else ""
        return f"HInfinityResult: controller of {system(self._controller)}\n  {norms}{self.certificate._on_full_plant}"


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
    """Design a controller ``u = K y`` whose closed loop has an H-infinity norm near the lowest possible one.

    The assumptions are checked first. The level gamma is found by bisection. The controller is verified: the closed
    loop is stable, and its norm is at most 1.01 times the level. If the limit on the controller's poles
    prevents ``rtol``, the certificate reports it.

    Parameters
    ----------
    P : control.StateSpace or ReductionResult
        Generalized plant: the last ``nmeas`` outputs are measured, the last ``ncon`` inputs are controls, see
        `generalized_plant`. If it, or the plant passed to `generalized_plant`, is a result of `reduce`, the design is
        also evaluated on the full plant: ``certificate.full_plant``. For a discrete plant the controller is designed for
        its bilinear transform, which has the same closed-loop norms. Controller and loop are mapped back
        and verified on the unit circle.
    nmeas, ncon : int, optional
        Numbers of measurements and controls. If None, they are determined from the labels that `generalized_plant` and
        `mixed_sensitivity` give.
    gamma : float, optional
        Target for the norm of the closed loop. If a controller reaches it, neither a lower norm nor a lower bound is
        searched for.
    rtol : float, default: 0.01
        Relative gap between the norm and the lower bound at which the bisection stops.
    fastest_pole : float, optional
        Largest magnitude of the controller's poles [rad/s]. If None, 1,000 times the fastest pole of the plant and
        of its H2-optimal state feedback and filter; with ``gamma`` of the plant alone, if that suffices. This limit is
        dropped if the norm would exceed twice the lower bound, as the certificate then states. Must be None for a
        discrete plant.
    time_limit : float, default: 60
        Time limit [s].
    progress : callable, optional
        Called with a `Progress` at each stage. If None, a progress line is shown after 3 s.

    Returns
    -------
    HInfinityResult
        The controller, the verified closed loop, its norm ``gamma``, and a certificate.

    Raises
    ------
    TypeError
        If `P` is not a system.
    ValueError
        If the sampling time of `P` is unspecified or it has a pole at ``z = -1``, if an entry is not finite, or if a
        count or a number is out of range.
    SynthesisError
        If an assumption fails (the message names the signal or mode); if ``gamma`` is below the lower bound for all
        controllers; if no controller passes verification; or if the time limit is exceeded.

    Warns
    -----
    ReductionWarning
        If the loop with the full plant is not stable, not proved to be stable, or has a norm larger by more than a tenth.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> P = control.ss(-1.0, [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]])
    >>> design = bc.h_infinity(P, nmeas=1, ncon=1)
    >>> bool(design.gamma <= 1.01 * design.certificate.lower_bound)  # within 1 % of the optimum
    True
    """
    original = partition(P.system if isinstance(P, ReductionResult) else P, nmeas, ncon, sampled=True)
    discrete = original.system.dt != 0.0
    if discrete and fastest_pole is not None:
        raise ValueError("`fastest_pole` must be None for a discrete plant, whose controller runs once a sample.")
    wanted = None if gamma is None else positive("gamma", gamma) * (1.0 - _MAP_RTOL if discrete else 1.0)
    plant = replace(original, system=continuous_image(original.system))
    rtol, limit = positive("rtol", rtol), positive("time_limit", time_limit)
    allowed = None if fastest_pole is None else positive("fastest_pole", fastest_pole)
    ready = checked(plant)
    with computing("H-infinity synthesis", progress):
        deadline = Deadline(limit)
        try:
            task = _Task(plant, ready, allowed, rtol, deadline, wanted)
            given = None if wanted is None else _at_given_level(task, wanted)
            task, candidate = given or _searched(task)
        except OutOfTimeError as over:
            raise SynthesisError(f"The time limit of {limit:g} s was exceeded while {over}.") from None
        bounds = task.bounds.below(candidate.norm.upper_bound)
        summary = _summary(task, bounds, candidate)
        bounds = replace(bounds, omega=float(omega_of_image(bounds.omega, original.system.dt)))
        if discrete:
            candidate, summary = _on_circle(original, candidate), f"{summary}; verified again on the unit circle"
        labels = {"input_labels": original.measurements, "output_labels": original.controls}
        K = replace(candidate.K, **labels, scales=original.system.scales)
        certificate = DesignCertificate(
            norm_bounds=candidate.norm,
            spectral_abscissa=candidate.abscissa,
            fastest_pole=largest_pole(candidate.K),
            lower_bound=bounds.lower,
            lower_bound_source=bounds.why,
            stages=candidate.stages,
            summary=summary,
            full_plant=evaluate_on_full_plant(origin_of(P), original, K, candidate.norm),
        )
        return HInfinityResult(
            _controller=K,
            _closed_loop=candidate.loop,
            _plant=original.system,
            gamma=candidate.norm.lower_bound,
            certificate=certificate,
            gamma_bounds=bounds,
            _rtol=rtol if wanted is None else np.inf,
            elapsed=deadline.elapsed,
        )


@dataclass(frozen=True)
class _Task:
    """A plant, the requirements on a controller and, once they are known, lower bounds and the lowest level reached."""

    plant: GeneralizedPlant
    ready: NormalizedPlant
    allowed: float | None
    rtol: float
    deadline: Deadline
    wanted: float | None
    bounds: Bounds = _NOT_COMPUTED
    reached: Level | None = None

    @property
    def fastest(self) -> float:
        """Largest magnitude of the controller's poles [rad/s]."""
        return self.allowed if self.allowed is not None else (_MAX_SPEED * self.bounds.band or np.inf)

    def level(self, excess: float) -> float:
        """Return a level by its excess over the lower bound, not below the one that is reached."""
        reached = self.bounds.reached
        level = (self.bounds.lower or reached) * (1.0 + excess)
        return level if level >= reached else reached * (1.0 + 0.1 * self.rtol)


def _at_given_level(task: _Task, wanted: float) -> tuple[_Task, Candidate] | None:
    """Return a controller of the given level without a search; None if none passes.

    Its poles are limited relative to those of the plant alone.
    """
    band = float(np.abs(task.ready.system.poles).max(initial=0.0))
    task = replace(task, bounds=replace(task.bounds, reached=wanted, band=band))
    log: list[str] = []
    passed: dict[float, Candidate] = {}
    if not any(_passes(task, passed, log, wanted * factor) for factor in _WANTED_LEVELS):
        return None
    return task, replace(*passed.values(), stages=tuple(log))


def _searched(task: _Task) -> tuple[_Task, Candidate]:
    """Return the controller of the lowest level whose poles are slow enough and whose loop is verified.

    If there is none up to twice the lower bound, and the user set no limit on the poles, the limit is dropped.

    Raises
    ------
    SynthesisError
        If a given level is below the lower bound, or if no controller passes, with the reasons.
    OutOfTimeError
        If the time is up.
    """
    bounds, reached = lowest_level(task.ready, task.rtol, task.deadline, task.wanted)
    if task.wanted is not None and task.wanted < bounds.lower:
        raise SynthesisError(f"`gamma` = {task.wanted:.6g} cannot be reached: {bounds.why}.")
    task = replace(task, bounds=bounds, reached=reached)
    log: list[str] = []
    strict = {task.fastest: _MAX_EXCESS_STRICT}
    limits = strict if task.allowed is not None else {task.fastest: _MAX_EXCESS, np.inf: _MAX_EXCESS_STRICT}
    for fastest, most in limits.items():
        passed: dict[float, Candidate] = {}
        passes = partial(_passes, replace(task, allowed=fastest), passed, log)
        if task.wanted is not None:
            any(passes(max(task.wanted * factor, bounds.reached)) for factor in _WANTED_LEVELS)
        elif not any(passes(task.level(factor * task.rtol)) for factor in _FIRST_LEVELS):
            levels = [task.level(excess) for excess in np.geomspace(task.rtol, most, _LEVELS)]
            bisect_left(levels, True, key=passes)
        if passed:
            return task, replace(passed[min(passed)], stages=tuple(log))
    raise SynthesisError(f"No controller passed verification: {'; '.join(log[-2:])}.")


def _passes(task: _Task, passed: dict[float, Candidate], log: list[str], gamma: float) -> bool:
    """Return whether the controller of a level passes, without its poles that are too fast; append the outcome to the log."""
    task.deadline.check(f"computing a controller for gamma = {gamma:.6g}")
    name, level = "two Riccati equations", f"at gamma = {gamma:.6g}"
    try:
        reached = task.reached
        if reached is None or abs(gamma / reached.gamma - 1.0) > SOLVED:
            reached = level_of(task.ready, gamma)
        K = suboptimal_controller(task.ready, reached, task.plant.D22)
        if (speed := largest_pole(K)) > task.fastest:
            log.append(f"{name} {level}: a pole at {speed:.3g} rad/s where {task.fastest:.3g} are allowed")
            name, K = f"{name}, fast poles residualized", without_fast_poles(K, task.fastest)
        passed[gamma] = verified_candidate(task.plant, K, task.wanted or (1.0 + _NORM_RTOL) * gamma)
    except ValueError as error:  # Also `numpy.linalg.LinAlgError`.
        log.append(f"{name} {level}: {error}")
        return False
    log.append(f"{name} {level}: passed")
    return True


def _on_circle(plant: GeneralizedPlant, image: Candidate) -> Candidate:
    """Map the controller of the continuous image of a discrete plant back, and verify its loop.

    Raises
    ------
    SynthesisError
        If the loop on the unit circle is not that of the image.
    """
    try:
        K = discrete_image(image.K, plant.system.dt)
        result = verified_candidate(plant, K, (1.0 + _MAP_RTOL) * image.norm.upper_bound)
    except ValueError as error:
        raise SynthesisError(f"The controller could not be mapped to discrete time: {error}.") from None
    return replace(result, stages=(*image.stages, "mapped to the unit circle"))


def _summary(task: _Task, bounds: Bounds, candidate: Candidate) -> str:
    """Return the norm, its distance from the lower bound and, if that or a pole is beyond its limit, the reason."""
    gamma, fastest = candidate.norm.upper_bound, largest_pole(candidate.K)
    text = f"verified norm {gamma:.6g}"
    if bounds.lower > 0.0:
        excess = gamma / bounds.lower - 1.0
        text += f", at most {percent(excess)} above {bounds.lower:.6g}, the lower bound for all controllers"
        if task.wanted is None and excess > task.rtol:
            unreached = bounds.reached > bounds.lower * (1.0 + task.rtol)
            reason = "due to rounding" if unreached else f"with poles below {task.fastest:.3g} rad/s"
            text += f"; rtol = {task.rtol:.3g} could not be met {reason}"
    if fastest > task.fastest:
        text += f"; the controller has a pole at {fastest:.3g} rad/s, none passed below {task.fastest:.3g} rad/s"
    return text
