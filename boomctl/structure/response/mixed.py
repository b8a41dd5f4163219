"""The pencil ``s^2 M + s C + K`` in mixed form: forces of strains as unknowns beside the coordinates.

A stiffness matrix that is formed loses as many digits as its stiffest element is stiffer than the structure: all of them
on a beam of ten thousand elements.  Here ``K`` is never formed.  With rows ``R`` and weights ``w = k + s c``

    [ -1/w   R    ] [ forces ]   [ 0 ]
    [ R^T    s^2 M ] [ motion ] = [ f ]

is eliminated along the structure, coordinates first and each strain after the last coordinate that it is made of, with
pivots chosen by size.  Coordinates then follow from strains by summation, as they do along the beam, and ``R^T w R`` never
arises.  What an element far stiffer than most joins moves in coordinates of its own: together, and by its strains.  A boom
of 100,000 elements keeps eleven digits so (measured), in time and memory that grow as the number of elements.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from boomctl.arrays import Array
from boomctl.structure.layout import Layout, Weights, squared_sums
from boomctl.structure.response.pencil import Solve
from boomctl.structure.strain_coordinates import unstrained

# share of its terms up to which each strain of a motion is rounding, and the motion rigid: a mode strains some row by about
# as much as its terms, a rigid motion of 10,000 elements strains none by more than some 1e-8 of them (measured)
_STRAINLESS = 1e-5
_FAR_STIFFER = (
    1e6  # stiffness over mass of a row, times the median one, from which on its element is a group (a choice)
)
_LARGEST_GROUP = 32  # coordinates; a few tiny elements beside each other have fewer (a choice)
_DEPENDENT = 1e-12  # of the largest; what of a motion is below it, beside others, is rounding
_WIDEST = 64.0  # places that a row spans in the mean, up to which elimination along the structure is cheap (a choice)


@dataclass(frozen=True, eq=False)
class MixedForm:
    """Rows and weights in the order in which they are eliminated.

    Attributes
    ----------
    weights : Weights
    used : (rows,) ndarray
        Elastic rows that carry stiffness or damping.
    place : ndarray
        Where each strain and, behind them, each coordinate stands in the order of elimination.
    M : csr_array
        Mass matrix over the structure's coordinates.
    R, inertia : csr_array
        Elastic rows used, and mass matrix, over own coordinates.
    T : csr_array
        The structure's coordinates over the own ones.  They differ where an element is far stiffer than most: what it
        joins has motions without its strains, and one for each strain; masses then stand beside the stiffness that holds
        them, not beside one in which they would be rounding.
    """

    weights: Weights
    used: Array
    place: Array
    M: sparse.csr_array
    R: sparse.csr_array
    inertia: sparse.csr_array
    T: sparse.csr_array

    @classmethod
    def of(cls, layout: Layout, weights: Weights) -> "MixedForm | None":
        """Return the mixed form; None where rows reach so far that elimination along the structure would fill up."""
        R, M = sparse.csr_array(layout.R), sparse.csr_array(layout.mass(weights.m, False))
        used = np.flatnonzero(((weights.k > 0.0) | (weights.c > 0.0)) & (np.diff(R.indptr) > 0))
        R, T = _grouped(sparse.csr_array(R[used]), weights.k[used], M.diagonal())
        inertia = sparse.csr_array(T.T @ M @ T)
        pattern = sparse.csr_array(abs(R).T @ abs(R) + abs(inertia))
        order = reverse_cuthill_mckee(pattern, symmetric_mode=True)
        n = layout.n
        at = np.empty(n, dtype=np.intp)
        at[order] = np.arange(n)
        if not len(used):
            return None
        last, first = (f.reduceat(at[R.indices], R.indptr[:-1]) for f in (np.maximum, np.minimum))
        if (last - first).mean() > _WIDEST:
            return None
        place = np.empty(len(used) + n, dtype=np.intp)
        place[np.argsort(np.concatenate([last + 0.5, at]), kind="stable")] = np.arange(len(place))
        return cls(weights, used, place, M, R, inertia, T)

    def factorized(self, s: complex) -> Solve:
        """Return a solver of ``s^2 M + s C + K``; real where ``s`` is."""
        return self._solver(s * s, self.weights.k[self.used] + s * self.weights.c[self.used])

    def shifted(self, alpha: float) -> Solve:
        """Return a solver of ``K + alpha M``."""
        return self._solver(alpha, self.weights.k[self.used])

    def projected(self, alpha: float, loads: Array) -> tuple[Array, Array, Array]:
        """Return ``M, C, K`` over the responses of ``K + alpha M`` to loads, made of mass one; those that depend left out."""
        strain, X = self._both(alpha, self.weights.k[self.used])(self.T.T @ loads)
        k, c = self.weights.k[self.used], self.weights.c[self.used]
        mass = X.T @ (self.inertia @ X)
        size = 1.0 / np.sqrt(np.diag(mass))
        values, mixed = linalg.eigh(size[:, None] * mass * size)
        kept = values > _DEPENDENT * values[-1]
        T = size[:, None] * mixed[:, kept] / np.sqrt(values[kept])
        strain, X = strain @ T, X @ T
        still = np.sqrt(c[k == 0.0])[:, None] * (self.R[np.flatnonzero(k == 0.0)] @ X)
        elastic = k > 0.0
        C = strain.T @ ((c[elastic] / k[elastic])[:, None] * strain) + still.T @ still
        return np.eye(int(kept.sum())), C, strain.T @ strain

    def damping(self) -> Solve:
        """Return a solver of ``C``."""
        return self._solver(0.0, self.weights.c[self.used])

    def _solver(self, inertia: complex, stiffness: Array) -> Solve:
        both = self._both(inertia, stiffness)
        return lambda rhs: self.T @ both(self.T.T @ rhs)[1]

    def _both(self, inertia: complex, stiffness: Array) -> Callable[[Array], tuple[Array, Array]]:
        """Return a solver over own coordinates: strains, times the roots of their stiffness, and the motion.

        Strains keep their digits where differences of the motion have none left.
        """
        kept = np.flatnonzero(stiffness != 0.0)
        w, n = np.abs(stiffness[kept]), self.inertia.shape[0]
        R, strains = sparse.csr_array(self.R[kept]), len(kept)
        diagonal = squared_sums(R, w) + np.abs(inertia) * self.inertia.diagonal()
        size = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        R = sparse.csr_array(sparse.diags_array(np.sqrt(w)) @ R @ sparse.diags_array(size))
        scaled = sparse.diags_array(size) @ (inertia * self.inertia) @ sparse.diags_array(size)
        flexibility = sparse.diags_array(-w / stiffness[kept])
        full = sparse.coo_array(sparse.block_array([[flexibility, R], [R.T, scaled]]))
        place = self.place
        if strains < len(self.used):
            chosen = np.concatenate([place[: len(self.used)][kept], place[len(self.used) :]])
            place = np.empty(strains + n, dtype=np.intp)
            place[np.argsort(chosen)] = np.arange(strains + n)
        i, j = (place[axis] for axis in full.coords)
        placed = sparse.csc_array((full.data, (i, j)), shape=full.shape)
        try:
            lu = splu(placed, permc_spec="NATURAL")
        except RuntimeError:
            raise np.linalg.LinAlgError("the matrix is singular") from None
        motion = place[strains:]

        def solve(rhs: Array) -> tuple[Array, Array]:
            load = np.zeros((strains + n, *rhs.shape[1:]), dtype=full.dtype)
            scale = size.reshape(-1, *(1,) * (rhs.ndim - 1))
            load[motion] = scale * rhs
            found = lu.solve(load)
            found += lu.solve(load - placed @ found)  # what pivots of very unlike size have lost
            return found[place[:strains]], scale * found[motion]

        return solve

    def solved(self, s: complex, rhs: Array) -> Array:
        """Return the solution at a complex ``s``."""
        return self.factorized(s)(rhs)

    def lowest(self, alpha: float, count: int) -> tuple[Array, Array]:
        """Return the ``count`` lowest undamped frequencies [rad/s], those of rigid motions zero, and mass-normalised shapes.

        They are found with the stiffness ``K + alpha M``, and mended by a projection of the strains of their shapes.

        Raises
        ------
        ArpackError
            Lanczos' method does not converge.
        """
        n, M = self.M.shape[0], self.inertia
        both = self._both(alpha, self.weights.k[self.used])
        inverse = LinearOperator((n, n), matvec=lambda v: both(v)[1], dtype=float)  # type: ignore[call-arg]
        start = np.random.default_rng(0).standard_normal(n)
        _, V = eigsh(M, count, M, sigma=-alpha, OPinv=inverse, v0=start, tol=1e-12)
        strain, X = both(M @ V)
        stiffness, mixed = linalg.eigh(strain.T @ strain, X.T @ (M @ X))
        shapes = X @ mixed
        strained = np.abs(self.R @ shapes) > _STRAINLESS * (abs(self.R) @ np.abs(shapes))
        return np.where(strained.any(axis=0), np.sqrt(np.maximum(stiffness, 0.0)), 0.0), self.T @ shapes


def _grouped(R: sparse.csr_array, k: Array, mass: Array) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Return rows over own coordinates, and the structure's coordinates over these; see :attr:`MixedForm.T`."""
    n = R.shape[1]
    squares = sparse.csr_array(R.multiply(R) @ sparse.diags_array(1.0 / np.where(mass > 0.0, mass, np.inf)))
    fast = k * squares.max(axis=1).toarray().ravel()
    level = _FAR_STIFFER * float(np.median(fast))
    stiff = fast > level
    T = sparse.eye_array(n, format="csr")
    if not stiff.any() or not (mass > 0.0).all():
        return R, T
    of_row, group = R.indices[R.indptr[:-1]], np.arange(n)
    while stiff.any():  # a whole stiff section is no group, but shorter elements in it may be
        joined = sparse.csr_array(abs(R[np.flatnonzero(stiff)]))
        group = connected_components(joined.T @ joined, directed=False)[1]
        large = stiff & (np.bincount(group)[group[of_row]] > _LARGEST_GROUP)
        if not large.any():
            break
        level *= _FAR_STIFFER
        stiff &= ~large | (fast > level)
    T, found = sparse.lil_array(T), sparse.lil_array(R)
    for one in np.flatnonzero(np.bincount(group[of_row[stiff]]) > 0):
        members, rows = np.flatnonzero(group == one), np.flatnonzero(stiff & (group[of_row] == one))
        own, root = R[rows][:, members].toarray(), np.sqrt(k[rows])
        V, Q, order, _ = unstrained(root[:, None] * own, own, 1.0 / np.sqrt(mass[members]))
        T[np.ix_(members, members)] = V
        beside = np.flatnonzero(abs(R[:, members]).sum(axis=1) * ~np.isin(np.arange(R.shape[0]), rows))
        found[np.ix_(beside, members)] = R[beside][:, members].toarray() @ V
        found[np.ix_(rows[order], members)] = Q / root[order][:, None]
    return sparse.csr_array(found), sparse.csr_array(T)
