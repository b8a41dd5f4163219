"""The pages of the documentation: examples run, every public name stands on one page, the site builds without a warning."""

import dataclasses
import doctest
import importlib.util
import inspect
import pkgutil
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

import boomctl
from tests.docstrings import sections
from tests.public import EXCEPTIONS, HANDED_OUT, functions, public, records

pytestmark = pytest.mark.early

DOCS = Path(__file__).parents[1] / "docs"


def _pages():
    found = []
    for page in sorted(DOCS.rglob("*.md")):
        blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        if blocks:
            found.append(pytest.param(page.name, blocks, id=page.stem))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("name", "blocks"), _pages())
def test_the_examples_of_a_page_run(name, blocks, tmp_path, monkeypatch):
    """From the first to the last, as a reader would run them."""
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    with mpl.rc_context():
        for block in blocks:
            exec(compile(block, name, "exec"), names)
    plt.close("all")
    results = [value for value in names.values() if hasattr(value, "certificate")]
    assert all(getattr(value.certificate, "verified", True) for value in results)
    assert set(names) > {"__builtins__"}


@cache
def _listed():
    """Return the names that "Functions by task" and its pages list."""
    pages = [page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md")]
    return [name for page in pages for name in re.findall(r"^   ~?boomctl\.(\S+)$", page, flags=re.MULTILINE)]


def test_every_public_name_stands_on_one_page():
    raised = {f"exceptions.{name}" for name in EXCEPTIONS}
    assert sorted(_listed()) == sorted({*public(), *HANDED_OUT, *raised} - {"__version__"})


def _methods():
    """Yield the public methods of what users are handed, each where it is written, its name, and whether it is bound."""
    seen = set()
    for owner in records():
        for name in dir(owner):
            value = inspect.getattr_static(owner, name)
            bound = not isinstance(value, staticmethod)
            value = getattr(value, "__func__", value)
            ours = inspect.isfunction(value) and value.__module__.startswith("boomctl")
            if ours and not name.startswith("_") and value not in seen:
                seen.add(value)
                yield value, value.__qualname__, bound


def _names(entries):
    """Return the names that stand in front of the colons, without stars."""
    return {name.strip(" *") for first, _ in entries for name in first.partition(" : ")[0].split(",")}


def _bare(said, *titles):
    """Return the entries that nothing is said of but a type and a unit."""
    return [first for title in titles for first, words in said.get(title, []) if not re.sub(r"\[.*?\]", "", words)]


def test_functions_say_what_they_take_and_what_they_return():
    """Every argument in words, and of what is returned more than its type."""
    for function, name, bound in [*((value, name, False) for value, name in functions().items()), *_methods()]:
        said = sections(function)
        assert _names(said.get("Parameters", [])) == set(list(inspect.signature(function).parameters)[bound:]), name
        assert said["Returns"], name
        assert not _bare(said, "Parameters", "Returns", "Raises"), name


def test_functions_have_examples_and_raises():
    """From the import on, and by the name that users know; what takes something refuses something."""
    for function, name in functions().items():
        assert sections(function).get("Raises") or not inspect.signature(function).parameters, name
        shown = doctest.DocTestParser().get_examples(function.__doc__)
        assert shown, name
        assert shown[0].source == "import boomctl as bc\n", name
        assert any(f".{function.__name__}(" in example.source for example in shown), name


def test_classes_say_what_their_fields_are():
    for owner, name in records().items():
        said = sections(owner)
        fields = {field.name for field in dataclasses.fields(owner)} if dataclasses.is_dataclass(owner) else set()
        fields = {field for field in fields if not field.startswith("_")}
        assert fields <= _names([*said.get("Parameters", []), *said.get("Attributes", [])]), name
        assert not _bare(said, "Parameters", "Attributes", "Raises"), name


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
    assert not {f"{function.__module__}.{function.__qualname__}" for function in functions()} - tried


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
    assert "<math" in (tmp_path / "explanation" / "models.html").read_text(encoding="utf-8")
    result = (tmp_path / "api" / "generated" / "boomctl.analysis.SigmaResult.html").read_text(encoding="utf-8")
    for said in ('href="boomctl.sigma.html', "Angular frequencies [rad/s]", "Draw the singular values", "bc.sigma("):
        assert said in re.sub(r"</?span[^>]*>", "", result)
