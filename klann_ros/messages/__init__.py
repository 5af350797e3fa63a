"""
The messages of legs and walkers as bytes, without ROS.

Conversion between bytes and a Python message costs more than the solution of a pose. Here each
type is known once, by its fields: it reads one message (`read`), the numbers of many as columns
(:mod:`klann_ros.messages.columns`), writes a message, and fills templates.

>>> from klann_ros.messages import STRING
>>> STRING.read(STRING.write({'data': 'a leg'}))
{'data': 'a leg'}
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .cdr import HEADER_SIZE, MAX_STAMP, STAMP_SIZE
    from .columns import ColumnReader, MAX_MESSAGE_SIZE, MessageColumns
    from .joints import (
        JointReading,
        JointsReader,
        JointStateTemplate,
        NumberReader,
        point_template,
        twist_template,
    )
    from .known_types import (
        ANGLE_TYPES,
        ARRAY_TYPES,
        CLOCK,
        DIAGNOSTICS,
        FLOAT32,
        FLOAT64,
        FRAMED_TYPES,
        IMU,
        INT32,
        JOINT_STATE,
        JOINT_TRAJECTORY,
        KEY_VALUE,
        MARKER,
        MESSAGE_TYPES,
        ODOMETRY,
        POINT,
        POINT_FIELDS,
        POSE,
        POSE_WITH_COVARIANCE,
        STRING,
        TRANSFORM,
        TRANSFORMS,
        TWIST,
        TWIST_STAMPED,
    )
    from .message_type import Layout, MessageType, NumberPlaces, parse_definition, Template
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
