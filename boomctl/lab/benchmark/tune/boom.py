"""Lines of the benchmark on suspensions of the boom that were tuned over the whole box, as ``boomctl design`` judges them."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from math import inf, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from boomctl.lab.benchmark.report import Row, Tell

_SECTION = "Suspensions of the boom, springs ±30 % and mass ±20 %"
_PATIENCE = 1200.0  # given to the making and judging of one design [s]; they take a minute or two
_BAD_USE = 2  # exit code of a command that is given what there is not
# largest certified peak, proved worst peak, deposit CV and force [N] asked for
LIMITS = {"tuned_suspension": (9.3, 10.2, 0.0112, 13.0), "codesign": (7.9, 9.9, 0.0112, 13.0)}


def boom_lines(full: bool, tell: Tell) -> Iterator[Row]:
    """Judge the tuned suspensions that come with boomctl, each in a process of its own."""
    del full
    for name, limits in LIMITS.items():
        tell(f"design {name}")
        found = _judged(name)
        if found is not None:
            yield from design_rows(name, found, limits)


def design_rows(name: str, found: Mapping[str, Any], limits: tuple[float, ...]) -> Iterator[Row]:
    """Return the lines of a design from its ``results.json``."""
    bounds = [half["upper_bound"] for half in (found["worst_case"] or {}).values()]
    worst = max(inf if bound is None else bound for bound in bounds) if bounds else inf
    active = found["active"]
    seen = (active["peak_upper_bound"], worst, active["deposit_cv"], active["force"])
    states = found["controller"]["states"]
    for word, value, limit in zip(("peak", "proved worst peak", "deposit CV", "force [N]"), seen, limits, strict=True):
        target, met = (f"<= {limit:g}", float(value) <= limit) if isfinite(limit) else ("", None)
        yield Row(_SECTION, f"{name}, {states} states: {word} {value:.4g}", target=target, met=met)


def _judged(name: str) -> dict[str, Any] | None:
    """Return the results of a design; None where it does not come with boomctl.

    Raises
    ------
    RuntimeError
        It fails; the message is its own.
    """
    home = str(Path(__file__).resolve().parents[4])
    paths = os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])
    with TemporaryDirectory(prefix="boomctl-") as folder:
        done = subprocess.run(
            [sys.executable, "-P", "-m", "boomctl.cli", "design", name, "--json", "--out", folder],
            capture_output=True,
            text=True,
            env=os.environ | {"PYTHONPATH": paths},
            timeout=_PATIENCE,
        )
    if done.returncode == _BAD_USE:
        return None
    if done.returncode:
        raise RuntimeError(f"design {name!r}: {done.stderr.strip()}")
    return json.loads(done.stdout)
