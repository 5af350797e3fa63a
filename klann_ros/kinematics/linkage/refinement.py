"""Newton-Raphson for a linkage, block by block."""

from klann_ros.kinematics.angles import FAR

from .blocks import CoupledLoops, Dyad
from .configuration import Configuration
from .linkage import Linkage
from .pose import LinkagePose, made_pose


def refine(
    linkage: Linkage,
    alpha: float,
    guess: tuple[float, ...],
    tolerance: float,
    max_iterations: int,
) -> LinkagePose | None:
    """
    Return the pose that Newton-Raphson reaches from a guess, or None.

    Each block is solved to the end before the next, which needs its angles.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    alpha : float
        Crank angle [rad].
    guess : tuple of float
        The other angles, in the order of `joint_names` [rad].
    tolerance : float
        Largest correction of a converged pose [rad].
    max_iterations : int
        How many iterations a block may take.

    Returns
    -------
    LinkagePose or None
        None: it did not converge, or not on the linkage's assembly branch.

    """
    configuration = Configuration(linkage.senses, [alpha, *guess])
    iterations = 0
    for block, sign in zip(linkage.blocks, linkage.assembly, strict=True):
        spent = refine_block(block, configuration, tolerance, max_iterations)
        if spent == 0 or block.sine(configuration.u) * sign < -block.rounding_of_sine:
            return None
        if max(abs(configuration.angles[j]) for j in block.unknowns) > FAR:
            return None
        iterations = max(iterations, spent)
    return made_pose(linkage, configuration, iterations)


def refine_block(
    block: Dyad | CoupledLoops,
    configuration: Configuration,
    tolerance: float,
    max_iterations: int,
) -> int:
    """Correct the angles of one block; return the iterations, 0 if it did not converge."""
    angles, u = configuration.angles, configuration.u
    settled = False
    for iteration in range(1, max_iterations + 1):
        gap = block.gap(u)
        if settled or block.is_closed(gap):
            return iteration
        turns = block.turn(u, gap)
        if turns is None:
            return 0
        for j, turn in zip(block.unknowns, turns, strict=True):
            configuration.put(j, angles[j] + turn)
        settled = max(map(abs, turns)) <= tolerance
    return 0
