"""The frequency response of a record, with its deviation and coherence at each frequency."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import positive, warn_user
from boomctl.identification.record import EXCITED, PULSE, Record, band
from boomctl.lti.python_control import control
from boomctl.printing import between, count
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

_DEGREE = 2  # of the polynomials in frequency whose ratios response and transient are locally (McKelvey & Guerin 2012)
_POLES = 2  # degree of their denominator
_REGULAR = 1e-8  # Least singular value of columns of length one that are not taken for dependent.
_SPARE = 8  # lines of a local fit beyond its unknowns: its deviation is then known to a quarter
_INDEPENDENT = 0.01  # Least singular value of a local fit's unit columns: the result loses two digits.
_OUTPUTS = 4  # whose lag is estimated at most, to check what was given
_BLOCKS = 12  # of frequencies, whose scatter gives the deviation of the lag
_LEAST_LAG, _SURE = 0.15, 2.0  # ratio of lags from -1 (none) to 1 (half a sample): least absolute value, deviations
_REAL = 0.3  # mean cosine of twice the phase, least, of a response that is real but near resonances
_SLOW = 1.0 / 180.0  # of the sampling rate: half a sample is one degree there
_EDGE, _EDGE_LINES = 0.02, 16  # width of the edge below the Nyquist frequency: fraction of the band, least lines
_UNFILTERED = 0.5  # power at the edge over mean power, above which no anti-alias filter acted
_SPARSE = 0.1  # fraction of a record that impacts fill, at most
_REST, _RESTING = 5, 0.02  # least samples of a rest at a level; least fraction of the record in such rests
_LEVELS = 16  # steps of the range, of which a jump has more than one and a half


class FrequencyResponseEstimate(control.FrequencyResponseData):
    """Frequency response estimated from a record, with standard deviations and coherence.

    Attributes
    ----------
    deviation : (outputs, inputs, n) ndarray
        Standard deviation of the real and of the imaginary part of each entry.
    coherence : (outputs, n) ndarray
        Multiple coherence: fraction of the power of each output that is linearly related to the inputs, from 0 to 1.
    quantity : tuple of str
        Quantity of each output: "displacement", "velocity" or "acceleration".
    source : str
        Origin of the deviation: local fits or periods, and their number.
    record : Record or None
        The record, to which `identify` fits the modes, because errors of overlapping local fits are correlated. None
        for periodic excitation.
    """

    deviation: Array
    coherence: Array
    quantity: tuple[str, ...]
    source: str
    record: Record | None = None

    def __repr__(self) -> str:
        hz = self.omega / (2.0 * np.pi)
        return (
            f"FrequencyResponseEstimate: {between(self.input_labels, self.output_labels)}, {len(hz)} frequencies "
            f"from {hz[0]:.4g} to {hz[-1]:.4g} Hz\n  median coherence {np.median(self.coherence):.4g}; from {self.source}"
        )

    __str__ = __repr__

    def plot(self, ax: "Axes | None" = None, *, frequency_unit: str | None = None, **style: Any) -> Array:  # type: ignore[override]
        """Draw the magnitude of each entry with its deviation, and the coherence of each output.

        Parameters
        ----------
        ax : sequence of two matplotlib Axes, or a figure, optional
            Where to draw; by default a new figure of pyplot.
        frequency_unit : {"Hz", "rad/s"}, optional
            Of the frequency axis; by default that of the curves that are there already, otherwise Hz.
        **style
            Of the curves, as matplotlib's lines take it.

        Returns
        -------
        ndarray of matplotlib.axes.Axes
            Magnitude, coherence.
        """
        plotting = import_module("boomctl.plotting.identification")
        return plotting.plot_response(self, ax, frequency_unit=frequency_unit, **style)


@one_blas_thread
def estimate_frequency_response(
    inputs: "ArrayLike | Mapping[str, ArrayLike] | Any",
    outputs: "ArrayLike | Mapping[str, ArrayLike] | Any",
    sample_time: float,
    *,
    quantity: str | Mapping[str, str] = "displacement",
    intersample: str | None = None,
    period: float | None = None,
    resolution_hz: float | None = None,
    frequency_range_hz: tuple[float, float] | None = None,
) -> FrequencyResponseEstimate:
    """Estimate a frequency response from sampled inputs and outputs: noise, chirps, sines, multisines.

    Parameters
    ----------
    inputs, outputs : (N, m) array_like, mapping of names to (N,) array_like, or a sequence of such
        Samples, one row per sample; several records as a list of arrays or of mappings.
    sample_time : float
        Time between samples [s].
    quantity : "displacement", "velocity", "acceleration", or mapping of outputs to these
        Quantity of each output; used by `bc.identify`.
    intersample : "bl" or "zoh", optional
        Inputs between samples: band-limited (a measurement behind an anti-alias filter, such as a shaker force) or
        zero-order hold (a computed command).  By default determined from the record.
    period : float, optional
        Period of the excitation [s], if it repeats.  The response is then computed from the mean period, and its deviation
        from the periods; the record must begin in the steady state.  Needs as many records as inputs, each with a different
        excitation.
    resolution_hz : float, optional
        Spacing of the frequencies of the result.  By default the smallest spacing at which adjacent estimates are
        nearly uncorrelated.
    frequency_range_hz : (float, float), optional
        Frequency range of the result [Hz].  By default all frequencies at which the inputs have power.

    Returns
    -------
    FrequencyResponseEstimate
        FrequencyResponseData, with ``deviation`` and ``coherence``, for `fit`, `sigma`, `bode` and `identify`.

    Raises
    ------
    TypeError, ValueError
        If signals differ in length, are not finite, constant, saturated or have gaps; the record is too short; the inputs do
        not excite, or are dependent; or the band is beyond half the sampling rate.

    Notes
    -----
    In a window of a few spectral lines, response and transient are fitted as ratios of polynomials by linear least
    squares (local rational method, McKelvey & Guerin 2012). There is no leakage error if a record begins or ends in
    motion, and resonances may be narrower than a line.  A record of one early impact is assumed to begin at rest. For
    ``intersample="zoh"`` the response of the zero-order hold is divided out; aliasing from above half the sampling
    rate remains. Inputs that are linear between samples, as in `forced_response`, are neither: their spectrum should
    be limited to well below half the sampling rate.

    Examples
    --------
    >>> import boomctl as bc
    >>> import numpy as np
    >>> force = np.random.default_rng(0).standard_normal(4000)
    >>> mass = bc.structure.SecondOrderModel([[1.0]], [[2.0]], [[400.0]], {"force": [1.0]}, {"place": [1.0]})
    >>> moved = bc.forced_response(mass, 0.02 * np.arange(4000), {"force": force})["place"]
    >>> H = bc.estimate_frequency_response({"force": force}, {"place": moved}, 0.02, frequency_range_hz=(0.5, 2.5))
    >>> exact = mass.frequency_response(H.omega).frdata
    >>> bool(abs(H.frdata / exact - 1.0).max() < 0.02)
    True
    """
    record = Record.of(inputs, outputs, sample_time, quantity, intersample)
    low, high = band(frequency_range_hz, 0.5 / record.step)
    record = with_intersample(record, high)
    wanted = None if resolution_hz is None else positive("resolution_hz", resolution_hz)
    if period is not None:
        if wanted is not None:
            raise ValueError(f"`resolution_hz` must be None with a period, which sets it, got {resolution_hz!r}.")
        estimated = _periods(record, period)
    else:
        estimated = _local(record, wanted)
    hz, G, variance, coherence, excited, source = estimated
    inside = (hz > 0.0) & (hz >= low) & (hz <= high)
    if not (inside & excited).any():
        raise ValueError(
            "inputs: expected power, and of each input its own, at some frequency of the band; linearly"
            " dependent inputs cannot be separated, nor can many inputs in a short record"
        )
    use = inside & excited
    hz = hz[use]
    held = through_hold(2j * np.pi * hz, record.step) if record.intersample == "zoh" else 1.0
    names: dict[str, Any] = {"inputs": list(record.inputs), "outputs": list(record.outputs), "name": "measured"}
    result = FrequencyResponseEstimate(G[..., use] / held, 2.0 * np.pi * hz, **names)
    result.deviation = np.sqrt(variance[..., use] / 2.0) / np.abs(held)
    result.coherence, result.quantity, result.source = coherence[:, use], record.quantity, source
    result.record = record if period is None else None
    for values in (result.frdata, result.omega, result.deviation, result.coherence):
        values.flags.writeable = False  # Otherwise they could differ from the record.
    return result


def with_intersample(record: Record, top_hz: float) -> Record:
    """Return the record with the behavior of its inputs between samples, determined where it was not given."""
    outputs, inputs = _intersample_of_outputs(record), _intersample_of_inputs(record)
    expected = outputs or inputs
    if record.intersample is not None:
        if expected not in (None, record.intersample):
            why = "the phase of the outputs" if outputs else "the input spectrum"
            warn_user(
                f"intersample = {record.intersample!r}: {why} indicates {expected!r}; a wrong choice shifts phases by"
                " half a sample. Check also `quantity`"
            )
        return record
    if expected is None and top_hz > _SLOW / record.step:
        warn_user(
            "intersample: the record does not show whether its inputs are band-limited ('bl', assumed: measured behind"
            " an anti-alias filter) or held between samples ('zoh': a computed command), and the wrong one shifts phases"
            f" by half a sample, {180.0 * top_hz * record.step:.2g} degrees at {top_hz:.4g} Hz; give intersample"
        )
    return replace(record, intersample=expected or "bl")


def _intersample_of_outputs(record: Record) -> str | None:
    """Return what the lag of the outputs shows; None where it is not clear.

    Between displacements and forces of a lightly damped structure the response is real but near resonances (velocity:
    imaginary), and held inputs delay it by half a sample, all but the feedthrough of accelerations.
    """
    if min(map(len, record.u)) < 4 * _BLOCKS * (len(record.inputs) + _DEGREE + _POLES):
        return None
    every = len(record.outputs)
    some = np.unique(np.linspace(0, every - 1, every if record.intersample is None else _OUTPUTS).astype(int))
    kinds = [record.quantity[k] for k in some]
    hz, G, variance, _, use, _ = _local(replace(record, y=tuple(y[:, some] for y in record.y)), None)
    if use.sum() < 2 * _BLOCKS:
        return None
    G, variance, half = G[..., use], variance[..., use], np.pi * hz[use] * record.step
    G = G * np.array([1j if kind == "velocity" else 1.0 for kind in kinds])[:, None, None]
    size = np.sqrt(np.square(np.abs(G)) + variance + np.finfo(float).tiny)
    held = G * np.exp(1j * half)
    row = np.sin(half) / size
    feedthrough = (held.imag / size * row).sum(axis=2) / np.square(row).sum(axis=2)
    feedthrough *= np.array([kind == "acceleration" for kind in kinds])[:, None]
    held = held - feedthrough[..., None] * np.expm1(1j * half)
    real, late = ((x**2).real / (np.square(np.abs(x)) + variance + np.finfo(float).tiny) for x in (G, held))
    gain = (late - real).sum(axis=(0, 1))
    clear = np.square(np.abs(G) / size)
    if max(real.sum(), late.sum()) < _REAL * clear.sum():
        return None
    expected = (clear * (1.0 - np.cos(2.0 * half))).sum(axis=(0, 1))
    ratio = gain.sum() / expected.sum() if expected.any() else 0.0  # -1: no lag; 1: half a sample
    blocks = np.array([part.sum() for part in np.array_split(gain - ratio * expected, _BLOCKS)])
    if abs(ratio) < max(
        _LEAST_LAG, _SURE * np.sqrt(np.square(blocks).sum()) / max(expected.sum(), np.finfo(float).tiny)
    ):
        return None
    return "zoh" if ratio > 0.0 else "bl"


def _intersample_of_inputs(record: Record) -> str | None:
    """Return "zoh" where inputs have power up to the Nyquist frequency or rest at several levels between jumps."""
    return (
        "zoh"
        if all(_unfiltered(signals) or _stepped(signals) for signals in zip(*(u.T for u in record.u), strict=True))
        else None
    )


def _unfiltered(signals: Sequence[Array]) -> bool:
    """Return whether the power at the Nyquist frequency excludes an anti-alias filter."""
    edge = mean = 0.0
    if all(np.mean(np.abs(signal) > PULSE * np.abs(signal).max()) < _SPARSE for signal in signals):
        return False  # impacts have such spectra too
    for signal in signals:
        power = np.square(np.abs(np.fft.rfft(signal)[1:]))
        edge += power[-max(round(_EDGE * len(power)), _EDGE_LINES) :].mean()
        mean += power.mean()
    return bool(edge > _UNFILTERED * mean)


def _stepped(signals: Sequence[Array]) -> bool:
    """Return whether the signal rests at several levels of a record and leaves them by jumps, as no filtered signal does."""
    quantum, levels, resting = min(map(_quantum, signals)), 0, 0
    for signal in signals:
        change = np.diff(signal)
        moving = np.flatnonzero(change)
        length = np.diff(moving, prepend=-1)
        rests = (length >= _REST) & (np.abs(change[moving]) > 1.5 * quantum)
        levels = max(levels, len(np.unique(signal[moving[rests]])))
        resting += length[rests].sum()
    return levels > 1 and resting > _RESTING * sum(map(len, signals))


def _quantum(signal: Array) -> float:
    """Return the least change of a signal, at most a sixteenth of its range."""
    change = np.abs(np.diff(signal))
    return float(min(np.ptp(signal) / _LEVELS, change.min(where=change > 0.0, initial=np.inf)))


def through_hold(s: Array, step: float) -> Array:
    """Return what a hold over a step [s] makes of a signal: ``(1 - exp(-s h)) / (s h)``."""
    return -np.expm1(-s * step) / (s * step)


def _local(record: Record, resolution: float | None) -> tuple[Any, ...]:
    """Return the estimates of local fits: around a line, response and transients are ratios of polynomials of degree two.

    All have one denominator, that of the poles nearby.
    """
    length, order = min(map(len, record.u)), _DEGREE + 1
    span = length * record.step
    U = np.stack([np.fft.rfft(u[:length], axis=0) for u in record.u])  # records x lines x inputs
    Y = np.stack([np.fft.rfft(y[:length], axis=0) for y in record.y])
    records, lines, m = U.shape
    width = order * (m + 1) + _POLES + _SPARE
    stride = max(round(width / order if resolution is None else resolution * span), 1)
    width = max(width, order * stride)
    if width > lines - 1:
        raise ValueError(f"inputs: expected records of at least {2 * width + 2} samples for {m} inputs, got {length}")
    centers = np.arange(stride, lines, stride)
    first = np.clip(centers - width // 2, 1, lines - width)
    at = first[:, None] + np.arange(width)  # centers x width
    r = (at - centers[:, None]) / width
    alone = np.broadcast_to(np.eye(records)[:, None], (records, lines, records))  # of the transient of each record
    signals = np.concatenate([U, alone], axis=2)[:, at]
    K = np.einsum("ecwj,cwd->cewdj", signals, r[..., None] ** np.arange(order)).reshape(len(at), records * width, -1)
    size = np.linalg.norm(K, axis=1)
    size[size == 0.0] = 1.0
    K = K / size[:, None]
    inverse, values = _inverse(K)
    by_inputs = np.tile(np.arange(m + records) < m, order)
    powers = np.tile(r, (1, records))[..., None] ** np.arange(1, _POLES + 1)  # centers x rows x powers
    result = []
    for y in np.moveaxis(Y[:, at], 3, 0):
        rows = np.moveaxis(y, 0, 1).reshape(len(at), -1, 1)
        columns = -powers * rows / _norm(rows)
        numerators = inverse @ columns
        of_poles = _inverse(columns - K @ numerators)[0]
        denominator = of_poles @ rows
        fitted = inverse @ rows - numerators @ denominator
        error = rows - K @ fitted - columns @ denominator
        weight = np.square(np.abs(1.0 + powers @ (denominator / _norm(rows))))  # of errors
        noise = np.square(_norm(error))[:, 0, 0] / (error.shape[1] - K.shape[2] - _POLES) / weight.mean(axis=(1, 2))
        estimator = inverse[:, :m] - numerators[:, :m] @ of_poles
        spread = (np.square(np.abs(estimator)) @ weight)[..., 0]
        explained = np.square(_norm(K[..., by_inputs] @ fitted[:, by_inputs]))[:, 0, 0]
        coherence = explained / (explained + error.shape[1] * noise + _least(explained))
        result.append((fitted[:, :m, 0] / size[:, :m], noise[:, None] * spread / np.square(size[:, :m]), coherence))
    G, variance, coherence = (np.stack(item) for item in zip(*result, strict=True))
    power = np.square(np.abs(U[:, at])).mean(axis=(0, 2))  # centers x inputs
    excited = _driven(power) & (values[:, -1] > _INDEPENDENT)
    source = f"local fits over {count(width, 'line')} of {count(records, 'record')}"
    return centers / span, G.swapaxes(1, 2), variance.swapaxes(1, 2), coherence, excited, source


def _inverse(columns: Array) -> tuple[Array, Array]:
    """Return the pseudoinverses of columns of length one and less, and their singular values."""
    left, values, right = np.linalg.svd(columns, full_matrices=False)
    scale = np.where(values > _REGULAR, 1.0 / np.maximum(values, _REGULAR), 0.0)
    return np.conj(right.swapaxes(1, 2)) * scale[:, None] @ np.conj(left.swapaxes(1, 2)), values


def _norm(columns: Array) -> Array:
    """Return the norm of each column, at least the least number."""
    return np.linalg.norm(columns, axis=1, keepdims=True) + np.finfo(float).tiny


def _periods(record: Record, period: Any) -> tuple[Any, ...]:
    """Return the response of the mean periods; the deviation comes from what differs between periods."""
    samples, periods = record.cut(period)
    m, records = len(record.inputs), len(record.u)
    if records < m:
        raise ValueError(
            f"period: expected at least {m} records for {m} inputs, each driven another way, got {records}"
        )
    U, Y = (
        np.stack([np.fft.rfft(x[len(x) - periods * samples :].reshape(periods, samples, -1), axis=1) for x in data])
        for data in (record.u, record.y)
    )
    mean, mean_Y = (x.mean(axis=1, keepdims=True) for x in (U, Y))
    columns = mean[:, 0].swapaxes(0, 1)  # lines x records x inputs
    size = _norm(columns)
    inverse, values = _inverse(columns / size)
    inverse = inverse / size.swapaxes(1, 2)
    excited = _driven(np.square(size[:, 0])) & (values[:, -1] > _INDEPENDENT)
    G = (inverse @ mean_Y[:, 0].swapaxes(0, 1)).transpose(2, 1, 0)
    change = Y - mean_Y - np.einsum("oik,epki->epko", G, U - mean)
    noise = np.square(np.abs(change)).sum(axis=(0, 1)) / (records * (periods - 1))  # lines x outputs, of one period
    spread = np.square(np.abs(inverse)).sum(axis=2) / periods
    signal = np.square(np.abs(np.einsum("oik,epki->epko", G, mean))).mean(axis=(0, 1))
    coherence = (signal / (signal + noise + _least(signal))).T
    variance = noise.T[:, None, :] * spread.T[None, :, :]
    hz = np.fft.rfftfreq(samples, record.step)
    return hz, G, variance, coherence, excited, f"{count(periods, 'period')} in {count(records, 'record')}"


def _driven(power: Array) -> Array:
    """Return where each input has power, of powers (lines, inputs)."""
    return (power > EXCITED * power.max(axis=0)).all(axis=1)


def _least(power: Array) -> Array:
    """Return a number that keeps zero over zero from coherences: what rounding leaves of the largest power."""
    return np.finfo(float).eps * power.max(axis=0) + np.finfo(float).tiny
