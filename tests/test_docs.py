"""The pages of the documentation: examples run, every public name stands on one page, the site builds without a warning."""

import doctest
import importlib.util
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import boomctl
import boomctl.structure

DOCS = Path(__file__).parents[1] / "docs"
LONG = ("optimal_slew", "worst_case")  # what takes seconds


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
    names = {}
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
    public = {*boomctl.__all__, *(f"structure.{name}" for name in boomctl.structure.__all__)} - {"__version__"}
    assert sorted(listed) == sorted(public)


@pytest.mark.slow
def test_the_examples_of_docstrings_run():
    """Of all modules but the workers that are processes of their own."""
    tried = 0
    for found in pkgutil.walk_packages(boomctl.__path__, "boomctl."):
        if found.name.rpartition(".")[2].startswith("_"):
            continue
        for example in doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(found.name)):
            if example.examples:
                tried += 1
                assert not doctest.DocTestRunner().run(example).failed, example.name
    assert tried >= 12


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
