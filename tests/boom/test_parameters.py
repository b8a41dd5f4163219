"""Parameters of the boom: what they mean, files, and what is warned of."""

import dataclasses
import warnings
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from tests.profiles import examples

NAMES = [field.name for field in dataclasses.fields(bc.BoomParameters)]


def test_the_tube_is_that_of_table_2():
    p = bc.BoomParameters()
    assert p.second_moment == pytest.approx(2.17932e-8, rel=1e-5)
    assert p.area == pytest.approx(3.212e-4, rel=1e-4)
    assert p.tube_mass == pytest.approx(30.064, abs=5e-4)
    assert p.tube_inertia == pytest.approx(360.772, abs=5e-4)


def test_the_annotated_file_holds_the_defaults():
    path = files("boomctl.boom").joinpath("table_2.toml")
    text = path.read_text()
    assert bc.BoomParameters.from_toml(str(path)) == bc.BoomParameters()
    assert all(f"\n{name} = " in text for name in NAMES)


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("spring_stifness = 900.0", ValueError, "did you mean 'spring_stiffness'"),
        ("length = 'long'", TypeError, "length = 'long': expected a number"),
        ("length = true", TypeError, "length"),
        ("[boom]\nlength = 12.0", ValueError, "unknown key 'boom'"),
        ("length = ", ValueError, "not a TOML file"),
        ("length = -1.0", ValueError, "length = -1"),
        pytest.param(
            "a = " + "[" * 100_000, ValueError, r"boom\.toml: tables or arrays are nested too deep", id="arrays"
        ),
        pytest.param("a = " + "{b = " * 100_000, ValueError, "nested too deep", id="tables"),
    ],
)
def test_a_bad_file_names_file_and_key(tmp_path, text, kind, message):
    path = tmp_path / "boom.toml"
    path.write_text(text)
    with pytest.raises(kind, match=message) as caught:
        bc.BoomParameters.from_toml(path)
    assert "boom.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (bc.BoomParameters, {"youngs_modulus": 7e10}),
        (bc.HubBeamParameters, {"youngs_modulus": 7e10}),
        (bc.boom.TractorParameters, {"mass": 8000.0, "track_width": 2}),
    ],
)
def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path, kind, values):
    path = tmp_path / "given.toml"
    path.write_text("".join(f"{name} = {value}\n" for name, value in values.items()), encoding="utf-8-sig")
    assert kind.from_toml(path) == kind(**values)


@given(
    st.sampled_from([name for name in NAMES if not name.startswith(("inner", "outer"))]),
    st.floats(-300.0, 300.0),
)
@examples(40)
def test_infinite_peak_is_not_certified(name, decade):
    """The boom as it is has a finite peak, and none of its parameters makes it infinite while it stays above zero."""
    try:
        result, refusal = bc.sigma(bc.spray_boom(bc.BoomParameters(**{name: 10.0**decade}))), ""
    except ValueError as error:
        result, refusal = None, str(error)
    assert "NaN" not in refusal
    if result is not None:
        assert np.isfinite(result.sigma).all()
        assert np.isfinite(result.peak)


def test_parameters_by_name():
    softer = bc.BoomParameters(spring_stiffness=900.0)
    assert bc.BoomParameters().replace(spring_stiffness=900.0) == softer
    np.testing.assert_array_equal(bc.spray_boom(spring_stiffness=900.0).K, bc.spray_boom(softer).K)
    np.testing.assert_array_equal(
        bc.spray_boom(softer, hinge_damping=3.0).C, bc.spray_boom(softer.replace(hinge_damping=3.0)).C
    )
    assert bc.hub_beam(tip_mass=0.1).parameters == bc.HubBeamParameters(tip_mass=0.1)
    for wrong, near in (
        (bc.spray_boom, "spring_stiffness"),
        (bc.hub_beam, "tip_mass"),
        (bc.BoomParameters().replace, "length"),
    ):
        with pytest.raises(TypeError, match=f"did you mean '{near}'"):
            wrong(**{near[:-1]: 1.0})
    with pytest.raises(TypeError, match="did you mean 'elements'"):
        bc.spray_boom(element=6)


def test_mass_follows_the_tube():
    p = bc.BoomParameters()
    with pytest.raises(
        ValueError, match=r"`boom_mass` must be .* that of the tube, 60.\d+, got 35.76\. .*scaled\(length="
    ):
        p.replace(length=24.0)
    for changes in (
        {"length": 24.0},
        {"length": 6.0},
        {"density": 2700.0},
        {"outer_width": 0.03, "inner_width": 0.026},
    ):
        other = p.scaled(**changes)
        assert other.boom_mass - other.tube_mass == pytest.approx(p.boom_mass - p.tube_mass)
        assert other.boom_inertia - other.tube_inertia == pytest.approx(p.boom_inertia - p.tube_inertia)
        assert all(getattr(other, name) == value for name, value in changes.items())
    assert p.scaled() == p
    assert p.scaled(length=24.0, boom_mass=80.0).boom_mass == 80.0


