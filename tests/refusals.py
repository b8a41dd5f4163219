"""Tables of refusals: a row holds a call and the words in which it is refused, a regular expression.

Rows are ``CALL -> WORDS``, or ``CALL -> ERROR: WORDS`` where it is neither a TypeError nor a ValueError; an indented line
continues a row, ``#`` begins a comment.  A call may use all public names and those of its file.  Tables are for
combinations of arguments: `tests.fuzz` tries wrong kinds, shapes and numbers in every argument of every public function.
"""

import re
from dataclasses import replace

import control
import numpy as np
import pytest

import boomctl as bc
from tests import handed_out
from tests.public import EXCEPTIONS, public

NAMES = {"bc": bc, "control": control, "np": np, "one": handed_out, "replace": replace, "T": bc.tunable}
NAMES |= {name.rpartition(".")[2]: value for name, value in public().items()}


def refusals(quick, slow=""):
    """Return the decorator that gives a test the rows of a table one by one, and in slow runs those of another."""
    rows = [
        pytest.param(call, words, marks=marks, id=re.sub(r"\W+", " ", words)[:40])
        for table, marks in ((quick, ()), (slow, pytest.mark.slow))
        for call, words in re.findall(r"^(?![# \n])(.+?(?:\n +.+?)*?)\s+-> (.+)$", table, flags=re.MULTILINE)
    ]
    assert len(rows) == f"{quick}{slow}".count(" -> "), "rows that cannot be read"
    return pytest.mark.parametrize(("call", "words"), rows)


def assert_refused(call, words, names):
    """Assert that a call is refused in one line, by the error and in the words of its row; names: of the table's file."""
    kind, text = re.fullmatch(r"(?:(\w+Error): )?(.+)", words).groups()
    expected = eval(kind or "TypeError, ValueError", {**EXCEPTIONS})
    with np.errstate(all="ignore"), pytest.raises(expected, match=text) as refused:
        eval(call, NAMES | names)
    assert "\n" not in str(refused.value)
