"""Margins of feedback loops ``u = K y``: gain, phase and delay one loop at a time, and disk margins.

A disk margin ``alpha`` guarantees stability if all loops considered are multiplied simultaneously by any numbers, or stable
systems, in the disk with the diameter from ``(1 - a/2)/(1 + a/2)`` to its inverse, for all ``a < alpha``.  It is
``2/|S - T|`` in the H-infinity norm (Seiler, Packard & Gahinet 2020, IEEE Control Systems 40), here with a constant
diagonal scaling, so that it does not depend on units, and with the certified upper bound of the norm.

Frequencies at which the loop's response ``L`` is real, or of modulus one, are eigenvalues of one pencil each: with the
sensitivity ``S = 1/(1 - L)``, ``S(s) - S(-s)`` or ``S(s) + S(-s) - 1`` is zero there on the imaginary axis.  The sensitivity
of a stable loop has no pole there, regardless of the poles of ``L``.  Each eigenvalue is a candidate; a crossing is then
located in the response itself, between two frequencies at which the signs differ.

A sampled loop is evaluated through the bilinear transformation: on the imaginary axis of the image its response is that on
the unit circle, so that gains, angles and disks are the same; frequencies are mapped back before delays are computed.

The least further delay of a sampled loop around a continuous plant consists of ``W`` whole samples and a fraction ``t`` of
one.  The loop opened at the signal is ``z^-W h(z, t)``.  At each fraction of a grid, eigenvalues yield the stability of the
loop without whole samples, and the points of the unit circle with ``|h| = 1``, whose angles yield the whole samples at which
poles leave the circle.  The least delay of all fractions is then refined by bisection.  The delay is not proved: the search
may overlook a range of delays narrower than the grid.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from importlib import import_module
from math import ceil, floor, inf, isfinite, isnan, log10, nan
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from boomctl.analysis.claim import Claim
from boomctl.analysis.loops import joined, sign_advice, signals_of
from boomctl.analysis.norm import NormBounds, least_damped, matrices_norm, rounding_of
from boomctl.arrays import Array, blocks
from boomctl.checks import known, warn_user
from boomctl.exceptions import MarginAccuracyWarning, MarginLossWarning
from boomctl.lti.bilinear import continuous_image, omega_of_image
from boomctl.lti.frequency import BEYOND, DRAWN, EMPTY, SEARCHED, resonance_grid, singular_values, smooth_curve
from boomctl.lti.modal import resolved, sides
from boomctl.lti.rounding import ALIKE, CERTIFIED, EPS, LEVEL, SOLVED, SUMMED
from boomctl.lti.sampled import sampled_plant
from boomctl.lti.system import Lti, controller_of, of, signal_scales
from boomctl.printing import listed, table_html, table_text
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

    from boomctl.lti.system import Controller
    from boomctl.structure.model import SecondOrderModel

_COSTLY = 10.0 ** (-3.0 / 20.0)  # Warn if sampling reduces the disk margin by more than 3 dB.
# Largest imaginary part of L, relative to its modulus, at a crossing located by its sign.  A resonance with a larger value is
# so narrow that rounding of the frequency does not distinguish it from a pole on the axis.
_REAL = 1e-3
# Largest eigenvalue relative to the norm of ``A``: larger ones are infinite eigenvalues perturbed by rounding.
_FASTEST = 1e4
_OFF_AXIS = 0.1  # Largest distance of a candidate from the axis, relative to its modulus; signs decide on a crossing.
_FALSI_STEPS = 60  # Largest number of steps to a crossing; two to four are typical.
_ACTIVE = 24  # Number of frequencies, those of the largest singular values, at which the first scaling is optimized.
_ROUNDS = 12  # Largest number of added frequencies; two or three are typical.
_SWEEPS = 50  # Sweeps over rows and columns to balance them, as the initial value of an optimization.
_SEARCHED = 30  # Largest number of signals for an optimized scaling: it takes tens of seconds. Beyond, only balanced.
_STEPS = 50  # Largest number of iterations of the optimization; a dozen is typical.
_PARTS = 32  # Number of grid delays per sample.
# Frequencies relative to a crossing at which the sign of the gain's derivative is determined.
_NEAR_CROSSING = np.array([1.0 - 1e-6, 1.0, 1.0 + 1e-6])
_SAMPLES = 1000  # Whole samples after the first crossing at which poles outside the circle are counted.


@dataclass(frozen=True)
class DiskMargin:
    """Disk margin from the upper bound of a norm.

    Attributes
    ----------
    alpha : float
        Disk margin, at most 2; if ``verified`` is False a lower bound, or 0.
    omega : float
        Frequency of the smallest margin [rad/s]; ``inf`` for infinite frequency.
    verified : bool
        True if the norm is verified to a relative 1e-5, rounding error of the loop's matrices included.
    certified : bool
        True if the margin is also proved.  A proof may run on first access.
    """

    alpha: float
    omega: float
    verified: bool
    _norm: NormBounds = field(repr=False, compare=False)

    def __repr__(self) -> str:
        ranges = f"gains by {1.0 / self.gain_margin:.4g} to {self.gain_margin:.4g}, phases by {self.phase_margin_deg:.4g} deg"
        ranges += "" if self.verified else ", not verified"
        return f"DiskMargin: {self._text} at {self.omega:.4g} rad/s ({ranges})"

    @property
    def certified(self) -> bool:
        """True if the margin is proved.  A proof may run on first access."""
        return self.verified and self._norm.certified

    @property
    def _text(self) -> str:
        """The margin as text: a value, a lower bound, or "not found"."""
        if self.verified:
            return f"{self.alpha:.4g}"
        return f">= {self.alpha:.4g}" if self.alpha > 0.0 else "not found"

    @property
    def gain_margin(self) -> float:
        """Factor by which the gains may increase or decrease."""
        return (2.0 + self.alpha) / (2.0 - self.alpha) if self.alpha < 2.0 * (1.0 - ALIKE) else inf

    @property
    def phase_margin_deg(self) -> float:
        """Angle by which the phases may change [degrees]."""
        return float(np.degrees(2.0 * np.arctan(0.5 * self.alpha)))


@dataclass(frozen=True)
class LoopMargin:
    """Margins of one loop, opened at one signal with all others closed.

    Attributes
    ----------
    signal, location : str
        Signal at which the loop is opened; ``"control"`` or ``"measurement"``.
    gain_margin : (float, float)
        The loop remains stable for factors between these; 0 and ``inf`` without a limit between 1e-9 and 1e9.
    gain_margin_omega : (float, float)
        Frequencies of the two limits [rad/s]; NaN without a limit.
    phase_margin_deg, phase_margin_omega : float
        Smallest destabilizing angle [degrees], and its frequency [rad/s]; ``inf`` and NaN without a gain crossover.
    delay_margin, delay_margin_omega : float
        Smallest destabilizing delay [s], and its frequency [rad/s]; 0 and ``inf`` if the gain of a continuous loop at
        infinite frequency is at least one; ``inf`` and NaN without a limit.  In a sampled loop with a continuous plant it is
        an additional delay of this control or measurement, of any fraction of a sample.  It is computed on a grid of 32
        delays per sample and by bisection, and is not proved: the search may overlook a narrower range of destabilizing
        delays.  With a discrete plant it is the least ``tau`` for which ``L exp(-j omega tau)`` is one at a gain crossover,
        at most one sample if the gain at half the sampling rate is at least one: all whole samples below it are stable.
    disk_margin : DiskMargin
        Disk margin of this loop.
    rounding_error : float
        Largest change of ``1/(1 - L)`` by rounding errors of the loop's matrices, to first order: relative, or absolute if
        ``1/(1 - L)`` is below one.  The margins are accurate to this error, gain limits near zero are less accurate.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> half = bc.split_symmetric(bc.spray_boom())[1]
    >>> damper = control.ss(-300.0, 300.0, 3e5, -3e5, inputs="stroke_anti", outputs="suspension_anti")
    >>> bc.margins(half, damper)["suspension_anti"]
    LoopMargin: opened at control suspension_anti
      gain 0 to inf (-inf to inf dB), phase 55.58 deg at 221.2 rad/s, delay 0.004385 s, disk 1.005
    """

    signal: str
    location: str
    gain_margin: tuple[float, float]
    gain_margin_omega: tuple[float, float]
    phase_margin_deg: float
    phase_margin_omega: float
    delay_margin: float
    delay_margin_omega: float
    disk_margin: DiskMargin
    rounding_error: float = 0.0
    _sensitivity: Lti | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        gains = f"gain {self.gain_margin[0]:.4g} to {self.gain_margin[1]:.4g} ({' to '.join(self._gains_db)} dB)"
        at = f" at {self.phase_margin_omega:.4g} rad/s" if isfinite(self.phase_margin_omega) else ""
        limits = (
            f"phase {self.phase_margin_deg:.4g} deg{at}, delay {self.delay_margin:.4g} s, disk {self.disk_margin._text}"
        )
        return f"LoopMargin: opened at {self.location} {self.signal}\n  {gains}, {limits}"

    @property
    def _gains_db(self) -> list[str]:
        return [f"{_decibels(gain):.4g}" for gain in self.gain_margin]

    @cached_property
    @one_blas_thread
    def loop_gain(self) -> tuple[Array, Array]:
        """Frequencies [rad/s] and loop gain ``L``, so dense that the Nyquist curve is smooth."""
        S = self._sensitivity
        assert S is not None
        image = continuous_image(S)
        limits = [*self.gain_margin_omega, self.phase_margin_omega, self.delay_margin_omega, self.disk_margin.omega]
        is_finite = abs(float(image.D[0, 0])) > SUMMED  # L at infinite frequency
        poles = np.linalg.eigvals(image.A - image.B @ image.C / image.D[0, 0]) if is_finite else []  # of L
        omega = np.append(omega_of_image(grid_of_loop(np.append(image.poles, poles), places=DRAWN), S.dt), limits)

        def response(omega: Array) -> Array:
            with np.errstate(divide="ignore", invalid="ignore"):
                return 1.0 - 1.0 / S.response(omega, quiet=True)[0, 0]

        return smooth_curve(response, np.unique(omega[np.isfinite(omega)]))

    def plot(self, ax: "Axes | None" = None, **style: Any) -> "Axes":
        """Draw the loop's Nyquist curve around the critical point, and its margins.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.margins").plot_loop_margin(self, ax, **style)


