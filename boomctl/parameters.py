"""What all parameters of a machine have in common: they come from a file, print as code, and have a default."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import wraps
from inspect import unwrap
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

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

    def replace(self, **changes: float | None) -> Self:
        """Return the parameters with some changed.

        Parameters
        ----------
        **changes : float
            New values by name.

        Returns
        -------
        the parameters
            A new record; this one stays as it is.

        Raises
        ------
        TypeError, ValueError
            A name that is not there; a value of the wrong kind or out of its range.

        Examples
        --------
        >>> import boomctl as bc
        >>> bc.BoomParameters().replace(spring_stiffness=900.0).spring_stiffness
        900.0
        """
        return or_default(type(self), "parameters", self, changes)

    def _look_back(self, before: Any, changes: Mapping[str, Any]) -> None:
        """Warn about parameters that do not follow the changed ones although physics relates them."""

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

        result = read_toml(path)
        table = result.get(cls._toml_table)
        values = table if isinstance(table, dict) else result
        defaults = {field.name: field.default for field in fields(cls)}  # type: ignore[arg-type]
        try:
            for key, value in values.items():
                known("key", key, [*defaults])
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    raise TypeError(f"{key} = {value!r}: expected a number, got {type(value).__name__}")
            return cls(**{key: value for key, value in values.items() if value != defaults[key]})
        except (ValueError, TypeError) as error:
            raise type(error)(f"{path}: {error}") from None


P = TypeVar("P", bound=Parameters)


def signature_of(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of a function's arguments, without those that it takes by any name."""
    code = unwrap(function).__code__
    return code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]


def or_default(
    kind: type[P], name: str, given: object, changes: Mapping[str, Any] | None = None, beside: Sequence[str] = ()
) -> P:
    """Return the parameters given, the defaults for None, with changes by name; anything else is refused.

    ``beside`` are the other arguments of the function that takes the changes: what a name may have been meant for.
    """
    if given is not None and not isinstance(given, kind):
        raise TypeError(f"{name}: expected {kind.__name__}, got {type(given).__name__}")
    p = kind() if given is None else given
    if not changes:
        return p
    record = replaced(p, changes, beside)
    record._look_back(p, changes)
    return record


def replaced(parameters: P, changes: Mapping[str, Any], beside: Sequence[str] = ()) -> P:
    """Return parameters with changes by name, without a look back; an unknown name raises a TypeError."""
    allowed = [field.name for field in fields(parameters)]  # type: ignore[arg-type]
    for key in changes:
        if key not in allowed:
            try:
                known("argument", key, [*beside, *allowed])
            except ValueError as error:
                raise TypeError(str(error)) from None
    return replace(parameters, **changes)  # type: ignore[type-var]


def compared_with_defaults(kind: type[P]) -> type[P]:
    """Return a class of parameters whose constructor looks back at the defaults, as ``replace`` does at the record.

    A call with all parameters, as that of `dataclasses.replace`, changes no defaults.
    """
    init, names = kind.__init__, [field.name for field in fields(kind)]  # type: ignore[arg-type]

    @wraps(init)
    def construct(self: P, *values: Any, **changes: Any) -> None:
        init(self, *values, **changes)
        changes = {**dict(zip(names, values, strict=False)), **changes}
        if 0 < len(changes) < len(names):
            self._look_back(kind(), changes)

    setattr(kind, "__init__", construct)  # noqa: B010
    return kind
