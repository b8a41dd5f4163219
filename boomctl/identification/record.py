"""Sampled records of inputs and outputs, and their checks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.checks import finite_array, known, positive, shown, signal_name, span
from boomctl.lti.rounding import LEVEL
from boomctl.printing import compact

QUANTITIES = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""Quantities of outputs, and their order of differentiation from displacement."""
INTERSAMPLE = ("bl", "zoh")
"""Inputs between samples: band-limited or zero-order hold."""
EXCITED = 1e-3  # Least power of an input over its largest, to count as excited: 3 % of its amplitude.
_FEWEST = 32  # Fewest samples of a record.
_STILL = 16  # Constant samples in a row, within a record that changes, that count as a gap.
_LEVELS = 16  # Largest number of values of a coarse signal, which may be at its limits without saturation.
_CLIPPED = 5  # least ratio of samples at a limit to samples at the value next to it, of a signal cut off
_FAST, _UNIFORM, _FEW_VISITS = 2.9, 2.3, 3  # largest ratios of distances before a limit, of many and of few visits
_RESOLVED, _FLAT = 4.0, 1e-9  # quanta of a distance that count as resolved; least quantum over the range of the signal
_ABRUPT = 0.5  # change between two samples, in RMS of the changes: an output stops or starts at once
PULSE = 0.05  # of the largest input, above which an impact lasts
_EARLY = 8  # Latest beginning of an early impact: one over the fraction of the record.
_SHORT = 16  # Most samples of impacts, as above.
_FRONT = 4  # Samples at rest that are put in front of it, as above.
_MEAN = 8  # samples, least, of a mean before the impact
_AT_REST = 0.3  # deviations of an output, below which it is at rest


