"""A scene for tests of the benchmark, made in the processes that it starts."""

import time

from boomctl.lab.benchmark.scene import Scene, settings, sized


def _answer(value, problem, change):
    if value == "raises":
        raise ValueError("no\n  answer")
    if value == "sleeps":
        time.sleep(60.0)
    if value == "dies":
        raise SystemExit("gone")
    return problem + float(value) + change


def tiny():
    """Return a scene whose answers are one and a little more."""
    return Scene(
        title="A tiny scene",
        question="What is one?",
        measure="Distance from one.",
        problem=lambda: 1.0,
        reference=lambda problem: problem,
        error=lambda problem, true, found: abs(found - true),
        methods=(
            *settings("mine", "plus {}", (0.5, 0.25), _answer, verified=True, ours=True),
            *settings("other", "{}", (0.125, "raises", "nan", "sleeps", "dies"), _answer),
            *settings("absent", "{}", (0.0,), _answer, modules=("no_such_module.part",)),
            *sized(settings("mine", "{} parts", (1, 2, 4), _answer, verified=True, ours=True)),
        ),
        remarks=("One is one.",),
    )
