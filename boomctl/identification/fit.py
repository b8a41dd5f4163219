"""Parameters of any model from measured eigenfrequencies, frequency responses or singular values."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.arrays import Array
from boomctl.checks import MOST, positive, whole
from boomctl.exceptions import AccuracyWarning
from boomctl.identification.fit_certificate import FitCertificate, lack_of_fit, minimum
from boomctl.identification.fit_result import FitResult
from boomctl.identification.free import FreeParameters, function_of_parameters
from boomctl.identification.identifiability import STEP, IdentifiedSubspace, differences, jacobian
from boomctl.identification.intervals import Spread, confident, limits, of_residuals, of_sets
from boomctl.identification.measured import BOUNDED, Measured, answered
from boomctl.lti.rounding import ALIKE, LEVEL
from boomctl.progress import Deadline, Listener, computing, tell
from boomctl.structure.families import Family
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control

    from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse

    Range = tuple[float, float]
    One = ArrayLike | control.FrequencyResponseData | MeasuredFrequencyResponse
    Measurement = One | Sequence[One]

_SOLVER = {"xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-15, "max_nfev": 100}  # of least squares: to rounding
_SAME_FIT = 0.05  # of the squared size of errors by which sums of squares of the same fit differ
_UNCHANGED = 1e-5  # relative change of the measured values that counts as none
_MIN_RISE = 0.25  # of the rise of the sum of squares that the linear model predicts at the end of an interval
_MIN_DEVIATION = 1e-2  # of that for independent errors: a few data sets may agree by chance


@dataclass(frozen=True)
class _Problem:
    """The model against the measurements, in coordinates."""

    make: Callable[[Any], Any]
    data: Measured
    free: FreeParameters

    def answer(self, x: Array) -> tuple[Array, tuple[int, ...] | None]:
        """Return the model's values at coordinates in the places of those measured, and their modes."""
        return answered(self.make(self.free.at(x)), self.data)

    def residuals(self, x: Array) -> Array:
        """Compute the residuals, infinite where the model raises or has too few modes."""
        try:
            return self.data.residuals(self.answer(x)[0])
        except (ValueError, ArithmeticError):
            return np.full(self.data.residuals(self.data.values).shape, np.inf)

    def solve(self, x: Array) -> tuple[float, Array, int]:
        """Return the least sum of squares that is found from a start, its coordinates, and the number of evaluations."""
        from scipy.optimize import least_squares  # long to import, and only a fit comes here

        bounds: Any = (self.free.low, self.free.high)
        f = self.residuals
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AccuracyWarning)  # of trial parameters
            result = least_squares(
                f, x, jac=lambda y: np.nan_to_num(differences(f, y, STEP, self.free)), bounds=bounds, **_SOLVER
            )
        return 2.0 * float(result.cost), result.x, result.nfev


