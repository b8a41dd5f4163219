"""Text and HTML of models and results."""

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import pandas  # type: ignore[import-not-found]

DataFrame: TypeAlias = "pandas.DataFrame"

WIDTH = 98  # Largest number of columns.
PART = 60  # Letters of a nested value; a longer one is replaced by its class.
LINES = 5  # Largest number of lines of a repr.


def listed(names: Sequence[str], width: int = 78) -> str:
    """Return names in a row, as many as fit into the width, and how many there are where some are left out."""
    whole = ", ".join(names)
    if len(whole) <= width:
        return whole or "none"
    end = f", ... ({len(names)})"
    count = len(names)
    while count > 1 and len(", ".join(names[:count]) + end) > width:
        count -= 1
    return ", ".join(names[:count]) + end


def count(number: int, word: str, words: str = "") -> str:
    """Return "1 mode", "2 modes"."""
    return f"{number} {word}" if number == 1 else f"{number} {words or word + 's'}"


def percent(fraction: float) -> str:
    """Return a fraction in percent with two digits and without an exponent for large numbers, "0.85 %", "20,000 %"."""
    number = f"{100.0 * fraction:.2g}"
    return f"{float(number):,.0f} %" if float(number) >= 10.0 else f"{number} %"


def signals(inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return two lines that name inputs and outputs."""
    return f"  inputs: {listed(inputs)}\n  outputs: {listed(outputs)}"


def between(inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """Return "inputs -> outputs" for part of a line."""
    return f"{listed(inputs, 30)} -> {listed(outputs, 30)}"


def system(given: Any) -> str:
    """Return a linear system's size and signals in part of a line."""
    return f"{count(len(given.A), 'state')}, {between(given.input_labels, given.output_labels)}"


def value(given: Any) -> str:
    """Return a field's value in a few words: numbers to six digits, an array's shape and range."""
    if isinstance(given, bool) or given is None:
        return str(given)
    if isinstance(given, (float, complex)):
        return f"{given:.6g}"
    if isinstance(given, str):
        return repr(given) if len(given) <= 60 else repr(given[:57] + "...")
    if isinstance(given, Mapping):
        return "{" + ", ".join(f"{key}: {value(entry)}" for key, entry in list(given.items())[:6]) + "}"
    if isinstance(given, (tuple, list)):
        inside = [value(entry) for entry in given[:6]] + ([f"... ({len(given)})"] if len(given) > 6 else [])
        return "(" + ", ".join(inside) + ")"
    if hasattr(given, "shape") and hasattr(given, "dtype"):
        return array(given)
    if type(given).__repr__ is object.__repr__ or callable(given):
        return getattr(given, "__qualname__", type(given).__name__)
    first, *others = repr(given).splitlines()
    if others or len(first) > PART:
        if others and len(first) <= PART and "(" not in first:
            return first.removesuffix(":")
        size = f" of {count(int(given.nstates), 'state')}" if hasattr(given, "nstates") else ""
        return type(given).__name__ + size
    return first


def array(given: Any) -> str:
    """Return a small array's numbers, a large one's shape and range."""
    if given.ndim == 0:
        return value(given.item())
    if given.ndim == 1 and given.size <= 6:
        return "[" + ", ".join(value(entry) for entry in given.tolist()) + "]"
    shape = " x ".join(map(str, given.shape)) if given.ndim > 1 else f"{given.size} values"
    if given.dtype.kind not in "fiu" or not given.size:
        return f"[{shape}]"
    return f"[{shape}, {given.min():.4g} to {given.max():.4g}]"


def compact(self: Any) -> str:
    """Return a dataclass's name and fields, floats rounded, arrays by shape and range.  A ``__repr__`` for records.

    What would take more than ``LINES`` lines ends there.
    """
    words = [f"{field.name}={value(getattr(self, field.name))}" for field in fields(self) if field.repr]
    lines = wrapped(type(self).__name__, words).splitlines()
    return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "  ...)"])


def exact(self: Any) -> str:
    """Return a dataclass of numbers as Python code that makes it again.  A ``__repr__`` for parameters.

    Where that takes too many lines, what is at its default is left out.
    """
    words = {}
    for field in fields(self):
        given = getattr(self, field.name)
        short = f"{given:g}" if isinstance(given, float) else repr(given)
        words[field] = f"{field.name}={short if not isinstance(given, float) or float(short) == given else repr(given)}"
    whole = wrapped(type(self).__name__, words.values())
    if whole.count("\n") < LINES:
        return whole
    return wrapped(
        type(self).__name__, (word for field, word in words.items() if getattr(self, field.name) != field.default)
    )


def exact_html(self: Any) -> str:
    """Return a dataclass of numbers as an HTML table, what is not at its default in bold.  A ``_repr_html_``."""
    rows = []
    for field in fields(self):
        cells = (field.name, escape(repr(getattr(self, field.name))))
        changed = getattr(self, field.name) != field.default
        rows.append("".join(f"<td>{f'<b>{cell}</b>' if changed else cell}</td>" for cell in cells))
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table><caption>{type(self).__name__}</caption><tbody>{body}</tbody></table>"


def sentence(name: str, text: str) -> str:
    """Return "name: text", each part between semicolons on a line of its own."""
    parts = re.split(r"; (?![^()]*\))", f"{name}: {text}")  # Not within parentheses.
    lines = [
        textwrap.wrap(part, WIDTH, initial_indent="  " if k else "", subsequent_indent="    ")
        for k, part in enumerate(parts)
    ]
    return "\n".join(line for part in lines for line in part)


def wrapped(name: str, words: Iterable[str]) -> str:
    """Return "name(words)", further lines indented."""
    text = f"{name}({', '.join(words)})"
    return "\n".join(textwrap.wrap(text, WIDTH, subsequent_indent="  ", break_long_words=False))


def table_text(rows: Sequence[Sequence[str]], gap: str = "  ", first: int = 0) -> str:
    """Return a table as text, the first column, of at least ``first`` letters, left-aligned, the others right-aligned."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    widths[0] = max(widths[0], first)
    lines = ([name.ljust(widths[0]), *map(str.rjust, cells, widths[1:])] for name, *cells in rows)
    return "\n".join(gap.join(line).rstrip() for line in lines)


def table_html(caption: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in HTML."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Summarized:
    """A result whose certificate has a summary."""

    certificate: Any

    @property
    def message(self) -> str:
        """Result in one sentence."""
        return self.certificate.summary


def data_frame(data: Any, axis: str | None = None, units: Mapping[str, str] | None = None, **how: Any) -> DataFrame:
    """Return a data frame of pandas, its index named by ``axis``, units in its ``attrs``; ``how`` is pandas' own.

    Raises
    ------
    ImportError
        pandas is not installed.
    """
    try:
        import pandas  # type: ignore[import-not-found]
    except ImportError:
        raise ImportError("pandas is not installed: pip install 'boomctl[tables]'") from None
    frame = pandas.DataFrame(data, **how)
    frame.index.name, frame.attrs["units"] = axis, dict(units or {})
    return frame
