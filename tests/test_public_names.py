"""The public face is frozen: names, parameters and their defaults, members of models and results.

`tests/public_names.txt` holds one line a name. After a deliberate change, write it anew and look at the difference:

    python -m tests.test_public_names
"""

import difflib
import inspect
import re
from pathlib import Path

import boomctl
from boomctl import exceptions
from tests.public import EXCEPTIONS, members, parameters, public

STORED = Path(__file__).with_name("public_names.txt")
_VAGUE = {"chance", "each", "path", "place", "share", "statement"}
# names that end as participles and adverbs do: nouns, and adjectives that control theory and SciPy use
_NOUNS = {"assembly", "damping", "family", "foreshortening", "seed", "spacing", "speed", "to_string", "warning"}
_ADJECTIVES = {
    "certified", "closely_spaced", "commanded", "completed", "converged", "decentralized", "elapsed", "error_std_estimated",
    "fixed", "followed", "proved", "recovered", "reduced", "scaled", "verified",
}  # fmt: skip


def _lines():
    structure = {f"structure.{name}": getattr(boomctl.structure, name) for name in boomctl.structure.__all__}
    named = {f"exceptions.{name}": value for name, value in EXCEPTIONS.items()} | structure | public()
    lines, classes = [], {"GeometricallyExactBeam": type(boomctl.hub_beam(model="geometrically-exact", modes=1))}
    for name, value in named.items():
        room, _, last = name.rpartition(".")
        made = isinstance(value, type) and not issubclass(value, Exception)
        if isinstance(value, type) and room not in ("exchange", "maneuvers"):
            classes[last] = value
        if inspect.isfunction(value) or room in ("", "structure", "studies", "tunable", "exceptions"):
            words = parameters(value, bound=0) if inspect.isfunction(value) or made else ""
            lines.append(f"boomctl.{name}{words}")
    return sorted({*lines, *(f"{name}.{member}" for name, owner in classes.items() for member in members(owner))})


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
