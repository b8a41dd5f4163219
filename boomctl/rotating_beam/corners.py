"""Where a function of time jumps, or its slope does: samples at even distances, and cuts of what is not smooth there.

No finite number of samples finds everything. What is found is said by :func:`resolution`: jumps and corners that are no
nearer to each other than that. A jump is located to rounding, a corner (a jump of the slope) to 1/4096 of the resolution.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from boomctl.arrays import Array

RESOLUTION = 5e-4  # [s] between samples: a choice; a pulse of 1 N m so short moves the tip of Table 1's beam by 1e-5 m
_FEWEST, _MOST = 2**14, 2**20  # samples, so that short motions are seen as finely, and long ones end: choices
_ORDER, _WEIGHT = 6, 20.0  # of the differences that tell smooth from not, and the largest weight of a value in them
_FAINT = 1e-10  # of the largest value: smaller differences are rounding or do nothing; a sine of 90 ms has such
_NOISE = 1e-6  # of the largest value: where jumps are too many, those below are noise of the function, not jumps
_ROUNDED = 64.0 * np.finfo(float).eps  # of values, and of slopes times instants: second differences below are rounding
_STRIDES = (1, 8, 64)  # samples between those that show a swift event: of 0.5, 4 and 32 ms, beyond any step sees it
_SEED, _MEMBER = 1e-4, 1e-7  # of the largest value: an event's largest difference at least, and those that belong to it
_MOST_EVENTS, _SHARE = 1000, 0.5  # more of them, or in more of the whole time, are no events: the function is swift
_LEVELS = 6  # cuts in four after which jumps are told from all else: 1/4096 of the interval is left
_SMOOTH = 1.0 / 40.0  # fall of the second differences in two cuts: 1/256 if smooth, 1/16 at a corner, 1 at a jump
_JUMP = 0.1  # likewise in the last cut but one: between 1/16 and 1
_SETTLED = 4.0  # units in the last place, to which a jump is located
_ONE = 1e-11, 1e-2  # two jumps nearer than this share of the whole time, corners of the resolution, are one
_MOST_CORNERS = 10_000  # that steps can follow: 500 a second for 20 s
_SWIFT = _MOST // 4  # suspects beyond which only some are looked at closely: a second or two (a choice of patience)
_TIED = 1e-3  # weight of first differences, which decide where second ones are equal: at the ends of what is looked at


def resolution(end: float) -> float:
    """Distance of the samples in a motion that ends at an instant, s: what lasts as long or longer is seen."""
    return end / float(np.clip(np.ceil(end / RESOLUTION), _FEWEST, _MOST))


def found_corners(
    name: str, function: Callable[[Array], Array], known: tuple[float, ...], end: float
) -> tuple[float, ...]:
    """Return the instants at which a function, or its slope, jumps; those that are known among them.

    Parameters
    ----------
    name : str
        Of the function, for messages.
    function : callable
        Of an array of instants [s].
    known : tuple of float
        Instants at which it is known to jump, s.
    end : float
        Until when it is looked at, from 0 on, s.

    Raises
    ------
    ValueError
        If it jumps at more than 10,000 places.
    """
    bounds = np.unique([0.0, *(each for each in known if 0.0 < each < end), end])
    inside = _SETTLED * np.spacing(end)  # at a known instant neither the value before nor that after is to be mixed in
    low, high = bounds[:-1] + inside, bounds[1:] - inside
    wide = high - low > _ONE[0] * end
    samples = _sampled(function, low[wide], high[wide], resolution(end))
    size = float(np.abs(samples.values).max())
    left, width, low, high = _suspects(samples, size)
    if left.size > _SWIFT:  # nearly everywhere faster than the samples: some of it tells whether it jumps or is smooth
        some = slice(None, None, left.size // (2 * _MOST_CORNERS))
        left, width, low, high = left[some], width[some], low[some], high[some]
    jumps, corners = _located(function, left, width, low, high, size) if left.size else (left, left)
    if len(jumps) > _MOST_CORNERS:
        jumps = jumps[_steps(function, jumps, inside) > _NOISE * size]
        corners = corners[:0]
    jumps = _apart(jumps, bounds, _ONE[0] * end)
    if jumps.size > _MOST_CORNERS:
        raise ValueError(
            f"{name}: jumps at {jumps.size} instants up to t = {end:g} s, the first near {jumps[0]:.6g} s; expected at "
            f"most {_MOST_CORNERS}, or a smoother function"
        )
    corners = _apart(corners, np.concatenate([bounds, jumps]), _ONE[1] * resolution(end))
    if corners.size > _MOST_CORNERS:  # a table's; what it does between the steps is seen as of a smooth function
        corners = corners[:0]
    found = np.concatenate([jumps, corners])
    corners_of_all = np.sort(np.concatenate([bounds, found]))
    events = _apart(_events(samples, corners_of_all, size), corners_of_all, resolution(end))
    return (*known, *found.tolist(), *events.tolist())


class _Samples(NamedTuple):
    """Values of a function at instants, even between known corners; which part each belongs to, ends of the parts."""

    times: Array
    values: Array
    part: Array
    low: Array
    high: Array


def _sampled(function: Callable[[Array], Array], low: Array, high: Array, distance: float) -> _Samples:
    counts = np.maximum(_ORDER + 1, np.ceil((high - low) / distance).astype(int))
    part = np.repeat(np.arange(counts.size), counts + 1)
    place = np.arange(part.size) - np.repeat(np.cumsum(counts + 1) - counts - 1, counts + 1)
    times = low[part] + ((high - low) / counts)[part] * place
    return _Samples(times, function(times), part, low, high)


def _suspects(samples: _Samples, size: float) -> tuple[Array, Array, Array, Array]:
    """Intervals between samples on which a function may not be smooth: left ends, widths, and ends of their parts."""
    times, values, part, low, high = samples
    rough = np.abs(np.diff(values, _ORDER)) > _WEIGHT * _FAINT * size
    rough &= part[_ORDER:] == part[:-_ORDER]
    chosen = np.unique(np.flatnonzero(rough)[:, None] + np.arange(_ORDER))
    return times[chosen], times[chosen + 1] - times[chosen], low[part[chosen]], high[part[chosen]]


def _events(samples: _Samples, corners: Array, size: float) -> Array:
    """Instants at which a function becomes swift for a while, and slow again, between its corners."""
    found: list[Array] = []
    beside = _ONE[1] * (samples.times[1] - samples.times[0])  # a sample at a corner belongs to neither side
    parts = np.searchsorted(corners - beside, samples.times) + np.searchsorted(corners + beside, samples.times)
    for stride in _STRIDES:
        times, values, part = samples.times[::stride], samples.values[::stride], parts[::stride]
        if times.size <= _ORDER:
            break
        rough = np.abs(np.diff(values, _ORDER)) / (_WEIGHT * size + np.finfo(float).tiny)
        rough[part[_ORDER:] != part[:-_ORDER]] = 0.0
        first = np.flatnonzero(rough > _MEMBER)
        if not first.size or rough.max() < _SEED:
            continue
        begins = np.flatnonzero(np.diff(first, prepend=-_ORDER - 1) > _ORDER)
        seeded = np.maximum.reduceat(rough[first], begins) > _SEED
        ends = np.append(begins[1:], first.size) - 1
        left, right = times[first[begins[seeded]]], times[first[ends[seeded]] + _ORDER]
        if left.size <= _MOST_EVENTS and float(np.sum(right - left)) < _SHARE * float(times[-1] - times[0]):
            found += [left, right]
    return np.concatenate(found) if found else np.zeros(0)


def _located(
    function: Callable[[Array], Array], left: Array, width: Array, low: Array, high: Array, size: float
) -> tuple[Array, Array]:
    """Cut intervals in four again and again, always that quarter which is the least smooth: jumps, and all else.

    Of a function with a largest value; second differences that are rounding tell nothing.
    """
    sizes: list[Array] = []
    for level in range(_LEVELS):
        left, width, bend, slope = _cut(function, left, width, low, high)
        sizes.append(bend)
        if level >= 2:
            kept = (bend > _SMOOTH * sizes[-3]) & (bend > _ROUNDED * (size + slope * left))
            left, width, low, high = left[kept], width[kept], low[kept], high[kept]
            sizes = [each[kept] for each in sizes]
    jumping = sizes[-1] > _JUMP * sizes[-2]
    corners = left[~jumping] + 0.5 * width[~jumping]
    left, width, low, high = left[jumping], width[jumping], low[jumping], high[jumping]
    while left.size and np.any(width > _SETTLED * np.spacing(left)):
        left, width, _, _ = _cut(function, left, width, low, high)
    return left + width, corners


def _cut(
    function: Callable[[Array], Array], left: Array, width: Array, low: Array, high: Array
) -> tuple[Array, Array, Array, Array]:
    """The quarter of each interval at whose ends second differences are largest; these, and the steepest slope."""
    step = 0.25 * width
    times = left[:, None] + step[:, None] * np.arange(-1.0, 6.0)
    outside = times[:, 0] < low, times[:, 6] > high
    times = np.clip(times, low[:, None], high[:, None])
    slopes = np.diff(function(times.ravel()).reshape(times.shape), axis=1)
    bends = np.abs(np.diff(slopes, axis=1))
    for place, where in zip((0, 4), outside, strict=True):
        bends[where, place] = 0.0
    inner = slopes[:, 1:5]
    sizes = bends[:, :-1] + bends[:, 1:] + _TIED * np.abs(inner - inner.mean(axis=1, keepdims=True))
    best = np.argmax(sizes, axis=1)
    steepest = np.abs(slopes).max(axis=1) / step
    return left + step * best, step, sizes[np.arange(best.size), best], steepest


def _steps(function: Callable[[Array], Array], jumps: Array, beside: float) -> Array:
    """By how much a function jumps."""
    return np.abs(function(jumps + beside) - function(np.maximum(jumps - beside, 0.0)))


def _apart(found: Array, others: Array, distance: float) -> Array:
    """Of instants those that are farther than a distance from the others and from the one found before."""
    found = np.sort(found)
    found = found[np.diff(found, prepend=-np.inf) > distance]
    others = np.sort(others)
    place = np.clip(np.searchsorted(others, found), 1, others.size - 1)
    return found[np.minimum(np.abs(found - others[place - 1]), np.abs(found - others[place])) > distance]
