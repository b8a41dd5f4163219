"""Profiles: how many examples a property is tried on, said once for the whole suite.

``quick`` is what plain ``pytest`` runs, ``full`` what runs on every change, ``hunt`` draws new examples, and many. Of what
takes long for every case ``full`` tries some cases, ``hunt`` all. The first two draw the same examples on every run, so that
a failure is one of the change.
"""

from math import ceil

from hypothesis import HealthCheck, settings

ALL = 100  # examples of a property that names no number: hypothesis's own default
QUICK = 3  # of a hundred: the whole suite then takes a minute on two cores
FULL = 20  # of a hundred: all tests, the slow ones too, then take some half an hour on two cores
HUNT = 1000  # of a hundred: ten times as many as a property names, a choice
FEWEST = 2  # examples of any property: one would not tell a law from a coincidence

for _name, _count in (("quick", QUICK), ("full", FULL), ("hunt", HUNT)):
    settings.register_profile(
        _name,
        deadline=None,
        max_examples=_count,
        derandomize=_name != "hunt",
        suppress_health_check=[HealthCheck.too_slow],
    )


def examples(count):
    """Return the decorator that gives a property another number of examples than :data:`ALL`.

    Each profile draws its share of them.
    """
    return settings(max_examples=max(min(count, FEWEST), ceil(count * settings().max_examples / ALL)))


def is_quick():
    """Return whether the quick profile runs."""
    return settings().max_examples == QUICK


def is_hunt():
    """Return whether the profile runs that tries all cases of what takes long."""
    return settings().max_examples == HUNT
