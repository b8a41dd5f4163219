"""The scenes: each module makes one, its reference included.  A new one is entered in `SCENES` of `run.py` beside this folder."""