@one_blas_thread
def fit(
    model: "Callable[..., Any] | Family",
    data: "Measurement",
    free: "Iterable[str] | Mapping[str, Range | None] | None" = None,
    initial: Any = None,
    *,
    modes: Sequence[int] | None = None,
    weights: "ArrayLike | None" = None,
    error_model: str = "relative",
    error_std: float | None = None,
    confidence_level: float = 0.95,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    n_starts: int = 5,
    seed: int = 0,
    progress: Listener | None = None,
) -> FitResult:
    """Fit parameters of a model to measurements, with confidence intervals.

    Parameters
    ----------
    model : callable or Family
        Function of the parameters, such as ``bc.spray_boom``, ``bc.exact_eigenfrequencies_hz`` or a user's function.  It
        returns a model (:class:`SecondOrderModel`, ``StateSpace``, a hub-beam), or data of the same kind as ``data``:
        eigenfrequencies [Hz], a frequency response or singular values at the measured frequencies (the sorted union of
        all data sets).  Parameters for which it raises ValueError or ArithmeticError are treated as infeasible.
    data : array_like, FrequencyResponseData or MeasuredFrequencyResponse
        Eigenfrequencies [Hz], ascending unless ``modes`` is given, damped or undamped as in the model; a complex frequency
        response;
        singular values (magnitudes).  A `MeasuredFrequencyResponse` with phase is fitted as a complex response, one
        without phase as singular values; ``data.kind`` of the result states the kind. A list of these: repeated
        data sets of one kind.
    free : names, or mapping from names to (low, high) or None
        Names of the parameters that are fitted. A range bounds the search and the random starts. By default all parameters
        of a family.
    initial : dataclass or mapping, optional
        Initial parameters, including fixed ones.  By default the midpoint of the family, or of the ranges in ``free``.
    modes : sequence of int, optional
        Mode number of each eigenfrequency, from 1.  If None, each measured value is assigned to the nearest mode,
        as modes may be missing in the data. The same for all data sets.
    weights : array_like, optional
        Weight of each value, proportional to 1 / standard deviation of its error; the same for all data sets.  By default
        from the standard deviations of :func:`boomctl.estimate_frequency_response`, otherwise 1; 0 excludes a value.
        With relative errors, values of such a response with a standard deviation above 20 % (low coherence) are excluded
        by default, because their logarithms are biased.  That may exclude deep antiresonances: use
        ``error_model="absolute"`` for parameters that only these determine.
    error_model : "relative" or "absolute"
        "relative": the errors are relative to the values (differences of logarithms, also of complex values). "absolute":
        they are in the unit of the values.
    error_std : float, optional
        Standard deviation of errors at weight 1, if known; of complex data, that of the real and of the imaginary part.  By
        default it is estimated from the residuals.
    confidence_level : float
        Confidence level of the intervals, between 0.5 and 1.
    inputs, outputs : str or sequence of str, optional
        Measured inputs and outputs of the model.  By default the signals of the data, if the model has them, else the model's
        signals (platform actuators and tips for a boom).
    n_starts : int
        Number of starts of the search; the first is ``initial``, the others are random.
    seed : int
        Seed of the random starts.
    progress : callable, optional
        Called with a `Progress` at each start and each data set.

    Returns
    -------
    FitResult
        Parameters, their intervals, unidentifiable combinations, and a certificate.  Positive parameters are fitted by their
        logarithms, so that their intervals are positive too.

    Raises
    ------
    TypeError, ValueError
        If an argument is invalid, or the model raises an error at the start or returns another kind of data.
    ArithmeticError
        If the model cannot be evaluated near the fitted value of a parameter.

    Notes
    -----
    Intervals follow from the linearized model with Student's t, symmetric in the logarithm of positive parameters.
    ``uncertainty_source`` states how the covariance was estimated. For several data sets it is estimated from their
    scatter, and the intervals are prediction intervals for another data set. For a response it is estimated from the
    residuals, including their correlation over frequency. For lists of frequencies, responses at fewer than 12
    frequencies, and with ``error_std``, errors are assumed independent and normal.

    For a single data set, standard deviations are assumed proportional to 1 / weight: intervals are too narrow if relative
    errors are fitted as absolute, which ``certificate.adequacy`` reports. The intervals do not include a bias of the model
    that is common to all data sets: ``certificate.adequacy`` compares residuals with errors. Unidentifiable parameters have
    infinite intervals; weak combinations are listed too, in ``unidentifiable``.

    Examples
    --------
    >>> import boomctl as bc
    >>> def spring(parameters):  # natural frequency [Hz] of a mass of 2 kg on a spring
    ...     return [(parameters["stiffness"] / 2.0) ** 0.5 / 6.2832]
    >>> found = bc.fit(spring, [0.8], initial={"stiffness": 10.0}, free=["stiffness"], error_std=0.01)
    >>> round(found.values["stiffness"], 2), [round(end, 1) for end in found.intervals["stiffness"]]
    (50.53, [48.6, 52.6])
    """
    make = function_of_parameters(model)
    measured = Measured.of(data, modes, weights, error_model, inputs, outputs)
    known_size = None if error_std is None else positive("error_std", error_std)
    confidence_level = confident("confidence_level", confidence_level)
    count = whole("n_starts", n_starts, most=MOST)
    whole("seed", seed, least=0)
    free_parameters = FreeParameters.of(model, free, initial)
    problem, names = _Problem(make, measured, free_parameters), free_parameters.names

    def named(numbers: Array) -> dict[str, Any]:
        return dict(zip(names, numbers.tolist(), strict=True))

    zero = np.zeros(free_parameters.size)
    try:
        initial_fit, _ = problem.answer(zero)  # errors of the model at the start are raised here
    except KeyError as error:
        raise ValueError(f"model: parameter {error} is missing; add it to `initial`") from error
    if not np.isfinite(measured.residuals(initial_fit)).all():
        raise ValueError(
            "model: expected finite values above zero at the start; zeros are allowed with error_model='absolute'"
        )
    with computing("fit", progress):
        clock = Deadline()
        candidates = _search(problem, count, seed)
        f, (cost, x, _) = problem.residuals, candidates[0]
        matrix, error = jacobian(f, x, free_parameters)
        identified = IdentifiedSubspace.of(matrix, error, f, x, free_parameters)
        item = _set_estimates(problem, x)
    dof = max(measured.size - identified.rank, 0)
    size = known_size if known_size is not None else np.sqrt(cost / dof) if dof else 0.0
    floor = ALIKE * measured.scale  # smaller errors are rounding errors of the model
    size, exact = max(float(size), floor), bool(size < floor)
    spread = None
    if len(item):
        spread = of_sets(item)
    elif known_size is None and not exact:
        spread = of_residuals(matrix, f(x), measured, identified)
    # Number of standard deviations of the confidence level: normal, or Student's t, undefined without dof.
    degrees = np.inf if known_size is not None else dof
    limit = float(limits(confidence_level, np.array(degrees))) if degrees > 0 else np.inf
    if spread is None:
        source = f"{'error_std' if known_size is not None else 'residuals'}, with independent errors"
        spread = Spread(identified.covariance() * size**2, np.full(free_parameters.size, float(degrees)), source)
    coordinates = _covariance(spread, identified)
    floors = _MIN_DEVIATION * size * np.sqrt(np.diag(identified.covariance()))
    half = limits(confidence_level, np.maximum(spread.dof, 1.0)) * np.maximum(np.sqrt(np.diag(coordinates)), floors)
    low, high = _intervals(problem, cost, x, identified, half)
    same = cost + max(_SAME_FIT * size**2, measured.size * (LEVEL * measured.scale) ** 2)
    rivals, agreeing = [], 0  # rivals fit about as well, with a parameter outside its interval
    for other, at, _ in candidates:
        values = free_parameters.values(at)
        slack = LEVEL * np.abs(values)
        outside = bool(((values < low - slack) | (values > high + slack)).any())
        if outside and other < cost + (limit * size) ** 2:
            rivals.append(named(values))
        agreeing += other <= same and not outside
    near = np.minimum(x - free_parameters.low, free_parameters.high - x)
    fitted, paired = problem.answer(x)
    residuals = measured.difference(fitted)
    offset, shown = minimum(f, free_parameters, x, identified, size)
    variance, sure = measured.variance(residuals, paired)
    tested = (variance, sure) if known_size is None else (known_size**2, np.inf)
    excess, chance = lack_of_fit(cost, dof, max(tested[0], floor**2), tested[1])
    certificate = FitCertificate(
        distance_to_minimum=offset,
        is_minimum=shown,
        n_starts=count,
        n_agreeing_starts=agreeing,
        alternatives=tuple(rivals),
        at_bounds=tuple(n for n, d in zip(names, near, strict=True) if d < STEP),
        residual_percent=measured.percent(fitted),
        residual_ratio=excess,
        p_value=chance if known_size is not None or np.isfinite(sure) else float("nan"),
        ndata=measured.size,
        errors_grow=not exact and measured.growing(residuals, fitted),
    )
    scale = free_parameters.derivatives(x)
    covariance = coordinates * np.outer(scale, scale)
    deviations = np.sqrt(np.diag(covariance))
    return FitResult(
        parameters=free_parameters.at(x),
        names=names,
        values=named(free_parameters.values(x)),
        intervals=dict(zip(names, zip(low.tolist(), high.tolist(), strict=True), strict=True)),
        confidence_level=confidence_level,
        standard_errors=named(deviations),
        covariance=covariance,
        data=measured,
        best_fit=fitted,
        initial_fit=initial_fit,
        mode_numbers=paired,
        residuals=residuals,
        error_std=size if limit < np.inf else float("nan"),
        error_std_estimated=known_size is None,
        dof=dof,
        unidentifiable=identified.combinations(
            f,
            x,
            free_parameters,
            limit * size if limit < np.inf else 0.0,
            _UNCHANGED * measured.scale * np.sqrt(measured.size),
        ),
        certificate=certificate,
        uncertainty_source=spread.source,
        parameter_dof=named(spread.dof),
        per_dataset=tuple(named(free_parameters.values(at)) for at in item),
        nfev=sum(evaluations for *_, evaluations in candidates),
        elapsed=clock.elapsed,
        model=model,
    )


