"""What the package costs and how exact it is, beside its peers: run time and error of the same jobs, in one run."""

from boomctl.benchmark.boom.run import Settings, run, run_settings
from boomctl.benchmark.report import BenchmarkReport, Row

__all__ = ["BenchmarkReport", "Row", "Settings", "run", "run_settings"]
