"""``prove``: what a result says of stability and norms, proved of the numbers that were handed in."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Protocol

from boomctl.checks import positive
from boomctl.exceptions import CertificateError
from boomctl.lti.rounding import SUMMED
from boomctl.lti.system import ClosedLoop, Lti
from boomctl.threads import one_blas_thread

if TYPE_CHECKING:
    from boomctl.lti.proof import Exact

_LEAST = 1e-300  # level of a bound that is zero: its square is a rational number still


@dataclass(frozen=True)
class Proof:
    """What was proved of a result.

    Attributes
    ----------
    proved : bool or None
        True, or None where it could not be decided within the limit; what is refuted raises.
    claim : str
        What was to be proved, in words.
    bits : int
        Size of the largest number that it rests on, in binary digits.
    operations : float
        What it took, as counted against ``max_operations``.
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


@dataclass(frozen=True)
class Claim:
    """A statement about a system, a loop, or the difference of two systems.

    Attributes
    ----------
    what : str
        What it is about, as messages call it.
    system : Lti
        As it was handed in.
    controller : Lti or None
        ``u = K y``, around the last signals of the system.
    minus : Lti or None
        What is taken from it.
    stable : bool or None
        Whether all poles decay; None where only the response is spoken of.
    norm : (float, float, float) or None
        Two bounds of the H-infinity norm, and the frequency of the peak [rad/s].
    energy : (float, float) or None
        Two bounds of the H2 norm.
    band : (float, float) or None
        Frequencies within which the norm is meant [rad/s].
    rounded : str
        What the system stands for, where it is not itself what was handed in: then nothing is refuted.
    """

    what: str
    system: Lti
    controller: Lti | None = None
    minus: Lti | None = None
    stable: bool | None = None
    norm: tuple[float, float, float] | None = None
    energy: tuple[float, float] | None = None
    band: tuple[float, float] | None = None
    rounded: str = ""


class Claiming(Protocol):
    """A result that says what can be proved of it."""

    def __claims__(self) -> "Iterator[Claim]": ...


@one_blas_thread
def prove(result: Claiming, *, max_operations: float = 1.2e10) -> Proof:
    """Prove what a result says of stability and norms, in exact and ball arithmetic, of the doubles that were handed in.

    The numbers are taken as exact.  Whether the last digit of one would change the answer is another question, which the
    result itself answers.

    Parameters
    ----------
    result : NormBounds, ReductionResult, Margins, TuneResult, or of a synthesis
        Of :func:`boomctl.hinf_norm`, :func:`boomctl.h2_norm`, :func:`boomctl.reduce` and so on.
    max_operations : float, optional
        Operations after which a proof is given up, some 5 ns each: the answer does not depend on the machine.

    Returns
    -------
    Proof
        ``proved`` is True, or None where it was not decided.

    Raises
    ------
    TypeError, ValueError
        A result that says nothing which can be proved; a limit that is not positive.
    CertificateError
        The result is wrong; the message holds the counterexample.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> swing = control.ss([[0.0, 1.0], [-1.0, -0.1]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    >>> bc.prove(bc.hinf_norm(swing)).proved
    True
    """
    from boomctl.exact_roots import UndecidedError
    from boomctl.lti.proof import Exact

    limit = positive("max_operations", max_operations)
    if not hasattr(result, "__claims__"):
        raise TypeError(
            f"result: expected a certificate of a norm, a reduction, a design or margins, got {type(result).__name__};"
            " boomctl.hinf_norm(system) makes one"
        )
    claims = list(result.__claims__())
    if not claims:
        raise ValueError(
            "result: it does not hold the system that it speaks of; prove the norm of that system's StateSpace"
        )
    spent, sure, said, bits = 0.0, True, [], 0
    for claim in claims:
        text, exact = claim.what, None
        try:
            given = claim.system if claim.controller is None else ClosedLoop(claim.system, claim.controller)
            exact = Exact.of(given, limit - spent, claim.minus)
            text = f"{text}: {', '.join(_shown(claim, exact))}"
            bits = max(bits, exact.bits)
        except UndecidedError as reason:
            sure, text = False, f"{text}: not decided{f' ({reason})' if str(reason) else ' within the limit'}"
        spent += exact.work.spent if exact is not None else 0.0
        said.append(text)
    return Proof(True if sure else None, "; ".join(said), bits, spent)


