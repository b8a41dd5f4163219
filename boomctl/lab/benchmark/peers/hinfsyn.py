"""``control.hinfsyn`` as a peer: in a process of its own, which is killed if it hangs."""

import atexit
import json
import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from boomctl.lti.python_control import control

PATIENCE = 120.0  # given to a call of the peer before it is killed [s]; one that ends takes a few


@dataclass(frozen=True)
class Answer:
    """What the peer said: processor time [s], the norm it claims, its controller's matrices; None where it said none."""

    seconds: float | None
    gamma: float | None
    K: list[Any] | None
    error: str = ""

    @cached_property
    def controller(self) -> control.StateSpace | None:
        """The controller, None where there is none."""
        return None if self.K is None else control.ss(*(np.array(part, dtype=float) for part in self.K))


class HinfsynProcess:
    """The process. It ends with this one, with `close`, or when a call of it takes too long; then it answers no more."""

    def __init__(self) -> None:
        home = str(Path(__file__).resolve().parents[4])
        paths = os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "boomctl.lab.benchmark.peers._hinfsyn"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | threads | {"PYTHONPATH": paths},
            text=True,
        )
        self._spent = 0.0
        atexit.register(self.close)

    @property
    def processor_time(self) -> float:
        """Processor time that it has spent on the calls it answered [s]."""
        return self._spent

    def __enter__(self) -> "HinfsynProcess":
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        atexit.unregister(self.close)
        self._process.kill()
        self._process.communicate()

    def ask(self, P: control.StateSpace, nmeas: int, ncon: int) -> Answer:
        """Run it once."""
        source, sink = self._process.stdout, self._process.stdin
        assert source is not None
        assert sink is not None
        plant = {name: np.asarray(getattr(P, name)).tolist() for name in "ABCD"} | {"nmeas": nmeas, "ncon": ncon}
        timer = threading.Timer(PATIENCE, self._process.kill)
        timer.start()
        try:
            sink.write(json.dumps(plant) + "\n")
            sink.flush()
            line = source.readline()
        except OSError:
            line = ""
        finally:
            timer.cancel()
        if not line:
            return Answer(None, None, None, f"killed after {PATIENCE:g} s")
        found = json.loads(line)
        self._spent += found["seconds"]
        return Answer(found["seconds"], found.get("gamma"), found.get("K"), found.get("error", ""))
