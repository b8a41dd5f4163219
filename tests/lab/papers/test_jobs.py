"""Jobs of the reproductions: the same results in parallel processes and in one, and errors that end all of them."""

import math
import os
import time
from concurrent.futures.process import BrokenProcessPool
from functools import partial

import pytest

from boomctl.lab.papers.jobs import run_jobs

ROOTS = {f"root of {k}": partial(math.sqrt, k) for k in range(7)}


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_run_jobs_returns_results_by_name_in_order(workers):
    told = []
    found = run_jobs(ROOTS, workers, lambda *stage: told.append(stage))
    assert list(found.items()) == [(name, work()) for name, work in ROOTS.items()]
    assert told == [(name, k, len(ROOTS)) for k, name in enumerate(ROOTS)]
    assert run_jobs({}, workers) == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "error"), [(partial(math.sqrt, -1.0), ValueError), (partial(os._exit, 3), BrokenProcessPool)]
)
def test_run_jobs_error_ends_the_other_jobs(work, error):
    began = time.monotonic()
    with pytest.raises(error):
        run_jobs({"wrong": work, "long": partial(time.sleep, 600.0)}, 2)
    assert time.monotonic() - began < 300.0
