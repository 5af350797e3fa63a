"""How far the feet of many legs are from where they should be."""

from collections.abc import Mapping
from math import ceil
from typing import Any

from klann_ros.kinematics.arrays import AnyArray, BoolArray, FloatArray, IntArray
import numpy as np


def deviations(h: FloatArray, nominal: FloatArray) -> dict[str, AnyArray]:
    """
    Return what is to be known of the feet at some crank angles, shape (legs, k, 2).

    Where they should be is `nominal`; a foot that is not there is NaN. Of each angle there are
    statistics, of each leg whether it is there at all, and how far it goes.
    """
    there = ~np.isnan(h[..., 0])
    least, greatest = (np.where(there[..., None], h, far) for far in (np.inf, -np.inf))
    apart = h - nominal
    count = there.sum(axis=0)
    # NaN comes last in order.
    distance = np.sort(np.hypot(apart[..., 0], apart[..., 1]), axis=0)
    statistics = {
        'mean': _total(apart) / np.maximum(1, count)[:, None],
        'rms': np.sqrt(_total(distance * distance) / np.maximum(1, count)),
        'p95': _kept(distance, count, 0.95),
        'p99': _kept(distance, count, 0.99),
        'largest': _kept(distance, count, 1.0),
        'box': np.stack([least.min(axis=0), greatest.max(axis=0)], axis=1),
    }
    nowhere = (count == 0) | np.isnan(nominal[:, 0])
    for values in statistics.values():
        values[nowhere] = np.nan
    legs = {'least': least.min(axis=1), 'greatest': greatest.max(axis=1)}
    return {**statistics, 'turns': there.all(axis=1), **legs}


class Deviations:
    """Statistics of many legs against one, taken up some crank angles at a time."""

    def __init__(self, legs: int, angles: int) -> None:
        self._at_angles: dict[str, FloatArray] = {
            'mean': np.empty((angles, 2)),
            'box': np.empty((angles, 2, 2)),
            **{name: np.empty(angles) for name in ('rms', 'p95', 'p99', 'largest')},
        }
        self._turns: BoolArray = np.ones(legs, dtype=np.bool_)
        self._least = np.full((legs, 2), np.inf)
        self._greatest = np.full((legs, 2), -np.inf)

    @property
    def stuck(self) -> float:
        """Return the share of legs that do not turn fully."""
        return float((~self._turns).mean())

    def add(self, part: slice, found: Mapping[str, Any]) -> None:
        """Take up what `deviations` found at some crank angles."""
        self._turns &= found['turns']
        self._least = np.minimum(self._least, found['least'])
        self._greatest = np.maximum(self._greatest, found['greatest'])
        for name, values in self._at_angles.items():
            values[part] = found[name]

    def exclude(self, stuck: BoolArray) -> None:
        """Count legs as not turning fully that do so between the crank angles."""
        self._turns &= ~stuck

    def statistics(self) -> dict[str, FloatArray]:
        """Return all of them by the names in ToleranceStudy."""
        extent = np.where(self._turns[:, None], self._greatest - self._least, np.nan)
        return {**self._at_angles, 'stride': extent[:, 0].copy(), 'lift': extent[:, 1].copy()}


def _total(values: FloatArray) -> FloatArray:
    """Return the sum over the legs that are there."""
    return np.asarray(np.where(np.isnan(values), 0.0, values).sum(axis=0), dtype=np.float64)


def _kept(distance: FloatArray, count: IntArray, share: float) -> FloatArray:
    """Return what a share of the legs keeps to, of distances in order: the nearest rank."""
    rank = np.maximum(0, [ceil(share * n) - 1 for n in count.tolist()])
    kept: FloatArray = distance[rank, np.arange(distance.shape[1])]
    return kept
