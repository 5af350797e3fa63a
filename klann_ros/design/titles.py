"""Titles of legs, by the figure in which each is best, and the aims in words."""

from collections.abc import Sequence
from math import inf

import numpy as np

from .proof import FoundLeg
from .requirements import Aim, Requirements

# Words for the least and the greatest of a figure, if not lowest and highest.
ADJECTIVES = {'stride': ('shortest', 'longest'), 'ground_covered': ('least', 'most')}
# Figures in a report beside those of the requirements.
ALSO_SHOWN = ('transmission_angle', 'margin')


def figure_aims(requirements: Requirements) -> dict[str, Aim]:
    """Return the figures that a report shows, each with the aim that makes a leg better."""
    aims = {aim.figure: aim for aim in requirements.aims}
    limited = [limit.figure for limit in requirements.limits]
    for limit in requirements.limits:
        sense = 'maximize' if limit.sense == 'at_least' else 'minimize'
        # No leg is better within a range.
        is_range = limited.count(limit.figure) > 1
        aims.setdefault(limit.figure, Aim(limit.figure, 'any' if is_range else sense))
    if requirements.target is not None and not requirements.target.is_timed:
        aims.setdefault('point_error', Aim('point_error', 'minimize'))
    for figure in ALSO_SHOWN:
        aims.setdefault(figure, Aim(figure, 'maximize'))
    return aims


def aims_text(requirements: Requirements) -> str:
    """Return the aims of a search in words."""
    texts = []
    for figure, sense, value in requirements.aims:
        is_near = sense == 'near'
        goal = f'near {requirements.figure_text(figure, value)}' if is_near else f'{sense}d'
        texts.append(f'{figure.replace("_", " ")} {goal}')
    return f'{"One aim" if len(texts) == 1 else "Aims"}: {", ".join(texts)}'


def leg_titles(requirements: Requirements, legs: Sequence[FoundLeg]) -> list[str]:
    """
    Return a title of each leg: the figure in which it has the best rank, or that it is balanced.

    No title is there twice: a rank of a figure is that of one leg, and legs that are alike to the
    digits shown have none. A leg without any has an empty title.
    """
    titles = [''] * len(legs)
    if len(legs) < 2:
        return titles
    ranks = [len(legs)] * len(legs)
    squares = np.zeros(len(legs))
    for aim in figure_aims(requirements).values():
        figures = [leg.reached.get(aim.figure) for leg in legs]
        texts = [requirements.figure_text(aim.figure, figure) for figure in figures]
        losses = np.array([inf if figure is None else aim.loss(figure) for figure in figures])
        for rank, index in enumerate(np.argsort(losses, kind='stable').tolist()):
            is_distinct = texts[index] and texts.count(texts[index]) == 1
            if is_distinct and rank < ranks[index] and aim.sense != 'any':
                ranks[index] = rank
                titles[index] = _superlative(aim, rank)
        if aim in requirements.aims:
            losses = np.nan_to_num(losses)
            losses -= losses.min()
            # A leg that is the best in an aim has that title.
            squares += np.where(losses > 0.0, (losses / (losses.max() or 1.0)) ** 2, inf)
    if len(requirements.aims) > 1 and np.isfinite(squares).any():
        titles[int(squares.argmin())] = 'balanced'
    return titles


def _superlative(aim: Aim, rank: int) -> str:
    """Return such as 'longest stride', or '2nd lowest torque peak' of rank 1."""
    adjective = ADJECTIVES.get(aim.figure, ('lowest', 'highest'))[aim.sense == 'maximize']
    if aim.sense == 'near':
        adjective = 'nearest'
    number = rank + 1
    ending = {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10 * (number // 10 % 10 != 1), 'th')
    return f'{f"{number}{ending} " if rank else ""}{adjective} {aim.figure.replace("_", " ")}'
