"""SI units of signals: of motions, of forces, and of those of a symmetric machine's halves."""

from collections.abc import Mapping, Sequence

HALVES = {"_sym": "the mean", "_anti": "half the difference"}
"""How the names of a half's signals end, and what these are root of two times (right and left, right less left)."""

_RATES = ("", "/s", "/s^2")


def motion_unit(turns: bool, derivative: int) -> str:
    """Return the unit of a place or turn, of its speed or its acceleration."""
    return f"{'rad' if turns else 'm'}{_RATES[derivative]}"


def is_half(name: str) -> bool:
    """Return whether a signal is named as one of a half: no sensor reads it, and no actuator takes it."""
    return name.endswith(tuple(HALVES))


def half_unit(unit: str, name: str) -> str:
    """Return the unit of a signal of a half in words: ``"m (orthonormal, root of two times the mean)"``."""
    of = next((words for ending, words in HALVES.items() if name.endswith(ending)), "")
    return f"{unit} (orthonormal, root of two times {of})" if of and unit else unit


def gain_unit(units: Mapping[str, str], inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return the unit of a gain between signals, ``"m/N"``: of several, all that there are; ``""`` where one is unknown."""
    sides = [dict.fromkeys(plain_unit(units.get(name, "")) for name in names) for names in (outputs, inputs)]
    if any("" in side for side in sides):
        return ""
    above, below = (" or ".join(side) for side in sides)
    return f"{above}/{below}" if above.isalnum() and below.isalnum() else f"{above} per {below}"


def plain_unit(unit: str) -> str:
    """Return a unit without the words of a half."""
    return unit.partition(" (")[0]