@dataclass(frozen=True)
class Record:
    """Sampled inputs and outputs of one or more experiments, less their means.

    Attributes
    ----------
    inputs, outputs : tuple of str
        Names.
    u, y : tuple of (N, m) ndarray
        Samples, one array a record.
    step : float
        Time between samples [s].
    quantity : tuple of str
        Quantity of each output: "displacement", "velocity" or "acceleration".
    intersample : "bl", "zoh" or None
        Inputs between samples: band-limited, zero-order hold, or not known yet.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    u: tuple[Array, ...]
    y: tuple[Array, ...]
    step: float
    quantity: tuple[str, ...]
    intersample: str | None

    __repr__ = compact

    @classmethod
    def of(cls, inputs: Any, outputs: Any, sample_time: Any, quantity: Any, intersample: Any) -> "Record":
        """Return what was recorded, checked."""
        step = positive("sample_time", sample_time)
        if intersample is not None:
            known("intersample", intersample, INTERSAMPLE)
        ins, u = _signals("inputs", inputs, "in")
        outs, y = _signals("outputs", outputs, "out")
        if len(u) != len(y):
            raise ValueError(
                f"outputs: expected as many records as inputs has, {len(u)}, got {len(y)}; signals of one record are columns"
            )
        for k, (a, b) in enumerate(zip(u, y, strict=True)):
            of = f" of record {k + 1}" if len(u) > 1 else ""
            if len(a) != len(b):
                raise ValueError(f"outputs{of}: expected {len(a)} samples, as inputs has, got {len(b)}")
            if len(a) < _FEWEST:
                raise ValueError(f"inputs{of}: expected at least {_FEWEST} samples, got {len(a)}")
            _no_gap(of, a, b, step)
        if both := set(ins) & set(outs):
            raise ValueError(f"outputs: {min(both)!r} is the name of an input too")
        for what, names, data in (("inputs", ins, u), ("outputs", outs, y)):
            for i, name in enumerate(names):
                if not any(np.ptp(record[:, i]) > 0.0 for record in data):
                    remedy = "; for a free decay, pass an impulse at the release" if what == "inputs" else ""
                    value = f"{data[0][0, i]:g}"
                    raise ValueError(f"{what}: expected signals that vary, got {name!r} constant at {value}{remedy}")
                if what == "outputs":
                    _not_clipped(name, [record[:, i] for record in data])
        kinds = quantities(quantity, outs)
        u, y = zip(*(_from_rest(a, b, kinds) for a, b in zip(u, y, strict=True)), strict=True)
        u, y = (tuple(record - record.mean(axis=0) for record in data) for data in (u, y))
        return cls(ins, outs, u, y, step, kinds, intersample)

    def part(self, which: slice = slice(None), begin: float = 0.0, end: float = 1.0) -> "Record":
        """Return some of the records, of each what is between two fractions of its length."""
        u, y = (tuple(x[round(len(x) * begin) : round(len(x) * end)] for x in data[which]) for data in (self.u, self.y))
        return replace(self, u=u, y=y)

    def cut(self, period: Any) -> tuple[int, int]:
        """Return the samples of a period [s], and how many whole periods the shortest record has."""
        samples = positive("period", period) / self.step
        if abs(samples - round(samples)) > LEVEL * samples or round(samples) < 2:
            raise ValueError(f"period = {period!r}: expected a whole number of samples at {self.step:g} s")
        count = min(len(u) for u in self.u) // round(samples)
        if count < 2:
            raise ValueError(f"period = {period!r}: expected at least two periods in each record, got {count}")
        return round(samples), count


def quantities(quantity: Any, outputs: Sequence[str]) -> tuple[str, ...]:
    """Return what each output is, from one word or from words by name."""
    if not isinstance(quantity, Mapping):
        return (known("quantity", quantity, QUANTITIES),) * len(outputs)
    for name in quantity:
        known("output in quantity", name, outputs)
    if missing := [name for name in outputs if name not in quantity]:
        raise ValueError(f"quantity: expected a word for each output, got none for {missing[0]!r}")
    return tuple(known("quantity", quantity[name], QUANTITIES) for name in outputs)


def band(frequency_range_hz: Any, top: float) -> tuple[float, float]:
    """Return a band of frequencies [Hz] below the Nyquist frequency."""
    if frequency_range_hz is None:
        return 0.0, top
    low, high = span("frequency_range_hz", frequency_range_hz)
    if high > top * (1.0 + LEVEL):
        raise ValueError(
            f"frequency_range_hz = {shown(frequency_range_hz)}: expected at most {top:g} Hz, the highest that was measured"
        )
    return low, high


def _signals(what: str, values: Any, word: str) -> tuple[tuple[str, ...], list[Array]]:
    """Return names and records of signals: of one record or of a sequence of them, arrays or mappings."""
    several = isinstance(values, (list, tuple)) and all(_is_record(x, len(values)) for x in values)
    result = [_one(what, item, word) for item in (values if several or np.ndim(_bare(values)) == 3 else [values])]
    if not result:
        raise ValueError(f"{what}: expected at least one record, got none")
    if any(names != result[0][0] for names, _ in result):
        raise ValueError(f"{what}: expected the same signals in every record, in the same order")
    return result[0][0], [data for _, data in result]


def _is_record(item: Any, count: int) -> bool:
    """Return whether an item of a sequence is a record: a mapping, a matrix, or a vector longer than any row of signals."""
    if isinstance(item, Mapping) or np.ndim(_bare(item)) == 2:
        return True
    vector = isinstance(item, (list, tuple)) or np.ndim(_bare(item)) == 1
    return vector and len(item) >= max(_FEWEST, count) and np.ndim(item[0]) == 0


def _bare(values: Any) -> Any:
    return values if isinstance(values, np.ndarray) else 0.0


def _one(what: str, values: Any, word: str) -> tuple[tuple[str, ...], Array]:
    if values is None:
        raise TypeError(f"{what}: expected measured signals, got None")
    if not isinstance(values, Mapping):
        data = finite_array(what, values)
        data = data[:, None] if data.ndim == 1 else data
        if data.ndim != 2 or not data.shape[1]:
            raise ValueError(f"{what}: expected samples x signals, got shape {data.shape}")
        if data.shape[1] > len(data):
            raise ValueError(f"{what}: expected one row per sample, got shape {data.shape}; is it transposed?")
        return tuple(f"{word}_{k + 1}" for k in range(data.shape[1])), data
    if not values:
        raise ValueError(f"{what}: expected at least one signal, got none")
    names = tuple(signal_name(f"name in {what}", name) for name in values)
    columns = [finite_array(f"{what}[{name!r}]", column, ndim=1) for name, column in values.items()]
    for name, column in zip(names, columns, strict=True):
        if len(column) != len(columns[0]):
            raise ValueError(f"{what}: expected {len(columns[0])} samples of {name!r}, got {len(column)}")
    return names, np.column_stack(columns)


def _from_rest(u: Array, y: Array, quantity: Sequence[str]) -> tuple[Array, Array]:
    """Return a record of impacts, the first of them early, with samples at rest in front of it; other records unchanged.

    The free motion of a record that begins with an impact explains as much as the impact; samples at rest exclude it.
    """
    largest = np.abs(u).max(axis=0)
    pulse = np.flatnonzero((np.abs(u) > PULSE * largest).any(axis=1))
    hit = int(pulse[0])
    level = np.median(u, axis=0)
    if hit > len(u) // _EARLY or len(pulse) > len(u) // _SHORT or (np.abs(level) > PULSE * largest).any():
        return u, y
    before, tail = y[: max(hit, 1)], y[len(y) // 2 :].mean(axis=0)
    first = before.mean(axis=0)
    rest = first if hit >= _MEAN else np.where(np.abs(first) <= np.abs(first - tail), 0.0, tail)
    still = np.sqrt(np.square(before - rest).mean(axis=0)) < _AT_REST * y.std(axis=0)
    if not all(ok or (hit == 0 and kind != "displacement") for ok, kind in zip(still, quantity, strict=True)):
        return u, y
    front = np.ones((len(u) // _FRONT, 1))
    return np.vstack([front * level, u]), np.vstack([front * rest, y])


def _no_gap(of: str, u: Array, y: Array, step: float) -> None:
    """Raise an error if all signals are constant and an output stops or starts abruptly."""
    rates = np.abs(np.diff(y, axis=0))
    typical = _ABRUPT * np.sqrt(np.square(rates).sum(axis=0) / np.maximum((rates > 0.0).sum(axis=0), 1))
    typical = np.maximum(
        typical, 1.5 * rates.min(axis=0, where=rates > 0.0, initial=np.inf)
    )  # a converter's last digit
    driven = (np.diff(u, axis=0) != 0.0).any(axis=1)
    moving = np.flatnonzero(driven | (rates > 0.0).any(axis=1))
    for stop, start in pairwise(moving):
        if start - stop <= _STILL:
            continue
        if (rates[stop] > typical).any() or (not driven[start] and (rates[start] > typical).any()):
            raise ValueError(
                f"inputs, outputs{of}: expected no gap, but every signal is constant from {step * (stop + 1):g} to"
                f" {step * start:g} s; pass the two sides as two records"
            )


def _not_clipped(name: str, signals: Sequence[Array]) -> None:
    """Raise if an output is cut off at a limit, to which it comes at speed; extrema and rests are smooth."""
    values, counts = np.unique(np.concatenate(signals), return_counts=True)
    if len(values) <= _LEVELS:
        return
    quantum = max(float(np.diff(values).min()), _FLAT * float(np.ptp(values)))
    for limit, there, adjacent in ((values[0], counts[0], counts[1]), (values[-1], counts[-1], counts[-2])):
        if there < _CLIPPED * max(adjacent, 2):
            continue
        visits, growth = _approach(signals, limit, quantum)
        if visits and growth < (_FAST if visits > _FEW_VISITS else _UNIFORM):
            raise ValueError(
                f"outputs: expected signals within their range, got {name!r} saturated: {there} samples at {limit:g}"
            )


def _approach(signals: Sequence[Array], limit: float, quantum: float) -> tuple[int, float]:
    """Return how often signals come to a limit, and the median ratio of their distances two windows and one before.

    At constant speed the ratio is 2; on the parabola of an extremum, of which the last quantum does not show, 2.8 to 4;
    on the way to a rest it is larger.
    """
    begins = [np.flatnonzero(np.diff((signal == limit).astype(int)) == 1) + 1 for signal in signals]
    window = 4
    while True:
        pairs = [
            (s[b - window], s[b - 2 * window])
            for s, at in zip(signals, begins, strict=True)
            for b in at
            if b >= 2 * window
        ]
        if not pairs:
            return 0, np.inf
        near, far = np.abs(np.array(pairs).T - limit)
        if np.median(near) >= _RESOLVED * quantum:
            return len(pairs), float(np.median(far / np.maximum(near, quantum)))
        window += window // 4
