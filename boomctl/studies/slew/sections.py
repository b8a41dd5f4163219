"""Sections of the slew report that only some slews have: switching function, payloads, spin-ups."""

from collections.abc import Sequence
from typing import Any

from boomctl.report import Picture, Section, Table, number
from boomctl.slew import SlewResult


def switching_section(results: dict[str, Any], picture: bytes) -> Section:
    """Return the section of Pontryagin's principle.

    Parameters
    ----------
    results : dict
        What results.json holds.
    picture : bytes
        PNG.
    """
    text = (
        "The switching function says how much time a little more torque would save at each instant. In minimum time the "
        "torque has its sign everywhere (Pontryagin's principle), which is necessary, and not sufficient where the problem "
        "is not convex. It is carried back along the nonlinear motion from the multipliers of the end conditions, and has "
        f"the torque's sign on {_share(results['switching_agreement'])} of the duration."
    )
    caption = "Switching function over its largest size, on a scale of cube roots, and torque."
    return Section("The switching function", (text,), (), (Picture(picture, "png", caption),))


def _share(value: float) -> str:
    return "all" if value == 1.0 else f"{100.0 * value:.2f} %"


def payload_section(nominal: float, lines: Sequence[dict[str, Any]], picture: bytes) -> Section:
    """Return the section of one torque with several payloads.

    Parameters
    ----------
    nominal : float
        Tip mass for which the angle is prescribed, kg.
    lines : sequence of dict
        Payload by payload, as results.json has them.
    picture : bytes
        PNG.
    """
    names = tuple(dict.fromkeys(line["slew"] for line in lines))
    masses = sorted({line["tip_mass"] for line in lines})
    by = {(line["slew"], line["tip_mass"]): line for line in lines}
    columns = (("vibration [m]", "vibration"), ("largest tip [m]", "peak_tip"), ("angle error [rad]", "angle_error"))
    heads = ("payload", *(f"{head}, {name}" for head, _ in columns for name in names))
    body = tuple(
        (f"{mass:g}\u00a0kg", *(number(by[name, mass][key]) for _, key in columns for name in names)) for mass in masses
    )
    text = (
        "The torque does not know which payload there is. Largest tip: its displacement on the way; vibration: the same in "
        "one and a half periods after the end; angle error: of the hub, its mean afterwards. The angle is prescribed for "
        f"{nominal:g} kg; other payloads that were planned for are only to come to rest."
    )
    caption = (
        "Left: tip displacement with each payload, grey while the torque acts; broken lines: payloads not planned for. "
        "Right: vibration left over the payload, filled markers where it was planned for; what is below 0.1 mm stands on the "
        "lower edge."
    )
    return Section(
        "The same torque with every payload", (text,), (Table(heads, body),), (Picture(picture, "png", caption),)
    )


def spin_up_section(spin_ups: Sequence[dict[str, Any]], slew: SlewResult, picture: bytes) -> Section:
    """Return the section of a spin-up and the profile of the hub set beside it.

    Parameters
    ----------
    spin_ups : sequence of dict
        As results.json has them: the planned one, and the profile.
    slew : SlewResult
        The planned one.
    picture : bytes
        PNG.
    """
    problem = slew.plan.problem
    columns = (
        ("duration [s]", "duration"),
        ("peak torque [N\u00a0m]", "peak_torque"),
        ("vibration [m]", "vibration"),
        ("speed error [rad/s]", "speed_error"),
    )
    body = tuple((each["name"], *(number(each[key]) for _, key in columns)) for each in spin_ups)
    text = (
        f"The beam ends in steady rotation at {problem.final_speed:g} rad/s, its hub free. The classical profile of Bai et "
        "al. (2009), Eq. (43), prescribes the hub's course exactly, then and afterwards, as an ideal speed loop would, "
        "whatever torque that takes. Vibration and speed error are the largest after the end."
    )
    caption = (
        "Torque, hub speed and tip displacement. Broken lines: torque limit and speed asked for; dotted: the ends."
    )
    table = Table(("", *(head for head, _ in columns)), body)
    return Section("Into steady rotation", (text,), (table,), (Picture(picture, "png", caption),))