@dataclass(frozen=True)
class Margins:
    """Margins of a loop.

    Attributes
    ----------
    loops : tuple of LoopMargin
        One for each control, then one for each measurement.
    multiloop_input, multiloop_output, multiloop_io : DiskMargin
        Disk margins with all controls, all measurements, and all of both opened simultaneously.
    """

    loops: tuple[LoopMargin, ...]
    multiloop_input: DiskMargin
    multiloop_output: DiskMargin
    multiloop_io: DiskMargin
    _loop: tuple[Lti, Lti | None] | None = field(default=None, repr=False, compare=False)

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims that can be proved."""
        if self._loop is not None:
            yield Claim("the closed loop", *self._loop, stable=True)

    def __getitem__(self, signal: str) -> LoopMargin:
        signals = [loop.signal for loop in self.loops]
        return self.loops[signals.index(known("loop", signal, signals))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return [loop.signal for loop in self.loops]

    def __str__(self) -> str:
        """Return the margins as text.

        Returns
        -------
        str
            A table, one line for each loop.
        """
        return table_text(self._table(), " ")

    def plot(self, ax: Any = None, **style: Any) -> Array:
        """Draw each loop's Nyquist curve around the critical point, and its margins.

        Parameters
        ----------
        ax : sequence of matplotlib Axes, or a figure, optional
            Axes to draw on, one for each loop. If None, a new figure is created.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.margins").plot_margins(self, ax, **style)

    @property
    def _disks(self) -> dict[str, DiskMargin]:
        """Disk margins by the signals at which the loops are opened simultaneously."""
        named = "at all controls", "at all measurements", "everywhere"
        return dict(zip(named, (self.multiloop_input, self.multiloop_output, self.multiloop_io), strict=True))

    def __repr__(self) -> str:
        disks = ", ".join(f"{disk._text} {where}" for where, disk in self._disks.items())
        phase, delay, *_ = self.__figures__().values()
        least = f"phase {phase:.4g} deg, delay {delay:.4g} s"
        return f"Margins: opened at {listed([x.signal for x in self.loops])}\n  least: {least}\n  disk {disks}"

    def __figures__(self) -> dict[str, float]:
        """Return the metrics for a comparison."""
        figures = {
            "phase margin, min [deg]": min(x.phase_margin_deg for x in self.loops),
            "delay margin, min [s]": min(x.delay_margin for x in self.loops),
        }
        return figures | {f"disk margin, {where.removeprefix('at ')}": d.alpha for where, d in self._disks.items()}

    def _repr_html_(self) -> str:
        heads, *rows = self._table()
        return table_html("Margins", heads, rows)

    def _table(self) -> list[tuple[str, ...]]:
        """Return heads and rows of the margins."""
        heads = ("opened at", "gain min", "max", "min [dB]", "max [dB]", "at [rad/s]", "phase [deg]", "at [rad/s]")
        table: list[tuple[str, ...]] = [(*heads, "delay [s]", "disk")]
        for x in self.loops:
            limits = zip(x.gain_margin, x.gain_margin_omega, strict=True)
            nearest = min(limits, key=lambda limit: abs(log10(limit[0])) if 0.0 < limit[0] < inf else inf)[1]
            gains = (*(f"{gain:.4g}" for gain in x.gain_margin), *x._gains_db, _frequency(nearest))
            phase = (f"{x.phase_margin_deg:.4g}", _frequency(x.phase_margin_omega))
            table.append((x.signal, *gains, *phase, f"{x.delay_margin:.4g}", x.disk_margin._text))
        for where, disk in self._disks.items():
            factors = 1.0 / disk.gain_margin, disk.gain_margin
            gains = (f"{x:.4g}" for x in (*factors, *map(_decibels, factors)))
            ends = ("", f"{disk.phase_margin_deg:.4g}", _frequency(disk.omega), "", disk._text)
            table.append((f"all loops: {where.removeprefix('at all ')}", *gains, *ends))
        return table


