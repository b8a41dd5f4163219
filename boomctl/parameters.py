"""What all parameters of a machine have in common: they come from a file, print as code, and have a default."""

from dataclasses import fields
from pathlib import Path
from typing import ClassVar, Self, TypeVar

import numpy as np

from boomctl.checks import known
from boomctl.printing import exact, exact_html


class Parameters:
    """Base of frozen dataclasses whose fields are numbers with defaults; declare them with ``repr=False``."""

    _toml_table: ClassVar[str] = ""

    __repr__ = exact
    _repr_html_ = exact_html

    def _plain(self) -> None:
        """Keep numbers of numpy as Python's own: those of half precision overflow in products."""
        for name, value in vars(self).items():
            if isinstance(value, np.generic):
                object.__setattr__(self, name, value.item() if isinstance(value, np.integer) else float(value))

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read parameters from a TOML file whose keys are their names; those not in it keep their defaults.

        Parameters
        ----------
        path : str or Path
            The file, with the keys at top level; those of a hub-beam also in a table ``[hub_beam]``.

        Returns
        -------
        the parameters
            A record of the class that is asked, such as ``BoomParameters``.

        Raises
        ------
        OSError
            The file cannot be read.
        ValueError, TypeError
            Not TOML, an unknown key, a value of the wrong type or out of range; the message names file and key.
        """
        from boomctl.files import read_toml

        found = read_toml(path)
        table = found.get(cls._toml_table)
        values = table if isinstance(table, dict) else found
        allowed = [field.name for field in fields(cls)]  # type: ignore[arg-type]
        try:
            for key, value in values.items():
                known("key", key, allowed)
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    raise TypeError(f"{key} = {value!r}: expected a number, got {type(value).__name__}")
            return cls(**values)
        except (ValueError, TypeError) as error:
            raise type(error)(f"{path}: {error}") from None


P = TypeVar("P", bound=Parameters)


def or_default(kind: type[P], name: str, given: object) -> P:
    """Return the parameters given, the defaults for None; anything else is refused by the argument's name."""
    if given is None:
        return kind()
    if not isinstance(given, kind):
        raise TypeError(f"{name}: expected {kind.__name__}, got {type(given).__name__}")
    return given
