"""Settings of every test: its profile, one thread, and the processor time that a test not marked slow may take."""

import os
import sys
from itertools import pairwise

import pytest
from hypothesis import settings

from tests.profiles import is_quick

# the matrices are small and the tests run side by side: more threads only get into one another's way
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

settings.load_profile("quick")

LIMIT = 2.0  # s of processor time for a test that is not marked slow: a choice, a fiftieth of what all may take
REFERENCE = 0.065  # s of processor time of `_yardstick` on the machine that LIMIT is meant for, measured there
HEAVY = ("casadi", "control", "matplotlib", "scipy.signal")  # imports of a second: not the fault of a test

_SPENT = pytest.StashKey[float]()


def pytest_addoption(parser):
    parser.addoption("--cpu", type=int, default=0, metavar="N", help="show the N tests that take most processor time")


def pytest_collection_modifyitems(items):
    """Put files marked early before all others: what takes long must not begin last."""
    items.sort(key=lambda item: item.get_closest_marker("early") is None)


def _processor_time():
    """Return the seconds this process and its finished children have computed; waiting for others is not counted."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def _yardstick():
    """Return the processor time of a fixed piece of work, the longest of three: how slow the machine is just now."""
    times = [_processor_time()]
    for _ in range(3):
        sum(k * k % 7 for k in range(1_000_000))
        times.append(_processor_time())
    return max(after - before for before, after in pairwise(times))


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    """Charge a test with the fixtures that are made for it alone."""
    began = _processor_time()
    try:
        return (yield)
    finally:
        spent = _processor_time() - began
        if fixturedef.scope == "function":
            request.node.stash[_SPENT] = request.node.stash.get(_SPENT, 0.0) + spent
        else:
            request._pyfuncitem.user_properties.append((f"fixture {fixturedef.argname}", spent))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Fail a test that is not marked slow and takes more than LIMIT."""
    loaded, began = set(sys.modules), _processor_time()
    result = yield
    spent = item.stash.get(_SPENT, 0.0) + _processor_time() - began
    item.user_properties.append(("call", spent))
    if spent > LIMIT and is_quick() and not item.get_closest_marker("slow") and loaded.issuperset(HEAVY):
        allowed = LIMIT * max(1.0, _yardstick() / REFERENCE)
        if spent > allowed:
            pytest.fail(
                f"took {spent:.1f} s of processor time, expected <= {allowed:.1f}: make it cheaper or mark it slow",
                pytrace=False,
            )
    return result


def pytest_terminal_summary(terminalreporter, config):
    """Show where the processor time went: tests, and fixtures that several tests share."""
    spent = sorted(
        (
            (seconds, what, report.nodeid)
            for outcome in ("passed", "failed")
            for report in terminalreporter.stats.get(outcome, ())
            if report.when == "call"
            for what, seconds in report.user_properties
        ),
        reverse=True,
    )
    if config.option.cpu:
        terminalreporter.section(f"processor time: {sum(seconds for seconds, _, _ in spent):.0f} s in tests")
        for seconds, what, name in spent[: config.option.cpu]:
            terminalreporter.line(f"{seconds:6.2f} s  {name}  {what if what != 'call' else ''}")