def _decibels(gain: float) -> float:
    return 20.0 * log10(gain) if gain > 0.0 else -inf


def _frequency(omega: float) -> str:
    return "" if isnan(omega) else f"{omega:.4g}"


@one_blas_thread
def margins(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
    controller: "Controller",
    *,
    delay: float = 0.0,
) -> Margins:
    """Return the margins of the loop ``u = K y``, with signals matched by name.

    Parameters
    ----------
    plant : SecondOrderModel, control.StateSpace or control.TransferFunction
        Plant with named signals.  A discrete plant requires a discrete controller with the same sampling time.
        :func:`boomctl.with_state_outputs` adds its states as outputs, for controllers that read them.
    controller : control.StateSpace, control.TransferFunction, or a design
        Controller with ``u = K y``. Signals are matched by name.  A discrete-time controller defines the sampled loop of
        :func:`boomctl.feedback_loop`.  Its margins apply at the samples: to the controller outputs, and to the sampled
        measurements.
    delay : float, optional
        Computation delay [s].  Requires a discrete-time controller.

    Returns
    -------
    Margins
        Gain, phase, delay and disk margins of each control and each measurement, and simultaneous disk margins.

    Raises
    ------
    TypeError, ValueError
        If a system has an unsupported type, sampling times differ or are unspecified, the loop cannot have this delay, signal
        names do not match, or the loop is not well-posed or not stable.

    Warns
    -----
    MarginAccuracyWarning
        If rounding errors of the loop's matrices may change the response by more than a relative 1e-5.
    MarginLossWarning
        If sampling and delay reduce the disk margin at all controls, or at all measurements, by more than 3 dB.  The
        reference is the loop of the continuous plant and of the continuous controller whose Tustin discretization is the
        discrete controller.  Without such a loop (discrete plant, pole at ``z = -1``, unstable continuous loop) nothing is
        compared.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, inputs="force", outputs="position")
    >>> lead = control.ss([[-20.0]], [[1.0]], [[360.0]], -20.0, inputs="position", outputs="force")
    >>> round(bc.margins(mass, lead)["force"].phase_margin_deg, 1)
    34.0
    >>> round(bc.margins(mass, bc.discretize(lead, 0.01), delay=0.004)["force"].phase_margin_deg, 1)  # sampled
    33.2
    """
    P = of(plant, "plant", sampled=True)
    K = controller_of(controller, sampled=True, scales=P.scales)
    loop = joined(P, K, delay)
    dt = loop.system.dt
    poles = loop.system.poles
    bad = poles[sides(poles, dt) >= 0]
    if len(bad):
        worst = bad[int(np.argmax(bad.real if dt == 0.0 else np.abs(bad)))]
        at = f"{worst:.4g} rad/s" if dt == 0.0 else f"z = {worst:.4g}, of size {abs(worst):.7g}"
        advice = sign_advice(P, K, delay)
        raise ValueError(f"The loop is not stable (pole at {at}): it has no margins. {advice}".rstrip())
    S = loop.sensitivity
    m, total = len(loop.controls), len(S.D)
    groups = range(m), range(m, total), range(total)
    disks, rounding = disk_margins(S, [*([i] for i in range(total)), *groups])
    if (most := float(rounding.max(initial=0.0))) > CERTIFIED:
        text = f"rounding of the loop's matrices alone may change its response by {most:.1g} of its magnitude"
        warn_user(f"{text}; scale the states", MarginAccuracyWarning)
    loops = []
    for i, name in enumerate(loop.controls + loop.measurements):
        where, own = "control" if i < m else "measurement", S.between([i], [i])
        found = _loop_margin(name, where, own, disks[i], float(rounding[i]))
        if dt != 0.0 and P.dt == 0.0:
            further = _further_delay(P, K, delay, i)
            found = replace(found, delay_margin=further[0], delay_margin_omega=further[1])
        loops.append(found)
    if dt != 0.0 and P.dt == 0.0:
        with suppress(ValueError):  # The loop before sampling does not exist.
            before = joined(P, continuous_image(K))
            if (sides(before.system.poles, 0.0) < 0).all():
                _warn_of_sampling(disks[total:], disk_margins(before.sensitivity, groups[:2])[0], dt, delay)
    original = (loop.plant, K) if P.dt == K.dt and not delay else (loop.system, None)
    return Margins(tuple(loops), disks[total], disks[total + 1], disks[total + 2], original)


