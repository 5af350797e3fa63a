"""A name is refused before ROS is asked to do something with it."""

import re

from hypothesis import example, given, strategies as st
from klann_ros.nodes.endpoints import name_refusal

# https://docs.ros.org: a slash before each part, which begins with a letter or an underscore.
FULL_NAME = re.compile('(/[A-Za-z_][A-Za-z0-9_]*)+')


@given(st.text('/ab1_{}~ \u00e9\0\n', max_size=8) | st.text() | st.from_regex(FULL_NAME))
@example('/' + 'x' * 246)
@example('/' + 'x' * 247)
@example('/a\0')
@example('/\udcff')
def test_just_the_full_names_of_ros_are_taken(name: str) -> None:
    good = FULL_NAME.fullmatch(name) is not None and len(name) <= 247
    reason = name_refusal(name)
    assert (reason == '') == good
    assert reason.isprintable()
    assert len(reason) < 120
