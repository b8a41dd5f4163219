"""Hub-beams, states and amplitudes for property tests."""

from hypothesis import strategies as st

from boomctl.rotating_beam import HubBeamParameters

ALL_MODELS = ("tlam", "sfoam", "sfoam-consistent", "foam", "cfoam")


@st.composite
def parameters(draw: st.DrawFn, damped: bool = False) -> HubBeamParameters:
    """Slender beams with and without tip mass, which is anywhere on the beam; hubs from light to heavy."""
    length = draw(st.floats(0.5, 12.0))
    return HubBeamParameters(
        length=length,
        density=draw(st.floats(1e3, 8e3)),
        area=draw(st.floats(2e-5, 5e-4)),
        youngs_modulus=draw(st.floats(1e10, 2e11)),
        second_moment=draw(st.floats(1e-10, 1e-8)),
        hub_inertia=draw(st.floats(0.0, 300.0)),
        hub_radius=draw(st.floats(0.0, 2.0)),
        tip_mass=draw(st.sampled_from([0.0, 0.01, 0.3])),
        tip_mass_position=draw(st.one_of(st.none(), st.floats(0.0, 1.0).map(lambda part: part * length))),
        damping_ratio=draw(st.floats(0.0, 0.2)) if damped else 0.0,
    )
