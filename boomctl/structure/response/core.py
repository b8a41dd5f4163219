"""A structure of many coordinates seen through a few motions."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import ALIKE
from boomctl.structure.matrices import Structure, dense
from boomctl.structure.ports import Ports
from boomctl.structure.response.direct import direct_response, ports_rounding
from boomctl.structure.response.poles import undamped_modes

_KEPT = 4.0  # times the top of the band, up to where modes are kept: their error falls with the eighth power (a choice)
# times the top of the band: a motion faster than that follows at once, so that it may be as slow as that (its share of the
# response, small as it is, changes by the inverse square of it)
_FASTEST = 1e4
_DROP = 1e-6  # of the largest motion at rest; what others add to it below that shows in the response by the square


@dataclass(frozen=True)
class Core:
    """A structure of many coordinates seen through a few motions: its lowest modes, and how it answers at rest.

    Modes left out follow forces as at rest, up to the second power of frequency squared: that is two motions for each column
    through which inputs act and outputs read, and for each damper that couples them with the modes kept.  Inputs and outputs
    share the basis, so that the error of the core's response is of second order in the error of the basis.  It is measured
    at the frequencies that matter, against the structure itself.

    Attributes
    ----------
    structure, ports : Structure, Ports
        The small one, over motions of mass one.
    whole : tuple of Structure and Ports
        The large one.
    """

    structure: Structure
    ports: Ports
    whole: tuple[Structure, Ports]

    @classmethod
    def of(cls, structure: Structure, ports: Ports, top: float) -> "Core":
        """Return a core for frequencies up to ``top`` [rad/s].

        It is taken from strain coordinates where the structure has them, which keep the digits of the slow motions.  Motions
        so fast that no state space holds them beside the slow ones get more mass: see :data:`_FASTEST`.

        Raises
        ------
        ValueError
            A structure without real modes.
        """
        form = structure.strain_form
        if form is None:
            (frequencies, own), seen, damping = undamped_modes(structure), ports, dense(structure.C)
        else:
            (frequencies, own), seen, damping = form.own_modes, form.ports(ports), form.C
        low = frequencies <= _KEPT * top
        slow, fast, rates = own[:, low], own[:, ~low], frequencies[~low]
        coupled, size, _ = np.linalg.svd(fast.T @ damping @ slow, full_matrices=False)
        resisted = np.einsum("ij,ij->j", slow, damping @ slow).max(initial=0.0)
        ports_loads = fast.T @ np.hstack([*seen.B, *(line.T for line in seen.L)])
        loads = np.hstack([ports_loads, coupled[:, size > ALIKE * resisted]])
        still = np.hstack([loads / rates[:, None] ** 2, loads / rates[:, None] ** 4])
        size = np.linalg.norm(still, axis=0)
        Q, spread, _ = np.linalg.svd(still[:, size > 0.0] / size[size > 0.0], full_matrices=False)
        Q = Q[:, spread > _DROP * spread.max(initial=0.0)]
        stiffness, mixed = linalg.eigh(Q.T @ (rates[:, None] ** 2 * Q))
        basis = np.hstack([slow, fast @ (Q @ mixed)])
        stiffness = np.concatenate([frequencies[low] ** 2, stiffness])
        decay = np.einsum("ij,ij->j", basis, damping @ basis)
        mass = np.maximum(1.0, np.maximum(stiffness / (_FASTEST * top) ** 2, decay / (_FASTEST * top)))
        basis = basis / np.sqrt(mass)
        names = tuple(f"v{i}" for i in range(len(mass)))
        small = Structure(names, (np.eye(len(mass)), basis.T @ damping @ basis, np.diag(stiffness / mass)))
        return cls(small, seen.congruent(basis), (structure, ports))

    def error(self, omega: Array) -> float:
        """Return how far outputs are off at frequencies [rad/s], each input's largest for one, rounding included."""
        structure, ports = self.whole
        true = direct_response(structure, ports, omega)
        off, size = (
            np.abs(values).max(axis=0) for values in (direct_response(self.structure, self.ports, omega) - true, true)
        )
        form = structure.strain_form
        motions = np.eye(structure.n) if form is None else form.V
        rounding = ports_rounding(structure.in_strains, ports, motions, omega)
        return float((off[size > 0.0] / size[size > 0.0]).max(initial=0.0)) + rounding