def _warn_of_sampling(disks: Sequence[DiskMargin], before: Sequence[DiskMargin], dt: float, delay: float) -> None:
    """Warn of disk margins at all controls and at all measurements that are much smaller than before sampling."""
    costs = [
        f"from {of.alpha:.3g} to {now.alpha:.3g} at all {where}"
        for where, now, of in zip(("controls", "measurements"), disks, before, strict=False)
        if now.alpha < of.alpha * _COSTLY
    ]
    if costs:
        text = f"sampling every {dt:g} s with a delay of {delay:g} s takes the disk margin {', and '.join(costs)}"
        warn_user(text, MarginLossWarning)


def disk_margins(S: Lti, groups: Sequence[Sequence[int]]) -> tuple[list[DiskMargin], Array]:
    """Return the disk margins of groups of signals from the sensitivity, and the rounding error of each signal's.

    The rounding error is the largest change by rounding errors of the entries, at DC and resonances.
    """
    omega = np.append(0.0, least_damped(S.rates))
    size = np.abs(S.response(omega, quiet=True).diagonal()).max(axis=0)
    rounding = np.array([rounding_of(S.between([i], [i]), omega) for i in range(len(S.D))]) / np.maximum(size, 1.0)
    grid = grid_of_loop(S.rates, S.nyquist, points=SEARCHED)
    G = S.response(grid, quiet=True) if len(S.D) > 1 else np.ones((1, 1, 1))
    disks = (
        _disk(S.between(rows, rows), G[np.ix_(rows, rows)], float(rounding[list(rows)].max(initial=0.0)))
        for rows in groups
    )
    return list(disks), rounding


