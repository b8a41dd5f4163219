"""Parameters of any model from measured eigenfrequencies, frequency responses or singular values."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import positive, whole
from boomctl.identification.blocks import Spread, confident, limits, of_blocks, of_sets
from boomctl.identification.certificate import FitCertificate, minimum
from boomctl.identification.free import FreeParameters
from boomctl.identification.identifiability import Forward, Seen, differences, slopes
from boomctl.identification.intervals import BetterFit, Profile
from boomctl.identification.measured import BOUNDED, Builder, Measured
from boomctl.identification.result import FitResult
from boomctl.lti.rounding import ALIKE
from boomctl.progress import Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.analysis.measured import MeasuredCurve
    from boomctl.analysis.sigma import SigmaResult

    Range = tuple[float, float]
    One = ArrayLike | Mapping[int, float] | control.FrequencyResponseData | MeasuredCurve | SigmaResult
    Measurement = One | Mapping[str, One] | Sequence[One]

_SEARCH = {"xtol": 1e-6, "ftol": 1e-10, "gtol": 1e-12, "max_nfev": 60}  # of a start: near enough to tell minima apart
_POLISH = {"xtol": 1e-13, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 100}  # of the best of them: down to rounding
_STEP = 1e-5  # of a coordinate, for differences on the way; at the end steps are chosen by comparison
_PAIRINGS = 10  # times that modes are paired anew; two or three do
_POLISHES = 4  # times that a profile may find a better fit (a choice)
_AGREE = 0.05  # of the squared size of errors, by which sums of squares of the same fit differ (a choice)
_ENDED = 1e-6  # relative size of the residuals with which a start that should come to none may end
_CHANGED = 1e-5  # relative change of what was measured below which it is said that nothing changes (a choice)
_LEAST = 1e-2  # of a white deviation: a narrower spread is that of a few data sets that agree by chance (a choice)
_MOST_STARTS = 1000  # (a choice)


@dataclass(frozen=True)
class _Problem:
    """The model against the measurements, in coordinates."""

    builder: Builder
    free: FreeParameters

    def residuals(self, x: Array, modes: tuple[int, ...] | None) -> Array:
        """Return the residuals; where the model refuses the parameters, numbers that are not finite."""
        data = self.builder.data
        try:
            answer = self.builder(self.free.at(x))
            if modes is not None and max(modes) > len(answer):
                return self.refused
            return data.residuals(data.matched(answer, modes))
        except (ValueError, ArithmeticError):
            return self.refused

    @property
    def refused(self) -> Array:
        """What stands for residuals where there is no model."""
        data = self.builder.data
        return np.full(data.residuals(data.values).shape, np.inf)

    def paired(self, x: Array) -> tuple[int, ...] | None:
        """Return which modes are nearest to those measured."""
        data = self.builder.data
        return data.nearest(self.builder(self.free.at(x))) if data.kind == "eigenfrequencies" else None

    def solve(self, x: Array, steps: Array, options: dict[str, Any]) -> "_Candidate":
        """Return the least squares from a start; modes are paired anew until they stay."""
        from scipy.optimize import least_squares  # long to import, and only a fit comes here

        bounds: Any = (self.free.low, self.free.high)
        modes = self.paired(x)
        cost = np.inf
        for _ in range(_PAIRINGS):
            f = self.at(modes)
            beside = Forward(f, steps, self.free)
            central = lambda y, f=f: differences(f, y, steps, self.free)  # noqa: E731
            jac = central if options is _POLISH else beside.slopes
            found = least_squares(beside.residuals, x, jac=jac, bounds=bounds, **options)
            x, cost = found.x, 2.0 * float(found.cost)
            for at in self.ends_beside(x):
                beside = float(np.square(f(at)).sum())
                x, cost = (at, beside) if beside <= cost else (x, cost)
            again = self.paired(x)
            if again == modes:
                break
            modes = again
        return _Candidate(cost, x, modes)

    def ends_beside(self, x: Array) -> list[Array]:
        """Return the coordinates with those next to an end of their range put there; the solver stays within ranges."""
        low, high = self.free.low, self.free.high
        ends = np.where(x - low < high - x, low, high)
        near = np.flatnonzero(np.abs(ends - x) < _STEP)
        moved = [near, *near[:, None]] if len(near) > 1 else [near] if len(near) else []
        return [np.where(np.isin(np.arange(len(x)), which), ends, x) for which in moved]

    def at(self, modes: tuple[int, ...] | None) -> Callable[[Array], Array]:
        """Return the residuals of a pairing as a function of the coordinates."""
        return lambda x: self.residuals(x, modes)


@dataclass(frozen=True)
class _Candidate:
    """Where a start came to: sum of squares, coordinates, modes."""

    cost: float
    x: Array
    modes: tuple[int, ...] | None


@one_blas_thread
def fit(
    build: "Callable[..., Any] | Family",
    measured: "Measurement",
    free: "Iterable[str] | Mapping[str, Range | None] | None" = None,
    start: Any = None,
    *,
    modes: Sequence[int] | None = None,
    weights: "ArrayLike | None" = None,
    errors: str = "relative",
    deviation: float | None = None,
    confidence: float = 0.95,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    starts: int = 5,
    seed: int = 0,
    progress: Listener | None = None,
) -> FitResult:
    """Fit parameters of a model to measurements, and say how sure they are.

    Parameters
    ----------
    build : callable or Family
        A function of the parameters, such as ``bc.spray_boom``, ``bc.exact_eigenfrequencies_hz`` or one's own.  It
        returns a model (:class:`SecondOrderModel`, ``StateSpace``, a hub-beam), or what was measured of it:
        eigenfrequencies [Hz], a frequency response at the measured frequencies, singular values.  Parameters of the
        function that are called ``omega`` [rad/s], ``count`` (of modes), ``inputs`` and ``outputs`` are given to it.
        What it refuses with a ValueError or an ArithmeticError is not searched.
    measured : array_like, mapping, FrequencyResponseData, MeasuredCurve or SigmaResult
        Eigenfrequencies [Hz], ascending (damped, if the model's are), or a mapping from the numbers of modes, from 1,
        to them; a complex frequency response; singular values (magnitudes).  A curve that has its phase is fitted as the
        complex response that it is; singular values where there is no phase.  ``measured.kind`` of the result says which.
        A mapping from names, or a list, of such: several data sets of one kind, such as days.
    free : names, or mapping from names to (low, high) or None
        Names of the parameters that are fitted. A range limits the search, and is where further starts are drawn. Of a
        family all are fitted by default.
    start : dataclass or mapping, optional
        The parameters to begin from, those that stay among them.  By default those that ``build`` takes, at their
        defaults; the middle of a family; the middle of the ranges.
    modes : sequence of int, optional
        Which mode of the model each eigenfrequency is, from 1.  By default the nearest ones in order, some of which may
        have been missed in the measurement.
    weights : array_like, optional
        How much each value counts: one over the size of its error beside that of the others. By default as the
        ``deviation`` of a response of :func:`boomctl.estimate_response` says, otherwise 1 for each; 0 leaves a value out.
        Of several data sets the same for all, or a mapping from their names.
    errors : "relative" or "absolute"
        "relative": the errors are shares of the values (differences of logarithms, also of complex values). "absolute":
        they are in the unit of the values.
    deviation : float, optional
        Standard deviation of the errors of weight 1, where it is known; of complex values, of each part.  By default it
        is estimated from the residuals.
    confidence : float
        Confidence of the intervals, between 0.5 and 1.
    inputs, outputs : str or sequence of str, optional
        Signals of the model between which was measured.  By default those of the measured data, where the model has
        them, else the model's own (of a boom, platform actuators and tips).
    starts : int
        Number of starts of the search; the first is the one given, the others are drawn.
    seed : int
        Seed of the further starts, which are drawn at random.
    progress : callable, optional
        Is told a `Progress` at each start and at each interval.

    Returns
    -------
    FitResult
        The parameters, their intervals, what the measurements do not see, and a certificate.  Positive parameters are
        fitted by their logarithms, so that their intervals are positive too.

    Raises
    ------
    TypeError, ValueError
        An argument is not what was expected; the model refuses the start, or answers something else than was measured.
    ArithmeticError
        The sum of squares has so many minima that none can be called the least; the model refuses whatever lies beside.

    Notes
    -----
    Intervals come from what repeats itself in the measurements, and ``source`` says from what: of several data sets from
    how much they differ, so that they hold for the value in another one; of a response from blocks of neighbouring
    frequencies, so that errors need not be independent.  Of few numbers, or with ``deviation``, errors are taken for
    independent and normal, as large beside each other as the weights say.  A model error that is the same in every data set
    no interval sees: ``repeated`` says how large it is.  What the measurements do not see has no interval: it is infinite,
    and said in ``unseen``.

    Examples
    --------
    >>> import boomctl as bc
    >>> def spring(parameters):  # a model of one's own: the eigenfrequency [Hz] of a mass of 2 kg on a spring
    ...     return [(parameters["stiffness"] / 2.0) ** 0.5 / 6.2832]
    >>> found = bc.fit(spring, [0.8], start={"stiffness": 10.0}, free=["stiffness"], deviation=0.01)
    >>> round(found.values["stiffness"], 2), [round(end, 1) for end in found.intervals["stiffness"]]
    (50.53, [48.6, 52.6])
    """
    data = Measured.of(measured, modes, weights, errors, inputs, outputs)
    known_size = None if deviation is None else positive("deviation", deviation)
    confidence = confident("confidence", confidence)
    count = whole("starts", starts, most=_MOST_STARTS)
    whole("seed", seed, least=0)
    free_parameters = FreeParameters.of(build, free, start)
    problem = _Problem(Builder.of(build, data), free_parameters)
    zero = np.zeros(free_parameters.size)
    offered = problem.builder(free_parameters.at(zero))  # what is wrong at the start is said from here
    begun = data.matched(offered, problem.paired(zero))
    if not np.isfinite(data.residuals(begun)).all():
        raise ValueError("build: expected finite values above zero at the start; of absolute errors zeros will do")
    with computing("fit", progress):
        candidates, path = _search(problem, count, seed)
        best, seen, size, freedom, ends, names, spread, each = _polished(problem, candidates[0], known_size, confidence)
    f = problem.at(best.modes)
    offset, shown = minimum(f, free_parameters, best.x, seen, size if size > 0.0 else 1.0)
    # so many standard deviations are within confidence: normal, or Student's t, which has none without freedom
    degrees = np.inf if known_size is not None else freedom
    limit = float(limits(confidence, np.array(degrees))) if degrees > 0 else np.inf
    same = best.cost + max(_AGREE * size**2, data.size * (_ENDED * data.scale) ** 2)
    within = [other for other in candidates if other.cost < best.cost + (limit * size) ** 2]
    low, high = np.array(ends).T
    apart = []  # fits about as well, with a parameter outside its interval
    for other in within:
        found = free_parameters.values(other.x)
        slack = _ENDED * np.abs(found)
        if (found < low - slack).any() or (found > high + slack).any():
            apart.append((dict(zip(free_parameters.names, found.tolist(), strict=True)), other.cost))
    near = np.minimum(best.x - free_parameters.low, free_parameters.high - best.x)
    chance, excess = _chance(best.cost, freedom, known_size)
    certificate = FitCertificate(
        offset,
        shown,
        count,
        sum(other.cost <= same for other in candidates) - sum(cost <= same for _, cost in apart),
        tuple(found for found, _ in apart),
        tuple(n for n, d in zip(free_parameters.names, near, strict=True) if d < _STEP),
        problem.paired(best.x) == best.modes,
        chance,
        excess,
    )
    fitted = data.matched(problem.builder(free_parameters.at(best.x)), best.modes)
    changed = _CHANGED * data.scale * np.sqrt(data.size)
    values = free_parameters.values(best.x)
    covariance = _covariance(free_parameters, best.x, seen, spread)
    deviations = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(deviations, deviations)
    listed = free_parameters.names
    residuals = data.difference(fitted)
    return FitResult(
        parameters=free_parameters.at(best.x),
        names=listed,
        values=dict(zip(listed, values.tolist(), strict=True)),
        intervals=dict(zip(listed, ends, strict=True)),
        confidence=confidence,
        standard_errors=dict(zip(listed, deviations.tolist(), strict=True)),
        covariance=covariance,
        correlation=correlation,
        measured=data,
        fitted=fitted,
        begun=begun,
        modes=best.modes,
        residuals=residuals,
        deviation=size if limit < np.inf else float("nan"),
        estimated=known_size is None,
        freedom=freedom,
        unseen=seen.combinations(f, best.x, free_parameters, limit * size if limit < np.inf else 0.0, changed),
        certificate=certificate,
        path=(*path, *names),
        source=spread.source,
        freedoms=dict(zip(listed, spread.freedom.tolist(), strict=True)),
        each={
            name: dict(zip(listed, free_parameters.values(x).tolist(), strict=True))
            for name, x in zip(data.sets, each, strict=False)
        },
        repeated=data.repeated(residuals),
        build=build,
    )


def _search(problem: _Problem, count: int, seed: int) -> tuple[list[_Candidate], tuple[str, ...]]:
    """Return where the starts came to, the best first.

    Of a response, the search goes by bounded relative errors first: it finds resonances from further away.
    """
    data, path = problem.builder.data, []
    first = None
    if data.kind != "eigenfrequencies" and (data.values[data.kept] != 0.0).all():
        first = replace(problem, builder=replace(problem.builder, data=replace(data, errors=BOUNDED)))
        path.append("bounded relative errors first")
    found, steps = [], np.full(problem.free.size, _STEP)
    for k, x in enumerate(problem.free.drawn(count, seed)):
        tell("starts", k, count)
        try:
            if not np.isfinite(problem.residuals(x, problem.paired(x))).all():
                continue  # not even a value to compare
        except (ValueError, ArithmeticError):  # drawn where there is no such model
            continue
        if first is not None and np.isfinite(first.residuals(x, None)).all():
            x = first.solve(x, steps, _SEARCH).x
        found.append(problem.solve(x, steps, _SEARCH))
    path.append(f"{count} starts" if count > 1 else "1 start")
    return sorted(found, key=lambda candidate: candidate.cost), tuple(path)


def _polished(
    problem: _Problem, best: _Candidate, known: float | None, confidence: float
) -> tuple[_Candidate, Seen, float, int, list[tuple[float, float]], tuple[str, ...], Spread, Array]:
    """Return the fit to the last digit, what is seen, the size of errors, degrees of freedom, intervals, what was done,
    how far parameters spread, and what each of several data sets says.
    """
    free, data = problem.free, problem.builder.data
    path = ["steps by comparison"]
    for _ in range(_POLISHES):
        best = problem.solve(best.x, slopes(problem.at(best.modes), best.x, free).steps, _POLISH)
        f = problem.at(best.modes)
        found = slopes(f, best.x, free)
        seen = Seen.of(found, f, best.x, free)
        freedom = max(data.size - seen.rank, 0)
        size = known if known is not None else np.sqrt(best.cost / freedom) if freedom else 0.0
        # relative: smaller errors than these are of the model's rounding, not of a measurement
        floor = ALIKE * data.scale
        size, exact = max(float(size), floor), bool(size < floor)
        each = _of_each(problem, best, found.steps)
        covariance = seen.covariance() * size**2
        spread = None
        if len(each):
            spread = of_sets(each, data.sets)
        elif known is None and not exact:
            spread = of_blocks(found.matrix, f(best.x), data, seen)
        if spread is None:
            said = "the deviation given" if known is not None else "all residuals"
            lost = np.inf if known is not None else freedom if freedom else 0
            spread = Spread(covariance, np.full(free.size, lost), f"{said}, as independent errors")
        white = np.sqrt(np.diag(covariance))
        # in white deviations, which profiles are drawn over; a parameter that spreads less than their rounding has some
        times = np.maximum(np.sqrt(np.diag(spread.covariance)) / np.where(white > 0.0, white, np.inf), _LEAST)
        times[seen.hidden] = 1.0
        quantiles = np.where(spread.freedom > 0.0, limits(confidence, np.maximum(spread.freedom, 1.0)), np.inf) * times
        try:
            ends = [
                _ends(Profile(f, free, best.x, found.steps, seen, size, float(quantiles[i])), i, exact)
                for i in range(free.size)
            ]
        except BetterFit as better:
            best = _Candidate(best.cost, better.x, best.modes)
            path.append("a profile found a better fit")
            continue
        path.append("intervals of the linearised model" if exact else "intervals by profiles")
        return best, seen, size, freedom, ends, tuple(path), spread, each
    raise ArithmeticError(
        "fit: profiles go on finding better fits; the sum of squares has many minima, or the model refuses what lies beside"
        " the least: try more starts, narrower ranges, or ranges that end where the model does"
    )


def _of_each(problem: _Problem, best: _Candidate, steps: Array) -> Array:
    """Return the coordinates at which each of several data sets is fitted by itself, from the fit to all."""
    data, found = problem.builder.data, []
    for k in range(len(data.sets) if data.member is not None else 0):
        tell("data sets", k, len(data.sets))
        alone = replace(problem, builder=replace(problem.builder, data=data.one(k)))
        found.append(alone.solve(best.x, steps, _SEARCH).x)
    return np.array(found)


def _ends(profile: Profile, i: int, exact: bool) -> tuple[float, float]:
    """Return the interval of a parameter, in its unit."""
    free = profile.free
    tell("intervals", i, free.size)
    lost = profile.seen.hidden[i] and (exact or not profile.seen.alone[i])
    if lost or not np.isfinite(profile.quantile):
        return (0.0 if free.logarithmic[i] else -np.inf, np.inf)
    if exact:  # the profile would be one of rounding
        half = profile.quantile * profile.size * np.sqrt(profile.seen.covariance()[i, i])
        ends = [profile.x[i] - half, profile.x[i] + half]
    else:
        ends = [profile.end(i, -1), profile.end(i, 1)]
    at = [profile.x.copy(), profile.x.copy()]
    for x, end in zip(at, ends, strict=True):
        x[i] = end
    low, high = (float(free.values(x)[i]) for x in at)
    return low, high


def _chance(cost: float, freedom: int, known: float | None) -> tuple[float, float]:
    """Return how likely residuals as large as these are, and how large they are beside the deviation given."""
    from scipy.special import chdtrc

    if known is None or freedom == 0:
        return float("nan"), float("nan")
    return float(chdtrc(freedom, cost / known**2)), float(np.sqrt(cost / freedom) / known)


def _covariance(free: FreeParameters, x: Array, seen: Seen, spread: Spread) -> Array:
    """Return the covariance of the parameters, infinite where they are not seen."""
    if not (spread.freedom > 0.0).all():
        return np.where(np.eye(free.size, dtype=bool), np.inf, np.nan)
    scale = free.slopes(x)
    found = spread.covariance * np.outer(scale, scale)
    hidden = np.flatnonzero(seen.hidden)
    found[hidden] = np.nan
    found[:, hidden] = np.nan
    found[hidden, hidden] = np.inf
    return found
