"""The command line: ``boomctl design``, ``reproduce``, ``sigma``, ``parameters``, ``slew``, ``benchmark``.

A command imports what it uses and no more: ``boomctl parameters`` waits for no numpy.  Exit code 0: done; 1: could not be
done; 2: bad use or bad input.
"""

import os
import sys
from argparse import ArgumentParser, BooleanOptionalAction
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from functools import partial
from importlib import import_module
from io import TextIOWrapper
from math import isfinite, pi, tau
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from boomctl.papers.side_by_side import Job
    from boomctl.report import Report

    _Paper = tuple[list[Job], Callable[[list[Any]], Report]]  # what is to be done, and the report of what it finds


class _Parser(ArgumentParser):
    """The options of one command, described by the docstring of its function; bad use is a ValueError."""

    def __init__(self, command: Callable[..., None]) -> None:
        name = f"boomctl {command.__name__}"
        super().__init__(name, description=command.__doc__, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)

    def add_json(self) -> None:
        self.add_argument("--json", action="store_true", help="print the results as JSON on standard output")

    def add_out(self, default: str) -> None:
        text = "folder for pictures, report and results (default: %(default)s)"
        self.add_argument("--out", type=Path, default=Path(default), metavar="FOLDER", help=text)


_HELP = """usage: boomctl [--version] COMMAND ...

Control design for flexible structures on a moving base.

Commands; boomctl COMMAND --help says more:"""


def main() -> None:
    """Run the command line; every failure is one line on standard error.

    Matrices here are small and want one thread; who sets the variables of BLAS is obeyed.
    """
    for stream in (sys.stdout, sys.stderr):  # a letter that a terminal does not know ends no command
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    try:
        _run(sys.argv[1:])
    except (ValueError, TypeError) as error:
        _fail(str(error), 2)
    except (OSError, ArithmeticError, ImportError, RuntimeError) as error:
        if isinstance(error, NotImplementedError | RecursionError):
            raise
        _fail(str(error), 1)
    except KeyboardInterrupt:
        _fail("interrupted", 1)
    sys.exit(0)


