"""What the legs of a run weigh: by the parameters in it, or by a file."""

from collections.abc import Sequence
from dataclasses import replace

from klann_ros.dynamics import Dynamics
from klann_ros.log.run_parameters import SolverParameters
from klann_ros.review.model.recording import LegRecording, LegSolver
from klann_ros.robot import Robot, robot_from_parameters


def dynamics_of(
    leg: LegRecording, records: Sequence[SolverParameters], robot: Robot | None = None
) -> LegSolver:
    """
    Return a leg's solver with the leg's masses, if anybody tells them.

    Parameters
    ----------
    leg : LegRecording
        The leg.
    records : sequence of SolverParameters
        What the run says, in the order of time.
    robot : Robot, optional
        Who tells them instead.

    """
    solver = leg.solver
    if robot is not None:
        return replace(solver, dynamics=_of_robot(robot, leg.name))
    own = [record for record in records if record.node in solver.nodes]
    if solver.leg is None or not own:
        return solver
    # A run tells a linkage by its text; a name of a file, maybe a stranger's, would be opened.
    told = {
        name: value
        for name, value in own[-1].parameters.items()
        if name.rpartition('.')[2] != 'linkage'
    }
    # No other leg's parameters matter, nor how many legs there are.
    told['legs'] = [leg.name] if leg.name else []
    try:
        return replace(solver, dynamics=_of_robot(robot_from_parameters(told), leg.name))
    except (TypeError, ValueError, RecursionError):
        return solver


def _of_robot(robot: Robot, name: str) -> Dynamics | None:
    """Return a leg of a robot with its masses."""
    leg = robot.leg(name)
    return robot.dynamics(leg) if leg and leg.masses else None
