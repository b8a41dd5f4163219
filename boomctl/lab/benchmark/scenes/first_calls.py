"""First calls and commands, each in a new process, beside the import that each stands on."""

import os
import subprocess
import sys
from functools import cache, partial
from tempfile import TemporaryDirectory

from boomctl.lab.benchmark.promise import Promise, Who, times_the_cost
from boomctl.lab.benchmark.scene import Extent, Scene, Setting

_LINALG = "import numpy, scipy.linalg"
_COMMAND = """import sys
sys.argv[1:] = {!r}.split()
from boomctl.cli import main
try:
    main()
except SystemExit:
    pass"""
_PATIENCE = 120.0  # given to a process [s]; they take a second at most

_PEERS = {"import numpy alone": "import numpy", _LINALG: _LINALG, "boomctl --version": _COMMAND.format("--version")}
# job, its lines of Python, those it stands beside, and how many times as long it may take: what this package promised itself
_JOBS = (
    ("import boomctl", "import boomctl", "import numpy alone", 1.5),
    ("first BoomParameters()", "import boomctl as bc; bc.BoomParameters()", _LINALG, 1.0),
    ("first spray_boom()", "import boomctl as bc; bc.spray_boom()", _LINALG, 2.0),
    ("first sigma(boom), peak", "import boomctl as bc; bc.sigma(bc.spray_boom()).peak", _LINALG, 2.5),
    ("boomctl sigma --json", _COMMAND.format("sigma --json"), _LINALG, 2.5),
    ("boomctl parameters", _COMMAND.format("parameters"), "boomctl --version", 1.3),
)
_QUICK = 1  # jobs of a quick run


def first_calls(extent: Extent) -> Scene:
    """Return the scene of first calls."""
    jobs = _JOBS[:_QUICK] if extent == "quick" else _JOBS
    promises: list[Promise] = [times_the_cost(Who(job), Who(peer), most, "cold") for job, _, peer, most in jobs]
    peers = dict.fromkeys(peer for _, _, peer, _ in jobs)
    return Scene(
        key="first-calls",
        title="First calls and commands, each in a new process",
        question="From the start of Python to the end of a first call, with bytecode compiled beforehand.",
        measure="none: a process that fails has no answer.",
        settings=(
            *(Setting(job, "new process", ours=True, cold=partial(_process, code)) for job, code, _, _ in jobs),
            *(Setting(peer, "new process", ours=False, cold=partial(_process, _PEERS[peer])) for peer in peers),
        ),
        error=float,
        promises=tuple(promises),
        shows="promises",
    )


def _process(code: str, change: float) -> int:
    """Run some lines of Python in a new process, which knows no parameters to change."""
    words = [sys.executable, "-c", code]
    return subprocess.run(words, capture_output=True, check=True, timeout=_PATIENCE, env=_variables()).returncode


@cache
def _bytecode() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="boomctl-")


def _variables() -> dict[str, str]:
    """Return an environment in which bytecode is kept, also where Python is told not to write it."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | ({"PYTHONPYCACHEPREFIX": _bytecode().name} if sys.dont_write_bytecode else {})
