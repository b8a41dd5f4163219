"""The suspensions among the designs."""

from boomctl.studies import catalogue
from boomctl.studies.suspension.design import SuspensionDesign


def design_names() -> tuple[str, ...]:
    """Return the names of the suspension designs that come with boomctl."""
    return catalogue.design_names("suspension")


def load_design(name: str) -> SuspensionDesign:
    """Return the design of a name, or of a Python file whose ``design()`` returns a :class:`SuspensionDesign`.

    Raises
    ------
    ValueError
        No such design; the file has no ``design()``.
    TypeError
        ``design()`` returns something else.
    """
    return catalogue.design_file(name, "suspension").made(SuspensionDesign)
