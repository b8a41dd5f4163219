"""Singular values over frequency, on a grid that resolves every lightly damped peak, with a certified largest one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.claim import Claim
from boomctl.analysis.model_norm import SplitModel
from boomctl.analysis.norm import UNSTABLE, NormBounds, matrices_norm, norm_of_data
from boomctl.arrays import Array
from boomctl.checks import exactly, frequencies, known, mapping, names, up_to
from boomctl.lti.frequency import NARROWEST, Resonances, singular_values
from boomctl.lti.modal import side_of_axis, sides
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti, is_frequency_response, of
from boomctl.printing import between, listed
from boomctl.progress import computing, tell
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import first_order_poles
from boomctl.threads import one_blas_thread
from boomctl.units import gain_unit

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

    from boomctl.analysis.model_norm import LinearSystem

_PRINTED = 100  # coordinates up to which printing waits for the poles: tens of milliseconds (measured)
_BESIDE = 0.1  # share of it beside an undamped mode that is not drawn: half of the way to the next place (`DRAWN`)


@dataclass(frozen=True)
class GivenSystem:
    """A state-space system, asked the same as a :class:`SplitModel`."""

    system: Lti

    def singular_values(self, omega: Array, quiet: bool = False) -> Array:
        """Return the singular values, descending; ``quiet`` as in :meth:`Lti.response`."""
        return singular_values(self.system.response(omega, quiet=quiet))

    def response(self, omega: Array, quiet: bool = False) -> Array:
        """Return the frequency response, shape (outputs, inputs, frequencies)."""
        return self.system.response(omega, quiet=quiet)

    def resonances(self, high: float | None = None) -> Resonances:
        """Return the lowest resonances, or those up to ``high`` [rad/s], and a band that shows them."""
        return Resonances.of_system(self.system, high)

    @one_blas_thread
    def norm(self) -> NormBounds:
        """Return the certified H-infinity norm."""
        return replace(matrices_norm(self.system), _given=self.system)


def has_unstable_pole(given: SplitModel | GivenSystem) -> bool | None:
    """Return whether a system has an unstable pole; None where the model is too large to be asked while it is printed."""
    if isinstance(given, GivenSystem):
        return bool((sides(given.system.poles, given.system.dt) > 0).any())
    m = given.model
    poles = first_order_poles(m.M, m.C, m.K) if m.ncoordinates <= _PRINTED else None
    return None if poles is None else bool((side_of_axis(poles) > 0).any())


NO_SINES = "unstable: these are no responses to sines, which would grow without bound"


@dataclass(frozen=True, eq=False)
class SigmaResult:
    """Singular values over frequency and the largest of all.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    sigma : (k, n) ndarray
        Singular values, descending.
    input_labels, output_labels : tuple of str
        Names of the signals between which the singular values are.
    peak, peak_omega : float
        Largest singular value and its frequency: the H-infinity norm of a model or state-space system (``inf`` with
        undamped, integrating or unstable modes that show), the largest value on the grid of measured data.
    verified, certified : bool
        Whether an independent computation confirms ``peak``, and whether it is proved; see `NormBounds`.
    frequency_unit : str
        Unit in which the frequencies were asked for, "Hz" where none were; pictures use it.
    magnitude_unit : str
        Unit of the singular values of a structural model, such as "m/N", or "m or rad per N" where signals differ; empty
        where it is not known, as of a ``StateSpace``.
    """

    omega: Array
    sigma: Array
    input_labels: tuple[str, ...]
    output_labels: tuple[str, ...]
    _of: SplitModel | GivenSystem | NormBounds  # what the norm is of; the norm itself where it is known
    frequency_unit: str = "Hz"
    magnitude_unit: str = ""

    @cached_property
    def certificate(self) -> NormBounds:
        """The norm and its bounds, computed when first asked for."""
        return self._of if isinstance(self._of, NormBounds) else self._of.norm()

    def __repr__(self) -> str:
        span = f"{len(self.omega)} frequencies, {self.omega[0]:.4g} to {self.omega[-1]:.4g} rad/s"
        if isinstance(self._of, NormBounds) or "certificate" in self.__dict__:
            at = f" at {self.peak_omega:.6g} rad/s" if isfinite(self.peak_omega) else ""
            peak = f"peak {self.peak:.6g}{at}, {self.certificate.status}"
        else:  # printing must not cost what the norm costs
            peak = f"largest of these {self.sigma.max():.6g}; the norm is computed when .peak is asked for"
            if isinstance(self._of, SplitModel) and self._of.model.ncoordinates > _PRINTED:
                return f"SigmaResult: {between(self.input_labels, self.output_labels)}\n  {span}\n  {peak}"
        if not self.stable:
            span += f"\n  {NO_SINES}"
        return f"SigmaResult: {between(self.input_labels, self.output_labels)}\n  {span}\n  {peak}"

    @cached_property
    def stable(self) -> bool:
        """Whether no pole is unstable: otherwise no response to a sine is as large as its singular value."""
        if "certificate" in self.__dict__ or isinstance(self._of, NormBounds):
            return self.certificate.method != UNSTABLE
        result = has_unstable_pole(self._of)
        return self.certificate.method != UNSTABLE if result is None else not result

    def __claims__(self) -> Iterator[Claim]:
        """Yield what can be proved of the peak."""
        yield from self.certificate.__claims__()

    def __figures__(self) -> dict[str, float]:
        """Return what a comparison shows."""
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
        """Whether the peak is verified."""
        return self.certificate.verified

    @property
    def certified(self) -> bool:
        """Whether the peak is certified; a proof may run when this is first read."""
        return self.certificate.certified

    @property
    def frequency_hz(self) -> Array:
        """The frequencies of ``omega`` in Hz."""
        return self.omega / (2.0 * np.pi)

    def plot(self, ax: Axes | None = None, *, frequency_unit: str | None = None, **style: Any) -> Axes:
        """Draw the singular values over frequency.  The picture says so if the system is unstable.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis.  By default that of the curves that are there already, otherwise that in which the
            frequencies were asked for.
        **style
            Of the curves, as matplotlib's lines take it: ``label``, ``color``, ``linestyle``, ...

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
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
        A structure, a system in continuous time, or measured data.
    omega : array_like, optional
        Angular frequencies [rad/s], of a discrete system at most ``pi/dt``.  By default a grid that spans the lowest
        modes and resolves each of their peaks, the certified one included.
    inputs, outputs : str or sequence of str, optional
        Between which signals.  By default all; of a boom model, platform actuators and tips.
    frequency_hz : array_like, optional
        Frequencies in Hz, in place of ``omega``.

    Returns
    -------
    SigmaResult
        Frequencies, singular values (k x n, descending), the peak and its certificate.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; unknown signals; frequencies above half the sampling rate, negative or not
        finite, given twice, or given for measured data; a response beyond all floating-point numbers.

    Examples
    --------
    >>> import boomctl as bc
    >>> found = bc.sigma(bc.spray_boom(), frequency_hz=[0.1, 1.0])
    >>> found.sigma.round(3)  # one row a singular value, one column a frequency
    array([[8.122, 3.016],
           [1.052, 0.637]])
    >>> round(float(found.peak)), bool(found.certified)
    (2473, True)
    """
    asked, unit = asked_frequencies(omega, frequency_hz)
    if is_frequency_response(system):
        return _of_data(system, asked, inputs, outputs)
    chosen, given = between_signals(system, inputs, outputs)
    if asked is not None:
        asked = below_nyquist(asked, given, "omega" if frequency_hz is None else "frequency_hz")
        values = _finite(asked, given.singular_values(asked))
        return SigmaResult(asked, values, chosen.input_labels, chosen.output_labels, given, unit, _unit_of(chosen))
    with computing("singular values"):
        tell("verified peak")
        certificate = given.norm()
        tell("resonances")
        grid = drawn_grid(given.resonances(), [certificate.peak_omega])
        tell(f"{len(grid)} frequencies")
        values = _finite(grid, given.singular_values(grid, quiet=True))
    return SigmaResult(
        grid, values, chosen.input_labels, chosen.output_labels, certificate, magnitude_unit=_unit_of(chosen)
    )


def asked_frequencies(omega: ArrayLike | None, frequency_hz: ArrayLike | None) -> tuple[Array | None, str]:
    """Return the frequencies asked for [rad/s], None for none, and the unit in which they were."""
    if frequency_hz is None:
        return (None, "Hz") if omega is None else (frequencies("omega", omega), "rad/s")
    if omega is not None:
        raise ValueError("omega, frequency_hz: expected one of them, got both")
    return 2.0 * np.pi * frequencies("frequency_hz", frequency_hz), "Hz"


def between_signals(
    system: SecondOrderModel | control.StateSpace | control.TransferFunction,
    inputs: str | Sequence[str] | None,
    outputs: str | Sequence[str] | None,
) -> tuple[SecondOrderModel | Lti, SplitModel | GivenSystem]:
    """Return a system between the chosen signals, and what answers for it."""
    if isinstance(system, SecondOrderModel):
        model = system.between(inputs, outputs)
        for kind, there in (("inputs", model.input_labels), ("outputs", model.output_labels)):
            if not there:
                raise ValueError(f"system: expected a model with {kind}, got none")
        return model, SplitModel.of(model)
    expected = "SecondOrderModel, StateSpace or FrequencyResponseData"
    chosen = of(system, expected=expected, sampled=True).select(inputs, outputs).balanced()
    return chosen, GivenSystem(chosen)


def _unit_of(chosen: SecondOrderModel | Lti) -> str:
    """Return the unit of a gain between the signals of a structure; other systems do not say theirs."""
    return (
        gain_unit(chosen.units, chosen.input_labels, chosen.output_labels)
        if isinstance(chosen, SecondOrderModel)
        else ""
    )


def _nyquist(given: SplitModel | GivenSystem) -> float:
    return given.system.nyquist if isinstance(given, GivenSystem) else float("inf")


def below_nyquist(omega: Array, given: SplitModel | GivenSystem, what: str) -> Array:
    """Return frequencies that a system has; above half the sampling rate it has none."""
    top = _nyquist(given)
    high = float(omega.max(initial=0.0))
    if high > top * (1.0 + ALIKE):
        unit, per = ("Hz", 2.0 * np.pi) if what.endswith("frequency_hz") else ("rad/s", 1.0)
        raise ValueError(
            f"{what}: expected at most half the sampling rate, {up_to(top / per)} {unit}, got {exactly(high / per)} {unit}"
        )
    return np.minimum(omega, top)


def drawn_grid(found: Resonances, also: Sequence[float] = ()) -> Array:
    """Return frequencies that show the resonances in their band, and others where they are in it and above it."""
    return beside_undamped(found, found.curve([omega for omega in also if found.low <= omega < np.inf]))


def beside_undamped(found: Resonances, grid: Array) -> Array:
    """Return the frequencies at which the response can be asked: not those of undamped modes."""
    undamped = np.abs(found.poles[side_of_axis(found.poles) == 0].imag)
    return grid[(np.abs(grid[:, None] - undamped) > _BESIDE * NARROWEST * undamped).all(axis=1)]


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
        """Draw all singular values on one frequency axis, each system in a color of its own.

        Parameters
        ----------
        ax, frequency_unit
            As for :meth:`SigmaResult.plot`.
        **style
            Of all curves, as matplotlib's lines take it; a ``label`` stands before the names.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
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
    """Return the singular values of several systems over the same band, to be drawn over each other.

    Parameters
    ----------
    systems : mapping of str to SecondOrderModel or to a system of python-control
        The systems by name, each as :func:`sigma` takes it.
    omega, frequency_hz : array_like, optional
        As for :func:`sigma`.  By default the band that shows the lowest modes of all of them, on one grid that resolves
        each system's peaks in it.  Data have frequencies of their own.
    inputs, outputs : str or sequence of str, optional
        As for :func:`sigma`, of all of them.

    Returns
    -------
    SigmaComparison
        One `SigmaResult` for each name: ``comparison["name"]``; ``.plot()`` draws them over each other.

    Raises
    ------
    TypeError, ValueError
        No systems by name; as :func:`sigma`, with the name of the system.

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
    asked, unit = asked_frequencies(omega, frequency_hz)
    done: dict[str, SigmaResult] = {}
    models: dict[str, Any] = {}
    for name, system in systems.items():
        try:
            if is_frequency_response(system):
                done[name] = _of_data(system, None, inputs, outputs)
            else:
                models[name] = between_signals(system, inputs, outputs)
        except (TypeError, ValueError) as error:
            raise type(error)(f"systems[{name!r}]: {error}") from None
    norms: dict[str, Any] = {}
    grid = np.zeros(0) if asked is None else asked
    if asked is None and models:
        norms = {name: given.norm() for name, (_, given) in models.items()}
        bands = [given.resonances() for _, given in models.values()]
        low, high = min(result.low for result in bands), max(result.high for result in bands)
        poles = np.concatenate([given.resonances(high).poles for _, given in models.values()])
        grid = drawn_grid(Resonances(poles, low, high), [norm.peak_omega for norm in norms.values()])
        grid = grid[grid <= min(_nyquist(given) for _, given in models.values())]  # what all of them have
    for name, (chosen, given) in models.items():
        if asked is not None:
            grid = below_nyquist(
                asked, given, f"systems[{name!r}]: {'omega' if frequency_hz is None else 'frequency_hz'}"
            )
        values = _finite(grid, given.singular_values(grid, quiet=asked is None))
        done[name] = SigmaResult(
            grid, values, chosen.input_labels, chosen.output_labels, norms.get(name, given), unit, _unit_of(chosen)
        )
    return SigmaComparison({name: done[name] for name in systems})


def _finite(omega: Array, values: Array) -> Array:
    """Return singular values; those beyond all floating-point numbers are refused."""
    told = np.isfinite(values)
    if told.all():
        return values
    raise ValueError(
        f"system: its response at {omega[~told.all(axis=0)][0]:g} rad/s is beyond all floating-point numbers;"
        " expected a system in units in which it is not"
    )


def _of_data(
    data: control.FrequencyResponseData,
    omega: Array | None,
    inputs: str | Sequence[str] | None,
    outputs: str | Sequence[str] | None,
) -> SigmaResult:
    if omega is not None:
        raise ValueError("omega: frequency response data have their own frequencies; leave it out")
    ins, outs = names("input", inputs, data.input_labels), names("output", outputs, data.output_labels)
    o, i = [data.output_labels.index(n) for n in outs], [data.input_labels.index(n) for n in ins]
    response: Array = np.asarray(data.frdata)[np.ix_(o, i)]
    grid, values = np.asarray(data.omega, dtype=float), singular_values(response)
    return SigmaResult(grid, values, ins, outs, norm_of_data(grid, response))
