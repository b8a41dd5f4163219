"""Run time against error of thirteen scenes, this package and other programs side by side."""
