"""The live page without ROS: access rules, protocol, drawn state and server."""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .clients import PageState, recorded_counts, status_text
    from .drive import crank_at, DriveError, LiveCrankDrive, WalkDrive
    from .guard import Guard, new_token
    from .legs import (
        assumed_solver,
        joint_positions,
        LiveLeg,
        LiveSolver,
        MAX_LEGS,
        replayed_solver,
        solver_of,
        walker_data,
    )
    from .protocol import Answer, Command
    from .rates import TopicRate
    from .server import LiveServer, ServerError
    from .walker_parts import WalkerParts
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
