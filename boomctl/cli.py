"""The command line: ``boomctl design``, ``reproduce``, ``sigma``, ``parameters``, ``benchmark``.

Exit code 0: done; 1: could not be done; 2: bad use or bad input.
"""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from math import tau
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from boomctl.studies.catalogue import design_file, design_names

if TYPE_CHECKING:
    from boomctl.report import Report

app = typer.Typer(
    help="Control design for flexible structures on a moving base.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)

Json = Annotated[bool, typer.Option("--json", help="Print the results as JSON on standard output.")]


def main() -> None:
    """Run the command line; every failure is one line on standard error.

    Matrices here are small and want one thread; who sets the variables of BLAS is obeyed.
    """
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    code: object = 0
    try:
        code = app(standalone_mode=False)
    except (ValueError, TypeError) as error:
        _fail(str(error), 2)
    except (OSError, ArithmeticError, ImportError, RuntimeError) as error:
        if isinstance(error, NotImplementedError | RecursionError):
            raise
        _fail(str(error), 1)
    except KeyboardInterrupt:
        _fail("interrupted", 1)
    except Exception as error:
        show = getattr(error, "show", None)
        if show is None:
            raise
        show()
        sys.exit(getattr(error, "exit_code", 2))
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int) -> None:
    print(f"boomctl: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(code)


def _print_json(value: Any) -> None:
    from boomctl.files import plain

    print(json.dumps(plain(value), allow_nan=False))


@contextmanager
def _progress(steps: int) -> Iterator[Callable[[str], None]]:
    """Show a progress bar on a terminal's standard error; give the function that moves it on."""
    from rich.console import Console
    from rich.progress import BarColumn as Bar
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), Bar(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=steps)
        yield lambda text: bar.update(task, description=text, advance=1)


def _version(wanted: bool) -> None:
    if wanted:
        from boomctl import __version__

        print(f"boomctl {__version__}")
        raise typer.Exit


@app.callback()
def _root(version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True)] = False) -> None:
    del version


@app.command()
def reproduce(
    what: Annotated[str, typer.Argument(help="boom, hub-beam or all")] = "all",
    out: Annotated[Path, typer.Option(help="Folder for pictures, report and results.")] = Path("results"),
    parameters: Annotated[Path | None, typer.Option(help="TOML file with other boom parameters.")] = None,
    measured: Annotated[Path | None, typer.Option(help="CSV file with a measured sigma curve of the boom.")] = None,
    as_json: Json = False,
) -> None:
    """Compute the papers' tables and figures again, beside the published values.

    "all" puts either paper into a folder of its own below --out.
    """
    from boomctl.checks import known
    from boomctl.files import plain, prepared_folder, write_json, write_whole
    from boomctl.report import bound_reports

    known("what to reproduce", what, ("boom", "hub-beam", "all"))
    if what == "hub-beam" and (parameters or measured):
        raise ValueError("--parameters and --measured are of the boom: leave them out for hub-beam")
    folder, results, reports = prepared_folder(out), {}, []
    for name in ("boom", "hub-beam") if what == "all" else (what,):
        target = folder / name if what == "all" else folder
        report = _boom_report(parameters, measured) if name == "boom" else _hub_beam_report()
        report.write(target)
        results[name] = plain(report.results)
        reports.append((_PAPERS[name], report.html))
        if not as_json:
            _print_paper(name, results[name])
            print(f"Report: {target / 'report.html'}")
    if what == "all":
        write_whole(folder / "report.html", bound_reports("Two papers, computed again", reports))
        write_json(folder / "results.json", results)
        if not as_json:
            print(f"Both reports in one: {folder / 'report.html'}")
    if as_json:
        _print_json(results if what == "all" else results[what])


_PAPERS = {
    "boom": "Anthonis & Ramon (2003): the spray boom",
    "hub-beam": "Bai et al. (2009): the rotating hub-beam",
}


def _boom_report(parameters: Path | None, measured: Path | None) -> "Report":
    from boomctl.analysis.measured import read_measured_curve
    from boomctl.boom.parameters import BoomParameters
    from boomctl.papers.anthonis_ramon.report import STEPS, reproduction

    p = BoomParameters.from_toml(parameters) if parameters else None
    curve = read_measured_curve(measured) if measured else None
    with _progress(STEPS) as progress:
        return reproduction(p, curve, progress)


