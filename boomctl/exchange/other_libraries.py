"""Systems as the objects of SciPy and pyMOR."""

from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.lti.system import of
from boomctl.structure.matrices import dense
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


def to_scipy(system: "SecondOrderModel | control.StateSpace") -> Any:
    """Return a system as ``scipy.signal.StateSpace``, in continuous or discrete time; SciPy knows no names of signals.

    Parameters
    ----------
    system : SecondOrderModel or control.StateSpace
        The system, in continuous or discrete time.

    Returns
    -------
    scipy.signal.StateSpace
        The same ``A, B, C, D``; signals in the same order, without names.

    Raises
    ------
    TypeError, ValueError
        Another kind of system; a sampling time that is not said; entries that are not finite.

    Examples
    --------
    >>> import boomctl as bc
    >>> bc.to_scipy(bc.spray_boom(elements=4)).A.shape
    (20, 20)
    """
    from scipy import signal

    given = of(system, any_time=True)
    if np.isnan(given.dt):
        raise ValueError("system: its sampling time is not said; expected one in seconds")
    matrices = given.A, given.B, given.C, given.D
    return signal.StateSpace(*matrices) if given.dt == 0.0 else signal.StateSpace(*matrices, dt=given.dt)


def to_pymor(system: "SecondOrderModel | control.StateSpace") -> Any:
    """Return a system as pyMOR's ``LTIModel``, or ``SecondOrderModel`` where its structure can be kept.

    It can for force inputs and outputs of places and speeds, neither filtered.  pyMOR is not installed with boomctl.

    Parameters
    ----------
    system : SecondOrderModel or control.StateSpace
        The system, in continuous or discrete time.

    Returns
    -------
    pymor.models.iosys.LTIModel or pymor.models.iosys.SecondOrderModel
        Signals in the same order, without names.

    Raises
    ------
    ImportError
        pyMOR is not installed.
    TypeError, ValueError
        Another kind of system; a sampling time that is not said.

    Examples
    --------
    pyMOR has to be installed beside boomctl: ``pip install pymor``.
    >>> import boomctl as bc
    >>> bc.to_pymor(bc.spray_boom(elements=4)).dim_input  # doctest: +SKIP
    5
    """
    try:
        from pymor.models.iosys import LTIModel
        from pymor.models.iosys import SecondOrderModel as Second
    except ImportError:
        raise ImportError("to_pymor needs pyMOR: pip install pymor") from None
    if isinstance(system, SecondOrderModel) and _keeps_structure(system):
        ports = system.ports
        places, speeds = ports.L[0], ports.L[1]
        M, C, K = (dense(matrix) for matrix in (system.M, system.C, system.K))
        return Second.from_matrices(M, C, K, ports.B[0], places, speeds if speeds.any() else None, ports.E[0])
    given = of(system, any_time=True)
    if np.isnan(given.dt):
        raise ValueError("system: its sampling time is not said; expected one in seconds")
    return LTIModel.from_matrices(given.A, given.B, given.C, given.D, sampling_time=given.dt)


def _keeps_structure(model: SecondOrderModel) -> bool:
    ports = model.ports
    further = ports.B[1:].any() or ports.L[2].any() or ports.E[1:].any()
    return ports.plain and not further
