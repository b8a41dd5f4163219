"""The boom's benchmark: run time and error of every job in one run, beside python-control where it can do the same."""

from collections.abc import Callable

from boomctl.benchmark.boom.accuracy import accuracy_lines, high_order_lines, memory_lines, rounding_lines
from boomctl.benchmark.boom.scene import Progress, Scene, Settings, scene
from boomctl.benchmark.boom.speed import exact_lines, finite_element_lines, import_lines
from boomctl.benchmark.report import BenchmarkReport, Row, Sheet
from boomctl.benchmark.timing import environment, one_thread

Lines = Callable[[Scene, Settings, Progress], tuple[list[Row], list[Sheet]]]

_LINES: tuple[Lines, ...] = (
    exact_lines,
    finite_element_lines,
    rounding_lines,
    memory_lines,
    high_order_lines,
    accuracy_lines,
    import_lines,
)


def run(full: bool = False, progress: Progress | None = None) -> BenchmarkReport:
    """Measure the boom's jobs.

    Parameters
    ----------
    full : bool
        Also time python-control on 500 elements (some minutes), and judge meshes at every frequency.
    progress : callable, optional
        Told in words what comes next.

    Returns
    -------
    BenchmarkReport
    """
    return run_settings(Settings.of(full), progress)


def run_settings(settings: Settings, progress: Progress | None = None) -> BenchmarkReport:
    """Measure the boom's jobs to the given extent; see :func:`run`."""
    tell: Progress = progress if progress is not None else lambda text: None
    rows: list[Row] = []
    sheets: list[Sheet] = []
    with one_thread():
        tell("exact solution in 50 digits")
        ground = scene(settings)
        for lines in _LINES:
            new_rows, new_sheets = lines(ground, settings, tell)
            rows += new_rows
            sheets += new_sheets
    return BenchmarkReport(tuple(rows), tuple(sheets), _notes(ground, settings), environment())


def _notes(ground: Scene, settings: Settings) -> tuple[str, ...]:
    notes = [
        f"Time: median processor time of jobs that take turns in one process, one BLAS thread, {len(ground.omega)} "
        "frequencies a call. Ratio: peer over ours.",
        "Error: largest relative error of any singular value, actuators -> tips, against the exact beam in 50 digits; "
        f"{settings.points} points from 0.1 to 10 Hz and {settings.cluster} around each of the first five resonances.",
        "Models and state spaces are built beforehand, a symmetric model with its two halves and their bands; each call "
        "gets a model of its own, so that no modes or responses are cached. The exact beam keeps, for each set of "
        "parameters, what does not depend on frequency; the lines 'prepared anew' use new parameters in every call.",
        f"In 50 digits meshes are solved at {len(ground.judged)} of the {len(ground.omega)} frequencies.",
    ]
    if settings.skipped:
        meshes = " and ".join(f"{n:,}" for n in settings.skipped)
        notes.append(f"python-control on {meshes} elements takes half a minute a call; --full measures it.")
    elif max(settings.peers, default=0) >= 500:
        notes.append("python-control on 500 elements is timed once, without a call before to warm up.")
    return tuple(notes)
