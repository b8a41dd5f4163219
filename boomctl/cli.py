"""The command line: ``boomctl design``, ``reproduce``, ``sigma``, ``slew``, ``notebooks`` and others; ``boomctl --help``.

A command imports what it uses and no more: ``boomctl parameters`` waits for no numpy.  Exit code 0: done; 1: could not be
done; 2: bad use or bad input.
"""

import os
import re
import sys
import threading
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from functools import partial
from io import TextIOWrapper
from math import isfinite, pi, tau
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn
from warnings import catch_warnings, filterwarnings

if TYPE_CHECKING:
    from boomctl.lab.papers.jobs import Jobs
    from boomctl.progress import Progress as Told
    from boomctl.report import Report

    _Paper = tuple[Jobs, Callable[[Mapping[str, Any]], Report]]  # jobs, and the report of their results


_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$|-inf$|-nan$", re.IGNORECASE)


class _Parser(ArgumentParser):
    """The options of one command, described by the docstring of its function; bad use is a ValueError."""

    def __init__(self, command: Callable[..., None]) -> None:
        name = f"boomctl {command.__name__}"
        super().__init__(name, description=command.__doc__, allow_abbrev=False)
        self._negative_number_matcher = _NEGATIVE  # argparse's own takes -3e4 for an option

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Namespace:  # type: ignore[override]
        if args is _LIST:
            raise _Listed(self)
        return super().parse_args(args, namespace)

    def add_json(self) -> None:
        self.add_argument("--json", action="store_true", help="print the results as JSON on standard output")

    def asked(self, words: Sequence[str]) -> Namespace:
        """Return what some words ask for, of a command that can print JSON or nothing."""
        self.add_json()
        text = "print nothing, show no progress: the exit code, the files written, and what --json asks for"
        self.add_argument("--quiet", action="store_true", help=text)
        return self.parse_args(words)

    def add_out(self, default: str) -> None:
        text = "folder for pictures, report and results (default: %(default)s)"
        self.add_argument("--out", type=Path, default=Path(default), metavar="FOLDER", help=text)


class _Listed(Exception):
    """The options of a command, in place of its work."""

    def __init__(self, parser: _Parser) -> None:
        super().__init__(parser.prog)
        self.parser = parser


_LIST: list[str] = []  # words by which a command is asked for its options; told by identity

_HELP = """usage: boomctl [--version] COMMAND ...

Control design for flexible structures on a moving base.

Commands; boomctl COMMAND --help says more:"""

_CODES = """
Exit codes: 0 done; 1 could not be done; 2 bad use or bad input. What went
wrong is one line on standard error. Progress is shown on terminals only, and colours too; NO_COLOR turns them off."""


