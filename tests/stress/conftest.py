"""The fixture that records how exact an answer is, and fails where it is neither exact nor refused nor called uncertain."""

import inspect
import warnings
from math import isfinite

import pytest

from boomctl.exceptions import BoomctlWarning
from tests.stress.cases import raised_by_boomctl


@pytest.fixture
def check_error(request, record_property):
    """Return the function ``check_error(compute, limit, may_refuse=False)``.

    ``compute`` returns an error against a reference, or that and whether the answer is certified.  The test passes if the
    error is at most the limit ("exact"), or if the answer is not certified or comes with a warning of the package
    ("uncertified"), or, where ``may_refuse``, if the package raises an error of its own ("refused").  A warning of an inner
    library fails it.  The test's docstring says how the error is measured; without one nothing is recorded.
    """
    measure = " ".join((inspect.getdoc(request.function) or "").split())

    def record(outcome, error, limit, message):
        if measure:
            record_property("accuracy", (outcome, error, limit, message, measure))

    def check(compute, limit, may_refuse=False):
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            try:
                found = compute()
            except Exception as error:
                if not (may_refuse and raised_by_boomctl(error)):
                    raise
                record("refused", "", limit, " ".join(str(error).split()))
                return
        inner = [str(warning.message) for warning in noted if issubclass(warning.category, RuntimeWarning)]
        assert not inner
        error, certified = found if isinstance(found, tuple) else (found, True)
        said = [str(warning.message) for warning in noted if warning.category in BoomctlWarning.__subclasses__()]
        exact = isfinite(error) and error <= limit
        outcome = "exact" if exact else "uncertified" if said or not certified else "wrong"
        record(outcome, f"{error:.1e}", limit, "; ".join(said))
        assert outcome != "wrong", f"error {error:.3g}, limit {limit:.3g}"

    return check
