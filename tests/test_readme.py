"""Every Python block of the README runs, top to bottom, as a reader would run it."""

import functools
import re
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"


def _blocks():
    """Return the blocks by section and number in it, in the README's order."""
    sections = re.split(r"^## ", README.read_text(), flags=re.MULTILINE)
    return {
        (section.splitlines()[0], number): block
        for section in sections
        for number, block in enumerate(re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL), start=1)
    }


BLOCKS = _blocks()
FIRST = next(iter(BLOCKS))


@functools.cache
def _names_after(section, number):
    """Return the names that a reader has who ran a block and what comes before it."""
    before = (section, number - 1) if number > 1 else FIRST
    names = {} if (section, number) == FIRST else dict(_names_after(*before))
    exec(compile(BLOCKS[section, number], f"README.md, {section}", "exec"), names)
    return names


def _case(section, number):
    slow = "optimal_slew" in BLOCKS[section, number]
    return pytest.param(section, number, marks=pytest.mark.slow if slow else (), id=f"{section} {number}")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """What a block writes is written elsewhere."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("section", "number"), [_case(*key) for key in BLOCKS])
def test_a_block_of_the_readme_runs(section, number):
    assert _names_after(section, number)
