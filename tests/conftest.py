"""Settings of every test: hypothesis runs a modest number of examples, reproducibly, without a time limit on each."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "boomctl",
    deadline=None,
    max_examples=100,
    derandomize=False,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("boomctl")
