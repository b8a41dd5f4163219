"""Profiles: how many examples a property is tried on, said once for the whole suite.

``quick`` is what plain ``pytest`` runs, ``full`` what runs on every change, ``hunt`` draws new examples, and many.
The first two draw the same examples on every run, so that a failure is one of the change.
"""

from math import ceil

from hypothesis import HealthCheck, settings

FULL = 100  # examples of a property that names no number, full profile: hypothesis's own default
QUICK = 3  # of a hundred: the whole suite then takes a minute on two cores
HUNT = 1000  # of a hundred: ten times the full profile, a choice
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
    """Return the decorator that tries a property on so many examples in the full profile, in others in proportion.

    A property without it is tried on :data:`FULL`.
    """
    return settings(max_examples=max(min(count, FEWEST), ceil(count * settings().max_examples / FULL)))


def is_quick():
    """Return whether the quick profile runs."""
    return settings().max_examples == QUICK
