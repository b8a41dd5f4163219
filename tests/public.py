"""What is public: names, functions, classes and their members, told once for the tests that go through all of them."""

import inspect
from functools import cache
from importlib import import_module

import numpy as np

from boomctl import exceptions

EXCEPTIONS = {name: value for name, value in vars(exceptions).items() if isinstance(value, type)}
# packages whose classes users are handed: their members are public too
PACKAGES = (
    *("structure", "boom", "rotating_beam", "analysis", "identification", "reduction", "synthesis", "tuning"),
    *("simulation", "slew"),
)
BESIDE = ("exchange", "maneuvers", "studies", "tunable")
HANDED_OUT = (  # classes of what functions and results hold, which are exported nowhere
    "report.Report",
    "structure.families.Slope",
    "structure.parts.Ground",
    "studies.evaluation.Finding",
    "studies.machine.MachineResult",
    "studies.slew.SlewEvaluation",
    "studies.suspension.design.SuspensionResult",
    "studies.suspension.performance.Performance",
    "studies.sweeps.result.FailedPoint",
    "studies.sweeps.result.SweepResult",
    "synthesis.hinf.bounds.Bounds",
    "synthesis.lq.riccati.RiccatiSolution",
)


@cache
def public():
    """Return all public names with their values: those of packages begin with the package, where ``bc`` has them not."""
    found = {}
    for room in ("", *PACKAGES, *BESIDE):
        module = import_module(f"boomctl.{room}".rstrip("."))
        for name in module.__all__:
            if not any(getattr(module, name) is value for value in found.values()):
                found[f"{room}.{name}".lstrip(".")] = getattr(module, name)
    return found


@cache
def functions():
    """Return the public functions, each with its name."""
    return {value: name for name, value in public().items() if inspect.isfunction(value)}


@cache
def records():
    """Return the public classes and those that are handed out, each with its name."""
    hidden = {
        name: getattr(import_module(f"boomctl.{name.rpartition('.')[0]}"), name.rpartition(".")[2])
        for name in HANDED_OUT
    }
    return {value: name for name, value in (public() | hidden).items() if isinstance(value, type)}


def _default(value):
    if value is inspect.Parameter.empty:
        return ""
    if value is None or isinstance(value, (bool, int, float, str, tuple)):
        return f"={value!r}"
    return "=..." if isinstance(value, np.ndarray) else f"=<{type(value).__name__}>"


def parameters(function, bound):
    """Return the parameters of a function as they are written in a call: names, stars and defaults."""
    words, keyword_only = [], False
    for parameter in list(inspect.signature(function).parameters.values())[bound:]:
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            keyword_only = True
            words.append("*")
        star = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(parameter.kind, "")
        keyword_only = keyword_only or star == "*"
        words.append(f"{star}{parameter.name}{_default(parameter.default)}")
    return f"({', '.join(words)})"


def members(owner):
    """Return a class's public members: fields and properties by name, methods with their parameters."""
    found = {name: "" for name in getattr(owner, "__dataclass_fields__", {}) if not name.startswith("_")}
    for name in dir(owner):
        value = inspect.getattr_static(owner, name)
        home = next((base for base in owner.__mro__ if name in vars(base)), owner)
        if name.startswith("_") or name in found or not home.__module__.startswith("boomctl"):
            continue
        if isinstance(value, (classmethod, staticmethod)):
            found[name] = parameters(getattr(owner, name), bound=0)
        else:
            found[name] = parameters(value, bound=1) if inspect.isfunction(value) else ""
    return [name + words for name, words in found.items()]
