"""Whether a log describes a message type as ROS 2 Jazzy does."""

from klann_ros.log.records import Topic

from .layouts import CRANK_ANGLE, FOOT, JOINT_STATE

_HEADER = {
    'std_msgs/Header': ('builtin_interfaces/Time stamp', 'string frame_id'),
    'builtin_interfaces/Time': ('int32 sec', 'uint32 nanosec'),
}
_FIELDS = {
    CRANK_ANGLE: {'': ('float64 data',)},
    FOOT: {
        '': ('std_msgs/Header header', 'Point point'),
        'geometry_msgs/Point': ('float64 x', 'float64 y', 'float64 z'),
        **_HEADER,
    },
    JOINT_STATE: {
        '': (
            'std_msgs/Header header',
            'string[] name',
            'float64[] position',
            'float64[] velocity',
            'float64[] effort',
        ),
        **_HEADER,
    },
}


def has_standard_fields(topic: Topic) -> bool:
    """Return whether a topic's messages are CDR of the fields that its type has in Jazzy."""
    if (topic.message_encoding, topic.schema_encoding) != ('cdr', 'ros2msg'):
        return False
    return _fields(topic.definition) == _FIELDS.get(topic.type)


def _fields(definition: str) -> dict[str, tuple[str, ...]]:
    """Return the fields of each type in a definition, the first under ''."""
    found: dict[str, list[str]] = {}
    name = ''
    for line in definition.splitlines():
        words = line.partition('#')[0].split()
        if words[:1] == ['MSG:']:
            name = words[-1]
        elif len(words) == 2:
            found.setdefault(name, []).append(' '.join(words))
    return {name: tuple(fields) for name, fields in found.items()}