def _disk(S: Lti, G: Array, rounding: float) -> DiskMargin:
    """Return the disk margin of a sensitivity; ``S - T = 2 S - 1``.

    ``G`` is its response at some frequencies.

    The largest singular value is convex in the logarithm of a diagonal scaling.  It is minimized over the frequencies at
    which it is largest; frequencies at which the optimized scaling yields a larger value are added, until there are none.
    With very many signals rows and columns are only balanced.  The margin is valid for any scaling.  It is verified if
    rounding errors of the loop's matrices change the sensitivity by less than the certified accuracy of a norm.
    """
    n, eye = len(S.D), np.eye(len(S.D))
    T, G = replace(S, C=2.0 * S.C, D=2.0 * S.D - eye), 2.0 * G - eye[:, :, None]

    def norm_of(log: Array) -> NormBounds:
        d = np.exp(np.append(log, 0.0))
        return matrices_norm(replace(T, B=T.B / d, C=d[:, None] * T.C, D=d[:, None] * T.D / d))

    log = _leveled(G) if n > 1 else np.zeros(0)
    best = norm = norm_of(log)
    if 1 < n <= _SEARCHED:
        G = G[:, :, np.argsort(-_scaled_values(log, G))[:_ACTIVE]]
        for _ in range(_ROUNDS):
            at = T.response(np.array([norm.peak_omega]), quiet=True) if isfinite(norm.peak_omega) else T.D[:, :, None]
            G = np.append(G, at, axis=2)
            log, reached = _least(G, log)
            norm = norm_of(log)
            best = min(best, norm, key=lambda norm: norm.upper_bound)
            if norm.lower_bound <= reached * (1.0 + LEVEL):
                break
    verified = best.verified and rounding <= CERTIFIED
    return DiskMargin(2.0 / max(best.upper_bound, 1.0), best.peak_omega, verified, best)


