"""The command line: ``boomctl sigma``, ``design``, ``reproduce``, ``identify``, ``benchmark`` and others; ``boomctl --help``.

A command imports only what it uses: ``boomctl parameters`` does not import numpy.  Exit codes: 0 success, 1 failure,
2 invalid usage or input.
"""

import os
import re
import sys
import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext, redirect_stdout, suppress
from io import TextIOWrapper
from math import isfinite, tau
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from boomctl.report import Report

_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$|-inf$|-nan$", re.IGNORECASE)
_DISCRETIZATIONS = ("finite", "high-order", "discrete-hermite", "discrete-geometric", "exact")
_PAPERS = {
    "boom": "Anthonis & Ramon (2003): the spray boom",
    "hub-beam": "Bai et al. (2009): the rotating hub-beam",
}
_CODES = """
Exit codes: 0 success, 1 failure, 2 invalid usage or input. An error is one line on standard error. Progress and colors are
shown on terminals only; NO_COLOR turns colors off."""


class _Parser(ArgumentParser):
    """The options of a command; bad use is a ValueError."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)
        self._negative_number_matcher = _NEGATIVE  # argparse's own takes -3e4 for an option

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def main() -> None:
    """Run the command line; every failure is one line on standard error."""
    for stream in (sys.stdout, sys.stderr):  # a character that a terminal does not have is no error
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        _run(sys.argv[1:])
        sys.stdout.flush()
    except (ValueError, TypeError) as error:
        _fail(str(error), 2)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as error:  # an argument names a missing file
        problem = "expected a file, got a folder" if isinstance(error, IsADirectoryError) else "there is no such file"
        _fail(str(error) if error.filename is None else f"{error.filename}: {problem}", 2)
    except BrokenPipeError:  # the reader of the output has closed it (boomctl parameters | head)
        with suppress(AttributeError, OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except (OSError, ArithmeticError, ImportError, RuntimeError) as error:
        if isinstance(error, NotImplementedError | RecursionError):
            raise
        message = str(error)
        if isinstance(error, OSError) and error.strerror:
            message = error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
        if isinstance(error, ModuleNotFoundError) and error.name == "mpmath":
            message = "mpmath is not installed: pip install 'boomctl[lab]'"
        _fail(message, 1)
    except KeyboardInterrupt:
        _fail("interrupted", 1)
    sys.exit(0)


def _run(words: Sequence[str]) -> None:
    """Run the command that the first word names, with the others as its arguments."""
    if not words or words[0] in ("-h", "--help"):
        print("usage: boomctl [--version] COMMAND ...\n\nCommands; boomctl COMMAND --help lists the options:")
        print(
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
    command = _COMMANDS[words[0]]
    parser = _Parser(prog=f"boomctl {words[0]}", description=command.__doc__)
    if command is design:
        from boomctl.studies.catalogue import design_names

        parser.epilog = f"Designs of boomctl: {', '.join(design_names())}"
    for flag, given in {**_OPTIONS[words[0]], **_COMMON}.items():
        parser.add_argument(flag, **given)
    asked = parser.parse_args(words[1:])
    with ExitStack() as around:
        around.enter_context(warnings.catch_warnings())
        warnings.showwarning = lambda message, *place: _tell(f"warning: {message}")
        if asked.quiet:
            warnings.simplefilter("ignore")
        if asked.json or asked.quiet:
            from boomctl.progress import progress_callback

            around.enter_context(redirect_stdout(around.enter_context(open(os.devnull, "w"))))
            around.enter_context(progress_callback(None))
        results = command(asked)
    if asked.json:
        import json

        from boomctl.files import plain

        print(json.dumps(plain(results), allow_nan=False))


def _tell(message: str) -> None:
    print(f"boomctl: {' '.join(message.split())}", file=sys.stderr)


def _fail(message: str, code: int) -> NoReturn:
    _tell(message)
    sys.exit(code)


def _write(report: "Report", folder: Path) -> None:
    """Write a report into a folder, and name its other files, which are not of this run."""
    written = report.write(folder)
    others = sorted(item.name for item in folder.iterdir() if item.is_file() and item not in written)
    if others:
        _tell(f"{folder}: also has files that are not of this run: {', '.join(others)}")
    print(f"Report: {folder / 'report.html'}")


def sigma(asked: Namespace) -> dict[str, Any]:
    """Compute the boom's singular values from platform actuators to tips, with a verified peak."""
    if asked.out is not None and asked.out.suffix not in (".png", ".svg"):
        raise ValueError(f"--out {asked.out}: expected a name that ends in .png or .svg")
    if asked.out is not None and asked.out.is_dir():
        raise ValueError(f"--out {asked.out}: expected a file, got a folder")
    exact, elements = asked.discretization == "exact", 6 if asked.elements is None else asked.elements
    if exact and asked.elements is not None:
        raise ValueError(f"--elements {asked.elements}: leave it out with --discretization exact")
    from boomctl.analysis.sigma import sigma as singular_values
    from boomctl.boom.factory import spray_boom
    from boomctl.boom.model import ACTUATORS, TIPS
    from boomctl.boom.parameters import BoomParameters
    from boomctl.checks import known
    from boomctl.identification.files.frequency_response import read_frequency_response

    known("discretization", asked.discretization, _DISCRETIZATIONS)
    curve = read_frequency_response(asked.measured) if asked.measured else None
    p = BoomParameters.from_toml(asked.parameters) if asked.parameters else BoomParameters()
    if exact:
        from boomctl.boom.exact import exact_frequency_response  # it imports control, which no other mesh needs

        grid = singular_values(spray_boom(p, "high-order", 4)).omega
        result = singular_values(exact_frequency_response(p, grid, ACTUATORS, TIPS))
    else:
        result = singular_values(spray_boom(p, asked.discretization, elements))
    if asked.out is not None:
        _save_sigma(result, "exact" if exact else f"{asked.discretization}, {elements}", curve, asked.out)
    bound = result.certificate.upper_bound
    proof = f"{result.certificate.status} below {bound:.6g}" if isfinite(bound) else result.certificate.method
    print(f"peak {result.peak:.6g} at {result.peak_omega:.6g} rad/s ({result.peak_omega / tau:.6g} Hz), {proof}")
    found = {"peak": result.peak, "peak_omega": result.peak_omega, "verified": result.verified, "upper_bound": bound}
    curves = {"omega": result.omega, "sigma": result.sigma}
    return {**found, "inputs": result.input_labels, "outputs": result.output_labels, **curves}


