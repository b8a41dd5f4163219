"""What is measured: a question, its exact answer, who answers it at which settings, and what is promised of that."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any, Literal

from boomctl.lab.benchmark.diagram import Shown
from boomctl.lab.benchmark.promise import Promise

Tell = Callable[[str], None]
"""Told in words what comes next."""

Extent = Literal["quick", "whole"]
"""How much is measured: all scenes in a minute, with few settings; or in a quarter of an hour, with all."""


@dataclass(frozen=True)
class Setting:
    """A competitor at one of its settings.

    Attributes
    ----------
    competitor : str
        Who answers and how, e.g. "finite elements" or "python-control, finite elements"; settings of one are joined by a
        line.
    label : str
        The setting, short: "20 elements", "rtol 1e-6".
    ours : bool
        Whether it is this package.
    cold : callable or None
        Answers from parameters that were never seen before: it is given a small number (1e-9 to 1e-6, another in each call)
        by which to change a parameter, relative, so that nothing kept from a call before serves it; zero in the call whose
        answer is judged.  None: the competitor has no such way.
    hot : callable or None
        Answers again, with what a user would keep ready beforehand; its answer is judged too.  None: as cold.
    prepare : callable
        Makes what ``hot`` is given, once, untimed.
    call : str
        What a user writes to get this, one line of Python; for the table of recommended settings.
    size : int, optional
        What cost or error is shown over: unknowns that move with a mass of their own, elements, samples.
    """

    competitor: str
    label: str
    ours: bool
    cold: Callable[[float], Any] | None = None
    hot: Callable[[Any], Any] | None = None
    prepare: Callable[[], Any] = lambda: None
    call: str = ""
    size: int | None = None


def asked(
    competitor: str,
    label: str,
    made: Callable[[float], Any],
    ask: Callable[[Any], Any],
    *,
    ours: bool = False,
    call: str = "",
    size: int | None = None,
) -> Setting:
    """Return a setting that makes a model of changed parameters and asks it: in cold calls both, in hot ones the latter.

    Parameters
    ----------
    competitor, label, ours, call, size
        As of :class:`Setting`.
    made : callable
        Makes a model of parameters that are changed by so much; for hot calls by nothing.
    ask : callable
        Takes what was made to the answer.
    """

    def cold(change: float) -> Any:
        return ask(made(change))

    return Setting(competitor, label, ours, cold, ask, lambda: made(0.0), call, size)


@dataclass(frozen=True)
class Scene:
    """A question, and who answers it.

    Attributes
    ----------
    key : str
        Short name, for files and the command line: "boom-sigma".
    title : str
        Of the diagram.
    question : str
        What is computed, from what to what, in one or two sentences.
    settings : tuple of Setting
    measure : str
        What the error is, in one sentence, and against which reference.
    error : callable
        Takes an answer to its relative error; what is not finite counts as infinite.  By default there is none to be had.
    missing : tuple of str
        Peers that are not installed, or cannot do this, with the reason; named in the report.
    remarks : tuple of str
        What a reader has to know to read the diagram.
    promises : tuple of Promise
        What this package promised itself.
    found : callable
        Takes an answer to further numbers, by name, that promises are about.
    elsewhere : callable
        Processor time that was spent on answers so far by other processes that run on [s]; it counts as ours does.
    shows : str
        What is drawn of it: "front", run time over error of all who answer; "unknowns", that and error over size;
        "promises", nothing.
    share : float
        Of the seconds that a scene is given.
    """

    key: str
    title: str
    question: str
    settings: tuple[Setting, ...]
    measure: str = "none."
    error: Callable[[Any], float] = field(default=lambda answer: 0.0)
    missing: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    promises: tuple[Promise, ...] = ()
    found: Callable[[Any], Mapping[str, float]] = field(default=lambda answer: {})
    elsewhere: Callable[[], float] = field(default=lambda: 0.0)
    shows: Shown = "front"
    share: float = 1.0


SceneMaker = Callable[[Extent], Scene]
"""Makes a scene; its reference is found when an answer is judged."""


def there(module: str) -> bool:
    """Return whether a module can be imported."""
    return find_spec(module) is not None


def missing(**needed: str) -> tuple[str, ...]:
    """Return what is to be said of modules that are not installed: name of the peer, by the module it needs."""
    absent = {peer.replace("_", " "): module for peer, module in needed.items() if not there(module)}
    return tuple(f"{peer}: {'' if peer == module else f'{module} is '}not installed" for peer, module in absent.items())
