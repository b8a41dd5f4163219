"""The public face is frozen: names, parameters and their defaults, members of models and results.

`tests/public_names.txt` holds one line a name. After a deliberate change, write it anew and look at the difference:

    python -m tests.test_public_names
"""

import difflib
import inspect
import re
from importlib import import_module
from pathlib import Path

import numpy as np

import boomctl
import boomctl.structure
import boomctl.tunable
from boomctl import exceptions

STORED = Path(__file__).with_name("public_names.txt")
_VAGUE = {"chance", "each", "path", "place", "share", "statement"}
# names that end as participles and adverbs do: nouns, and adjectives that control theory and SciPy use
_NOUNS = {"assembly", "damping", "family", "foreshortening", "seed", "spacing", "speed", "to_string", "warning"}
_ADJECTIVES = {
    "certified", "closely_spaced", "commanded", "completed", "converged", "decentralized", "elapsed", "error_std_estimated",
    "fixed", "followed", "proved", "recovered", "reduced", "scaled", "verified",
}  # fmt: skip

# where the models and results that users are handed are exported; their members are listed under the bare class name
PACKAGES = (
    "structure",
    "boom",
    "rotating_beam",
    "analysis",
    "identification",
    "reduction",
    "synthesis",
    "tuning",
    "simulation",
    "slew",
)

EXCEPTIONS = {name: value for name, value in vars(exceptions).items() if isinstance(value, type)}


def _default(value):
    if value is inspect.Parameter.empty:
        return ""
    if value is None or isinstance(value, (bool, int, float, str, tuple)):
        return f"={value!r}"
    return "=..." if isinstance(value, np.ndarray) else f"=<{type(value).__name__}>"


def _parameters(function, bound):
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


def _members(owner):
    """Return a class's public members: fields and properties by name, methods with their parameters."""
    found = {name: "" for name in getattr(owner, "__dataclass_fields__", {}) if not name.startswith("_")}
    for name in dir(owner):
        value = inspect.getattr_static(owner, name)
        home = next((base for base in owner.__mro__ if name in vars(base)), owner)
        if name.startswith("_") or name in found or not home.__module__.startswith("boomctl"):
            continue
        if isinstance(value, (classmethod, staticmethod)):
            found[name] = _parameters(getattr(owner, name), bound=0)
        else:
            found[name] = _parameters(value, bound=1) if inspect.isfunction(value) else ""
    return [name + parameters for name, parameters in found.items()]


def _lines():
    lines = []
    classes = {}
    named = [(exceptions, name) for name in EXCEPTIONS]
    named += [(module, name) for module in (boomctl, boomctl.structure, boomctl.tunable) for name in module.__all__]
    for package in (*PACKAGES, "exchange", "maneuvers", "studies"):
        module = import_module(f"boomctl.{package}")
        functions = [
            name for name in module.__all__ if package == "studies" or inspect.isfunction(getattr(module, name))
        ]
        named += [(module, name) for name in functions if name not in boomctl.__all__]
    for module, name in named:
        value = getattr(module, name)
        if isinstance(value, type):
            classes[name] = value
        refused = isinstance(value, type) and issubclass(value, Exception)
        parameters = _parameters(value, bound=0) if callable(value) and not refused else ""
        lines.append(f"{module.__name__}.{name}{parameters}")
    for package in PACKAGES:
        module = import_module(f"boomctl.{package}")
        classes |= {name: getattr(module, name) for name in module.__all__ if isinstance(getattr(module, name), type)}
    classes["GeometricallyExactBeam"] = type(boomctl.hub_beam(model="geometrically-exact", modes=1))
    for name, owner in classes.items():
        lines += [f"{name}.{member}" for member in _members(owner)]
    return sorted(set(lines))


def test_public_names_are_frozen():
    stored = STORED.read_text().splitlines()
    changes = list(difflib.unified_diff(stored, _lines(), "written down", "now", lineterm="", n=0))
    assert not changes, "\n".join([*changes, "deliberate? python -m tests.test_public_names"])


def test_exceptions_and_warnings_have_common_bases():
    for name, value in EXCEPTIONS.items():
        bases = (exceptions.BoomctlWarning,) if name.endswith("Warning") else (exceptions.BoomctlError, RuntimeError)
        assert value is exceptions.BoomctlError or all(issubclass(value, base) for base in bases), name


def test_names_are_nouns_and_verbs():
    names = {line.partition("(")[0].rpartition(".")[2] for line in STORED.read_text().splitlines()}
    assert not names & _VAGUE
    ends = {name for name in map(str.lower, names) if re.search(r"(ed|ing|ly)$", name)}
    assert {name for name in ends if not name.endswith(tuple(_NOUNS))} <= _ADJECTIVES


if __name__ == "__main__":
    STORED.write_text("\n".join(_lines()) + "\n")
