"""Numbers as a reader likes them."""

__all__ = ["number", "power"]

_ROUNDING = 1e-9


def number(value: float, digits: int = 3) -> str:
    """Return a number with few digits, small and large ones with a power of ten; what is rounding is said to be so."""
    if abs(value) < _ROUNDING:
        return f"less than {power(_ROUNDING, 1)}"
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:#.{digits}g}".rstrip(".").replace("-", "−")
    return power(value, digits)


def power(value: float, digits: int) -> str:
    """Return a number times a power of ten, "2.1·10⁻³"."""
    mantissa, exponent = f"{value:.{digits - 1}e}".replace("-", "−").split("e")
    raised = str(int(exponent.replace("−", "-"))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if mantissa == "1" else f"{mantissa}·10{raised}"