def _save_sigma(result: Any, label: str, curve: Any, out: Path) -> None:
    from boomctl.files import prepared_folder, write_whole
    from boomctl.plotting.canvas import figure_bytes, new_figure

    prepared_folder(out.parent)
    figure = new_figure()
    ax = figure.add_subplot()
    result.plot(ax, frequency_unit="Hz", label=label)
    if curve is not None:
        curve.plot(ax)
    write_whole(out, figure_bytes(figure, out.suffix[1:]))


def design(asked: Namespace) -> Any:
    """Run a design of a suspension, a slew or another machine, and write a report.

    NAME is a design of boomctl, or a Python file with a function design() that returns a SuspensionDesign, a MachineDesign
    or a SlewDesign.
    """
    from boomctl.studies.catalogue import design_path, load_design

    path = design_path(asked.name)
    from boomctl.files import prepared_folder
    from boomctl.progress import computing
    from boomctl.studies.suspension.design import SuspensionDesign
    from boomctl.studies.suspension.scenario import FieldScenario

    given = {name: getattr(asked, name) for name in ("road_class", "speed", "seed")}
    chosen = {name: value for name, value in given.items() if value is not None}
    scenario, folder = FieldScenario(**chosen), prepared_folder(asked.out)
    aside = redirect_stdout(sys.stderr) if asked.json else nullcontext()  # a design may print
    with computing("design") as tell, aside:
        tell("synthesis", 0, 3)
        made = load_design(path)
        suspension = isinstance(made, SuspensionDesign)
        if chosen and not suspension:
            wrong = ", ".join(f"--{name.removesuffix('_class')}" for name in chosen)
            raise ValueError(f"{wrong}: of suspensions only; expected none for the design {asked.name!r}")
        tell("evaluation", 1, 3)
        result = made.evaluate(scenario) if suspension else made.evaluate()
        tell("report", 2, 3)
        report = result.report()
    print(result)
    _write(report, folder)
    return report.results


