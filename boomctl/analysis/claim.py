"""Statements of results about linear systems, which :func:`boomctl.prove` proves."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from boomctl.lti.system import Lti


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
    beside : tuple of Lti
        Systems of other signals: the norm is that of all of them together, as of the halves of a symmetric structure.
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
    beside: tuple[Lti, ...] = ()


class Claiming(Protocol):
    """A result that says what can be proved of it."""

    def __claims__(self) -> Iterator[Claim]: ...