def _leveled(G: Array) -> Array:
    """Return the logarithm of a scaling that balances rows and columns, without the last entry, which is zero."""
    size, log = np.abs(G).max(axis=2), np.zeros(len(G))
    for _ in range(_SWEEPS):
        for i in range(len(G)):
            scaled = np.exp(log)[:, None] * size / np.exp(log)
            row, column = (np.delete(x, i).max() for x in (scaled[i], scaled[:, i]))
            if row > 0.0 and column > 0.0:
                log[i] += 0.5 * np.log(column / row)
    return log[:-1] - log[-1]


def _scaled_values(log: Array, G: Array) -> Array:
    d = np.exp(np.append(log, 0.0))
    return singular_values(d[:, None, None] * G / d[None, :, None])[0]


def _least(G: Array, start: Array) -> tuple[Array, float]:
    """Return a scaling that minimizes the largest singular value of a response, from an initial one, and that value.

    The problem minimizes an upper bound of the two largest singular values at all frequencies: these are smooth where their
    maximum is not.  The scaling is limited to the inverse of the rounding unit.
    """
    from scipy import optimize  # slow import, not needed for a loop of one signal

    unit, ends = float(_scaled_values(start, G).max()), -np.log(EPS)
    n, bounds = len(start), [*((log - ends, log + ends) for log in start), (0.0, None)]

    @lru_cache(maxsize=1)
    def known(log: bytes) -> tuple[Array, Array]:
        d = np.exp(np.append(np.frombuffer(log), 0.0))
        U, values, Vh = np.linalg.svd((d[:, None, None] * G / d[None, :, None]).transpose(2, 0, 1))
        jacobian = values[:, :2, None] * (np.abs(U.swapaxes(1, 2)) ** 2 - np.abs(Vh) ** 2)[:, :2, :-1]
        return values[:, :2].ravel() / unit, jacobian.reshape(-1, n) / unit

    constraint = {
        "type": "ineq",
        "fun": lambda x: x[-1] - known(x[:-1].tobytes())[0],
        "jac": lambda x: np.insert(-known(x[:-1].tobytes())[1], n, 1.0, axis=1),
    }
    result = optimize.minimize(
        lambda x: x[-1],
        np.append(start, 1.0),
        jac=lambda _: np.eye(n + 1)[-1],
        method="SLSQP",
        bounds=bounds,
        constraints=constraint,
        options={"maxiter": _STEPS, "ftol": ALIKE},
    )
    return result.x[:-1], float(_scaled_values(result.x[:-1], G).max())


def grid_of_loop(poles: Array, top: float = inf, **density: Any) -> Array:
    """Return frequencies [rad/s] up to ``top`` that resolve the resonances of poles or rates.

    For ``density`` see :func:`boomctl.lti.frequency.resonance_grid`.
    """
    poles = poles[resolved(poles) & np.isfinite(poles)]
    size = np.abs(poles) if len(poles) else np.array(EMPTY)
    return resonance_grid(poles, size.min() / BEYOND, min(size.max() * BEYOND, top), also=[0.0], **density)