def main() -> None:
    """Run the command line; every failure is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):  # a letter that a terminal does not know ends no command
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        _run(sys.argv[1:])
        sys.stdout.flush()
    except (ValueError, TypeError) as error:
        _fail(str(error), 2)
    except (
        FileNotFoundError,
        NotADirectoryError,
        IsADirectoryError,
    ) as error:  # named and not there, as a design may be
        said = "expected a file, got a folder" if isinstance(error, IsADirectoryError) else "there is no such file"
        _fail(str(error) if error.filename is None else f"{error.filename}: {said}", 2)
    except BrokenPipeError:  # whoever read the output has seen enough (boomctl parameters | head)
        with suppress(AttributeError, OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (OSError, ArithmeticError, ImportError, RuntimeError) as error:
        if isinstance(error, NotImplementedError | RecursionError):
            raise
        absent = isinstance(error, ModuleNotFoundError) and error.name == "mpmath"  # its references are in sixty digits
        said = str(error)
        if isinstance(error, OSError) and error.strerror:
            said = error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
        _fail("mpmath is not installed: pip install 'boomctl[lab]'" if absent else said, 1)
    except KeyboardInterrupt:
        if any(thread.name == "boomctl-slew" for thread in threading.enumerate()):  # a solver's last iteration, unheard
            print("boomctl: interrupted", file=sys.stderr, flush=True)
            os._exit(1)
        _fail("interrupted", 1)
    sys.exit(0)


def _run(words: Sequence[str]) -> None:
    """Run the command that the first word names, with the others as its arguments."""
    if not words or words[0] in ("-h", "--help"):
        print(
            _HELP,
            *(f"  {name:<12} {(command.__doc__ or '').splitlines()[0]}" for name, command in _COMMANDS.items()),
            _CODES,
            sep="\n",
        )
        sys.exit(0 if words else 2)
    if words[0] == "--version":
        from boomctl import __version__

        print(f"boomctl {__version__}")
        return
    if words[0] not in _COMMANDS:
        from boomctl.checks import known

        known("command", words[0], _COMMANDS)
    if "--quiet" not in words:
        _COMMANDS[words[0]](words[1:])
        return
    from boomctl.progress import listening

    with (
        open(os.devnull, "w") as nowhere,
        listening(None),
        redirect_stdout(sys.stdout if "--json" in words else nowhere),
    ):
        _COMMANDS[words[0]](words[1:])


def _fail(message: str, code: int) -> None:
    print(f"boomctl: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)


def _name_others(folder: Path, written: Sequence[Path]) -> None:
    """Say which files of a folder are not those written in this run."""
    others = sorted(each.name for each in folder.iterdir() if each.is_file() and each not in written)
    if others:
        print(f"boomctl: {folder}: also has files that are not of this run: {', '.join(others)}", file=sys.stderr)


def _print_json(value: Any) -> None:
    import json

    from boomctl.files import plain

    print(json.dumps(plain(value), allow_nan=False))


@contextmanager
def _results_alone() -> Iterator[None]:
    """Let what is printed meanwhile go to standard error, by compiled libraries and other programs too.

    A design may print, and so may what it calls; results as JSON stand on standard output alone.
    """
    sys.stdout.flush()
    try:
        out, err = sys.stdout.fileno(), sys.stderr.fileno()
    except (AttributeError, OSError):  # neither is a file
        with redirect_stdout(sys.stderr):
            yield
        return
    kept = os.dup(out)
    try:
        os.dup2(err, out)
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, out)
        os.close(kept)


_WORTH_A_WORD = 1.0  # s that a computation within a step takes before the bar names it (a choice)


@contextmanager
def _progress(steps: int) -> Iterator[Callable[..., None]]:
    """Show a progress bar on a terminal's standard error; give the function of a text and of steps that moves it on."""
    from boomctl.progress import listening

    if not sys.stderr.isatty() or "--json" in sys.argv or "--quiet" in sys.argv:
        with listening(None):
            yield lambda text, advance=1: None
        return
    from rich.console import Console
    from rich.progress import BarColumn as Bar
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), Bar(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=steps)
        step = ["starting"]

        def move(text: str, advance: int = 1) -> None:
            step[0] = text
            bar.update(task, description=text, advance=advance)

        def within(told: "Told") -> None:
            if told.seconds > _WORTH_A_WORD:
                bar.update(task, description=f"{step[0]}; {told}")

        with listening(within):
            yield move