def reproduce(asked: Namespace) -> dict[str, Any]:
    """Compute the tables and figures of the papers, with the published values.

    "all" writes the report of each paper into a subfolder of --out.
    """
    from boomctl.checks import known, whole
    from boomctl.files import json_text, plain, prepared_folder, write_all
    from boomctl.progress import computing
    from boomctl.report import bound_reports

    known("what to reproduce", asked.what, (*_PAPERS, "all"))
    if asked.what == "hub-beam" and (asked.parameters or asked.measured):
        raise ValueError("--parameters and --measured are of the boom: leave them out for hub-beam")
    workers = None if asked.workers is None else whole("--workers", asked.workers)
    names = tuple(_PAPERS) if asked.what == "all" else (asked.what,)
    from boomctl.lab.papers.anthonis_ramon import report as anthonis_ramon
    from boomctl.lab.papers.bai import report as bai
    from boomctl.lab.papers.jobs import run_jobs

    jobs: dict[str, Any] = {}
    if "boom" in names:
        from boomctl.boom.parameters import BoomParameters
        from boomctl.identification.files.frequency_response import read_frequency_response

        p = BoomParameters.from_toml(asked.parameters) if asked.parameters else None
        jobs |= anthonis_ramon.jobs(p, read_frequency_response(asked.measured) if asked.measured else None)
    if "hub-beam" in names:
        jobs |= bai.jobs()
    folder, results, reports = prepared_folder(asked.out), {}, []
    with computing("reproduction") as tell:
        result = run_jobs(jobs, workers, tell)
    for name in names:
        report = (anthonis_ramon if name == "boom" else bai).report(result)
        results[name] = plain(report.results)
        reports.append((_PAPERS[name], report.html))
        _print_paper(name, results[name])
        _write(report, folder / name if asked.what == "all" else folder)
    if asked.what != "all":
        return results[asked.what]
    both = bound_reports("Two papers, computed again", reports)
    write_all({folder / "report.html": both, folder / "results.json": json_text(results)})
    print(f"Both reports in one: {folder / 'report.html'}")
    return results


def _print_paper(name: str, results: dict[str, Any]) -> None:
    if name == "hub-beam":
        verdicts = ", ".join(f"{count} {verdict}" for verdict, count in results["summary"].items())
        print(f"Bai et al. (2009), numbers and statements: {verdicts}.")
        return
    print("Anthonis & Ramon (2003), Table 1, difference from the published frequencies in percent:")
    for method, result in results["table_1"]["methods"].items():
        print(f"  {method}: {', '.join(f'{percent:+.2f}' for percent in result['difference_percent'])}")
    print("The geometrical column's fourth value, 2.9316 Hz, is not reproducible; see the report.")


def identify(asked: Namespace) -> Any:
    """Identify modes with confidence intervals and a model from a record, and write a report.

    The file is a record, CSV with a header line or .mat with vectors, or a measured frequency response, CSV or UFF.
    """
    from boomctl.files import prepared_folder
    from boomctl.studies.measurement import identified_file

    folder = prepared_folder(asked.out)
    options = {name: getattr(asked, name) for name in ("frequency_range_hz", "modes", "quantity", "intersample")}
    result, report = identified_file(asked.record, asked.inputs, asked.outputs, asked.sample_time, **options)
    print(result)
    _write(report, folder)
    return report.results


def benchmark(asked: Namespace) -> dict[str, Any]:
    """Measure run time and error, compared with other programs.

    NAME is a scene ("boom-sigma") or the first word of several ("boom").
    """
    from boomctl.files import prepared_folder
    from boomctl.lab.benchmark.report import run
    from boomctl.progress import computing

    folder = None if asked.out is None else prepared_folder(asked.out)
    with computing("benchmark") as tell:
        result = run(asked.what, quick=asked.quick, progress=tell)
    print(result)
    if folder is not None:
        _write(result.report(), folder)
    return result.to_dict()


def parameters(asked: Namespace) -> dict[str, Any]:
    """Print the boom's parameters as an annotated TOML file; edit it and pass it to --parameters."""
    text = (Path(__file__).parent / "boom" / "table_2.toml").read_text(encoding="utf-8")
    print(text, end="")
    if not asked.json:
        return {}
    import tomllib

    return tomllib.loads(text)


