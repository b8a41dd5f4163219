"""Certificates of controllers, computed from the closed loop independently of the synthesis."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, nan
from typing import TYPE_CHECKING

import numpy as np

from boomctl.analysis.claim import Claim
from boomctl.analysis.norm import NormBounds, matrices_norm
from boomctl.lti.system import ClosedLoop, Lti, rates_of, unscaled
from boomctl.printing import compact, sentence
from boomctl.synthesis.lq.riccati import RiccatiSolution
from boomctl.synthesis.plants.channels import Channel
from boomctl.synthesis.plants.partition import GeneralizedPlant

if TYPE_CHECKING:
    import control


class Design:
    """Controller and closed loop of a design, converted to python-control systems on first access.

    ``_controller`` and ``_closed_loop`` are in the scaled signals of a scaled plant.
    """

    _controller: Lti
    _closed_loop: Lti
    _called = "controller"  # name of that system

    @cached_property
    def controller(self) -> "control.StateSpace":
        """Controller ``u = K y`` in the units of the machine."""
        return unscaled(self._controller).statespace(self._called)

    @cached_property
    def scaled_controller(self) -> "control.StateSpace":
        """Controller ``u = K y`` in the scaled signals of the plant; equal to ``controller`` for a plant without scales."""
        return self._controller.statespace(self._called)

    @cached_property
    def closed_loop(self) -> "control.StateSpace":
        """The closed loop, converted on first access."""
        return self._closed_loop.statespace("closed_loop")


@dataclass(frozen=True)
class LoopDesign(Design):
    """Design of a controller for one plant, ``_plant``, whose last signals it closes."""

    _controller: Lti = field(repr=False)
    _closed_loop: Lti = field(repr=False)
    _plant: Lti = field(repr=False, compare=False)

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims about the loop of the plant that can be proved."""
        yield Claim("the closed loop", self._plant, self._controller, stable=True)


@dataclass(frozen=True)
class ChannelNorm:
    """A verified norm of one channel of one loop.

    Attributes
    ----------
    model : str
        Which of the models; empty where there is only one.
    channel : Channel
        Which channel.
    norm : NormBounds
        Its norm, between two bounds.
    """

    model: str
    channel: Channel
    norm: NormBounds

    @property
    def value(self) -> float:
        """The norm; of an H-infinity norm the largest value found."""
        return self.norm.value

    def __repr__(self) -> str:
        limit = "" if self.channel.limit is None else f", limit {self.channel.limit:.6g}"
        where = f", {self.model}" if self.model else ""
        return f"ChannelNorm: {self.channel.text}{where}: {self.value:.6g}{limit}"


@dataclass(frozen=True)
class ActivePeak:
    """One of the peaks that keep a norm from going lower.

    Attributes
    ----------
    model : str
        Which of the models; empty where there is only one.
    channel : Channel
        Which channel.
    omega : float
        Its frequency [rad/s]; nan of an H2 norm.
    value : float
        The singular value there, or the H2 norm.
    """

    model: str
    channel: Channel
    omega: float
    value: float

    __repr__ = compact