def reproduce(words: Sequence[str]) -> None:
    """Compute the papers' tables and figures again, beside the published values.

    "all" puts either paper into a folder of its own below --out.
    """
    parser = _Parser(reproduce)
    parser.add_argument("what", nargs="?", default="all", help="boom, hub-beam or all (default: %(default)s)")
    parser.add_out("results")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="TOML file with other boom parameters")
    text = "CSV file with a measured sigma curve of the boom"
    parser.add_argument("--measured", type=Path, metavar="FILE", help=text)
    text = (
        "twice as many torques where the hub-beam's models are held against the exact beam, and more frequencies where"
        " friction in the boom's cradle is simulated; neither is in the papers, whose tables and figures are all there"
        " without it. It takes about one and a half times as long"
    )
    parser.add_argument("--full", action="store_true", help=text)
    text = "processes side by side, one thread each; 1: in this one (default: as many as there are cores)"
    parser.add_argument("--workers", type=int, metavar="COUNT", help=text)
    asked = parser.asked(words)

    from boomctl.checks import known, whole
    from boomctl.files import json_text, locked_folder, plain, write_all
    from boomctl.lab.papers.jobs import run_jobs
    from boomctl.report import bound_reports

    known("what to reproduce", asked.what, ("boom", "hub-beam", "all"))
    if asked.what == "hub-beam" and (asked.parameters or asked.measured):
        raise ValueError("--parameters and --measured are of the boom: leave them out for hub-beam")
    workers = None if asked.workers is None else whole("--workers", asked.workers)
    results, reports = {}, []
    names = tuple(_PAPERS) if asked.what == "all" else (asked.what,)
    papers = [
        _boom_paper(asked.parameters, asked.measured, asked.full) if name == "boom" else _hub_beam_paper(asked.full)
        for name in names
    ]
    with locked_folder(asked.out) as folder:
        jobs = {name: work for of_paper, _ in papers for name, work in of_paper.items()}
        with _progress(len(jobs)) as progress:
            found = run_jobs(jobs, workers, progress)
        for name, (_, report_of) in zip(names, papers, strict=True):
            report = report_of(found)
            target = folder / name if asked.what == "all" else folder
            write = report.write if asked.what == "all" else report.write_into
            _name_others(target, write(target))
            results[name] = plain(report.results)
            reports.append((_PAPERS[name], report.html))
            if not asked.json:
                _print_paper(name, results[name])
                print(f"Report: {target / 'report.html'}")
        if asked.what == "all":
            both = bound_reports("Two papers, computed again", reports)
            write_all({folder / "report.html": both, folder / "results.json": json_text(results)})
            if not asked.json:
                print(f"Both reports in one: {folder / 'report.html'}")
    if asked.json:
        _print_json(results if asked.what == "all" else results[asked.what])


_PAPERS = {
    "boom": "Anthonis & Ramon (2003): the spray boom",
    "hub-beam": "Bai et al. (2009): the rotating hub-beam",
}


def _boom_paper(parameters: Path | None, measured: Path | None, full: bool) -> "_Paper":
    from boomctl.analysis.measured import read_measured_curve
    from boomctl.boom.parameters import BoomParameters
    from boomctl.lab.papers.anthonis_ramon.report import jobs, report

    p = BoomParameters.from_toml(parameters) if parameters else None
    return jobs(p, read_measured_curve(measured) if measured else None, full), report


def _hub_beam_paper(full: bool) -> "_Paper":
    from boomctl.lab.papers.bai.report import jobs, report
    from boomctl.lab.papers.bai.validity import FULL_TORQUES, TORQUES

    torques = FULL_TORQUES if full else TORQUES
    return jobs(torques), partial(report, torques)


def _print_paper(name: str, results: dict[str, Any]) -> None:
    if name == "boom":
        _print_table_1(results["table_1"])
    else:
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in results["summary"].items())
        print(f"Bai et al. (2009), numbers and statements: {verdicts}.")


