"""The live page without ROS: access rules, protocol, drawn state and server."""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .clients import PageState, recorded, status_text
    from .drive import (
        crank_at,
        CrankDrive,
        DriveError,
        WalkDrive,
    )
    from .guard import Guard, new_token
    from .protocol import Answer, Command
    from .rates import TopicRate
    from .server import LiveServer, ServerError
else:
    __getattr__, __dir__, __all__ = lazy_face(
        __name__,
        {
            'clients': 'PageState recorded status_text',
            'drive': 'CrankDrive DriveError WalkDrive crank_at',
            'guard': 'Guard new_token',
            'protocol': 'Answer Command',
            'rates': 'TopicRate',
            'server': 'LiveServer ServerError',
        },
    )
