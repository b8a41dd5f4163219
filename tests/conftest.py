"""Settings of every test: the same examples on every run; ``--hypothesis-profile=hunt`` draws new ones, and more."""

from hypothesis import HealthCheck, settings

_SLOW_IS_FINE = [HealthCheck.too_slow]

settings.register_profile(
    "boomctl", deadline=None, max_examples=100, derandomize=True, suppress_health_check=_SLOW_IS_FINE
)
settings.register_profile(
    "hunt", deadline=None, max_examples=1000, derandomize=False, suppress_health_check=_SLOW_IS_FINE
)
settings.load_profile("boomctl")
