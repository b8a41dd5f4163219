"""What is said where rounding could show in an answer."""

from boomctl.checks import warn_user


class AccuracyWarning(UserWarning):
    """The estimated rounding error of a result exceeds what it is usually good for."""


def warn_of_rounding(what: str, share: float, promised: float) -> None:
    """Warn, if rounding of an answer may be as much as ``share`` of its size and that is more than was ``promised``."""
    if share > promised:
        message = f"rounding of {what} may be as much as {share:.1g} of its size"
        warn_user(f"{message}: more than the {promised:.0e} that is usual", AccuracyWarning)
