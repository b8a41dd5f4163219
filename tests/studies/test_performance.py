"""What a suspension is judged by: each number is computed once, and is what asking for it alone would give."""

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.boom.parameters import BoomParameters
from boomctl.studies.suspension.performance import _FREQUENCIES, InField, _loop_sigma
from boomctl.studies.suspension.scene import FieldScene, suspension_model


def test_the_curve_of_a_loop_is_that_on_all_its_frequencies_with_the_loops_peak():
    loop = InField(BoomParameters(), None, FieldScene()).to_tips(suspension_model(BoomParameters(), 6, 20.0))
    found, alone = _loop_sigma(loop), sigma(loop)
    whole = sigma(loop, np.union1d(alone.omega, _FREQUENCIES))
    np.testing.assert_array_equal(found.omega, whole.omega)
    np.testing.assert_array_equal(found.sigma, whole.sigma)
    assert found.certificate == alone.certificate
