"""SI units of signals: of motions, of forces, and of those of a symmetric machine's halves."""

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


def plain_unit(unit: str) -> str:
    """Return a unit without the words of a half."""
    return unit.partition(" (")[0]