def _shown(claim: Claim, exact: "Exact") -> Iterator[str]:
    """Yield what was proved of a claim.

    Raises
    ------
    CertificateError
        It is refuted.
    UndecidedError
        Neither.
    """
    if claim.stable is not None:
        growing, on_axis, _ = exact.sides
        if (growing or on_axis) and claim.stable:
            where = f"a pole at {exact.slowest:.6g}"
            _refute(claim, f"{growing} poles grow, {len(on_axis)} lie on the boundary of stability, {where}")
        yield "stable"
    if claim.norm is not None and claim.norm[0] == inf:
        growing, _, shown = exact.sides
        if not (growing or shown):  # a pole that grows and does not show counts too
            _refute(claim, "all poles decay or do not show")
        yield "not stable" if growing else "a pole on the boundary of stability shows"
    elif claim.norm is not None:
        yield _norm_shown(claim, exact, *claim.norm)
    if claim.energy is not None:
        yield _energy_shown(claim, exact, *claim.energy)


def _norm_shown(claim: Claim, exact: "Exact", low: float, high: float, omega: float) -> str:
    """Return what was proved of two bounds of a norm; where there is no upper one, what the norm of the stored numbers is."""
    over, band = "", (0.0, inf)
    if claim.band is not None:
        over = f" between {claim.band[0]:.6g} and {claim.band[1]:.6g} rad/s"
        band = exact.square(claim.band[0]), exact.square(claim.band[1])
    elif claim.stable is None:
        growing, _, shown = exact.sides
        if growing or shown:
            if high < inf:
                _refute(claim, f"a pole at {exact.slowest:.6g} makes the norm infinite")
            return "not stable as stored; the result says that the last digits of the entries decide"
    guess = exact.square(omega)
    if high == inf:
        lowest, highest, _ = exact.norm(guess)
        return f"norm between {lowest:.9g} and {highest:.9g} as stored, where the result vouches for no upper bound"
    # a bound is the rounded result of a few operations, and is given so much way
    inside = 0.5 * (band[0] + band[1]) if band[1] < inf else band[0] + 1.0
    places, stays = exact.crossings(max(high * (1.0 + SUMMED), _LEAST), inside)
    reached = [float(x) for x in places if band[0] < float(x) < band[1]]
    if reached or not stays:
        at = f" at {exact.omega(reached[0]):.9g} rad/s" if reached else ""
        _refute(claim, f"a gain of {high:.9g} is exceeded{at}")
    if low > 0.0 and not (guess < inf and exact.gain(guess) >= low):
        places, stays = exact.crossings(low * (1.0 - SUMMED), inside)
        if stays and not any(band[0] < float(x) < band[1] for x in places):
            _refute(claim, f"no gain reaches {low:.9g}")
    return f"norm from {low:.9g} to {high:.9g}{over}"


def _energy_shown(claim: Claim, exact: "Exact", low: float, high: float) -> str:
    """Return what was proved of two bounds of an H2 norm."""
    growing, _, shown = exact.sides
    if growing or shown:
        if high < inf:
            _refute(claim, f"the H2 norm is infinite, not {high:.9g}")
        return "H2 norm infinite as stored"
    result = exact.energy().sqrt()
    if result > high * (1.0 + SUMMED) or result < low * (1.0 - SUMMED):
        _refute(claim, f"the H2 norm is {float(result):.9g}, not from {low:.9g} to {high:.9g}")
    return f"H2 norm {float(result):.9g}"


def _refute(claim: Claim, counterexample: str) -> None:
    from boomctl.exact_roots import UndecidedError

    if claim.rounded:
        raise UndecidedError(f"{claim.rounded}: {counterexample}")
    raise CertificateError(f"{claim.what}: {counterexample}")
