"""``prove``: proofs of the stability and norms that a result states, for the matrices passed by the user."""

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import hypot, inf

from boomctl.analysis.claim import Claim, Claiming
from boomctl.checks import positive
from boomctl.exact_roots import OPERATIONS, UndecidedError
from boomctl.exceptions import CertificateError
from boomctl.lti.proof import Exact
from boomctl.lti.rounding import SUMMED, TINY
from boomctl.lti.system import ClosedLoop
from boomctl.threads import one_blas_thread


@dataclass(frozen=True)
class Proof:
    """Proof of a result.

    Attributes
    ----------
    proved : bool or None
        True, or None if undecided within the limit; a refuted result raises.
    claim : str
        Statement as text.
    bits : int
        Size of the largest number used [bit].
    operations : float
        Number of operations, as limited by ``max_operations``.
    """

    proved: bool | None
    claim: str
    bits: int
    operations: float

    def __repr__(self) -> str:
        verdict = "proved" if self.proved else "not decided"
        return (
            f"Proof: {verdict} in ball arithmetic ({self.bits} bits, {self.operations:.2g} operations)\n  {self.claim}"
        )


@one_blas_thread
def prove(result: Claiming, *, max_operations: float = 1.2e10) -> Proof:
    """Prove the stability and norms that a result states, in exact and ball arithmetic.

    The floating-point entries are treated as exact.  Their rounding errors are covered by the result itself.

    Parameters
    ----------
    result : NormBounds, ReductionResult, Margins, TuneResult, or of a synthesis
        Result of :func:`boomctl.hinf_norm`, :func:`boomctl.h2_norm`, :func:`boomctl.reduce` and so on.
    max_operations : float, optional
        Number of operations after which the proof stops, about 5 ns each.  The outcome does not depend on the machine.

    Returns
    -------
    Proof
        ``proved`` is True, or None if undecided.

    Raises
    ------
    TypeError, ValueError
        If `result` has no statement that can be proved, or `max_operations` is not positive.
    CertificateError
        If the result is wrong; the message contains the counterexample.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> oscillator = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    >>> bc.prove(bc.hinf_norm(oscillator)).proved
    True
    """
    limit = positive("max_operations", max_operations)
    if not hasattr(result, "__claims__"):
        raise TypeError(
            f"result: expected a certificate of a norm, a reduction, a design or margins, got {type(result).__name__};"
            " boomctl.hinf_norm(system) returns one"
        )
    claims = list(result.__claims__())
    if not claims:
        raise ValueError("result: it does not contain its system; prove the norm of that system's StateSpace")
    return _proof(claims, limit)


@one_blas_thread
def is_proved(claims: Iterable[Claim]) -> bool:
    """Return whether statements are proved within a second or two; False if one is refuted."""
    try:
        return bool(_proof(list(claims), OPERATIONS).proved)
    except CertificateError:
        return False


def _proof(claims: list[Claim], limit: float) -> Proof:
    spent, sure, texts, bits = 0.0, bool(claims), [], 0
    for claim in claims:
        subject = claim.system if claim.controller is None else ClosedLoop(claim.system, claim.controller)
        text, exact = claim.what, []
        try:
            for system in (subject, *claim.others):
                exact.append(Exact.of(system, limit - spent, claim.minus))
            with warnings.catch_warnings():  # From floats, which are only initial values of a proof.
                warnings.simplefilter("ignore", RuntimeWarning)
                text = f"{text}: {', '.join(_shown(claim, exact))}"
            bits = max(bits, *(part.bits for part in exact))
        except UndecidedError as reason:
            sure, text = False, f"{text}: not decided{f' ({reason})' if str(reason) else ' within the limit'}"
        spent += sum(part.work.spent for part in exact)
        texts.append(text)
    return Proof(True if sure else None, "; ".join(texts), bits, spent)


def _shown(claim: Claim, parts: list[Exact]) -> Iterator[str]:
    """Yield the proved parts of a claim as text.

    Raises
    ------
    CertificateError
        If the claim is refuted.
    UndecidedError
        If the claim is neither proved nor refuted.
    """
    if claim.stable is not None:
        for exact in parts:
            if exact.is_large and claim.stable and (near := exact.inequality(1.0)) is not None and near.is_stable():
                continue
            growing, on_axis, _ = exact.sides
            if (growing or on_axis) and claim.stable:
                where = f"a pole at {exact.slowest:.6g}"
                _refute(claim, f"{growing} unstable poles, {len(on_axis)} on the stability boundary, {where}")
        yield "stable"
    if claim.norm is not None and claim.norm[0] == inf:
        growing, shown = (any(exact.sides[k] for exact in parts) for k in (0, 2))
        if not (growing or shown):  # an unstable pole counts even if it does not contribute
            _refute(claim, "all poles are stable or cancel")
        yield "not stable" if growing else "a pole on the stability boundary, not canceled"
    elif claim.norm is not None:
        yield _norm_shown(claim, parts, *claim.norm)
    if claim.energy is not None:
        yield _energy_shown(claim, parts, *claim.energy)


