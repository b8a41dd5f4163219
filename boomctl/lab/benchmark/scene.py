"""A scene of the benchmark: one problem, its reference solution, and the methods that solve it at various settings."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from itertools import chain
from typing import Any

import numpy as np

from boomctl.arrays import Array


@dataclass(frozen=True)
class Setting:
    """A method at one of its settings.

    Attributes
    ----------
    method : str
        Program and algorithm; a line joins the settings of one method in the pictures.
    label : str
        The setting, e.g. "20 elements".
    solve : callable
        Takes the problem and a relative change of one of its parameters to the answer, everything built from scratch.
    verified : bool
        Whether the method checks its answer by an independent computation within the run time shown.
    modules : tuple of str
        What has to be installed.
    ours : bool
        Whether it is this package.
    size : int
        Size of the problem, where run time is measured over it and no error; 0 otherwise.
    call : str
        Code of a call of this package, for the page of the documentation.
    """

    method: str
    label: str
    solve: Callable[[Any, float], Any]
    verified: bool = False
    modules: tuple[str, ...] = ()
    ours: bool = False
    size: int = 0
    call: str = ""

    @property
    def missing(self) -> str:
        """Why the method cannot be measured here; empty if it can."""
        absent = (name for name in self.modules if find_spec(name.partition(".")[0]) is None)
        return ", ".join(f"{name.partition('.')[0]} is not installed" for name in absent)


def settings(
    method: str, label: str, values: Iterable[Any], solve: Callable[..., Any], *, call: str = "", **kind: Any
) -> Iterator[Setting]:
    """Yield the settings of one method, the one with the largest error first.

    Parameters
    ----------
    method : str
    label : str
        Label, with ``{}`` for the values of a setting.
    values : iterable
        A value, or a tuple of values, for each setting.
    solve : callable
        Takes these values, the problem and the relative change of a parameter to the answer.
    call : str
        Code of the call, with ``{}`` as in `label`.
    **kind
        ``verified``, ``modules``, ``ours`` of :class:`Setting`.
    """
    for value in values:
        item = value if isinstance(value, tuple) else (value,)
        yield Setting(method, label.format(*item), partial(solve, *item), call=call.format(*item), **kind)


def sized(*chosen: Iterable[Setting]) -> Iterator[Setting]:
    """Yield settings, whose labels begin with the size of the problem, for run times over size instead of errors."""
    for setting in chain(*chosen):
        yield replace(setting, size=int(setting.label.split()[0]))


def relative_error(least: float = 0.0) -> Callable[[Any, Array, Array], float]:
    """Return the error of a scene whose answers are arrays: the largest over the largest true value; at least ``least``."""
    return lambda problem, true, answer: max(float(np.abs(answer - true).max() / np.abs(true).max()), least)


@dataclass(frozen=True)
class Scene:
    """One problem and the methods that solve it.

    Attributes
    ----------
    title, question, measure : str
        Title, what is computed from what, and what the error is of an answer.
    reference : callable
        Takes the problem to what the answers are compared with.
    error : callable
        Takes the problem, the reference and an answer to the error.
    methods : iterable of Setting
        Settings whose error is measured, and those of other sizes.
    remarks : tuple of str
        What a reader has to know to read the picture.
    problem : callable
        Makes what all methods are given; not timed.
    """

    title: str
    question: str
    measure: str
    reference: Callable[[Any], Any]
    error: Callable[[Any, Any, Any], float]
    methods: Iterable[Setting]
    remarks: tuple[str, ...] = ()
    problem: Callable[[], Any] = lambda: None

    @cached_property
    def settings(self) -> tuple[Setting, ...]:
        """All settings of all methods."""
        return tuple(self.methods)

    @property
    def few(self) -> Mapping[int, Setting]:
        """Every third setting of each method, by its place among all; none of other sizes."""
        indices: dict[str, list[int]] = {}
        for index, setting in enumerate(self.settings):
            indices.setdefault(setting.method, []).extend([] if setting.size else [index])
        return {index: self.settings[index] for result in indices.values() for index in result[::3]}
