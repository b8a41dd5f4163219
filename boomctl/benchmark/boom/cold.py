"""Cold paths: what a user waits for at a first call or a command, in a process of its own, beside the import it stands on."""

from boomctl.benchmark.boom.scene import Scene, Settings
from boomctl.benchmark.report import Measured, Row, Sheet, Tell, race
from boomctl.benchmark.timing import fresh_processes

_LINALG = "import numpy, scipy.linalg"
_COMMAND = """import sys
sys.argv[1:] = {!r}.split()
from boomctl.cli import main
try:
    main()
except SystemExit:
    pass"""

# job, its lines of Python, those it stands beside, and how many times as long it may take: what this package promised itself
_COLD = (
    ("import boomctl", "import boomctl", "import numpy", 1.5),
    ("first BoomParameters()", "import boomctl as bc; bc.BoomParameters()", _LINALG, 1.0),
    ("first spray_boom()", "import boomctl as bc; bc.spray_boom()", _LINALG, 2.0),
    ("first sigma(boom), peak", "import boomctl as bc; bc.sigma(bc.spray_boom()).peak", _LINALG, 2.5),
    ("boomctl sigma --json", _COMMAND.format("sigma --json"), _LINALG, 2.5),
    ("boomctl parameters", _COMMAND.format("parameters"), _COMMAND.format("--version"), 1.3),
)
_PEERS = {_LINALG: _LINALG, "import numpy": "import numpy", _COMMAND.format("--version"): "boomctl --version"}


def cold_lines(ground: Scene, settings: Settings, tell: Tell) -> list[Row | Sheet]:
    """Compare first calls and commands, each in a new process, with the import or command that each stands on."""
    del ground  # each process makes its own
    if not settings.processes:
        return []
    tell("first calls and commands in new processes")
    times = fresh_processes([*dict.fromkeys(code for line in _COLD for code in line[1:3])], settings.processes)
    return [
        race(
            f"Cold, new process; peer: {_PEERS[peer]}",
            f"cold: {job}",
            Measured(times[code]),
            Measured(times[peer]),
            f"<= {limit:g} x peer",
            times[code] <= limit * times[peer],
        )
        for job, code, peer, limit in _COLD
    ]
