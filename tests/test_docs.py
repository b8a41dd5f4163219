"""The pages of the documentation: examples run, every public name stands on one page, the site builds without a warning."""

import dataclasses
import doctest
import importlib.util
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import boomctl
import boomctl.structure
import boomctl.tunable
from boomctl.lazy import MOVED
from tests import fuzz
from tests.test_public_names import PACKAGES

DOCS = Path(__file__).parents[1] / "docs"
LONG = ("optimal_slew", "worst_case", "executor=2")  # what takes seconds

HANDED_OUT = (  # classes of what functions and results hold, which are exported nowhere
    ("report", "Report"),
    ("rotating_beam.exact.beam", "GeometricallyExactBeam"),
    ("structure.families", "Slope"),
    ("structure.parts", "Ground"),
    ("studies.machine", "MachineResult"),
    ("studies.slew.design", "SlewEvaluation"),
    ("studies.spin_up", "SpinUpResult"),
    ("studies.suspension.assurance", "Assurance"),
    ("studies.suspension.assurance", "HalfAssurance"),
    ("studies.suspension.design", "SuspensionResult"),
    ("studies.suspension.passive_assurance", "PassiveAssurance"),
    ("studies.suspension.performance", "Performance"),
    ("studies.sweeps.result", "FailedPoint"),
    ("studies.sweeps.result", "SweepResult"),
    ("synthesis.lq.lqr", "LqrCertificate"),
    ("synthesis.lq.output_feedback", "FeedbackCertificate"),
    ("synthesis.lq.output_feedback", "QuadraticNorm"),
    ("synthesis.lq.riccati", "RiccatiCertificate"),
)


def _pages():
    found = []
    for page in sorted(DOCS.glob("*.md")):
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        if blocks:
            slow = any(name in block for block in blocks for name in LONG)
            found.append(pytest.param(page.name, blocks, marks=pytest.mark.slow if slow else (), id=page.stem))
    return found


@pytest.mark.parametrize(("name", "blocks"), _pages())
def test_the_examples_of_a_page_run(name, blocks, tmp_path, monkeypatch):
    """From the first to the last, as a reader would run them."""
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for block in blocks:
        exec(compile(block, name, "exec"), names)
    results = [value for value in names.values() if hasattr(value, "certificate")]
    assert all(getattr(value.certificate, "certified", True) for value in results)
    assert set(names) > {"__builtins__"}


