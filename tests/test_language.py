"""Language of docs, docstrings, comments and messages: words that CONTRIBUTING.md excludes, and numpydoc."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

from tests.public import functions

ROOT = Path(__file__).parents[1]
BANNED = (
    "anew|asks|beside|dear|doubtful|feels|felt|hardly|judged|judges|likewise|mended|nobody|outlives|programme|programmes|refuse|"
    "refused|refuses|seen|shall|swings|taste|told|tells|unfelt|vouch|vouches|whatever|whichever|worth"
)
WORD = re.compile(rf"(?<![\w.`])({BANNED})(?![\w`])", re.IGNORECASE)
NUMPYDOC = re.compile(r"SS0[2-6]|PR0[1256789]|PR10|RT0[1345]")  # summaries, parameters, returned values


def _texts(path):
    """Yield the docstrings, comments and messages of a file."""
    source = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.value
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


@pytest.mark.slow
def test_words_of_library():
    found = {
        (str(path.relative_to(ROOT)), match[1])
        for path in (ROOT / "boomctl").rglob("*.py")
        for text in _texts(path)
        for match in WORD.finditer(text)
    }
    assert not found


def test_words_of_documentation():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")]
    assert not {(page.name, match[1]) for page in pages for match in WORD.finditer(page.read_text(encoding="utf-8"))}


@pytest.mark.slow
def test_docstrings_of_public_functions_are_numpydoc():
    from numpydoc.validate import validate

    found = {}
    for function, name in functions().items():
        errors = validate(f"{function.__module__}.{function.__qualname__}")["errors"]
        if wrong := [error for error in errors if NUMPYDOC.fullmatch(error[0])]:
            found[name] = wrong
    assert not found
