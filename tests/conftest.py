"""Settings of every test: its profile, one thread, and what is said of tests that take long and are not marked slow."""

import csv
import gc
import inspect
import os
import re
import sys

import pytest
from hypothesis import is_hypothesis_test, settings

from tests.profiles import is_quick

# the matrices are small and the tests run side by side: more threads only get into one another's way
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# what one process compiles, the workers and the programs that tests start need not compile again
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

settings.load_profile("quick")

LIMIT = 1.0  # s of processor time: a test that takes more and is not marked slow is named
HEAVY = ("casadi", "control", "matplotlib", "scipy.signal")  # imports of a second: not the fault of a test

OTHER = re.compile("is_quick|is_hunt|skip")  # words of a file whose tests differ by profile, or by what is installed


def pytest_addoption(parser):
    parser.addoption("--accuracy", metavar="FILE", help="write how exact each answer in tests/stress is, as CSV")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Put files marked early before all others: what takes long must not begin last.  Mark what does more in full."""
    items.sort(key=lambda item: item.get_closest_marker("early") is None)
    other = {module: bool(OTHER.search(inspect.getsource(module))) for module in {item.module for item in items}}
    for item in items:
        if other[item.module] or is_hypothesis_test(item.obj):
            item.add_marker("full")


def pytest_collection_finish():
    """Leave out of every later search for garbage what lives to the end: modules, and thousands of tests."""
    gc.collect()
    gc.freeze()


def _processor_time():
    """Return the seconds this process and its finished children have computed; waiting for others is not counted."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Note what a test took, and what is too much for one that is not marked slow."""
    loaded, began = set(sys.modules), _processor_time()
    result = yield
    spent = _processor_time() - began
    if spent > LIMIT and is_quick() and not item.get_closest_marker("slow") and loaded.issuperset(HEAVY):
        item.user_properties.append(("long", spent))
    return result


def pytest_terminal_summary(terminalreporter, config):
    """Write how exact answers are, if asked for; name tests that take too long."""
    noted = [
        (value, what, report.nodeid)
        for outcome in ("passed", "failed")
        for report in terminalreporter.stats.get(outcome, ())
        if report.when == "call"
        for what, value in report.user_properties
    ]
    if config.option.accuracy:
        rows = sorted((name, *value) for value, what, name in noted if what == "accuracy")
        with open(config.option.accuracy, "w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([("test", "outcome", "error", "limit", "message", "measure"), *rows])
    for seconds, name in sorted(((value, name) for value, what, name in noted if what == "long"), reverse=True):
        terminalreporter.line(f"{seconds:.1f} s of processor time, make it cheaper or mark it slow: {name}")
