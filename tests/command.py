"""The command line, called in this process."""

import contextlib
import io
import os
import sys
from dataclasses import dataclass
from unittest import mock

from boomctl.cli import main


@dataclass(frozen=True)
class Done:
    """What a command leaves behind: its exit code and what it printed."""

    returncode: int
    stdout: str
    stderr: str


def boomctl(*words, cwd=None):
    """Run ``boomctl WORDS`` as a terminal would, but without a process of its own."""
    out, err, code = io.StringIO(), io.StringIO(), None
    with (
        contextlib.chdir(cwd or os.getcwd()),
        mock.patch.object(sys, "argv", ["boomctl", *words]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code
    return Done(code, out.getvalue(), err.getvalue())
