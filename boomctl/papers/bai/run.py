"""Every table and figure of Bai et al. (2009) beside what correct equations give."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from boomctl.files import prepared_folder, write_whole
from boomctl.papers.bai import frequencies as hub_beam_frequencies
from boomctl.papers.bai import spin_up as hub_beam_spin_up
from boomctl.papers.bai import tip_mass as hub_beam_tip_mass
from boomctl.papers.bai import torque as hub_beam_torque
from boomctl.papers.bai.comparison import Section
from boomctl.papers.bai.film import slew_film
from boomctl.papers.bai.report import images_of, report_html, results_json, summary
from boomctl.papers.bai.validity import TORQUES, section, validity
from boomctl.plotting.rotating_beam import film_bytes

PARTS: dict[str, Callable[[], Section]] = {
    "Table 2": hub_beam_frequencies.table_2,
    "Fig. 3": hub_beam_spin_up.neglected_terms,
    "Fig. 4": hub_beam_spin_up.cfoam_and_foam,
    "Fig. 5": hub_beam_spin_up.foam_and_tlam,
    "Fig. 6": hub_beam_spin_up.mode_by_mode,
    "Table 3, Fig. 7": hub_beam_torque.inertia_torque,
    "Fig. 8": hub_beam_torque.foam_and_sfoam,
    "critical speeds, Fig. 9": hub_beam_frequencies.critical_speeds,
    "Fig. 10": hub_beam_tip_mass.tip_mass,
}
"""Parts of the paper in its order, each computed by one function."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """What was computed, and the files written.

    Attributes
    ----------
    sections : tuple of Section
        Numbers, statements and pictures.
    files : tuple of Path
        Pictures (PNG and SVG), the film, results.json and report.html.
    summary : dict of str to int
        How many numbers and statements are met, met with corrected reading, not reproducible.
    """

    sections: tuple[Section, ...]
    files: tuple[Path, ...]
    summary: dict[str, int]


def run(
    out_dir: str | Path,
    *,
    torques: tuple[float, ...] = TORQUES,
    progress: Callable[[str], None] | None = None,
) -> Reproduction:
    """Reproduce the paper's tables and figures, and write them to a folder.

    Parameters
    ----------
    out_dir : str or Path
        Folder for the files; made if need be. A file is written whole or not at all, and replaces one of its name.
    torques : tuple of float
        Amplitudes over which the models are held against the geometrically exact beam, N m; at least two, ascending,
        > 0.
    progress : callable, optional
        Called with the name of each part before it is computed.

    Returns
    -------
    Reproduction

    Raises
    ------
    ValueError
        If `torques` are not as said.
    OSError
        If the folder cannot be made or written to.
    """
    if len(torques) < 2 or torques[0] <= 0.0 or any(b <= a for a, b in pairwise(torques)):
        raise ValueError(f"torques = {torques!r}: expected at least two, ascending and > 0")
    folder = prepared_folder(out_dir)
    tell = progress or (lambda part: None)
    sections = []
    for part, compute in PARTS.items():
        tell(part)
        sections.append(compute())
    tell("validity of the models")
    sections.append(section(validity(torques)))
    tell("pictures and report")
    return _write(folder, tuple(sections))


def _write(folder: Path, sections: tuple[Section, ...]) -> Reproduction:
    film = film_bytes(slew_film())
    pictures = images_of(sections, "png")
    contents = {f"{name}.png": image for name, image in pictures.items()}
    contents |= {f"{name}.svg": image for name, image in images_of(sections, "svg").items()}
    contents["slew.gif"] = film
    contents["results.json"] = results_json(sections).encode()
    contents["report.html"] = report_html(sections, pictures, film).encode()
    for name, content in contents.items():
        write_whole(folder / name, content)
    return Reproduction(sections, tuple(folder / name for name in contents), summary(sections))