def notebooks(asked: Namespace) -> list[str]:
    """Copy the notebooks that come with boomctl into a folder."""
    from boomctl.files import prepared_folder, write_all
    from boomctl.studies.catalogue import shipped

    source = shipped("notebooks")
    result = sorted(path for path in source.glob("*") if path.is_file() and path.name[0] not in "._")
    if not any(path.suffix == ".ipynb" for path in result):
        raise RuntimeError(f"there are no notebooks in {source}: this installation of boomctl came without them")
    if asked.out.resolve() == source.resolve():
        raise ValueError(f"--out {asked.out}: that is where they come from; expected another folder")
    there = [path.name for path in result if (asked.out / path.name).exists()]
    if there and not asked.force:
        raise ValueError(f"--out {asked.out}: {', '.join(there)} already there; expected another folder, or --force")
    prepared_folder(asked.out)
    write_all({asked.out / path.name: path.read_bytes() for path in result})
    copied = [str(asked.out / path.name) for path in result]
    print(*copied, sep="\n")
    return copied


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _folder(default: str, purpose: str = "report, pictures and results") -> dict[str, Any]:
    help_text = f"folder for {purpose} (default: %(default)s)"
    return {"type": Path, "default": Path(default), "metavar": "FOLDER", "help": help_text}


def _option(help_text: str, **options: Any) -> dict[str, Any]:
    return {"help": help_text, **options}


def _file(help_text: str) -> dict[str, Any]:
    return {"type": Path, "metavar": "FILE", "help": help_text}


def _flag(help_text: str) -> dict[str, Any]:
    return {"action": "store_true", "help": help_text}


_COMMON = {
    "--json": _flag("print the results as JSON on standard output"),
    "--quiet": _flag("print only the JSON and show no progress"),
}
_COMMANDS = {
    command.__name__: command for command in (sigma, design, reproduce, identify, benchmark, parameters, notebooks)
}
_OPTIONS: dict[str, dict[str, dict[str, Any]]] = {
    "sigma": {
        "--discretization": _option(f"{', '.join(_DISCRETIZATIONS)} (default: %(default)s)", default="finite"),
        "--elements": _option("number of elements, not for exact (default: 6)", type=int),
        "--parameters": _file("TOML file with boom parameters"),
        "--measured": _file("CSV file with a measured curve"),
        "--out": _file("image file to write, .png or .svg"),
    },
    "design": {
        "name": _option("name of a design, or a Python file", metavar="NAME"),
        "--out": _folder("results"),
        "--road": _option("suspensions: road class, ISO 8608, A to H (default: E)", dest="road_class"),
        "--speed": _option("suspensions: driving speed, m/s (default: 3.0)", type=float),
        "--seed": _option("suspensions: of the random track (default: 1)", type=int),
    },
    "reproduce": {
        "what": _option("boom, hub-beam or all (default: %(default)s)", nargs="?", default="all"),
        "--out": _folder("results"),
        "--parameters": _file("TOML file with other boom parameters"),
        "--measured": _file("CSV file with a measured curve of the boom"),
        "--workers": _option("parallel processes (default: one for each core)", type=int, metavar="COUNT"),
    },
    "identify": {
        "record": _option("the file: .csv, .mat, .uff or .unv", type=Path),
        "--inputs": _option("input columns, separated by commas", type=_names, default=[]),
        "--outputs": _option(
            "output columns, separated by commas (default: all others except time)", type=_names, default=[]
        ),
        "--sample-time": _option("sample time, s (default: from the column named time)", type=float),
        "--band": _option(
            "frequency range of the modes, Hz (default: where all inputs have power)",
            dest="frequency_range_hz",
            type=float,
            nargs=2,  # lower and upper limit
            metavar=("LOW", "HIGH"),
        ),
        "--modes": _option("number of modes (default: all that the data determine)", type=int),
        "--quantity": _option("of the outputs: displacement (default), velocity or acceleration"),
        "--intersample": _option(
            "of the inputs: bl (band-limited) or zoh (zero-order hold) (default: from the record)"
        ),
        "--out": _folder("identified"),
    },
    "benchmark": {
        "what": _option("scenes (default: all)", nargs="*", metavar="NAME"),
        "--quick": _flag("fewer settings, one process for each"),
        "--out": {"type": Path, "metavar": "FOLDER", "help": "folder for report, pictures and results"},
    },
    "parameters": {},
    "notebooks": {
        "--out": _folder("notebooks", "the copies"),
        "--force": _flag("overwrite files of the same names"),
    },
}


if __name__ == "__main__":
    main()