def _print_table_1(table: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    shown = Table(title="Anthonis & Ramon (2003), Table 1 [Hz]: published / here (difference in %)")
    for head in ("", "measured", *table["methods"], "exact beam"):
        shown.add_column(head, justify="right")
    for k, exact in enumerate(table["exact_hz"]):
        cells = [str(k + 1), f"{table['measured_hz'][k]:g}"]
        for method in table["methods"].values():
            published, here = method["published_hz"][k], method["computed_hz"][k]
            cells.append(f"{published:.4f} / {here:.4f} ({method['difference_percent'][k]:+.2f})")
        shown.add_row(*cells, f"{exact:.5f}")
    Console(width=140 if not sys.stdout.isatty() else None).print(shown)
    print(
        "The geometrical column's fourth value, 2.9316 Hz, is not reproducible under any reading tried; see the report."
    )


def design(words: Sequence[str]) -> None:
    """Run a design and report what it is worth: a suspension beside the boom as it is, a slew beside classical ones."""
    from boomctl.studies.catalogue import design_file, design_names

    parser = _Parser(design)
    own = "a Python file with a function design(), slew() or drive(), of a machine of your own too"
    parser.add_argument("name", help=f"a design of boomctl ({', '.join(design_names())}), or {own}")
    parser.add_out("results")
    parser.add_argument(
        "--road", dest="road_class", help="suspensions: class of the track, ISO 8608, A to H (default: E)"
    )
    parser.add_argument("--speed", type=float, help="suspensions: driving speed, m/s (default: 3.0)")
    parser.add_argument("--seed", type=int, help="suspensions: of the random track (default: 1)")
    asked = parser.asked(words)

    from boomctl.files import locked_folder  # after the options, so that help and bad use wait for no numpy

    with _results_alone() if asked.json else nullcontext():
        found = design_file(asked.name)
        given = {option: getattr(asked, option) for option in ("road_class", "speed", "seed")}
        chosen = {option: value for option, value in given.items() if value is not None}
        wrong = [f"--{option.removesuffix('_class')}" for option in chosen if option not in found.kind.options]
        if wrong:
            raise ValueError(
                f"{', '.join(wrong)}: of suspensions only; expected none for the {found.kind.name} {asked.name!r}"
            )
        scene = found.kind.design_class.scene(**chosen)
        with locked_folder(asked.out) as folder, _progress(found.kind.steps) as progress:
            progress("design")
            made = found.made()
            if not isinstance(made, found.kind.design_class):  # a machine of the user's own, which has another scene
                scene = type(made).scene(**chosen)
            progress("judging")
            result = made.evaluate(scene)
            report = result.report(progress)
            _name_others(folder, report.write_into(folder))
    if asked.json:
        _print_json(report.results)
        return
    print(result)
    print(f"Report: {asked.out / 'report.html'}")


def sigma(words: Sequence[str]) -> None:
    """Compute the boom's singular values from platform actuators to tips, with a certified peak."""
    parser, kinds = _Parser(sigma), "finite, high-order, discrete-hermite, discrete-geometric, exact"
    parser.add_argument("--discretization", default="finite", help=f"{kinds} (default: %(default)s)")
    parser.add_argument("--elements", type=int, help="number of elements, but of exact (default: 6)")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="TOML file with boom parameters")
    parser.add_argument("--measured", type=Path, metavar="FILE", help="CSV file with a measured curve")
    parser.add_argument("--out", type=Path, metavar="FILE", help="picture to write, .png or .svg")
    asked = parser.asked(words)
    if asked.out is not None and asked.out.suffix not in (".png", ".svg"):
        raise ValueError(f"--out {asked.out}: expected a name that ends in .png or .svg")
    if asked.out is not None and asked.out.is_dir():
        raise ValueError(f"--out {asked.out}: expected a file, got a folder")
    exact = asked.discretization == "exact"
    if exact and asked.elements is not None:
        raise ValueError(f"--elements {asked.elements}: leave it out; expected none for --discretization exact")
    if asked.discretization not in kinds.split(", "):
        from boomctl.checks import known

        known("discretization", asked.discretization, kinds.split(", "))
    elements = 6 if asked.elements is None else asked.elements
    curve = None
    if asked.measured:
        from boomctl.analysis.measured import read_measured_curve

        curve = read_measured_curve(asked.measured)
    result = _boom_sigma(asked.discretization, elements, asked.parameters)
    if asked.out is not None:
        label = "exact" if exact else f"{asked.discretization}, {elements}"
        _save_sigma(result, label, curve, asked.out)
    summary = {"peak": result.peak, "peak_omega": result.peak_omega, "certified": result.certified}
    if asked.json:
        summary |= {"upper_bound": result.certificate.upper, "inputs": result.inputs, "outputs": result.outputs}
        _print_json({**summary, "omega": result.omega, "sigma": result.sigma})
    else:
        bounded = result.certified and isfinite(result.certificate.upper)
        proof = f"certified below {result.certificate.upper:.6g}" if bounded else result.certificate.method
        print(f"peak {result.peak:.6g} at {result.peak_omega:.6g} rad/s ({result.peak_omega / tau:.6g} Hz), {proof}")