def _loop_margin(signal: str, where: str, S: Lti, disk: DiskMargin, rounding: float) -> LoopMargin:
    """Return the margins of the loop whose sensitivity is ``S = 1/(1 - L)``.

    Gain limits are ``1/L`` where ``L`` is real and positive.  Angles and delays are those from ``L`` to one at ``|L| = 1``.
    """
    image, dt = continuous_image(S), S.dt
    direct = float(image.D[0, 0])
    last = 1.0 - 1.0 / direct if abs(direct) > SUMMED else inf  # L at infinite frequency of the image

    def respond(omega: Array) -> Array:
        return S.response(omega_of_image(omega, dt), quiet=True)[0, 0]

    omega = np.append(0.0, _crossings(_axis_zeros(image, 1.0, 0.0), lambda omega: respond(omega).imag)[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        L = 1.0 - 1.0 / respond(omega)
        real = (np.abs(L.imag) < _REAL * np.abs(L)) & (L.real > ALIKE) & (L.real < 1.0 / ALIKE)
    gains = [*zip((1.0 / L.real[real]).tolist(), omega_of_image(omega[real], dt).tolist(), strict=True)]
    if ALIKE < last < inf:
        gains.append((1.0 / last, float(omega_of_image(inf, dt))))
    low = max((limit for limit in gains if limit[0] < 1.0), key=itemgetter(0), default=(0.0, nan))
    high = min((limit for limit in gains if limit[0] > 1.0), key=itemgetter(0), default=(inf, nan))
    omega = _unit_crossings(image, respond)
    turns, omega = np.angle(1.0 - 1.0 / respond(omega)), omega_of_image(omega, dt)
    phases = [*zip(np.degrees(np.abs(turns)).tolist(), omega.tolist(), strict=True)]
    # A delay has no effect at DC.
    delays = [
        (turn % (2.0 * np.pi) / at, at) for turn, at in zip(turns.tolist(), omega.tolist(), strict=True) if at > 0.0
    ]
    if abs(abs(last) - 1.0) <= ALIKE:
        phases.append((float(np.degrees(abs(np.angle(last)))), float(omega_of_image(inf, dt))))
    if abs(last) >= 1.0 - ALIKE:
        # Continuous: at some high frequency a delay shifts the phase by any angle. Discrete: for `P` poles of `L` outside the
        # unit circle, a stable loop has winding number `P` of `1 - L`; one sample of delay adds a real pole beyond z = -1.
        delays = [(0.0, inf)] if dt == 0.0 else [*delays, (dt, np.pi / dt)]
    phase, delay = (min(each, key=itemgetter(0), default=(inf, nan)) for each in (phases, delays))
    limits, at = (low[0], high[0]), (low[1], high[1])
    return LoopMargin(signal, where, limits, at, *phase, *delay, disk, rounding, S)


def _unit_crossings(S: Lti, respond: Callable[[Array], Array]) -> Array:
    """Return the frequencies [rad/s] at which the modulus of the loop's response crosses or touches one, DC included.

    ``S`` is the sensitivity of a stable loop of one signal in continuous time; ``respond`` may be more accurate than its
    matrices.
    """

    def height(omega: Array) -> Array:
        return respond(omega).real - 0.5

    crossed, others = _crossings(_axis_zeros(S, -1.0, 2.0 * float(S.D[0, 0]) - 1.0), height)
    touched = np.abs(height(others)) <= LEVEL * np.abs(respond(others)) ** 2 if len(others) else []
    omega = np.append(crossed, others[touched])
    # With a gain of one at DC or at infinite frequency, crossings near it are due to rounding error.
    at_rest = abs(height(np.zeros(1))[0]) <= ALIKE
    if at_rest:
        omega = omega[np.abs(height(0.5 * omega)) > ALIKE]
    if abs(float(S.D[0, 0]) - 0.5) <= ALIKE:
        omega = omega[np.abs(height(2.0 * omega)) > ALIKE]
    return np.append(omega, 0.0) if at_rest else omega


def _axis_zeros(S: Lti, sign: float, D: float) -> Array:
    """Return the zeros of ``C (s - A)^-1 B + sign C (s + A)^-1 B + D``, which is even or odd in ``s``."""
    if not len(S.A):
        return np.zeros(0, complex)
    n, scale = len(S.A), signal_scales(S.A, S.B, S.C)
    A, B, C = S.A / scale[:, None] * scale, S.B / scale[:, None], S.C * scale
    unit = float(np.linalg.norm(A)) or 1.0  # unit of time, so that no magnitude depends on it
    A, B, C, none = A / unit, B / unit**0.5, C / unit**0.5, np.zeros((n, n))
    pencil = blocks([[A, none, B], [none, -A, B], [C, sign * C, np.array([[D]])]])
    zeros = linalg.eigvals(pencil, np.diag(np.append(np.ones(2 * n), 0.0)))
    return unit * zeros[np.abs(zeros) <= _FASTEST]


def _crossings(zeros: Array, height: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return the frequencies near zeros at which a height changes its sign, and frequencies of zeros at which it does not.

    A crossing is located in the response itself by regula falsi, between frequencies at which the signs differ.
    """
    omega = zeros[np.abs(zeros.real) <= _OFF_AXIS * np.abs(zeros.imag)].imag
    omega = np.unique(omega[omega > 0.0])
    if not len(omega):
        return omega, omega
    ends = np.concatenate([[0.5 * omega[0]], 0.5 * (omega[1:] + omega[:-1]), [2.0 * omega[-1]]])
    values = height(ends)
    changed = values[1:] * values[:-1] < 0.0
    (a, b), (fa, fb) = ((x[:-1][changed], x[1:][changed]) for x in (ends, values))
    new = result = omega[changed]
    for _ in range(_FALSI_STEPS if len(new) else 0):
        value = height(new)
        same = np.sign(value) == np.sign(fb)
        a, fa = np.where(same, a, b), np.where(same, 0.5 * fa, fb)  # Illinois: half the value of a retained end.
        b, fb, result = new, value, new
        with np.errstate(invalid="ignore", divide="ignore"):
            new = np.where(fb == 0.0, b, b - fb * (b - a) / (fb - fa))
        if (np.abs(new - result) <= SOLVED * result).all():
            break
    return new, omega[~changed]


def _further_delay(plant: Lti, controller: Lti, delay: float, index: int) -> tuple[float, float]:
    """Compute the least further delay [s] that makes a sampled loop unstable, and its frequency [rad/s].

    ``index`` is that of the delayed signal, among the controls followed by the measurements.  Without a limit, the result is
    ``inf`` and NaN.
    """
    dt, (m, p) = controller.dt, controller.D.shape
    ends = signals_of(controller, plant.input_labels, plant.output_labels, scales=plant.scales)
    P = plant.between(*ends).balanced()

    def unstable_from(part: float) -> tuple[float, float]:
        """Return the number of whole samples, beyond a fraction of one, of an unstable loop, and the angle per sample."""
        late = [delay] * m + [0.0] * p
        late[index] += part * dt
        loop = joined(sampled_plant(P, range(m), dt, late[:m], late[m:]), controller, 0.0)
        poles = loop.system.poles
        if (sides(poles, dt) >= 0).any():
            return 0.0, float(abs(np.angle(poles[np.argmax(np.abs(poles))])))
        S = continuous_image(loop.sensitivity.between([index], [index]))
        if float(S.D[0, 0]) <= 0.5:  # the gain at z = -1 is one or more: one sample adds a pole beyond it
            return 1.0, np.pi

        def respond(omega: Array) -> Array:
            return S.response(omega, quiet=True)[0, 0]

        omega = _unit_crossings(S, respond)
        omega = omega[omega > 0.0]
        if not len(omega):
            return inf, nan
        turn = omega_of_image(omega, dt) * dt
        below, at_crossing, above = (1.0 - 1.0 / respond(np.outer(_NEAR_CROSSING, omega).ravel())).reshape(3, -1)
        at_one, leaving = np.angle(at_crossing) % (2.0 * np.pi) / turn, np.sign(np.abs(below) - np.abs(above))
        # With each further turn of a crossing, two poles leave the circle if the gain falls, and return if it rises.
        samples = ceil(at_one.min()) + np.arange(_SAMPLES)
        crossed = np.maximum(np.floor((samples[:, None] - at_one) * turn / (2.0 * np.pi)) + 1.0, 0.0)
        outside = np.flatnonzero(crossed @ leaving > 0.0)
        return (float(samples[outside[0]]), float(turn[np.argmin(at_one)])) if len(outside) else (inf, nan)

    high = min(part + unstable_from(part)[0] for part in np.arange(_PARTS) / _PARTS)
    if high == inf:
        return inf, nan
    low = max(high - 1.0 / _PARTS, 0.0)
    while high - low > ALIKE * max(high, ALIKE):
        middle = 0.5 * (low + high)
        unstable = unstable_from(middle % 1.0)[0] <= floor(middle)
        low, high = (low, middle) if unstable else (middle, high)
    return float(high * dt), unstable_from(high % 1.0)[1] / dt
