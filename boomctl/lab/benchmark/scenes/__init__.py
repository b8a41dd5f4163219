"""The scenes: each module makes one, its reference included; a new one is entered in the table of `run.py`, above."""
