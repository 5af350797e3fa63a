"""First derivatives of a linkage's angles by the crank angle."""

from math import nan

from .linkage import Linkage


def rates(linkage: Linkage, u: list[complex], count: int | None = None) -> list[float]:
    """
    Return dphi_j/dalpha of every body, block by block: Phi dx/dalpha = -df/dalpha.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    u : list of complex
        The bodies' unit vectors at a closed pose.
    count : int, optional
        Of the first so many blocks only; the other bodies stand still.

    Returns
    -------
    list of float
        In the order of the bodies, the crank's 1 first; all the others NaN at a singular pose.

    """
    senses = linkage.senses
    rate, moved = [0.0] * len(u), [0j] * len(u)
    rate[0], moved[0] = 1.0, 1j * senses[0] * u[0]
    for block in linkage.blocks[:count]:
        turns = None
        if abs(block.sine(u)) > block.singular_sine:
            turns = block.turn(u, block.total(moved))
        if turns is None:
            return [1.0, *[nan] * (len(u) - 1)]
        for j, turn in zip(block.unknowns, turns, strict=True):
            rate[j], moved[j] = turn, 1j * senses[j] * turn * u[j]
    return rate
