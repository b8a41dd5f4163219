"""Singular values over frequency, on a grid that resolves every lightly damped peak, with a certified maximum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.claim import Claim
from boomctl.analysis.model_norm import SplitModel, norm_of
from boomctl.analysis.norm import UNSTABLE, NormBounds
from boomctl.arrays import Array
from boomctl.checks import exactly, frequencies, known, mapping, names, up_to
from boomctl.lti.frequency import NARROWEST, Resonances, singular_values
from boomctl.lti.modal import side_of_axis, sides
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, is_frequency_response, of
from boomctl.printing import between, listed
from boomctl.progress import computing, tell
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread
from boomctl.units import gain_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from boomctl.analysis.model_norm import LinearSystem

Signals: TypeAlias = str | Sequence[str] | None  # names, None for all

_Key = TypeVar("_Key")
_EXPECTED = "SecondOrderModel, StateSpace or FrequencyResponseData"
ANY_RESULT = "SecondOrderModel, StateSpace, TransferFunction, or a result with a closed loop or a reduced system"
# Distance from an undamped mode within which frequencies are omitted, in units of `NARROWEST`: half a grid step (`DRAWN`).
_EXCLUDED = 0.1


@dataclass(frozen=True)
class SelectedSystem:
    """System between selected signals, with the frequencies of its curves.

    Attributes
    ----------
    chosen : SecondOrderModel, Lti or FrequencyResponseData
        System between the selected signals.
    omega : (n,) ndarray or None
        Angular frequencies [rad/s], of data their own; None for a default grid.
    unit : str
        Unit of the requested frequencies, "Hz" without any.
    """

    chosen: Any
    omega: Array | None = None
    unit: str = "Hz"

    @classmethod
    def of(cls, system: Any, omega: Any, frequency_hz: Any, inputs: Signals, outputs: Signals) -> SelectedSystem:
        """Select signals, and check frequencies in rad/s or Hz.

        Raises
        ------
        TypeError, ValueError
            As in :func:`sigma`.
        """
        if omega is not None and frequency_hz is not None:
            raise ValueError("omega, frequency_hz: expected one of them, got both")
        name, values, unit, scale = "frequency_hz", frequency_hz, "Hz", 2.0 * np.pi
        if omega is not None:
            name, values, unit, scale = "omega", omega, "rad/s", 1.0
        grid = None if values is None else scale * frequencies(name, values)
        if is_frequency_response(system):
            if grid is not None:
                raise ValueError("omega: frequency response data have their own frequencies; leave it out")
            ins, outs = names("input", inputs, system.input_labels), names("output", outputs, system.output_labels)
            result = cls(system[list(outs), list(ins)], np.asarray(system.omega, dtype=float))
            _ = result.norm  # raises for data that are not finite
            return result
        result = cls(between_signals(system, inputs, outputs), grid, unit)
        top, high = result.nyquist, 0.0 if grid is None else float(grid.max())
        if high > top * (1.0 + ALIKE):
            limits = f"{up_to(top / scale)} {unit}, got {exactly(high / scale)} {unit}"
            raise ValueError(f"{name}: expected at most half the sampling rate, {limits}")
        return result if grid is None else replace(result, omega=np.minimum(grid, top))

    @property
    def labels(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of inputs and outputs."""
        return tuple(self.chosen.input_labels), tuple(self.chosen.output_labels)

    @property
    def _split(self) -> SplitModel | None:
        """A structure with its subsystems."""
        return SplitModel.of(self.chosen) if isinstance(self.chosen, SecondOrderModel) else None

    def response(self, omega: Array, quiet: bool = False) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies); ``quiet`` as in :meth:`Lti.response`."""
        if split := self._split:
            return split.response(omega)
        if isinstance(self.chosen, Lti):
            return self.chosen.response(omega, quiet=quiet)
        return np.asarray(self.chosen.frdata)

    def singular_values(self, omega: Array, quiet: bool = False) -> Array:
        """Return the singular values, descending; ``quiet`` as in :meth:`Lti.response`."""
        split = self._split
        return singular_values(self.response(omega, quiet)) if split is None else split.singular_values(omega)

    @property
    def nyquist(self) -> float:
        """Nyquist frequency [rad/s]; ``inf`` for continuous time."""
        return self.chosen.nyquist if isinstance(self.chosen, Lti) else inf

    def resonances(self, high: float | None = None) -> Resonances:
        """Return the lowest resonances, or those up to ``high`` [rad/s], with their frequency range."""
        split = self._split
        return Resonances.of(self.chosen.rates, high, self.nyquist) if split is None else split.resonances(high)

    @cached_property
    @one_blas_thread
    def norm(self) -> NormBounds:
        """H-infinity norm."""
        return norm_of(self.chosen)

    @property
    def unstable(self) -> bool:
        """True if the system has an unstable pole; False for data."""
        if "norm" in self.__dict__ or is_frequency_response(self.chosen):
            return self.norm.method == UNSTABLE
        split = self._split
        side = sides(self.chosen.poles, self.chosen.dt) if split is None else side_of_axis(split.poles)
        return bool((side > 0).any())


def between_signals(
    system: object, inputs: Signals, outputs: Signals, expected: str = _EXPECTED
) -> SecondOrderModel | Lti:
    """Return a system between the selected signals; by default a boom model between platform actuators and tips."""
    if isinstance(system, SecondOrderModel):
        result: SecondOrderModel | Lti = system.between(inputs, outputs)
    else:
        result = of(system, expected=expected, sampled=True).select(inputs, outputs).balanced()
    for kind, there in (("inputs", result.input_labels), ("outputs", result.output_labels)):
        if not there:
            raise ValueError(f"system: expected a system with {kind}, got none")
    return result


def looked_at(source: object) -> Any:
    """Return the closed loop of a design, the reduced system of a reduction, or any other object unchanged."""
    for part in ("_closed_loop", "_reduced"):
        if isinstance(result := getattr(source, part, None), Lti | SecondOrderModel):
            return result
    return source


def matrices(source: object, inputs: Signals = None, outputs: Signals = None) -> Lti:
    """Return the balanced matrices of a system or a result between signals; by default a boom's actuators and tips.

    Raises
    ------
    TypeError, ValueError
        If the system has an unsupported type, no inputs, no outputs or an unspecified sampling time, or a name is unknown.
    """
    result = between_signals(looked_at(source), inputs, outputs, ANY_RESULT)
    return result if isinstance(result, Lti) else of(result).balanced()


NO_SINES = "unstable: no steady-state response"


@dataclass(frozen=True, eq=False)
class SigmaResult:
    """Singular values over frequency, with their maximum.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    sigma : (k, n) ndarray
        Singular values, descending.
    input_labels, output_labels : tuple of str
        Names of the signals.
    peak, peak_omega : float
        Largest singular value and its frequency: the H-infinity norm of a model or state-space system (``inf`` with
        undamped, integrating or unstable modes that contribute), the largest value on the grid of measured data.
    verified, certified : bool
        True if an independent computation confirms ``peak``, and if it is proved; see `NormBounds`.
    frequency_unit : str
        Unit of the requested frequencies, "Hz" without any; used by plots.
    """

    omega: Array
    sigma: Array
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    _of: SelectedSystem
    frequency_unit: str = "Hz"

    @property
    def magnitude_unit(self) -> str:
        """Unit of the singular values of a structural model, such as "m/N"; empty if unknown, as for a ``StateSpace``.

        With different units of signals it is, for example, "m or rad per N".
        """
        chosen = self._of.chosen
        return gain_unit(chosen.units, *self._of.labels) if isinstance(chosen, SecondOrderModel) else ""

    @property
    def certificate(self) -> NormBounds:
        """The norm and its bounds, computed on first access."""
        return self._of.norm

    def __repr__(self) -> str:
        lines = [f"{len(self.omega)} frequencies, {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s"]
        lines += [NO_SINES] if self._of.unstable else []
        if "norm" in self._of.__dict__:
            at = f" at {self.peak_omega:.6g} rad/s" if isfinite(self.peak_omega) else ""
            lines.append(f"peak {self.peak:.6g}{at}, {self.certificate.status}")
        else:  # Printing must not compute the norm.
            lines.append(f"largest of these {self.sigma.max():.6g}; the norm is computed on first access to .peak")
        return "\n  ".join([f"SigmaResult: {between(self.input_labels, self.output_labels)}", *lines])

    @property
    def stable(self) -> bool:
        """True if no pole is unstable; the singular values of an unstable system are not gains of responses to sines."""
        return not self._of.unstable

    def __claims__(self) -> Iterator[Claim]:
        """Yield the claims about the peak that can be proved."""
        yield from self.certificate.__claims__()

    def __figures__(self) -> dict[str, float]:
        """Return the metrics for a comparison."""
        return {"H-infinity norm" if self.verified else "largest singular value": self.peak}

    @property
    def peak(self) -> float:
        """Largest singular value."""
        return self.certificate.lower_bound

    @property
    def peak_omega(self) -> float:
        """Frequency of the largest singular value [rad/s]."""
        return self.certificate.peak_omega

    @property
    def verified(self) -> bool:
        """True if the peak is verified."""
        return self.certificate.verified

    @property
    def certified(self) -> bool:
        """True if the peak is certified.  A proof may run on first access."""
        return self.certificate.certified

    @property
    def frequency_hz(self) -> Array:
        """The frequencies of ``omega`` in Hz."""
        return self.omega / (2.0 * np.pi)

    def plot(self, ax: Axes | None = None, *, frequency_unit: str | None = None, **style: Any) -> Axes:
        """Draw the singular values over frequency, with a note if the system is unstable.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw on. If None, a new figure is created.
        frequency_unit : {"Hz", "rad/s"}, optional
            Unit of the frequency axis.  If None, the unit of the existing axes, or of the requested frequencies.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`: ``label``, ``color``, ``linestyle``, ...

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.sigma").plot_sigma(self, ax, frequency_unit=frequency_unit, **style)


@one_blas_thread
def sigma(
    system: LinearSystem,
    omega: ArrayLike | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    frequency_hz: ArrayLike | None = None,
) -> SigmaResult:
    """Return the singular values of a system over frequency.

    Parameters
    ----------
    system : SecondOrderModel, control.StateSpace, control.TransferFunction or control.FrequencyResponseData
        Structure, linear system, or measured data.
    omega : array_like, optional
        Angular frequencies [rad/s], at most ``pi/dt`` for a discrete system.  If None, a grid that spans the lowest modes and
        resolves their peaks and the certified peak.
    inputs, outputs : str or sequence of str, optional
        Signals.  If None, all signals; for a boom model, platform actuators and tips.
    frequency_hz : array_like, optional
        Frequencies [Hz], instead of ``omega``.

    Returns
    -------
    SigmaResult
        Frequencies, singular values (k x n, descending), the peak and its certificate.

    Raises
    ------
    TypeError, ValueError
        If `system` has an unsupported type, a signal is unknown, a frequency is above half the sampling rate, negative or not
        finite, both `omega` and `frequency_hz` or frequencies of measured data are passed, or the response overflows.

    Examples
    --------
    >>> import boomctl as bc
    >>> found = bc.sigma(bc.spray_boom(), frequency_hz=[0.1, 1.0])
    >>> found.sigma.round(3)  # one row per singular value, one column per frequency
    array([[8.122, 3.016],
           [1.052, 0.637]])
    >>> round(float(found.peak)), bool(found.certified)
    (2473, True)
    """
    return curves_of({"system": SelectedSystem.of(system, omega, frequency_hz, inputs, outputs)})["system"]


def curves_of(systems: Mapping[_Key, SelectedSystem]) -> dict[_Key, SigmaResult]:
    """Compute the singular values of systems, at common frequencies by default."""
    grid = np.zeros(0)
    if shown := [selected for selected in systems.values() if selected.omega is None]:
        # Up to the lowest Nyquist frequency, through the resonances and peaks of all systems
        with computing("singular values"):
            tell("verified peak")
            peaks = [selected.norm.peak_omega for selected in shown]
            tell("resonances")
            bands = [selected.resonances() for selected in shown]
            low, high = min(band.low for band in bands), max(band.high for band in bands)
            poles = [selected.resonances(high).poles for selected in shown]
            grid = drawn_grid(Resonances(np.concatenate(poles), low, high), peaks)
            tell(f"{len(grid)} frequencies")
        grid = grid[grid <= min(selected.nyquist for selected in shown)]
    result = {}
    for name, selected in systems.items():
        omega = grid if selected.omega is None else selected.omega
        values = finite(omega, selected.singular_values(omega, quiet=selected.omega is None))
        result[name] = SigmaResult(omega, values, *selected.labels, selected, selected.unit)
    return result


def finite(omega: Array, values: Array) -> Array:
    """Return values over frequency; raise ``ValueError`` if one is not finite."""
    bad = ~np.isfinite(values).all(axis=tuple(range(values.ndim - 1)))
    if bad.any():
        raise ValueError(
            f"system: its response at {omega[bad][0]:g} rad/s is not finite; leave this frequency out, or choose units in"
            " which it is"
        )
    return values


def drawn_grid(band: Resonances, also: Sequence[float] = ()) -> Array:
    """Return frequencies that resolve the resonances in their band, and other frequencies in the band or above it."""
    return exclude_undamped(band, band.curve([omega for omega in also if band.low <= omega < np.inf]))


def exclude_undamped(band: Resonances, grid: Array) -> Array:
    """Return the frequencies of a grid that are not those of undamped modes."""
    undamped = np.abs(band.poles[side_of_axis(band.poles) == 0].imag)
    return grid[(np.abs(grid[:, None] - undamped) > _EXCLUDED * NARROWEST * undamped).all(axis=1)]


@dataclass(frozen=True)
class SigmaComparison:
    """Singular values of several systems over the same band.

    Attributes
    ----------
    curves : dict of str to SigmaResult
        The singular values of each system by its name.
    """

    curves: dict[str, SigmaResult]

    def __getitem__(self, name: str) -> SigmaResult:
        """Return the singular values of a system by its name."""
        return self.curves[known("system", name, tuple(self.curves))]

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that consoles complete in brackets."""
        return list(self.curves)

    def __repr__(self) -> str:
        heads = [f"SigmaComparison: {listed(list(self.curves))}"]
        for name, curve in list(self.curves.items())[:3]:
            state = ", unstable" if not curve.stable else "" if curve.verified else ", not verified"
            signals = between(curve.input_labels, curve.output_labels)
            heads.append(f"  {name}: {signals}, peak {curve.peak:.6g} at {curve.peak_omega:.6g} rad/s{state}")
        more = len(self.curves) - 3
        return "\n".join([*heads, f"  ... {more} more"] if more > 0 else heads)

    def plot(self, ax: Axes | None = None, *, frequency_unit: str | None = None, **style: Any) -> Axes:
        """Draw all singular values on one frequency axis, each system in a separate color.

        Parameters
        ----------
        ax, frequency_unit
            See :meth:`SigmaResult.plot`.
        **style
            Line properties, passed to `matplotlib.axes.Axes.plot`; ``label`` is prefixed to the names.

        Returns
        -------
        matplotlib.axes.Axes
            The axes.
        """
        return import_module("boomctl.plotting.sigma").plot_sigma_comparison(
            self, ax, frequency_unit=frequency_unit, **style
        )


@one_blas_thread
def compare_sigma(
    systems: Mapping[str, LinearSystem],
    omega: ArrayLike | None = None,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    *,
    frequency_hz: ArrayLike | None = None,
) -> SigmaComparison:
    """Compute the singular values of several systems over a common frequency range.

    Parameters
    ----------
    systems : mapping of str to SecondOrderModel or to a system of python-control
        Systems by name, of the types that :func:`sigma` accepts.
    omega, frequency_hz : array_like, optional
        See :func:`sigma`.  If None, the range of the lowest modes of all systems, on a grid that resolves the peaks of each
        system in it.  Data have their own frequencies.
    inputs, outputs : str or sequence of str, optional
        See :func:`sigma`; the same for all systems.

    Returns
    -------
    SigmaComparison
        One `SigmaResult` for each name: ``comparison["name"]``; ``.plot()`` draws them in common axes.

    Raises
    ------
    TypeError, ValueError
        If there are no systems by name, or as in :func:`sigma`, with the name of the system.

    Examples
    --------
    >>> import boomctl as bc
    >>> soft = bc.BoomParameters(spring_stiffness=550.0)
    >>> both = bc.compare_sigma({"as published": bc.spray_boom(), "softer": bc.spray_boom(soft)}, [2.0, 4.0])
    >>> both["softer"].sigma.round(3)
    array([[3.195, 7.976],
           [2.11 , 0.674]])
    """
    mapping("systems", systems, "systems by name")
    if not systems:
        raise ValueError("systems: expected at least one")
    selected: dict[str, SelectedSystem] = {}
    for name, system in systems.items():
        where = (None, None) if is_frequency_response(system) else (omega, frequency_hz)
        with naming(f"systems[{name!r}]"):
            selected[name] = SelectedSystem.of(system, *where, inputs, outputs)
    return SigmaComparison(curves_of(selected))


@contextmanager
def naming(prefix: str) -> Iterator[None]:
    """Prefix the message of an error."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise type(error)(f"{prefix}: {error}") from None