def _boom_sigma(discretization: str, elements: int, parameters: Path | None) -> Any:
    from boomctl.analysis.sigma import sigma as singular_values
    from boomctl.boom.factory import spray_boom
    from boomctl.boom.model import ACTUATORS, TIPS
    from boomctl.boom.parameters import BoomParameters

    p = BoomParameters.from_toml(parameters) if parameters else BoomParameters()
    if discretization != "exact":
        return singular_values(spray_boom(p, discretization, elements))
    from boomctl.boom.exact import exact_frequency_response  # it imports control, two seconds that no other mesh needs

    grid = singular_values(spray_boom(p, "high-order", 4)).omega
    return singular_values(exact_frequency_response(p, grid, ACTUATORS, TIPS))


def _save_sigma(result: Any, label: str, curve: Any, out: Path) -> None:
    from boomctl.files import prepared_folder, write_whole
    from boomctl.plotting.canvas import figure_bytes, new_figure
    from boomctl.plotting.sigma import plot_measured, plot_sigma

    prepared_folder(out.parent)
    figure = new_figure()
    ax = figure.add_subplot()
    plot_sigma(result, ax, unit="Hz", label=label)
    if curve is not None:
        plot_measured(curve, ax)
    write_whole(out, figure_bytes(figure, out.suffix[1:]))


def parameters(words: Sequence[str]) -> None:
    """Print the boom's parameters as an annotated TOML file, to be changed and given to --parameters."""
    parser = _Parser(parameters)
    parser.add_json()
    asked = parser.parse_args(words)
    text = (Path(__file__).parent / "boom" / "table_2.toml").read_text(encoding="utf-8")
    if asked.json:
        import tomllib

        _print_json(tomllib.loads(text))
    else:
        print(text, end="")


def slew(words: Sequence[str]) -> None:
    """Plan an optimal slew of the hub-beam, certify it and set it beside classical ones."""
    parser = _Parser(slew)
    text = "angle to turn through, in radians (default: 1.5708, a quarter turn)"
    parser.add_argument("--angle", type=float, metavar="RADIANS", help=text)
    parser.add_argument("--angle-deg", type=float, metavar="DEGREES", help="the same in degrees, in place of --angle")
    parser.add_argument("--torque-limit", type=float, default=200.0, help="largest torque, N m (default: %(default)g)")
    text = "what is minimised: time, effort, jerk, torque-rate or tip (default: %(default)s)"
    parser.add_argument("--objective", default="time", help=text)
    parser.add_argument("--duration", type=float, help="duration, s; for every objective but time")
    parser.add_argument("--model", default="sfoam", help="sfoam, sfoam-consistent, foam or tlam (default: %(default)s)")
    parser.add_argument("--modes", type=int, default=3, help="number of modes (default: %(default)s)")
    parser.add_argument("--tip-mass", type=float, default=0.0, help="mass at the tip, kg (default: %(default)g)")
    parser.add_argument("--torque-rate-limit", type=float, help="largest rate of the torque, N m/s")
    parser.add_argument("--speed-limit", type=float, help="largest hub speed, rad/s")
    parser.add_argument("--tip-limit", type=float, help="largest tip displacement, m")
    parser.add_argument("--moment-limit", type=float, help="largest bending moment at the clamp, N m")
    text = "time to search for each slew, s; then the best verified one so far, or an error (default: %(default)g)"
    parser.add_argument("--time-limit", type=float, default=120.0, metavar="SECONDS", help=text)
    text = "show the error over meshes in the report (default: shown)"
    parser.add_argument("--mesh-study", action=BooleanOptionalAction, default=True, help=text)
    parser.add_out("slew")
    asked = parser.asked(words)
    if asked.angle is not None and asked.angle_deg is not None:
        raise ValueError("--angle and --angle-deg: expected one of the two")
    angle = asked.angle if asked.angle_deg is None else asked.angle_deg * pi / 180.0
    angle = pi / 2 if angle is None else angle

    from boomctl.files import locked_folder, plain
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
    from boomctl.rotating_beam.parameters import HubBeamParameters
    from boomctl.studies.slew.design import STEPS, evaluated_plan

    if asked.angle is not None and abs(asked.angle) > tau:
        said = f"--angle {asked.angle:g}: {abs(asked.angle) / tau:.3g} turns; this angle is in radians"
        print(f"boomctl: {said}; for degrees give --angle-deg {asked.angle:g}", file=sys.stderr)
    limits = ("torque_rate_limit", "speed_limit", "tip_limit", "moment_limit")
    given = {name: getattr(asked, name) for name in limits if getattr(asked, name) is not None}
    beam = AssumedModesBeam(HubBeamParameters(tip_mass=asked.tip_mass), asked.model, asked.modes)
    aside = _results_alone() if asked.json else nullcontext()
    with aside, locked_folder(asked.out) as folder, _progress(STEPS) as progress, catch_warnings():
        filterwarnings("ignore", "angle = ")  # said above, in words of the command
        evaluation = evaluated_plan(
            beam,
            angle=angle,
            torque_limit=asked.torque_limit,
            time_limit=asked.time_limit,
            meshes=None if asked.mesh_study else (),
            tell=progress,
            progress=lambda seen: progress(f"{seen.stage} ({seen.seconds:.0f} s)", 0),
            objective=asked.objective,
            duration=asked.duration,
            **given,
        )
        report = evaluation.report(progress)
        _name_others(folder, report.write_into(folder))
    found = plain(report.results)
    if asked.json:
        _print_json(found)
        return
    print(f"{found['duration']:.7g} s; {found['verdict']}")
    certificate = found["certificate"]
    free = f" ({certificate['prescribed_error']:.1e} without axial motion)" if certificate["free_errors"] else ""
    print(f"replay: end missed by {found['end_error']:.1e}{free}, {found['residual_energy']:.1e} J left")
    print(f"Report: {asked.out / 'report.html'}")