def _search(problem: _Problem, count: int, seed: int) -> list[tuple[float, Array, int]]:
    """Return where the starts came to and by how many evaluations, the best first.

    Of a response, the search goes by bounded relative errors first: it finds resonances from further away.
    """
    data, first, result = problem.data, None, []
    if data.kind != "eigenfrequencies" and (data.values[data.kept] != 0.0).all():
        first = replace(problem, data=replace(data, errors=BOUNDED))
    for k, x in enumerate(problem.free.drawn(count, seed)):
        tell("starts", k, count)
        if not np.isfinite(problem.residuals(x)).all():  # drawn where there is no such model
            continue
        before = 0
        if first is not None and np.isfinite(first.residuals(x)).all():
            _, x, before = first.solve(x)
        cost, x, more = problem.solve(x)
        result.append((cost, x, before + more))
    return sorted(result, key=lambda candidate: candidate[0])


def _set_estimates(problem: _Problem, x: Array) -> Array:
    """Return the coordinates at which each of several data sets is fitted by itself, from the fit to all."""
    data, result = problem.data, []
    for k in range(data.sets if data.sets > 1 else 0):
        tell("data sets", k, data.sets)
        result.append(replace(problem, data=data.one(k)).solve(x)[1])
    return np.array(result)


def _covariance(spread: Spread, identified: IdentifiedSubspace) -> Array:
    """Return the covariance of the coordinates, infinite for parameters that are not identifiable."""
    result, hidden = spread.covariance.copy(), np.flatnonzero(identified.hidden | ~(spread.dof > 0.0))
    result[hidden] = np.nan
    result[:, hidden] = np.nan
    result[hidden, hidden] = np.inf
    return result


def _intervals(
    problem: _Problem, cost: float, x: Array, identified: IdentifiedSubspace, half: Array
) -> tuple[Array, Array]:
    """Compute the ends of the intervals of the linearized model, in units of the parameters.

    They are infinite (0 for a parameter above zero) out of reach.  A parameter whose logarithm is not bounded, such as the
    damping of an undamped structure, has the upper end of the model linear in the parameter itself, if the sum of squares
    rises there as this model predicts.
    """
    free, unit = problem.free, identified.covariance()
    low, high = (free.values(end) for end in (x - half, x + half))
    open_low, open_high = (half > free.reach(x, sign) for sign in (-1, 1))
    low, high = np.where(open_low, np.where(free.logarithmic, 0.0, -np.inf), low), np.where(open_high, np.inf, high)
    for i in np.flatnonzero(free.logarithmic & open_low & open_high & np.isfinite(half)):
        at = x + half[i] * unit[:, i] / unit[i, i]
        at[i] = x[i] + np.log1p(half[i])
        rise = float(np.square(problem.residuals(at)).sum()) - cost
        if at[i] < free.high[i] and _MIN_RISE * half[i] ** 2 / unit[i, i] < rise < np.inf:
            high[i] = free.values(at)[i]
    return low, high