def _hub_beam_report() -> "Report":
    from boomctl.papers.bai.report import PARTS, reproduction

    with _progress(len(PARTS) + 2) as progress:
        return reproduction(progress=progress)


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


_DESIGNS = f"A design of boomctl ({', '.join(design_names())}), or a Python file with a function design() or slew()."


@app.command()
def design(
    name: Annotated[str, typer.Argument(help=_DESIGNS)],
    out: Annotated[Path, typer.Option(help="Folder for pictures, report and results.")] = Path("results"),
    road: Annotated[
        str | None, typer.Option(help="Suspensions: class of the track, ISO 8608, A to H.", show_default="E")
    ] = None,
    speed: Annotated[float | None, typer.Option(help="Suspensions: driving speed, m/s.", show_default="3.0")] = None,
    seed: Annotated[int | None, typer.Option(help="Suspensions: of the random track.", show_default="1")] = None,
    as_json: Json = False,
) -> None:
    """Run a design and report what it is worth: a suspension beside the boom as it is, a slew beside classical ones."""
    from boomctl.files import prepared_folder

    found = design_file(name)
    given = {"road_class": road, "speed": speed, "seed": seed}
    chosen = {option: value for option, value in given.items() if value is not None}
    wrong = [f"--{option.removesuffix('_class')}" for option in chosen if option not in found.kind.options]
    if wrong:
        raise ValueError(f"{', '.join(wrong)}: of suspensions only; expected none for the {found.kind.name} {name!r}")
    scene, folder = found.kind.design_class.scene(**chosen), prepared_folder(out)
    with _progress(found.kind.steps) as progress:
        progress("design")
        made = found.made()
        progress("judging")
        result = made.evaluate(scene)
        report = result.report(progress)
    report.write(folder)
    if as_json:
        _print_json(report.results)
        return
    print(result)
    print(f"Report: {out / 'report.html'}")


@app.command()
def sigma(
    discretization: Annotated[
        str, typer.Option(help="finite, high-order, discrete-hermite, discrete-geometric, exact")
    ] = "finite",
    elements: Annotated[int, typer.Option(help="Number of elements.")] = 6,
    parameters: Annotated[Path | None, typer.Option(help="TOML file with boom parameters.")] = None,
    measured: Annotated[Path | None, typer.Option(help="CSV file with a measured curve.")] = None,
    out: Annotated[Path | None, typer.Option(help="Picture to write, .png or .svg.")] = None,
    as_json: Json = False,
) -> None:
    """Compute the boom's singular values from platform actuators to tips, with a certified peak."""
    from boomctl.analysis.measured import read_measured_curve

    if out is not None and out.suffix not in (".png", ".svg"):
        raise ValueError(f"--out {out}: expected a name that ends in .png or .svg")
    curve = read_measured_curve(measured) if measured else None
    result = _boom_sigma(discretization, elements, parameters)
    if out is not None:
        _save_sigma(result, f"{discretization}, {elements}" if discretization != "exact" else "exact", curve, out)
    summary = {"peak": result.peak, "peak_omega": result.peak_omega, "certified": result.certified}
    if as_json:
        _print_json({**summary, "upper_bound": result.certificate.upper, "omega": result.omega, "sigma": result.sigma})
    else:
        proof = f"certified below {result.certificate.upper:.6g}" if result.certified else result.certificate.method
        print(f"peak {result.peak:.6g} at {result.peak_omega:.6g} rad/s ({result.peak_omega / tau:.6g} Hz), {proof}")


def _boom_sigma(discretization: str, elements: int, parameters: Path | None) -> Any:
    from boomctl.analysis.sigma import sigma as singular_values
    from boomctl.boom.exact import exact_frequency_response
    from boomctl.boom.model import ACTUATORS, TIPS, spray_boom
    from boomctl.boom.parameters import BoomParameters

    p = BoomParameters.from_toml(parameters) if parameters else BoomParameters()
    if discretization != "exact":
        return singular_values(spray_boom(p, discretization, elements))
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