def identify(words: Sequence[str]) -> None:
    """Find the modes of a machine in a record of it, with intervals, and a model; report them.

    The file is a record, CSV with a line of names or .mat with vectors, or a measured frequency response, CSV or UFF.
    """
    parser = _Parser(identify)
    parser.add_argument("record", type=Path, help="the file: .csv, .mat, .uff or .unv")
    parser.add_argument("--inputs", default="", metavar="NAMES", help="columns that drive the machine, between commas")
    text = "columns that it answers with, between commas (default: all others but the time)"
    parser.add_argument("--outputs", default="", metavar="NAMES", help=text)
    text = "time between samples, s (default: from the column named time)"
    parser.add_argument("--sample-time", type=float, metavar="SECONDS", help=text)
    text = "frequencies of the modes wanted, Hz (default: where all inputs have power)"
    parser.add_argument("--band", type=float, nargs=2, metavar=("LOW", "HIGH"), help=text)
    parser.add_argument("--modes", type=int, help="number of modes (default: all that have evidence)")
    text = "what the outputs are: displacement, velocity or acceleration (default: displacement)"
    parser.add_argument("--quantity", metavar="WORD", help=text)
    text = "inputs between samples: bl (band-limited) or zoh (zero-order hold) (default: from the record)"
    parser.add_argument("--intersample", metavar="WORD", help=text)
    parser.add_out("identified")
    asked = parser.asked(words)

    from boomctl.files import locked_folder, plain
    from boomctl.studies.measurement import identified_file

    inputs, outputs = (
        [name.strip() for name in text.split(",") if name.strip()] for text in (asked.inputs, asked.outputs)
    )
    band = None if asked.band is None else tuple(asked.band)
    options = {"band_hz": band, "modes": asked.modes, "quantity": asked.quantity, "intersample": asked.intersample}
    with _results_alone() if asked.json else nullcontext(), locked_folder(asked.out) as folder:
        found = identified_file(asked.record, inputs, outputs, asked.sample_time, **options)
        _name_others(folder, found.report().write_into(folder))
    if asked.json:
        _print_json(plain(found.results))
        return
    print(found.identification.render())
    print(f"Report: {asked.out / 'report.html'}")


_BENCHMARKS = ("boom", "hub-beam", "suspension", "slew", "tune", "identify", "lumped-masses", "growth", "limits", "all")
_EVERYTHING = "precision"  # the name that "all" had


