"""Reproduction of the papers, and the benchmark of run time and error."""
