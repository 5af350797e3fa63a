"""
The leg as it was built: its dimensions by measured points, with honest standard errors.

>>> import numpy as np
>>> from klann_ros.calibration import calibrate, CrankSamples, series_of
>>> from klann_ros.kinematics import KlannGeometry, linkage_poses
>>> drawn, built = (KlannGeometry(l_gh=length).linkage for length in (0.430, 0.4312))
>>> t = np.linspace(0.0, 5.0, 1000)
>>> crank = CrankSamples.of(t, 2.0 * t)
>>> noise = np.random.default_rng(1).normal(0.0, 1e-4, (3, 1000, 2))
>>> measured = [
...     series_of('point', name, t, linkage_poses(built.with_foot(name), 2.0 * t).h + own, crank)
...     for name, own in zip('HGF', noise)
... ]
>>> found = calibrate(drawn, measured)
>>> value, error = found.dimension('l_gh')
>>> round(value, 4), error < 1e-4, round(found.observability.condition)
(0.4312, True, 66)
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .fit import calibrate, Calibration, SeriesFit
    from .load import COMPUTED_TOPICS, point_topics
    from .measurements import CrankSamples, kind_of, MeasuredSeries, MeasurementError, series_of
    from .model import MeasurementModel, SCALES
    from .observability import Combination, Observability
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