def benchmark(words: Sequence[str]) -> None:
    """Measure run time and error side by side, against other programs, and whether what is promised holds.

    A name is that of a scene ("boom-sigma") or of all scenes of a subject ("boom"); "all" are all.
    """
    parser = _Parser(benchmark)
    text = f"{', '.join(_BENCHMARKS)}, or scenes (default: boom)"
    parser.add_argument("what", nargs="*", metavar="NAME", help=text)
    parser.add_argument("--full", action="store_true", help="include scenes that take minutes each")
    parser.add_argument("--quick", action="store_true", help="fewer settings, all scenes in about two minutes")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="folder for report, pictures and results")
    text = "page in Markdown whose tables of recommended settings, between two marks, are written anew"
    parser.add_argument("--page", type=Path, metavar="FILE", help=text)
    text = "what --json printed in an earlier run: adds what got slower or less exact since, in one table"
    parser.add_argument("--compare", type=Path, metavar="OLD.json", help=text)
    asked = parser.asked(words)
    from boomctl.files import locked_folder
    from boomctl.lab.benchmark.compare import compared, read_results
    from boomctl.lab.benchmark.recommended import PAGE
    from boomctl.lab.benchmark.run import run, steps

    if asked.full and asked.quick:
        raise ValueError("--full: expected --quick or --full, not both")
    names = [name for name in asked.what if name != _EVERYTHING]
    if len(names) < len(asked.what):
        names = names or ["all"]
        print(f"boomctl: {_EVERYTHING!r} is gone: 'boomctl benchmark {' '.join(names)}' does it", file=sys.stderr)
    names = names or ["boom"]
    extent = "quick" if asked.quick else "whole"
    count = steps(names, extent, asked.full)
    before = None if asked.compare is None else read_results(asked.compare)
    if asked.page is not None:
        PAGE.text(asked.page)
    aside = _results_alone() if asked.json else nullcontext()
    with (
        aside,
        nullcontext() if asked.out is None else locked_folder(asked.out) as folder,
        _progress(count) as progress,
    ):
        report = run(names, extent, asked.full, progress)
        if folder is not None:
            progress("pictures and report", 0)
            _name_others(folder, report.report().write_into(folder))
    if asked.page is not None:
        PAGE.write(asked.page, report.page())
    comparison = None if before is None else compared(before, report)
    if asked.json:
        _print_json({**report.as_dict(), **({} if comparison is None else {"comparison": comparison.as_dict()})})
        return
    from rich.console import Console

    console = Console(width=160 if not sys.stdout.isatty() else None)
    console.print(report.render())
    if comparison is not None:
        console.print()
        console.print(comparison.render())
    if asked.out is not None:
        print(f"Report: {asked.out / 'report.html'}")


def notebooks(words: Sequence[str]) -> None:
    """Copy the notebooks that come with boomctl into a folder."""
    from boomctl.studies.catalogue import shipped

    parser = _Parser(notebooks)
    text = "folder to copy them into (default: %(default)s)"
    parser.add_argument("--out", type=Path, default=Path("notebooks"), metavar="FOLDER", help=text)
    text = "write over files of the same names, which may hold changes of your own"
    parser.add_argument("--force", action="store_true", help=text)
    asked = parser.asked(words)

    from boomctl.files import prepared_folder, write_all

    source = shipped("notebooks")
    found = sorted(path for path in source.glob("*") if path.is_file() and path.name[0] not in "._")
    if not any(path.suffix == ".ipynb" for path in found):
        raise RuntimeError(f"there are no notebooks in {source}: this installation of boomctl came without them")
    if asked.out.resolve() == source.resolve():
        raise ValueError(f"--out {asked.out}: that is where they come from; expected another folder")
    there = [path.name for path in found if (asked.out / path.name).exists()]
    if there and not asked.force:
        raise ValueError(f"--out {asked.out}: {', '.join(there)} already there; expected another folder, or --force")
    prepared_folder(asked.out)
    write_all({asked.out / path.name: path.read_bytes() for path in found})
    if asked.json:
        _print_json([str(asked.out / path.name) for path in found])
        return
    for path in found:
        print(asked.out / path.name)


_SHELLS = ("bash", "zsh", "fish")