P = bc.BoomParameters()
HEAVIER = {"boom_mass": 1.1 * P.boom_mass, "boom_inertia": 1.1 * P.boom_inertia}
MASS = r"`boom_mass` changed, but the tube did not; .* at the hinge\..*`p\.scaled\(density=.* `cradle_mass`"
INERTIA = r"`boom_inertia` changed, but the tube did not; .*`p\.scaled\(density="
BOTH = r"`boom_mass` and `boom_inertia` changed, but the tube did not; .*`p\.scaled\(density="
UNCHANGED = r"`boom_mass` and `boom_inertia` unchanged, but the tube changed; .* at the hinge\."
LIGHTER = rf"{UNCHANGED}.* use `BoomParameters\(\)\.scaled\(length=9\)`"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bc.BoomParameters(boom_mass=1.1 * 35.76), MASS),
        (lambda: P.replace(boom_mass=39.3), MASS),
        (lambda: P.scaled(boom_mass=39.3), MASS),
        (lambda: bc.BoomParameters(boom_inertia=400.0), INERTIA),
        (lambda: bc.BoomParameters(**HEAVIER), BOTH),
        (lambda: bc.spray_boom(length=9.0), LIGHTER),
        (
            lambda: P.replace(length=9.0, boom_mass=30.0),
            r"`boom_inertia` unchanged, but the tube changed; .*`BoomParameters\(\)\.scaled\(length=9, boom_mass=30\)`",
        ),
        (
            lambda: P.scaled(**HEAVIER, length=11.0).replace(density=7900.0),
            rf"{UNCHANGED}.* use `p\.scaled\(density=7900\)`",
        ),
    ],
)
def test_inconsistent_boom_mass_warns_once(call, message):
    with pytest.warns(UserWarning, match=message) as caught:
        call()
    assert [warning.filename for warning in caught] == [__file__]


def test_consistent_boom_mass_does_not_warn():
    frequencies = bc.spray_boom().eigenfrequencies_hz(4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for q in (bc.BoomParameters(), P.scaled(), P.scaled(spring_stiffness=900.0), P.scaled(length=9.0)):
            assert bc.BoomParameters(*vars(q).values()) == dataclasses.replace(q)
        bc.BoomParameters(**HEAVIER, density=1.1 * P.density)
        bc.BoomParameters(boom_mass=P.boom_mass + 0.02)
        dataclasses.replace(P, boom_mass=39.3)
        bc.boom_family(mass_factor=(0.8, 1.2))
        bc.fit(bc.spray_boom, frequencies, ["boom_mass"], bc.BoomParameters(), n_starts=1)


@pytest.mark.parametrize("where", ["changed keys", "all keys"])
def test_parameter_file_warns_as_constructor(tmp_path, where):
    values = vars(P) if where == "all keys" else {}
    (tmp_path / "boom.toml").write_text("\n".join(f"{k} = {v}" for k, v in {**values, "boom_mass": 39.3}.items()))
    with pytest.warns(UserWarning, match=MASS):
        bc.BoomParameters.from_toml(tmp_path / "boom.toml")


def test_scaled_density_gives_frequency_of_heavier_frame():
    """Yaw moves the boom alone: a frame heavier by a factor has its frequency over the square root of that factor."""

    def yaw(p):
        return bc.split_symmetric(bc.spray_boom(p))[1].eigenfrequencies_hz(3)

    assert yaw(P.scaled(density=1.1 * P.density)) == pytest.approx(yaw(P) / np.sqrt(1.1), rel=5e-3)
    assert yaw(P.scaled(density=1.1 * P.density))[0] == pytest.approx(0.2336, abs=5e-5)
    with pytest.warns(UserWarning, match="`cradle_mass`"):
        at_hinge = bc.BoomParameters(boom_mass=P.boom_mass + 4.0)
    assert yaw(at_hinge) == pytest.approx(yaw(P), rel=1e-12)
    model, other = bc.spray_boom(at_hinge), bc.spray_boom(cradle_mass=P.cradle_mass + 4.0)
    assert model.eigenfrequencies_hz(4) == pytest.approx(other.eigenfrequencies_hz(4), rel=1e-12)