def test_every_public_name_stands_on_one_page():
    listed = [
        name
        for page in (DOCS / "api").glob("*.md")
        for name in re.findall(r"^   boomctl\.(\S+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    ]
    parts = (
        *(f"structure.{name}" for name in boomctl.structure.__all__),
        *(f"tunable.{name}" for name in boomctl.tunable.__all__),
    )
    public = {*boomctl.__all__, *parts, *(f"{package}.{name}" for name, package in MOVED.items())} - {"__version__"}
    assert sorted(listed) == sorted(public)


def _public():
    """Yield what users are handed by name: the name and the function or class."""
    for module in (
        boomctl,
        boomctl.structure,
        boomctl.tunable,
        *(importlib.import_module(f"boomctl.{name}") for name in PACKAGES),
    ):
        for name in module.__all__:
            if callable(value := getattr(module, name)):
                yield f"{module.__name__}.{name}", value
    for module, name in HANDED_OUT:
        yield f"boomctl.{module}.{name}", getattr(importlib.import_module(f"boomctl.{module}"), name)


FUNCTIONS = {value: name for name, value in reversed([*_public()]) if not isinstance(value, type)}
RECORDS = {
    value: value.__name__ for _, value in _public() if isinstance(value, type) and not issubclass(value, Exception)
}


def _methods():
    """Yield the public methods of what users are handed, each where it is written."""
    seen = set()
    for owner in RECORDS:
        for name in dir(owner):
            value = inspect.getattr_static(owner, name)
            bound = not isinstance(value, staticmethod)
            value = getattr(value, "__func__", value)
            if not name.startswith("_") and inspect.isfunction(value) and value not in seen:
                seen.add(value)
                yield pytest.param(value, bound, id=value.__qualname__)


def _sections(documented):
    """Return the sections of a docstring: of each its entries, the first line of one and what is said of it."""
    found = {}
    text = inspect.getdoc(documented) or ""
    parts = re.split(r"^(\w+)\n-{3,}\n", text, flags=re.MULTILINE)
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        entries = re.findall(r"^(\S.*)\n((?:(?:    .*)?\n|    .*$)*)", body.rstrip() + "\n", flags=re.MULTILINE)
        found[title] = [(first, said.strip()) for first, said in entries]
    return found


def _names(entries):
    """Return the names that stand in front of the colons, without stars."""
    return {name.strip(" *") for first, _ in entries for name in first.partition(" : ")[0].split(",")}


def _bare(sections, *titles):
    """Return the entries that nothing is said of but a type and a unit."""
    return [first for title in titles for first, said in sections.get(title, []) if not re.sub(r"\[.*?\]", "", said)]


@pytest.mark.parametrize(
    ("function", "bound"),
    [*(pytest.param(value, False, id=name) for value, name in FUNCTIONS.items()), *_methods()],
)
def test_a_function_says_what_it_takes_and_what_it_returns(function, bound):
    """Every argument in words, and of what is returned more than its type."""
    sections = _sections(function)
    assert _names(sections.get("Parameters", [])) == set(list(inspect.signature(function).parameters)[bound:])
    assert sections["Returns"]
    assert not _bare(sections, "Parameters", "Returns", "Raises")


@pytest.mark.parametrize("function", FUNCTIONS, ids=FUNCTIONS.values())
def test_a_function_shows_how_it_is_called_and_says_what_it_refuses(function):
    """From the import on, and by the name that users know; what takes something refuses something."""
    assert _sections(function).get("Raises") or not inspect.signature(function).parameters
    shown = doctest.DocTestParser().get_examples(function.__doc__)
    assert shown
    assert shown[0].source == "import boomctl as bc\n"
    assert any(f".{function.__name__}(" in example.source for example in shown)


@pytest.mark.parametrize("owner", RECORDS, ids=RECORDS.values())
def test_a_class_says_what_its_fields_are(owner):
    sections = _sections(owner)
    fields = {field.name for field in dataclasses.fields(owner)} if dataclasses.is_dataclass(owner) else set()
    fields = {name for name in fields if not name.startswith("_")}
    assert fields <= _names([*sections.get("Parameters", []), *sections.get("Attributes", [])])
    assert not _bare(sections, "Parameters", "Attributes", "Raises")


NEVER_RIGHT = (object(), float("nan"), "no such word")  # what no argument may be, of three kinds


@pytest.mark.parametrize("call", [*fuzz.CALLS, *fuzz.METHODS])
def test_what_is_raised_stands_under_raises(call, tmp_path, monkeypatch):
    """Whatever wrong thing stands in place of one argument."""
    monkeypatch.chdir(tmp_path)
    function, made = fuzz.function_of(call), fuzz.METHODS[call][1] if call in fuzz.METHODS else fuzz.CALLS[call]
    raised = set()
    for name in made():
        for value in NEVER_RIGHT:
            given = made() | {name: value}
            positional = [given.pop("*")] if "*" in given else []
            try:
                function(*positional, **given)
            except Exception as error:
                raised.add(type(error))
    said = {name.strip() for kinds, _ in _sections(function).get("Raises", []) for name in kinds.split(",")}
    assert not [kind.__name__ for kind in raised if not said & {base.__name__ for base in kind.__mro__}]


@pytest.mark.slow
def test_the_examples_of_docstrings_run():
    """Of all modules but the workers that are processes of their own."""
    tried = set()
    for found in pkgutil.walk_packages(boomctl.__path__, "boomctl."):
        if found.name.rpartition(".")[2].startswith("_"):
            continue
        for example in doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(found.name)):
            if example.examples:
                tried.add(example.name)
                assert not doctest.DocTestRunner().run(example).failed, example.name
    assert not {f"{function.__module__}.{function.__qualname__}" for function in FUNCTIONS} - tried


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("myst_nb") is None, reason="sphinx and myst-nb are not installed")
def test_the_site_builds_without_a_warning(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for page in (
        "index",
        "theory",
        "verification",
        "known_limits",
        "glossary",
        "api/index",
        "api/generated/boomctl.sigma",
    ):
        assert (tmp_path / f"{page}.html").stat().st_size > 2000
    assert "<math" in (tmp_path / "theory.html").read_text(encoding="utf-8")
    assert "Returns" in (tmp_path / "api/generated/boomctl.sigma.html").read_text(encoding="utf-8")
