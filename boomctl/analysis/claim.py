"""Statements of results about linear systems, which :func:`boomctl.prove` proves."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from boomctl.lti.system import Lti


@dataclass(frozen=True)
class Claim:
    """Statement about a system, a loop, or the difference of two systems.

    Attributes
    ----------
    what : str
        Name of the subject in messages.
    system : Lti
        The system passed by the user.
    controller : Lti or None
        Controller with ``u = K y``, around the last signals of the system.
    minus : Lti or None
        System to subtract.
    stable : bool or None
        True if all poles are stable; None if the statement is about the response only.
    norm : (float, float, float) or None
        Two bounds of the H-infinity norm, and the frequency of the peak [rad/s].
    energy : (float, float) or None
        Two bounds of the H2 norm.
    band : (float, float) or None
        Frequency range of the norm [rad/s].
    rounded : str
        Description of the system if it is only a representation of the user's system: then nothing is refuted.
    others : tuple of Lti
        Systems with other signals: the norm is that of all of them together, as of the subsystems of a symmetric structure.
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
    others: tuple[Lti, ...] = ()


class Claiming(Protocol):
    """Result with statements that can be proved."""

    def __claims__(self) -> Iterator[Claim]: ...
