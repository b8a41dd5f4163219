"""A modal model in continuous time from a record or from a measured frequency response.

From call to result: ``Record.of`` checks the record, ``Spectra.of_record`` transforms it, ``search_poles`` starts from common
denominators (``poles_by_order``) and fits poles and residues (``CommonPoles``, ``fitted``); ``_validated`` tests the fit on
other data, ``refine``, ``settled`` and ``unbiased`` repeat it on all data, ``deviations`` gives the intervals, and
``RankOne`` the system.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import fft, special

from boomctl.arrays import Array, squared
from boomctl.checks import known, warn_user, whole, within
from boomctl.identification.families import name_of_real_pole, names_of_mode, of_modes, paired_modes, union
from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse
from boomctl.identification.intervals import confident
from boomctl.identification.modal.common_poles import CommonPoles
from boomctl.identification.modal.jackknife import BLOCKS, deviations
from boomctl.identification.modal.realized import RankOne
from boomctl.identification.modal.search import Band, refine, search_poles, settled, unbiased, weakest, without
from boomctl.identification.modal.spectra import FEWEST, Spectra, complex_of, rms
from boomctl.identification.modal.start import Track
from boomctl.identification.record import EXCITED, QUANTITIES, Record, band, quantities
from boomctl.identification.response import with_intersample
from boomctl.lti.python_control import control
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import is_frequency_response
from boomctl.printing import LINES, WIDTH, between, compact, count, table_html
from boomctl.progress import Deadline
from boomctl.structure.families import Family
from boomctl.structure.model import SecondOrderModel
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

_SMOOTH = 31  # Lines over which the powers of inputs are averaged to determine the band.
_LOWEST = tuple(EXCITED * 10.0**-k for k in range(5))  # least power of an input in the band over its largest, in turn
_TOGETHER = 1e-4  # Least eigenvalue of the inputs' correlation; below it the inputs are dependent.
_TOP = 0.98  # Highest frequency over half the sampling rate: above it, filters and aliasing dominate.
_FOLDED, _LARGE = 0.95, 0.2  # Aliased poles: least frequency over half the sampling rate, least fraction of the energy.
_HIGHEST = 60  # Default order: about three times the expected number of modes.
_PARTS = 4  # Parts of a record that give prediction intervals.
_WHOLE_RECORDS = 3  # Records from which whole ones are held back.
_QUIET = 0.2  # RMS of the held-back outputs over those that are fitted, below which the fit is not checked.
_POOR = 50.0  # Fit [%] below which a warning is given.
_WIDEST = 20.0  # logarithm of a factor of damping: it is not determined then
_LOSS = 1.0  # Largest loss of fit [%] by the conversion to a structure.
_FEEDBACK = 6.0  # deviations of a correlation of errors with inputs that come later: one in a thousand million
_LATER = 3  # Excluded lags: the band correlates neighbors.


@dataclass(frozen=True)
class IdentifiedMode:
    """Mode identified from a record.

    Attributes
    ----------
    frequency_hz : float
        Damped frequency [Hz], as ``eigenfrequencies_hz`` of models.
    damping_ratio : float
        Damping ratio.
    frequency_interval_hz, damping_ratio_interval : (float, float)
        Confidence intervals of the mean over the record, from a block jackknife.
    shape : (p,) ndarray
        Mode shape at the outputs, as displacements; complex, the largest component is one.
    energy_fraction : float
        Energy of the mode's response to the inputs, outputs scaled by their magnitude, over the sum over all modes and
        real poles.
    stabilization : float
        Fraction of the orders with a stable pole at the mode; 0 if it was found in residuals.
    frequency_prediction_interval_hz, damping_ratio_prediction_interval : (float, float)
        Prediction intervals for another record of the same kind, from the scatter between long parts of this one.
    closely_spaced : bool
        True if cross-validation indicates a second mode within three half bandwidths, which the record does not
        determine.
    """

    frequency_hz: float
    damping_ratio: float
    frequency_interval_hz: tuple[float, float]
    damping_ratio_interval: tuple[float, float]
    shape: Array
    energy_fraction: float
    stabilization: float
    frequency_prediction_interval_hz: tuple[float, float]
    damping_ratio_prediction_interval: tuple[float, float]
    closely_spaced: bool

    __repr__ = compact


@dataclass(frozen=True)
class RealPole:
    """Real pole identified from a record: friction, a motor or a filter, not a mode.

    Attributes
    ----------
    rate : float
        Decay rate [rad/s].
    rate_interval : (float, float)
        Interval of ``confidence_level`` of the mean over the record.
    rate_prediction_interval : (float, float)
        Interval of ``confidence_level`` for another record of the kind.
    """

    rate: float
    rate_interval: tuple[float, float]
    rate_prediction_interval: tuple[float, float]

    __repr__ = compact


@dataclass(frozen=True)
class IdentificationResult:
    """Modal model identified from a record, with its validation.

    Attributes
    ----------
    modes : tuple of IdentifiedMode
        Modes within the frequency range, in ascending frequency.
    real_poles : tuple of RealPole
        Real poles, such as those of friction, motors and filters.
    integrators : int
        1 for a motor whose angle is measured, 2 for a body that a force moves, 0 for a structure on supports.
    system : StateSpace
        Continuous-time model with named signals; modes outside the band are represented by the feedthrough and the
        states "outside".
    model : SecondOrderModel
        The same model as a structure in modal coordinates with unit modal masses, whose inputs are forces. For
        several inputs it is the nearest structure with real modes, one coordinate for each, if ``fit_percent``
        decreases by less than one point; otherwise complex modes have two coordinates.
    fit_percent : dict of str to float
        ``100 (1 - |y - predicted| / |y|)`` of each output within the band, on the validation data.
    whiteness_p_value : dict of str to float
        p-value of the whiteness test of the residuals of each output (Bartlett's cumulative periodogram).
    frequency_range_hz : (float, float)
        Frequency range in which modes were identified [Hz].
    confidence_level : float
        Confidence level of the intervals.
    parts : int
        Number of parts of the record, or of records, from which prediction intervals were computed.
    uncertainty_source : str
        Origin of intervals and validation.
    stabilization_poles : dict of int to ndarray
        Poles [rad/s] at each order, before the fit.
    validation_spectra : (3, n) ndarray
        Frequencies [Hz], and spectra of outputs and residuals on the validation data, normalized by the RMS of each
        output.
    elapsed : float
        Run time [s].
    """

    modes: tuple[IdentifiedMode, ...]
    real_poles: tuple[RealPole, ...]
    integrators: int
    system: "control.StateSpace"
    model: SecondOrderModel
    fit_percent: dict[str, float]
    whiteness_p_value: dict[str, float]
    frequency_range_hz: tuple[float, float]
    confidence_level: float
    parts: int
    uncertainty_source: str
    stabilization_poles: dict[int, Array]
    validation_spectra: Array
    elapsed: float = field(repr=False, compare=False)

    @property
    def success(self) -> bool:
        """True if ``fit_percent`` of each output is 50 % or more."""
        return min(self.fit_percent.values()) >= _POOR

    @property
    def message(self) -> str:
        """Number of modes, band, signals and fit, in one sentence."""
        return f"{self._head()}; {self._fit()}"

    def family(
        self, probability: float = 0.95, range_margin: float = 0.0, *, union_with: "Sequence[IdentificationResult]" = ()
    ) -> Family:
        """Return the structures over a box that holds all frequencies and dampings at once with a probability.

        The input and output vectors of the modes are kept as identified.

        Parameters
        ----------
        probability : float
            Probability that the box contains all parameters, between 0.5 and 1: ranges are wider than intervals, by
            Bonferroni's bound.
        range_margin : float
            Fraction of each value by which its range is widened to either side, for changes after the measurement.
        union_with : sequence of IdentificationResult
            Results of other records, such as other levels or days: the box is the smallest that contains the boxes of all.
            Modes are paired by frequency, each with the nearest within a tenth; a mode that another record does not have
            keeps its range.  The residues of this record are used.

        Returns
        -------
        PolynomialFamily
            For `tune`, `worst_case`, `robust_stability`, `robust_stability_margin`; ``ranges`` are the box.

        Raises
        ------
        TypeError, ValueError
            If an interval is unbounded or has zero width.

        Warns
        -----
        BoomctlWarning
            Modes of another record that this one does not have.

        Examples
        --------
        >>> import boomctl as bc
        >>> import numpy as np
        >>> force = np.random.default_rng(0).standard_normal(4000)
        >>> mass = bc.structure.SecondOrderModel([[1.0]], [[0.8]], [[400.0]], {"force": [1.0]}, {"place": [1.0]})
        >>> moved = bc.forced_response(mass, 0.02 * np.arange(4000), {"force": force})["place"]
        >>> found = bc.identify({"force": force}, {"place": moved}, 0.02, frequency_range_hz=(0.5, 8.0))
        >>> found.family(range_margin=0.1).names
        ('mode_1_hz', 'mode_1_damping')
        """
        modes = [(mode.frequency_hz, mode.damping_ratio) for mode in self.modes]
        real_poles = [*(-pole.rate for pole in self.real_poles), *[0.0] * min(self.integrators, 1)]
        ranges = union(self, union_with, probability, range_margin, paired_modes)
        return of_modes(self.model, modes, ranges, real_poles)

    @property
    def _uncertain(self) -> tuple[dict[str, tuple[float, float, float]], dict[str, float]]:
        """Value and prediction interval of each frequency [Hz], damping ratio and real pole [rad/s], and dof."""
        result = {}
        for k, mode in enumerate(self.modes):
            frequency = mode.frequency_hz, *mode.frequency_prediction_interval_hz
            damping = mode.damping_ratio, *mode.damping_ratio_prediction_interval
            result.update(zip(names_of_mode(k), (frequency, damping), strict=True))
        for k, pole in enumerate(self.real_poles):
            result[name_of_real_pole(k)] = pole.rate, *pole.rate_prediction_interval
        return result, dict.fromkeys(result, self.parts - 1.0)

    def __repr__(self) -> str:
        lines = [f"IdentificationResult: {self._head()}"]
        shown = self.modes if len(self.modes) <= LINES - 2 else self.modes[: LINES - 3]
        lines += ["  " + ", ".join(self._row(mode)[:3]) for mode in shown]
        if len(shown) < len(self.modes):
            lines.append(f"  ... ({len(self.modes)})")
        lines += [*self._others(), f"  {self._fit()}; {self.uncertainty_source}"]
        return "\n".join(line if len(line) <= WIDTH else line[: WIDTH - 3] + "..." for line in lines)

    def _repr_html_(self) -> str:
        heads = ("frequency", "damping", "share of energy")
        return table_html(f"{self.message}; {self.uncertainty_source}", heads, map(self._row, self.modes))

    def __str__(self) -> str:
        """Return modes with their intervals, and the fit of each output, as lines of text.

        Returns
        -------
        str
            One line a mode, one an output.
        """
        lines = [self._head(), *("  " + ", ".join(self._row(mode)) for mode in self.modes), *self._others()]
        return "\n".join(
            [
                *lines,
                *(f"  fit of {name}: {fit:.2f} %" for name, fit in self.fit_percent.items()),
                self.uncertainty_source,
            ]
        )

    def _head(self) -> str:
        names = between(self.system.input_labels, self.system.output_labels)
        return (
            f"{count(len(self.modes), 'mode')} from {self.frequency_range_hz[0]:.4g} to "
            f"{self.frequency_range_hz[1]:.4g} Hz, {names}"
        )

    def _others(self) -> list[str]:
        """Return a line for each real pole, one for integrators, and one for modes that may be two."""
        lines = [
            f"  real pole at {-pole.rate:.4g} rad/s ({-pole.rate_interval[1]:.4g} to {-pole.rate_interval[0]:.4g})"
            for pole in self.real_poles
        ]
        if self.integrators:
            kind = "pole at zero" if self.integrators == 1 else "a body that moves freely"
            lines.append(f"  {count(self.integrators, 'integrator')}: {kind}")
        double = ", ".join(f"{mode.frequency_hz:.5g}" for mode in self.modes if mode.closely_spaced)
        return lines + ([f"  possibly closely spaced modes at {double} Hz"] if double else [])

    def _fit(self) -> str:
        fits = list(self.fit_percent.values())
        return f"fit {np.mean(fits):.2f} % mean, {min(fits):.2f} % least"

    @staticmethod
    def _row(mode: IdentifiedMode) -> tuple[str, str, str]:
        about = 0.5 * (mode.frequency_interval_hz[1] - mode.frequency_interval_hz[0])
        low, high = mode.damping_ratio_interval
        damping = f"damping {100.0 * mode.damping_ratio:.3g} % ({100.0 * low:.3g} to {100.0 * high:.3g})"
        return (
            f"{mode.frequency_hz:.6g} +- {about:.2g} Hz",
            damping,
            f"{100.0 * mode.energy_fraction:.3g} % of the energy",
        )

    def plot(self, ax: "Axes | None" = None, **style: Any) -> Array:
        """Draw poles over orders with the identified modes, and spectra of validation data and residuals.

        Parameters
        ----------
        ax : sequence of two matplotlib Axes, or a figure, optional
            Axes; by default a new figure of pyplot.
        **style
            Line properties of matplotlib for the measured curves.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Stabilization, validation.
        """
        return import_module("boomctl.plotting.identification").plot_identification(self, ax, **style)


@one_blas_thread
def identify(
    inputs: "ArrayLike | Mapping[str, ArrayLike] | control.FrequencyResponseData | Any",
    outputs: "ArrayLike | Mapping[str, ArrayLike] | Any" = None,
    sample_time: float | None = None,
    *,
    modes: int | None = None,
    rigid_body: int | None = None,
    frequency_range_hz: tuple[float, float] | None = None,
    quantity: str | Mapping[str, str] | None = None,
    intersample: str | None = None,
    validation_fraction: float = 0.3,
    order: int | None = None,
    confidence_level: float = 0.95,
    error_model: str | None = None,
) -> IdentificationResult:
    """Identify the modes and a model of a structure from a record.

    Parameters
    ----------
    inputs, outputs : (N, m) array_like, mapping of names to (N,) array_like, or a sequence of such
        Samples, one row per sample; several records as a list. Inputs must be measured. For a free decay, pass an
        impulse at the release as input: frequencies, damping ratios and shapes are then valid, gains are not. Or,
        as `inputs` alone, FrequencyResponseData or the result of `read_frequency_response`; if
        `estimate_frequency_response` made it from an aperiodic record, that record is fitted over the same frequencies,
        without validation data.
    sample_time : float
        Time between samples [s].
    modes : int, optional
        Number of modes in the band. By default all modes that the data determine, see Notes.
    rigid_body : {0, 1, 2}, optional
        Integrators of the plant: 1 for a motor whose angle is measured, 2 for a free mass driven by a force, 0 for none.
        By default determined from the data.
    frequency_range_hz : (float, float), optional
        Frequency range of the modes [Hz].  By default the range in which all inputs have power.
    quantity : "displacement", "velocity", "acceleration", or mapping of outputs to these, optional
        Quantity of each output; by default displacement, or the quantity of a result of `estimate_frequency_response`.
    intersample : "bl" or "zoh", optional
        Inputs between samples: band-limited (a measurement behind an anti-alias filter) or zero-order hold (a computed
        command).  By default determined from the record.
    validation_fraction : float
        Fraction of each record, at its end, for validation only; 0: validation on the fitted data.
    order : int, optional
        Highest order of the common-denominator models of the stabilization diagram; the result depends weakly on it.
    confidence_level : float
        Confidence of the intervals, between 0.5 and 1.
    error_model : "relative" or "absolute", optional
        Errors of a measured frequency response: proportional to its magnitude, or constant; by default the more likely one.
        Must be None if the response has standard deviations or repeated frequencies.

    Returns
    -------
    IdentificationResult
        Modes with intervals, a ``StateSpace``, a structure if one exists, and the fit on the validation data.

    Raises
    ------
    TypeError, ValueError
        If signals are invalid, as for `estimate_frequency_response`, the record is too short, inputs are linearly dependent,
        fewer modes than requested are found, or the mean fit on the validation data is negative.

    Warns
    -----
    BoomctlWarning
        If inputs depend on errors of the outputs, as in a closed loop, the fit of an output is below 50 %, or the record does
        not determine `intersample`.

    Notes
    -----
    The search starts from a common denominator, computed by linear least squares (Peeters, Van der Auweraer,
    Guillaume & Leuridan 2004), and minimizes the squared errors in the frequency domain over the poles, with residues
    and initial conditions eliminated (variable projection, Golub & Pereyra 1973).  A mode is retained if the record
    determines its damping ratio within a factor of 2 and its frequency within half the half-power bandwidth, ``zeta f``,
    both at 95 % confidence.  Candidates from the residuals, single or in pairs, must pass this test in a fit to a
    narrow band around them; close to another mode they must also lower the error on omitted blocks (cross-validation).
    Integrators, up to two real poles, and pairs of poles outside the band are added only if this error falls.

    The fit percentage is that of the model of the first part, in a simulation of the validation data with the inputs alone
    from an estimated initial state.  Then the model is fitted to the full record and exported.

    Confidence intervals come from a jackknife over blocks with equal information, so that they also hold for colored
    errors.  Against bias by strong modes just outside the band, the poles of a record are fitted with more pairs outside the
    band than the system has.  For a measured frequency response choose a band that includes such modes, or ends well
    below them.  Prediction intervals come from a jackknife over four long parts of the record or over several records:
    they include changes of the structure with time and level.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> force = np.random.default_rng(0).standard_normal(4000)
    >>> mass = bc.structure.SecondOrderModel([[1.0]], [[0.8]], [[400.0]], {"force": [1.0]}, {"place": [1.0]})
    >>> moved = bc.forced_response(mass, 0.02 * np.arange(4000), {"force": force})["place"]
    >>> found = bc.identify({"force": force}, {"place": moved}, 0.02, frequency_range_hz=(0.5, 8.0))
    >>> [(round(mode.frequency_hz, 2), round(mode.damping_ratio, 3)) for mode in found.modes]
    [(3.18, 0.02)]
    """
    clock, level = Deadline(), confident("confidence_level", confidence_level)
    back = within("validation_fraction", validation_fraction, 0.0, 0.8)
    wanted = None if modes is None else whole("modes", modes)
    rigid = None if rigid_body is None else whole("rigid_body", rigid_body, least=0, most=2)
    highest = _HIGHEST if order is None else whole("order", order, least=4, most=400)
    source: Any = inputs
    if isinstance(inputs, MeasuredFrequencyResponse):
        source = inputs.response
        if source is None:
            raise ValueError(
                "inputs: expected a frequency response with its phase, got magnitudes alone; give a file with columns"
                " re_OUT_IN, im_OUT_IN, or the record"
            )
    record: Any = getattr(source, "record", None)
    is_response = is_frequency_response(source)
    if is_response and not (outputs is sample_time is intersample is None):
        raise TypeError("outputs, sample_time, intersample: expected None for a measured frequency response")
    if error_model is not None and (record is not None or not is_response):
        raise TypeError(
            f"error_model = {error_model!r}: expected None for a record, whose residuals say how large its errors are"
        )
    if is_response and record is not None:
        low, high = (source.omega[[0, -1]] / (2.0 * np.pi)).tolist()
        band_hz = band((low, high) if frequency_range_hz is None else frequency_range_hz, high)
        kinds = record.quantity if quantity is None else quantities(quantity, record.outputs)
        trials = [_of_record(replace(record, quantity=kinds), band_hz, 0.0, rigid)]
    elif is_response:
        trials = _of_response(source, frequency_range_hz, quantity, error_model, rigid)
    else:
        record = Record.of(inputs, outputs, sample_time, "displacement" if quantity is None else quantity, intersample)
        band_hz = _band(record, frequency_range_hz, FEWEST * len(record.inputs) / min(1.0 - back, back or 1.0))
        trials = [_of_record(with_intersample(record, band_hz[1]), band_hz, back, rigid)]
    searches = [(search_poles(trial.data, trial.band, highest), trial) for trial in trials]
    (fit, unresolved, chains, by_order), trial = (
        max(searches, key=lambda search: _likelihood(search[0][0])) if len(searches) > 1 else searches[0]
    )
    percent, spectra, white = _validated(fit, trial.tested)
    if trial.complete is not trial.data:
        scale = fit.data.scale / trial.complete.scale
        fit, unresolved = refine(replace(fit, data=trial.complete.scaled(scale)), trial.band)
        fit = settled(fit, trial.band)
    wide, number = _modes_first(unbiased(fit, trial.band), trial, wanted)
    fit = replace(wide, fixed=fit.fixed)
    if (trial.tested.output_rms > _QUIET * trial.data.output_rms).any():  # not the end of the motion after an impact
        _check_fit(percent, trial.outputs)
    if trial.data.lengths:
        _warn_of_feedback(fit)
    parts = max(len(fit.data.lengths), _PARTS)
    tail = 0.5 + 0.5 * level
    of_mean = special.stdtrit(BLOCKS - 1, tail) * deviations(wide)
    of_part = special.stdtrit(parts - 1, tail) * np.sqrt(parts + 1.0) * deviations(wide, parts)
    # another record is at least as uncertain
    steps = np.stack([of_mean, np.maximum(of_part, np.sqrt(2.0) * of_mean)], axis=1)
    simple, energy = RankOne.of(fit), fit.energy_fractions / fit.energy_fractions.sum()
    signals, orders = (trial.inputs, trial.outputs), tuple(QUANTITIES[kind] for kind in trial.kinds)
    model = simple.with_real_directions(fit.data, _LOSS).structure(*signals, orders)
    shapes = simple.c / fit.poles[:, None] ** np.array(orders)
    near = np.abs(fit.poles[:, None] - unresolved) < -fit.poles.real[:, None]
    return IdentificationResult(
        modes=tuple(
            _mode(
                pole,
                steps[k],
                shapes[k],
                float(energy[k]),
                _steadiness(pole, chains, len(by_order)),
                bool(near[k].any()),
            )
            for k, pole in enumerate(fit.poles[:number].tolist())
        ),
        real_poles=tuple(
            RealPole(rate, *(_factors(rate, step) for step in steps[number + k, :, 0]))
            for k, rate in enumerate((-fit.poles[number:].real).tolist())
        ),
        integrators=fit.integrators,
        system=simple.system(*signals).without_dots().statespace("identified"),
        model=model,
        fit_percent=dict(zip(trial.outputs, percent.tolist(), strict=True)),
        whiteness_p_value=dict(zip(trial.outputs, white.tolist(), strict=True)),
        frequency_range_hz=trial.band_hz,
        confidence_level=level,
        parts=parts,
        uncertainty_source=trial.source,
        stabilization_poles=by_order,
        validation_spectra=spectra,
        elapsed=clock.elapsed,
    )


@dataclass(frozen=True)
class _Trial:
    """Data of the fit, of its validation and of the last fit, with the signals, the band and the source.

    A measured response is fitted once with each of the possible errors, a record in one way.
    """

    data: Spectra
    tested: Spectra
    complete: Spectra
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    kinds: tuple[str, ...]
    band_hz: tuple[float, float]
    rigid: int | None
    source: str

    @property
    def band(self) -> Band:
        """Frequencies of modes, and integrators: of a free body none in accelerations, one in velocities."""
        low, high = self.band_hz
        most = 2 - min(QUANTITIES[kind] for kind in self.kinds)
        return Band(
            2.0 * np.pi * low, 2.0 * np.pi * high, tuple(range(most + 1)) if self.rigid is None else (self.rigid,)
        )


def _of_record(record: Record, band_hz: tuple[float, float], back: float, rigid: int | None) -> _Trial:
    """Return the spectra of a record and of the part that is held back for validation: whole records, of three and more."""
    low, high = band_hz
    every = Spectra.of_record(record, low, high)
    size = rms(every.U)
    alike = (every.U / size).conj().T @ (every.U / size) / len(every.U)
    if np.linalg.eigvalsh(alike)[0] < _TOGETHER or (np.diagonal(alike) == 0.0).any():
        raise ValueError(
            f"inputs: expected each to move by itself from {low:.4g} to {high:.4g} Hz; linearly dependent inputs cannot"
            " be separated"
        )
    count, data, tested, end = len(record.u), every, every, "validated on the fitted data"
    if back:
        last, held = 0, f"its last {100.0 * back:g} %"
        if count >= _WHOLE_RECORDS:
            last = min(max(round(back * count), 1), count - 1)
            held = "its last experiment" if last == 1 else f"its last {last} experiments"
            parts = record.part(slice(count - last)), record.part(slice(count - last, None))
        else:
            parts = record.part(end=1.0 - back), record.part(begin=1.0 - back)
        data, tested = (Spectra.of_record(part, low, high) for part in parts)
        end = f"model validated by simulation of {held}, then refitted to the full record"
    source = f"intervals from {BLOCKS} blocks; {end}"
    return _Trial(data, tested, every, record.inputs, record.outputs, record.quantity, band_hz, rigid, source)


def _of_response(
    response: Any, frequency_range_hz: Any, quantity: Any, error_model: str | None, rigid: int | None
) -> list[_Trial]:
    """Return a measured response with errors of each possible kind, up to a factor for each output."""
    response = _merged(response)
    signals = tuple(response.input_labels), tuple(response.output_labels)
    band_hz = band(frequency_range_hz, float(response.omega[-1]) / (2.0 * np.pi))
    stated = getattr(response, "quantity", ("displacement",) * len(signals[1]))
    kinds = stated if quantity is None else quantities(quantity, signals[1])
    source = f"intervals from {BLOCKS} groups of frequencies, validated on all of them"
    if hasattr(response, "deviation"):
        if error_model is not None:
            raise TypeError(f"error_model = {error_model!r}: expected None for a response with standard deviations")
        sizes = {source: response.deviation}
    else:
        models = {"relative": np.abs(response.frdata), "absolute": None}
        chosen = models if error_model is None else [known("error_model", error_model, models)]
        sizes = {f"{source}; errors assumed {name}": models[name] for name in chosen}
    trials = []
    for words, size in sizes.items():
        data = Spectra.of_response(response, *band_hz, size)
        trials.append(_Trial(data, data, data, *signals, kinds, band_hz, rigid, words))
    return trials


def _validated(fit: CommonPoles, tested: Spectra) -> tuple[Array, Array, Array]:
    """Return the fit [%] of each output in a free run, the spectra of outputs and errors, and the chance of white errors.

    The chance is that of cumulated periodograms as far from a straight line, were the errors white.
    """
    tested = tested.scaled(fit.data.scale / tested.scale)
    left, first = complex_of(RankOne.of(fit).left(tested)), tested.record == 0
    percent = 100.0 * (1.0 - rms(tested.windowed(left)) / rms(tested.windowed(tested.Y)))
    spectra = [np.sqrt(np.square(np.abs(x) / rms(tested.Y)).mean(axis=1)) for x in (tested.Y, left)]
    power = np.cumsum(np.square(np.abs(left[first])), axis=0)
    line = np.arange(1, len(power) + 1)[:, None] / len(power)
    away = np.abs(power / np.where(power[-1] > 0.0, power[-1], 1.0) - line).max(axis=0)
    white = special.kolmogorov(np.sqrt(len(power)) * away)
    return percent, np.array([tested.s.imag / (2.0 * np.pi), *spectra])[:, first], white


def _modes_first(fit: CommonPoles, trial: _Trial, wanted: int | None) -> tuple[CommonPoles, int]:
    """Return the fit with the modes of the band before other poles, and their number: the one wanted, or all."""
    low, high = trial.band_hz
    inside = trial.band.modes(fit.poles)
    if wanted is not None and inside.sum() > wanted:
        fit = without(fit, weakest(fit, inside, int(inside.sum()) - wanted))
        inside = trial.band.modes(fit.poles)
    number = int(inside.sum())
    if not number or (wanted or 0) > number:
        noise = 100.0 * np.mean(fit.deviation * np.sqrt(2.0) / rms(fit.data.Y))
        bare = not number and not fit.integrators and not len(fit.poles)
        turned = "; are inputs and outputs interchanged?" if noise < 100.0 - _POOR and bare else ""
        remedy = "" if turned else "; a longer record, more excitation or another frequency range may help"
        raise ValueError(
            f"outputs: expected {count(wanted or 1, 'mode')} from {low:.4g} to {high:.4g} Hz, got evidence of {number}:"
            f" {min(noise, 100.0):.3g} % of the outputs is not explained by the inputs{turned}{remedy}"
        )
    step = trial.data.step
    folded = fit.poles[inside & (fit.energy_fractions > _LARGE) & (fit.poles.imag * step > np.pi * _FOLDED)]
    if len(folded):
        raise ValueError(
            f"sample_time = {step!r}: expected resonances well below half the sampling rate, got one at"
            f" {folded[0].imag / (2.0 * np.pi):.4g} Hz of {0.5 / step:.4g}; sample faster, or filter before sampling"
        )
    order = np.argsort(np.where(inside, fit.poles.imag, np.inf), kind="stable")
    return fit if (np.diff(order) > 0).all() else replace(fit, poles=fit.poles[order]), number


def _check_fit(percent: Array, outputs: Sequence[str]) -> None:
    """Raise if the model predicts worse than zero, warn if it predicts less than half."""
    worst = int(np.argmin(percent))
    if percent.mean() < 0.0:
        raise ValueError(
            f"outputs: expected outputs that the inputs predict, got a fit of {percent.mean():.3g} % on the"
            " validation data; use a longer record, another `frequency_range_hz`, or check that the inputs cause the outputs"
        )
    if percent.min() < _POOR:
        warn_user(
            f"Validation fit of {outputs[worst]!r} is only {percent[worst]:.3g} % (mean {percent.mean():.3g} %). Use a"
            " longer record, or another `frequency_range_hz`."
        )


def _merged(response: Any) -> Any:
    """Return a response with the median over each repeated frequency, and its deviation; others unchanged.

    A value that disagrees with its repetitions, such as one at the power line, then has a large deviation.
    """
    omega = np.asarray(response.omega)
    order = np.argsort(omega, kind="stable")
    group = np.append(0, np.cumsum(np.diff(omega[order]) > ALIKE * omega[order][1:]))
    counts = np.bincount(group)
    if hasattr(response, "deviation") or counts.max() == 1:
        return response
    G = np.asarray(response.frdata)[..., order]
    groups = [G[..., group == k] for k in range(len(counts))]
    middle = np.stack([np.median(np.real(g), axis=-1) + 1j * np.median(np.imag(g), axis=-1) for g in groups], axis=-1)
    variances = [np.square(np.abs(g - middle[..., [k]])).mean(axis=-1) / counts[k] for k, g in enumerate(groups)]
    spread, size = np.sqrt(np.stack(variances, axis=-1)), np.maximum(np.abs(middle), np.finfo(float).tiny)
    typical = np.median((spread / size)[..., counts > 1], axis=-1, keepdims=True)
    labels = {"inputs": response.input_labels, "outputs": response.output_labels}
    merged = control.frd(middle, omega[order][np.append(0, np.flatnonzero(np.diff(group)) + 1)], **labels)
    merged.deviation = np.hypot(spread, typical * size)
    merged.quantity = getattr(response, "quantity", ("displacement",) * len(middle))
    return merged


def _likelihood(fit: CommonPoles) -> float:
    """Return the logarithm of the likelihood of a measured response, whose rows have weights."""
    weights = np.abs(fit.data.U).max(axis=1)
    deviation = np.maximum(fit.deviation * fit.data.scale, np.finfo(float).tiny)
    return float(2.0 * len(deviation) * np.log(weights).sum() - 2.0 * len(weights) * np.log(deviation).sum())


def _mode(pole: complex, steps: Array, shape: Array, energy: float, steady: float, double: bool) -> IdentifiedMode:
    hz, damping, width = pole.imag / (2.0 * np.pi), -pole.real / abs(pole), -pole.real / (2.0 * np.pi)
    frequencies = [(hz - width * step, hz + width * step) for step in steps[:, 1].tolist()]
    dampings = [(low, min(high, 1.0)) for low, high in (_factors(damping, step) for step in steps[:, 0])]
    intervals = frequencies[0], dampings[0]
    shape = shape / shape[np.argmax(np.abs(shape))]
    return IdentifiedMode(hz, damping, *intervals, shape, energy, steady, frequencies[1], dampings[1], double)


def _steadiness(pole: complex, chains: Sequence[Track], orders: int) -> float:
    """Return the fraction of the orders with a pole near this one."""
    return max((len(chain.orders) for chain in chains if abs(chain.pole - pole) < -pole.real), default=0) / orders


def _factors(value: float, step: float) -> tuple[float, float]:
    factor = float(np.exp(min(step, _WIDEST)))
    return value / factor, value * factor


def _band(record: Record, frequency_range_hz: Any, least_lines: float) -> tuple[float, float]:
    """Return the given band, or that of at least so many lines where all inputs have power."""
    top = 0.5 / record.step
    if frequency_range_hz is not None:
        return band(frequency_range_hz, top)
    longest, shortest = max(record.u, key=len), min(map(len, record.u))
    hz, window, driven = np.fft.rfftfreq(len(longest), record.step), np.ones(_SMOOTH) / _SMOOTH, np.zeros(0, int)
    power = [np.convolve(squared(x), window, mode="same") for x in np.fft.rfft(longest, axis=0).T]
    fraction = np.min([x / x.max() for x in power], axis=0)
    for least in _LOWEST:  # low-pass inputs leave few lines at the first
        driven = np.flatnonzero(fraction > least)
        if len(driven) and driven[-1] - driven[0] > least_lines * len(hz) / (shortest // 2 + 1):
            break
    if not len(driven):
        raise ValueError("inputs: expected power at the same frequencies in all of them, got none")
    return float(hz[driven[0]]) if driven[0] > _SMOOTH else 0.0, min(float(hz[driven[-1]]), _TOP * top)


def _warn_of_feedback(fit: CommonPoles) -> None:
    """Warn where errors of the outputs are followed by inputs."""
    data, rows = fit.data, fit.data.record == 0
    U, errors, length = data.U[rows], complex_of(fit.residuals)[rows], fft.next_fast_len(data.lengths[0], real=True)
    size = np.abs(U)
    cross = np.zeros((length // 2 + 1, U.shape[1], errors.shape[1]), complex)
    cross[data.lines[0]] = (U / np.where(size > 0.0, size, 1.0))[:, :, None] * errors.conj()[:, None]
    lag = np.abs(fft.irfft(cross, length, axis=0))
    deviation = np.sqrt(2.0 * squared(cross).sum(axis=0)) / length
    later, sooner = lag[_LATER : length // 4].max(axis=0), lag[-(length // 4) : -_LATER].max(axis=0)
    follows = ((later > _FEEDBACK * deviation) & (later > 2.0 * sooner)).any(axis=0)
    if follows.any():
        warn_user(
            f"inputs follow from errors of output {follows.argmax() + 1}, as in a closed loop: the model then mixes"
            " structure and controller, unless errors are small; add a signal of your own to the inputs"
        )
