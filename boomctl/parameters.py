"""Base of the parameter classes: read from a file, printed as code, with defaults."""

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
        """Convert numbers of NumPy to Python numbers, because half precision overflows in products."""
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
            If a name is unknown, or a value has the wrong type or is out of range.

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
        """Read parameters from a TOML file whose keys are their names; others have their defaults.

        Parameters
        ----------
        path : str or Path
            The file, with the keys at top level; those of a hub-beam also in a table ``[hub_beam]``.

        Returns
        -------
        the parameters
            Instance of the class, such as ``BoomParameters``.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError, TypeError
            If it is not TOML, or a key is unknown, or a value has the wrong type or is out of range; the message names file
            and key.
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
    kind: type[P], name: str, value: object, changes: Mapping[str, Any] | None = None, arguments: Sequence[str] = ()
) -> P:
    """Return parameters (the defaults for None) with changes by name; another type raises an error.

    ``arguments`` are the other arguments of the calling function, for the suggestion in the error of an unknown name.
    """
    if value is not None and not isinstance(value, kind):
        raise TypeError(f"{name}: expected {kind.__name__}, got {type(value).__name__}")
    p = kind() if value is None else value
    if not changes:
        return p
    record = replaced(p, changes, arguments)
    record._look_back(p, changes)
    return record


def replaced(parameters: P, changes: Mapping[str, Any], arguments: Sequence[str] = ()) -> P:
    """Return parameters with changes by name, without a look back; an unknown name raises a TypeError."""
    allowed = [field.name for field in fields(parameters)]  # type: ignore[arg-type]
    for key in changes:
        if key not in allowed:
            try:
                known("argument", key, [*arguments, *allowed])
            except ValueError as error:
                raise TypeError(str(error)) from None
    return replace(parameters, **changes)  # type: ignore[type-var]


def compared_with_defaults(kind: type[P]) -> type[P]:
    """Return a class of parameters whose constructor compares the values with the defaults, as ``replace`` does.

    A call with all parameters, as by `dataclasses.replace`, is not compared.
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
