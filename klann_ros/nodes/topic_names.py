"""Topic names of others: whether ROS takes them, and if not, why."""

from rclpy.exceptions import NameValidationException
from rclpy.validate_full_topic_name import validate_full_topic_name


def refusal(name: str) -> str:
    """Return why ROS refuses a full name of a topic or service; '' for a good one."""
    # ROS's own check ends at a NUL, and calls what stands before it good; a lone surrogate is
    # nothing that it can be given.
    if '\0' in name or not name.isascii():
        return "topic name must not contain characters other than alphanumerics, '_', or '/'"
    try:
        validate_full_topic_name(name)
    except NameValidationException as error:
        # The name follows, which may be anything, and a line that points into it.
        return str(error).partition(':\n')[0].removeprefix('Invalid topic name: ')
    return ''
