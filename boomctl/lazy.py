"""Public names that are loaded when first used.

The stub ``__init__.pyi`` of a package lists its public names and where they are defined; the package, editors and type
checkers read it. Modules of boomctl import from the module that defines a name.

A stub may offer sub-packages too (``from . import structure as structure``): they are imported when first used, and are
not in ``__all__``.
"""

import ast
import sys
from collections.abc import Callable
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

TRANSLATED = {
    word: ours
    for ours, words in {
        "bode": "bode_plot bodemag",
        "compare_sigma": "singular_values_plot",
        "discretize": "c2d sample_system",
        "estimate_frequency_response": "etfe spa tfestimate modalfrf",
        "feedback_loop": "feedback connect interconnect",
        "fit": "greyest",
        "forced_response": "lsim",
        "generalized_plant": "augw",
        "h2": "h2syn",
        "h2_norm": "norm2",
        "h_infinity": "hinfsyn mixsyn",
        "hinf_norm": "linfnorm hinfnorm getPeakGain system_norm norm",
        "identify": "n4sid ssest tfest modalfit era",
        "impulse": "impulse_response impulseplot",
        "kalman": "lqe",
        "lqg": "lqgreg",
        "lqr": "dlqr lqi",
        "margins": "margin allmargin diskmargin disk_margins stability_margins",
        "mode_table": "damp pole poles",
        "nyquist": "nyquist_plot nyquist_response",
        "pzmap": "pole_zero_map pole_zero_plot iopzmap",
        "reduce": "balred modred balreal hankelmr",
        "robust_stability": "robstab robuststab",
        "shelf": "makeweight",
        "sigma": "singular_values_response sigmaplot",
        "step": "step_response stepplot step_info",
        "tune": "systune hinfstruct looptune",
        "with_state_outputs": "augstate",
        "worst_case": "wcgain wcnorm",
    }.items()
    for word in words.split()
}
"""Words of MATLAB and of python-control for what a public name of the top does."""

_THEIRS = """
acker append bandwidth care ctrb dare dcgain evalfr freqresp frequency_response gram hsvd initial_response minreal obsv pade
parallel place rlocus root_locus series ss ss2tf tf tf2ss zeros
"""
"""Functions of python-control without a counterpart in boomctl."""


class _Package(ModuleType):
    """A package in which a public name stays what it is, though a submodule of the same name is imported."""

    __all__: list[str]

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.__all__ and isinstance(value, ModuleType):
            if not hasattr(value, name):
                return  # The public name is defined elsewhere and loaded on access.
            value = getattr(value, name)
        super().__setattr__(name, value)

    def __reduce__(self) -> tuple[Callable[[str], ModuleType], tuple[str]]:
        """Pickle by name, as functions of a script that read the package are sent to other processes."""
        return import_module, (self.__name__,)


def loader(package: str) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__all__``, ``__getattr__`` and ``__dir__`` of a package, from the imports of its stub."""
    module = sys.modules[package]
    stub = Path(str(module.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = (node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom))
    home = {alias.name: node.module or "" for node in imports for alias in node.names}
    module.__class__ = _Package

    def load(name: str) -> Any:
        if name not in home:
            known = TRANSLATED.get(name) if package == "boomctl" else None
            if known is not None:
                hint = f"use boomctl.{known}"
            elif package == "boomctl" and name in _THEIRS.split():
                hint = f"use control.{name}, with .to_statespace() of a structure"
            else:
                near = get_close_matches(name, home, n=1, cutoff=0.6)
                hint = (f"did you mean {near[0]!r}? " if near else "") + f"help({package}) lists the names"
            raise AttributeError(f"module {package!r} has no attribute {name!r}; {hint}", name=name, obj=module)
        if not home[name]:
            return import_module(f"{package}.{name}")  # which becomes an attribute of the package by that
        value = getattr(import_module(home[name]), name)
        setattr(module, name, value)  # found without this function from now on
        return value

    shown = sorted({*home, *(name for name in vars(module) if name.startswith("__"))})
    return sorted(name for name, where in home.items() if where), load, lambda: shown
