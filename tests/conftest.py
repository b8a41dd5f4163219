"""Settings of every test: the same examples on every run; ``--hypothesis-profile=hunt`` draws new ones, and more."""

import os

from hypothesis import HealthCheck, settings

# the matrices are small and the tests run side by side: more threads only get into one another's way
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

_SLOW_IS_FINE = [HealthCheck.too_slow]

settings.register_profile(
    "boomctl", deadline=None, max_examples=100, derandomize=True, suppress_health_check=_SLOW_IS_FINE
)
settings.register_profile(
    "hunt", deadline=None, max_examples=1000, derandomize=False, suppress_health_check=_SLOW_IS_FINE
)
settings.load_profile("boomctl")
