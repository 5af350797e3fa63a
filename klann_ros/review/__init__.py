"""
Review of a recorded run, without ROS: load -> model -> checks -> report.

>>> from klann_ros.review import pose_arrays, review_run
>>> review = review_run('runs/first', rates='f8')  # a folder, or a file of any recorder
>>> review.is_healthy
True
>>> for finding in review.findings:
...     print(finding.severity.name, finding.check, finding.text, finding.time)
>>> leg = review.legs[0]
>>> round(leg.figures.turns, 3)
2.0
>>> poses = pose_arrays(leg)
>>> poses['alpha [rad]'].shape, float(poses['residual [m]'].max()) < 1e-12
((400,), True)

With pandas, `pose_frame(review)` is a DataFrame of all legs, of which
`.plot('time [s]', 'gamma [rad]')` draws a column.

======================  ===============================================================
A run                   `review_run`: `Review`, its `ReviewedLeg`s and `TopicFigures`
Its findings            `Finding`, `Severity`; `Limits`, `limits_from_file`
Its poses               `pose_arrays`, `pose_frame`
Two runs                `compare`: `Comparison`, `Difference`
A reference robot       `klann_ros.robot.robot_of`: by the name of a file or of a
                        shipped leg
Errors                  `klann_ros.log.errors.LogError`: `NotALogError`,
                        `LimitsFileError`; `NoPandasError`
======================  ===============================================================
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .fleet import Row, rows_from_table
    from .fleet.index import verdict_chip
    from .live.judge import LiveFinding, LiveJudge, STEP
    from .load.geometry import leg_solvers, parent, published_legs
    from .load.window import MAX_MESSAGES
    from .model.compare import compare, Comparison, Difference
    from .model.limits import Limits, limits_from_file, LimitsFileError
    from .model.recording import LegSolver
    from .model.review import Finding, Review, ReviewedLeg, Severity
    from .model.topics import TopicFigures
    from .report.data import NoPandasError, pose_arrays, pose_frame
    from .reviewing import review_run
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