@app.command()
def parameters(as_json: Json = False) -> None:
    """Print the boom's parameters as an annotated TOML file, to be changed and given to --parameters."""
    from importlib.resources import as_file, files

    from boomctl.files import read_toml

    with as_file(files("boomctl.boom").joinpath("table_2.toml")) as path:
        if as_json:
            _print_json(read_toml(path))
        else:
            print(path.read_text(encoding="utf-8"), end="")


@app.command()
def slew(
    angle: Annotated[
        float, typer.Option(help="Angle to turn through, rad.", show_default="a quarter turn")
    ] = 1.5707963267948966,
    torque_limit: Annotated[float, typer.Option(help="Largest torque, N m.")] = 200.0,
    objective: Annotated[str, typer.Option(help="What is minimised: time, effort, jerk, torque-rate or tip.")] = "time",
    duration: Annotated[float | None, typer.Option(help="Duration, s; for every objective but time.")] = None,
    model: Annotated[str, typer.Option(help="sfoam, sfoam-consistent, foam or tlam.")] = "sfoam",
    modes: Annotated[int, typer.Option(help="Number of modes.")] = 3,
    tip_mass: Annotated[float, typer.Option(help="Mass at the tip, kg.")] = 0.0,
    torque_rate_limit: Annotated[float | None, typer.Option(help="Largest rate of the torque, N m/s.")] = None,
    speed_limit: Annotated[float | None, typer.Option(help="Largest hub speed, rad/s.")] = None,
    tip_limit: Annotated[float | None, typer.Option(help="Largest tip displacement, m.")] = None,
    moment_limit: Annotated[float | None, typer.Option(help="Largest bending moment at the clamp, N m.")] = None,
    mesh_study: Annotated[bool, typer.Option(help="Show the error over meshes in the report.")] = True,
    out: Annotated[Path, typer.Option(help="Folder for report, pictures and film.")] = Path("slew"),
    as_json: Json = False,
) -> None:
    """Plan an optimal slew of the hub-beam, certify it and set it beside classical ones."""
    from boomctl.files import plain, prepared_folder
    from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
    from boomctl.rotating_beam.parameters import HubBeamParameters
    from boomctl.studies.slew.plan import STEPS, evaluated_plan

    folder = prepared_folder(out)
    given = {"torque_rate_limit": torque_rate_limit, "speed_limit": speed_limit, "tip_limit": tip_limit}
    given |= {"moment_limit": moment_limit}
    asked = {name: value for name, value in given.items() if value is not None}
    beam = AssumedModesBeam(HubBeamParameters(tip_mass=tip_mass), model, modes)
    with _progress(STEPS) as progress:
        evaluation = evaluated_plan(
            beam,
            angle=angle,
            torque_limit=torque_limit,
            meshes=None if mesh_study else (),
            tell=progress,
            objective=objective,
            duration=duration,
            **asked,
        )
        report = evaluation.report(progress)
    report.write(folder)
    found = plain(report.results)
    if as_json:
        _print_json(found)
        return
    print(f"{found['duration']:.7g} s; {found['verdict']}")
    print(f"replay: end missed by {found['end_error']:.1e}, {found['residual_energy']:.1e} J left")
    print(f"Report: {out / 'report.html'}")


_BENCHMARKS = {
    "boom": "boomctl.benchmark.boom.run",
    "hub-beam": "boomctl.benchmark.rotating_beam.run",
    "suspension": "boomctl.benchmark.suspension.run",
    "slew": "boomctl.benchmark.slew.run",
}


@app.command()
def benchmark(
    what: Annotated[str, typer.Argument(help=", ".join(_BENCHMARKS))] = "boom",
    full: Annotated[bool, typer.Option(help="Include what takes minutes.")] = False,
    as_json: Json = False,
) -> None:
    """Measure run time and error side by side, against other programs."""
    from boomctl.checks import known

    known("benchmark", what, tuple(_BENCHMARKS))
    with _progress(12) as progress:
        report = import_module(_BENCHMARKS[what]).run(full, progress)
    if as_json:
        _print_json(report.as_dict())
        return
    from rich.console import Console

    Console(width=110 if not sys.stdout.isatty() else None).print(report.render())


if __name__ == "__main__":
    main()