def completion(words: Sequence[str]) -> None:
    """Print what a shell needs to complete boomctl's commands and options.

    For bash: boomctl completion bash > ~/.local/share/bash-completion/completions/boomctl; for zsh, in ~/.zshrc:
    source <(boomctl completion zsh); for fish: boomctl completion fish > ~/.config/fish/completions/boomctl.fish
    """
    from boomctl.checks import known

    parser = _Parser(completion)
    parser.add_argument("shell", help=", ".join(_SHELLS))
    shell = known("shell", parser.parse_args(words).shell, _SHELLS)
    print("\n".join(_fish_lines() if shell == "fish" else _bash_lines(shell)))


def _listed(command: Callable[[Sequence[str]], None]) -> _Parser:
    """Return the options of a command, without running it."""
    try:
        command(_LIST)
    except _Listed as told:
        return told.parser
    raise AssertionError(command.__name__)  # a command parses its words before anything else


def _arguments(name: str) -> str:
    """Return the words that may follow a command, beside its options and files."""
    from boomctl.studies.catalogue import design_names

    choices = {"reproduce": ("boom", "hub-beam", "all"), "benchmark": _BENCHMARKS, "completion": _SHELLS}
    return " ".join(design_names() if name == "design" else choices.get(name, ()))


def _bash_lines(shell: str) -> Iterator[str]:
    if shell == "zsh":
        yield "autoload -U +X compinit && compinit"
        yield "autoload -U +X bashcompinit && bashcompinit"
    yield "_boomctl() {"
    yield '    local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" options="" choices="" files=""'
    yield "    COMPREPLY=()"
    yield '    if [ "$COMP_CWORD" -eq 1 ]; then'
    yield f'        COMPREPLY=($(compgen -W "{" ".join(_COMMANDS)} --help --version" -- "$word"))'
    yield "        return"
    yield "    fi"
    yield '    case "${COMP_WORDS[1]}" in'
    for name, command in _COMMANDS.items():
        actions = _listed(command)._actions
        given = " ".join(flag for action in actions for flag in action.option_strings if flag.startswith("--"))
        valued = "|".join(flag for action in actions if action.nargs != 0 for flag in action.option_strings)
        files = "|".join(flag for action in actions if action.type is Path for flag in action.option_strings)
        yield f"        {name})"
        yield f'            options="{given}" choices="{_arguments(name)}"'
        if name == "design":
            yield "            files=yes"
        if files:
            yield f'            case "$before" in {files}) compopt -o filenames 2>/dev/null'
            yield '                COMPREPLY=($(compgen -f -- "$word")); return;; esac'
        if valued:
            yield f'            case "$before" in {valued}) return;; esac'
        yield "            ;;"
    yield "    esac"
    yield '    case "$word" in'
    yield '        -*) COMPREPLY=($(compgen -W "$options" -- "$word"));;'
    yield '        *) COMPREPLY=($(compgen -W "$choices" -- "$word"))'
    yield '           if [ -n "$files" ]; then compopt -o filenames 2>/dev/null'
    yield """               COMPREPLY+=($(compgen -f -X '!*.py' -- "$word") $(compgen -d -- "$word")); fi;;"""
    yield "    esac"
    yield "}"
    yield "complete -F _boomctl boomctl"


def _fish_lines() -> Iterator[str]:
    def said(text: str) -> str:
        return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"

    yield "complete -c boomctl -f"
    for name, command in _COMMANDS.items():
        first = said((command.__doc__ or "").splitlines()[0])
        yield f"complete -c boomctl -n __fish_use_subcommand -a {name} -d {first}"
        within = f"complete -c boomctl -n '__fish_seen_subcommand_from {name}'"
        if words := _arguments(name):
            yield f"{within} -a '{words}'"
        if name == "design":
            yield f"{within} -F"
        parser = _listed(command)
        for action in parser._actions:
            for flag in action.option_strings:
                if flag.startswith("--"):
                    kind = " -r -F" if action.type is Path else " -x" if action.nargs != 0 else ""
                    text = parser._get_formatter()._expand_help(action) if action.help else ""
                    yield f"{within} -l {flag[2:]}{kind} -d {said(text)}"


_COMMANDS: dict[str, Callable[[Sequence[str]], None]] = {
    command.__name__: command
    for command in (design, reproduce, sigma, identify, parameters, slew, notebooks, benchmark, completion)
}


if __name__ == "__main__":
    main()