@dataclass(frozen=True)
class DesignCertificate:
    """Verification of a controller, and its distance from the optimum.

    Attributes
    ----------
    norm_bounds : NormBounds
        Bounds on the norm of the closed loop: the H-infinity norm; for `lqg` and `h2` the H2 norm, whose square is the
        cost; for `tune` the largest objective, computed from the plant passed by the user; for `lqr` the largest
        computed value of the inverse return difference.
    spectral_abscissa : float
        Largest real part of the closed loop's poles [rad/s], negative; ``-inf`` without states.  In discrete time of their
        rates ``log(z)/dt``.
    fastest_pole : float
        Largest magnitude of the controller's poles [rad/s]; in discrete time of ``z``.
    lower_bound : float
        Lower bound on the norm for controllers of any order; 0 if none is known.
    lower_bound_source : str
        Source of that bound, or the reason why there is none.
    stages : tuple of str
        Solver log, one entry per stage.
    summary : str
        Summary of the verification in one sentence.
    stable : bool or None
        True if the loop is stable; None for a loop on a full plant if neither stability nor instability was proved.
    full_plant : DesignCertificate or None
        For a design on a reduced plant: verification of the loop on the full plant.  Its ``norm_bounds`` has the same kind
        of norm as the design: for `lqg` the root of the cost on the full plant, for `h2` the H2 norm there.
    small_gain : float
        For a loop on a full plant: the largest ``K S`` (from signals added to the measurements to the controls) times the
        error of the reduction, at any frequency.  If it is below one, the loop is proved stable.
    regulator_riccati, filter_riccati : RiccatiSolution or None
        For `lqr`, `lqg` and `h2`: the solutions of the Riccati equations of regulator and filter, and their accuracy.
    min_return_difference : float
        For `lqr`: smallest computed singular value of ``R^1/2 (I + F (s I - A)^-1 B) R^-1/2`` at any frequency.  For an
        optimal regulator it is 1 (Kalman's inequality), which gives margins of 60 degrees and from one half to infinity in
        each control.  On very fine meshes rounding of the gain reduces its accuracy; a regulator is returned only if it is
        at least 0.99.  In discrete time, where a regulator has no such margins, of ``(R + B^T X B)^1/2 (I + F (z I - A)^-1
        B) R^-1/2`` on the unit circle, which is also at least 1.  With a cross weight ``N``, for which the inequality does
        not hold, the computed value without a limit.
    channel_norms : tuple of ChannelNorm
        For `tune`: the norm of each channel of each model.
    active_peaks : tuple of ActivePeak
        For `tune`: the peaks that are active at the optimum.
    stationarity : float
        For `tune`: length of the least element of the convex hull of the gradients of these peaks, relative to the longest of
        them.  It is near zero if no small step reduces the norm, and one if a single smooth peak can still be reduced.
    active_constraints : tuple of str
        For `tune`: active bounds.
    worst_case : ChannelNorm or None
        For `tune` over a family: the worst computed norm within it.
    """

    norm_bounds: NormBounds
    spectral_abscissa: float
    fastest_pole: float
    lower_bound: float
    lower_bound_source: str
    stages: tuple[str, ...]
    summary: str
    stable: bool | None = True
    full_plant: "DesignCertificate | None" = None
    small_gain: float = nan
    regulator_riccati: RiccatiSolution | None = field(default=None, repr=False)
    filter_riccati: RiccatiSolution | None = field(default=None, repr=False)
    min_return_difference: float = nan
    channel_norms: tuple[ChannelNorm, ...] = ()
    active_peaks: tuple[ActivePeak, ...] = ()
    stationarity: float = nan
    active_constraints: tuple[str, ...] = ()
    worst_case: ChannelNorm | None = None

    def __repr__(self) -> str:
        full = "" if self.full_plant is None else f"; {self.full_plant.summary}"
        return sentence("DesignCertificate", self.summary + full)

    @property
    def _on_full_plant(self) -> str:
        """Line of the ``repr`` of a design about the loop on the full plant; empty if nothing was reduced."""
        if self.full_plant is None:
            return ""
        if self.full_plant.stable:
            _, _, norm = self.full_plant.summary.partition("; ")
            return f"\n  stable on the full plant{f'; {norm}' if norm else ''}"
        return f"\n  {'not proved' if self.full_plant.stable is None else 'UNSTABLE'} on the full plant"

    @property
    def optimality_gap(self) -> float:
        """Excess of the norm over the lower bound, relative to it; ``inf`` if there is no bound."""
        if self.lower_bound > 0.0:
            return self.norm_bounds.upper_bound / self.lower_bound - 1.0
        return inf if self.norm_bounds.upper_bound > 0.0 else 0.0


@dataclass(frozen=True)
class Candidate:
    """A controller, its verified closed loop with norm and spectral abscissa, and the log of the search for it."""

    K: Lti
    loop: Lti
    norm: NormBounds
    abscissa: float
    stages: tuple[str, ...] = ()


def largest_pole(K: Lti) -> float:
    """Return the largest magnitude of a controller's poles [rad/s]."""
    return float(np.abs(np.linalg.eigvals(K.A)).max(initial=0.0))


def verified_candidate(plant: GeneralizedPlant, K: Lti, limit: float, fastest: float = np.inf) -> Candidate:
    """Return a controller whose loop is stable, with a verified norm up to ``limit``, and its poles up to ``fastest``.

    Raises
    ------
    ValueError
        If the controller does not pass, with the reason.
    """
    if fastest < np.inf and (speed := largest_pole(K)) > fastest:
        raise ValueError(f"a pole at {speed:.3g} rad/s where {fastest:.3g} are allowed")
    parts = ClosedLoop(plant.system, K)
    loop = parts.system
    abscissa = float(rates_of(loop.eigensystem[0], loop.dt).real.max(initial=-np.inf))
    if abscissa >= 0.0:
        raise ValueError(f"its loop has a pole with real part {abscissa:.3g} rad/s")
    norm = matrices_norm(parts)
    if not norm.verified:
        raise ValueError(f"the norm of its loop could not be verified ({norm.method})")
    if norm.upper_bound > limit or norm.lower_bound == np.inf:
        raise ValueError(f"its loop has norm {norm.lower_bound:.6g}, more than {limit:.6g}")
    return Candidate(K, loop, norm, abscissa)
