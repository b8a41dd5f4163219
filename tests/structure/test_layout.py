"""What is found once for machines that differ in weights alone: it changes no answer, and nothing else is shared."""

import pickle
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from hypothesis import example, given

import boomctl as bc
from boomctl.structure import FiniteElements, SecondOrderModel, assembly
from boomctl.structure.layout import weigh
from boomctl.structure.response.direct import respond
from tests.references import direct
from tests.strategies import random_machine, seeds

OMEGA = np.geomspace(0.3, 60.0, 400)


def matrices(model):
    ports = model.ports
    return [model.M, model.C, model.K, ports.B, ports.L, ports.E]


@pytest.mark.parametrize("name", [field.name for field in fields(bc.BoomParameters)])
def test_every_parameter_of_the_boom_is_felt(name):
    """None is hidden by what was found for other values of it."""
    p = replace(bc.BoomParameters(), boom_mass=60.0, boom_inertia=600.0)
    other = replace(p, **{name: 1.01 * getattr(p, name)})
    for excitation in ("force", "displacement"):
        bc.spray_boom(p, excitation=excitation)
        known = matrices(bc.spray_boom(other, excitation=excitation))
        assembly._find_mechanism.cache_clear()
        for a, b in zip(known, matrices(bc.spray_boom(other, excitation=excitation)), strict=True):
            assert np.array_equal(a, b)
    before, after = (matrices(bc.spray_boom(q, excitation="force")) for q in (p, other))
    exact = [bc.exact_frequency_response(q, [1.0, 9.0], excitation="force").frdata for q in (p, other)]
    assembly._find_mechanism.cache_clear()
    exact.append(bc.exact_frequency_response(other, [1.0, 9.0], excitation="force").frdata)
    assert any(not np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    assert not np.array_equal(*exact[:2])
    assert np.array_equal(*exact[1:])


def test_a_discretisation_compared_by_identity_is_asked_again():
    class Changing:
        elements = 2

        def mesh(self, beam, attachments):
            return FiniteElements(self.elements).mesh(beam, attachments)

    @dataclass
    class Unhashable(Changing):
        elements: int = 2

    for mesh in (Changing(), Unhashable()):
        machine = bc.boom.model.boom_assembly(bc.BoomParameters(), mesh)
        sizes = []
        for mesh.elements in (2, 3):
            sizes.append(machine.assemble().ncoordinates)
        assert sizes[1] == sizes[0] + 2


@given(seeds)
def test_damping_in_its_parts_is_the_damping(seed):
    model = random_machine(seed).assemble()
    R = model.structure.layout.R
    for structure, rows in (
        (model.structure, R),
        (SecondOrderModel(model.M, model.C, model.K).structure, np.eye(model.ncoordinates)),
    ):
        beta, excess = structure.weights.uneven_damping()
        found = beta * model.K + rows.T @ weigh(excess, rows)
        assert np.abs(found - model.C).max() <= 1e-8 * np.abs(model.C).max()


def test_pickled_models_carry_what_they_are_made_of_alone():
    model = bc.spray_boom(elements=190)
    before = pickle.dumps(model)
    bc.sigma(model, OMEGA)
    assert len(pickle.dumps(model)) < 1.01 * len(before)
    copy = pickle.loads(before)
    assert np.array_equal(bc.sigma(copy, OMEGA[::50]).sigma, bc.sigma(model, OMEGA[::50]).sigma)
    family = bc.boom_family(spring_factor=(0.7, 1.3), elements=40)
    entries = sum(X.size for _, slope in family.coefficients for X in (slope.M, slope.C, slope.K))
    assert len(pickle.dumps(family)) < 1.5 * 8 * (entries + sum(X.size for X in family.nominal.structure.matrices))
    assert np.array_equal(pickle.loads(pickle.dumps(family)).at([0.3, 1.0]).K, family.at([0.3, 1.0]).K)


@example(46)  # a link that only rounding strains, a coordinate that rounding alone holds
@example(361)
@example(1404)
@given(seeds)
def test_a_floating_machine_is_answered_too(seed):
    model = random_machine(seed, grounded=False).assemble()
    found = respond(model.structure, model.ports, OMEGA[::10])
    expected = direct(model, OMEGA[::10])
    assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()