def _run(words: Sequence[str]) -> None:
    """Run the command that the first word names, with the others as its arguments."""
    if not words or words[0] in ("-h", "--help"):
        print(
            _HELP,
            *(f"  {name:<12} {(command.__doc__ or '').splitlines()[0]}" for name, command in _COMMANDS.items()),
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
    _COMMANDS[words[0]](words[1:])


def _fail(message: str, code: int) -> None:
    print(f"boomctl: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)


def _print_json(value: Any) -> None:
    import json

    from boomctl.files import plain

    print(json.dumps(plain(value), allow_nan=False))


@contextmanager
def _progress(steps: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar on a terminal's standard error; give the function that moves it on."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console
    from rich.progress import BarColumn as Bar
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), Bar(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=steps)
        yield lambda text: bar.update(task, description=text, advance=1)


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
    parser.add_json()
    asked = parser.parse_args(words)

    from boomctl.checks import known, whole
    from boomctl.files import locked_folder, plain, write_json, write_whole
    from boomctl.papers.side_by_side import cores, side_by_side
    from boomctl.report import bound_reports

    known("what to reproduce", asked.what, ("boom", "hub-beam", "all"))
    if asked.what == "hub-beam" and (asked.parameters or asked.measured):
        raise ValueError("--parameters and --measured are of the boom: leave them out for hub-beam")
    workers = cores() if asked.workers is None else whole("--workers", asked.workers)
    results, reports = {}, []
    names = tuple(_PAPERS) if asked.what == "all" else (asked.what,)
    papers = [
        _boom_paper(asked.parameters, asked.measured, asked.full) if name == "boom" else _hub_beam_paper(asked.full)
        for name in names
    ]
    with locked_folder(asked.out) as folder:
        jobs = [job for work, _ in papers for job in work]
        with _progress(len(jobs)) as progress:
            found = iter(side_by_side(jobs, workers, progress))
        for name, (work, report_of) in zip(names, papers, strict=True):
            report = report_of([next(found) for _ in work])
            target = folder / name if asked.what == "all" else folder
            if asked.what == "all":
                report.write(target)
            else:
                report.write_into(target)
            results[name] = plain(report.results)
            reports.append((_PAPERS[name], report.html))
            if not asked.json:
                _print_paper(name, results[name])
                print(f"Report: {target / 'report.html'}")
        if asked.what == "all":
            write_whole(folder / "report.html", bound_reports("Two papers, computed again", reports))
            write_json(folder / "results.json", results)
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
    from boomctl.papers.anthonis_ramon.report import jobs, report

    p = BoomParameters.from_toml(parameters) if parameters else None
    return jobs(p, read_measured_curve(measured) if measured else None, full), report


def _hub_beam_paper(full: bool) -> "_Paper":
    from boomctl.papers.bai.report import jobs, report
    from boomctl.papers.bai.validity import FULL_TORQUES, TORQUES

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

    parser, own = _Parser(design), "a Python file with a function design() or slew()"
    parser.add_argument("name", help=f"a design of boomctl ({', '.join(design_names())}), or {own}")
    parser.add_out("results")
    parser.add_argument(
        "--road", dest="road_class", help="suspensions: class of the track, ISO 8608, A to H (default: E)"
    )
    parser.add_argument("--speed", type=float, help="suspensions: driving speed, m/s (default: 3.0)")
    parser.add_argument("--seed", type=int, help="suspensions: of the random track (default: 1)")
    parser.add_json()
    asked = parser.parse_args(words)

    from boomctl.files import locked_folder  # after the options, so that help and bad use wait for no numpy

    # what a design prints goes where it does not spoil the results
    with redirect_stdout(sys.stderr) if asked.json else nullcontext():
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
            progress("judging")
            result = made.evaluate(scene)
            report = result.report(progress)
            report.write_into(folder)
    if asked.json:
        _print_json(report.results)
        return
    print(result)
    print(f"Report: {asked.out / 'report.html'}")


def sigma(words: Sequence[str]) -> None:
    """Compute the boom's singular values from platform actuators to tips, with a certified peak."""
    parser, kinds = _Parser(sigma), "finite, high-order, discrete-hermite, discrete-geometric, exact"
    parser.add_argument("--discretization", default="finite", help=f"{kinds} (default: %(default)s)")
    parser.add_argument("--elements", type=int, default=6, help="number of elements (default: %(default)s)")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="TOML file with boom parameters")
    parser.add_argument("--measured", type=Path, metavar="FILE", help="CSV file with a measured curve")
    parser.add_argument("--out", type=Path, metavar="FILE", help="picture to write, .png or .svg")
    parser.add_json()
    asked = parser.parse_args(words)
    if asked.out is not None and asked.out.suffix not in (".png", ".svg"):
        raise ValueError(f"--out {asked.out}: expected a name that ends in .png or .svg")
    curve = None
    if asked.measured:
        from boomctl.analysis.measured import read_measured_curve

        curve = read_measured_curve(asked.measured)
    result = _boom_sigma(asked.discretization, asked.elements, asked.parameters)
    if asked.out is not None:
        label = "exact" if asked.discretization == "exact" else f"{asked.discretization}, {asked.elements}"
        _save_sigma(result, label, curve, asked.out)
    summary = {"peak": result.peak, "peak_omega": result.peak_omega, "certified": result.certified}
    if asked.json:
        _print_json({**summary, "upper_bound": result.certificate.upper, "omega": result.omega, "sigma": result.sigma})
    else:
        bounded = result.certified and isfinite(result.certificate.upper)
        proof = f"certified below {result.certificate.upper:.6g}" if bounded else result.certificate.method
        print(f"peak {result.peak:.6g} at {result.peak_omega:.6g} rad/s ({result.peak_omega / tau:.6g} Hz), {proof}")


def _boom_sigma(discretization: str, elements: int, parameters: Path | None) -> Any:
    from boomctl.analysis.sigma import sigma as singular_values
    from boomctl.boom.model import ACTUATORS, TIPS, spray_boom
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
    plot_sigma(result, label, ax)
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
    parser.add_argument(
        "--angle", type=float, default=pi / 2, help="angle to turn through, rad (default: a quarter turn)"
    )
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
    text = "show the error over meshes in the report (default: shown)"
    parser.add_argument("--mesh-study", action=BooleanOptionalAction, default=True, help=text)
    parser.add_out("slew")
    parser.add_json()
    asked = parser.parse_args(words)

    from boomctl.files import locked_folder, plain
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
    from boomctl.rotating_beam.parameters import HubBeamParameters
    from boomctl.studies.slew.plan import STEPS, evaluated_plan

    if abs(asked.angle) > tau:
        said = f"--angle {asked.angle:g}: {abs(asked.angle) / tau:.3g} turns; angles are in radians"
        print(f"boomctl: {said} ({asked.angle:g} degrees are {asked.angle * pi / 180.0:.5g} rad)", file=sys.stderr)
    limits = ("torque_rate_limit", "speed_limit", "tip_limit", "moment_limit")
    given = {name: getattr(asked, name) for name in limits if getattr(asked, name) is not None}
    beam = AssumedModesBeam(HubBeamParameters(tip_mass=asked.tip_mass), asked.model, asked.modes)
    with locked_folder(asked.out) as folder, _progress(STEPS) as progress:
        evaluation = evaluated_plan(
            beam,
            angle=asked.angle,
            torque_limit=asked.torque_limit,
            meshes=None if asked.mesh_study else (),
            tell=progress,
            objective=asked.objective,
            duration=asked.duration,
            **given,
        )
        report = evaluation.report(progress)
        report.write_into(folder)
    found = plain(report.results)
    if asked.json:
        _print_json(found)
        return
    print(f"{found['duration']:.7g} s; {found['verdict']}")
    print(f"replay: end missed by {found['end_error']:.1e}, {found['residual_energy']:.1e} J left")
    print(f"Report: {asked.out / 'report.html'}")


_BENCHMARKS = {
    "boom": "boomctl.benchmark.boom.run",
    "hub-beam": "boomctl.benchmark.rotating_beam.run",
    "suspension": "boomctl.benchmark.suspension.run",
    "slew": "boomctl.benchmark.slew.run",
}


def benchmark(words: Sequence[str]) -> None:
    """Measure run time and error side by side, against other programs."""
    from boomctl.checks import known

    parser = _Parser(benchmark)
    text = f"{', '.join(_BENCHMARKS)} (default: %(default)s)"
    parser.add_argument("what", nargs="?", default="boom", help=text)
    parser.add_argument("--full", action="store_true", help="include what takes minutes")
    parser.add_json()
    asked = parser.parse_args(words)
    known("benchmark", asked.what, tuple(_BENCHMARKS))
    with _progress(12) as progress:
        report = import_module(_BENCHMARKS[asked.what]).run(asked.full, progress)
    if asked.json:
        _print_json(report.as_dict())
        return
    from rich.console import Console

    Console(width=110 if not sys.stdout.isatty() else None).print(report.render())


_COMMANDS: dict[str, Callable[[Sequence[str]], None]] = {
    command.__name__: command for command in (design, reproduce, sigma, parameters, slew, benchmark)
}


if __name__ == "__main__":
    main()