def _norm_shown(claim: Claim, parts: list[Exact], low: float, high: float, omega: float) -> str:
    """Return the proved bounds of a norm as text; without an upper bound, the norm of the stored matrices."""
    ends = claim.band or (0.0, inf)
    over = f" between {ends[0]:.6g} and {ends[1]:.6g} rad/s" if claim.band else ""
    band = parts[0].square(ends[0]), parts[0].square(ends[1]) if ends[1] < inf else inf
    if high == inf:
        if any(exact.sides[0] or exact.sides[2] for exact in parts):
            return "not stable as stored; according to the result, rounding errors of the entries decide"
        lowest, highest, _ = max(exact.norm(exact.square(omega)) for exact in parts)
        return f"norm between {lowest:.9g} and {highest:.9g} as stored; the result has no upper bound"
    level, least = max(high * (1.0 + SUMMED), TINY), low * (1.0 - SUMMED)  # bounds are rounded results
    reached, small = low <= 0.0, not any(exact.is_large for exact in parts)
    for exact in parts:  # polynomials decide more, but take longer, with many signals ten times
        inequality = exact.inequality(max(low, TINY)) if claim.band is None else None
        if inequality is not None and inequality.stays_below(level, max(low, TINY)):
            reached = reached or bool(inequality.gain(omega) >= least)
        elif exact.is_large and claim.band is None:
            raise UndecidedError("the inequality of the bounded real lemma does not hold in 128 bits")
        else:
            if claim.band is None and claim.stable is None and (exact.sides[0] or exact.sides[2]):
                _refute(claim, f"a pole at {exact.slowest:.6g} makes the norm infinite")
            if (where := _reached(exact, level, band)) is not None:
                _refute(claim, f"a gain of {level:.9g} is exceeded{where}")
    if not reached and (small or claim.band is not None):
        reached = any(
            bool(exact.gain(exact.square(omega)) >= least) or _reached(exact, least, band) is not None
            for exact in parts
        )
    if not (reached or small):
        raise UndecidedError(f"no gain of {low:.9g} was found at {omega:.9g} rad/s")
    if not reached:
        _refute(claim, f"no gain reaches {low:.9g}")
    return f"norm from {low:.9g} to {high:.9g}{over}"


def _reached(exact: Exact, level: float, band: tuple[float, float]) -> str | None:
    """Return where a gain in a band reaches a level, as text, in exact arithmetic; None if it does not."""
    squares, stays = exact.crossings(level, 0.5 * (band[0] + band[1]) if band[1] < inf else band[0] + 1.0)
    reached = [f" at {exact.omega(x):.9g} rad/s" for x in map(float, squares) if band[0] < x < band[1]]
    return "".join(reached[:1]) if reached or not stays else None


def _energy_shown(claim: Claim, parts: list[Exact], low: float, high: float) -> str:
    """Return the proved bounds of an H2 norm as text."""
    lowest = highest = 0.0
    for exact in parts:
        if exact.is_large and (inequality := exact.inequality(1.0)) is not None:
            below, above = inequality.energy()
        else:
            growing, _, shown = exact.sides
            if growing or shown:
                if high < inf:
                    _refute(claim, f"the H2 norm is infinite, not {high:.9g}")
                return "H2 norm infinite as stored"
            energy = exact.energy().sqrt()
            below, above = float(energy.lower()), float(energy.upper())
        lowest, highest = hypot(lowest, below), hypot(highest, above)
    if lowest > high * (1.0 + SUMMED) or highest < low * (1.0 - SUMMED):
        _refute(claim, f"the H2 norm is {lowest:.9g}, not from {low:.9g} to {high:.9g}")
    if high < inf and not (lowest >= low * (1.0 - SUMMED) and highest <= high * (1.0 + SUMMED)):
        raise UndecidedError(f"the H2 norm lies between {lowest:.9g} and {highest:.9g}")
    return f"H2 norm from {lowest:.9g} to {highest:.9g}"


def _refute(claim: Claim, counterexample: str) -> None:
    if claim.rounded:
        raise UndecidedError(f"{claim.rounded}: {counterexample}")
    raise CertificateError(f"{claim.what}: {counterexample}")
