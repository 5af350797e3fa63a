"""The figures of a leg: names, units and bounds; in bulk, and as `describe` reports them."""

from math import inf, pi
from typing import Any, NamedTuple

from klann_ros.datasheet import DataSheet
from klann_ros.kinematics import (
    driven_clearances,
    Linkage,
    linkage_poses,
    path_figures,
    SampledPaths,
    Variants,
    whole_turns,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import BoolArray, FloatArray
import numpy as np

# Crank angles of a candidate's turn; between them the path is a cubic.
CANDIDATE_ANGLES = 96


class FigureKind(NamedTuple):
    """
    A figure that requirements may name.

    `unit` is 'm', 'rad', '' or another SI unit. A costly one is computed of
    survivors alone. `needs` is the key of the requirements that defines it.
    """

    text: str
    unit: str = ''
    min_value: float = 0.0
    max_value: float = inf
    is_costly: bool = False
    needs: str = ''


FIGURES = {
    'stride': FigureKind('extent of the foot path along x, also in the air', 'm'),
    'lift': FigureKind('extent of the foot path along y', 'm'),
    'path_length': FigureKind('length of the foot path', 'm'),
    'duty_factor': FigureKind('fraction of a turn on the ground', '', 0.0, 1.0),
    'ground_covered': FigureKind('advance of the foot in stance: what a step walks', 'm'),
    'deviation': FigureKind('greatest distance of the stance from its least-squares line', 'm'),
    'minimax_deviation': FigureKind('greatest distance of the stance from its best line', 'm'),
    'straightness': FigureKind('deviation relative to the ground covered', ''),
    'ripple': FigureKind('(greatest - least) / mean foot speed in stance', ''),
    'advance': FigureKind('mean foot speed in stance, at a crank rate of 1 rad/s', 'm'),
    'step_height': FigureKind('height of the foot at mid-swing', 'm'),
    'transmission_angle': FigureKind('worst, from links in line', 'rad', 0.0, pi / 2.0),
    'ground_clearance': FigureKind('from the ground up to the lowest pivot', 'm', -inf),
    'width': FigureKind('of the bounding box over a turn', 'm'),
    'height': FigureKind('of the bounding box over a turn', 'm'),
    'bar_ratio': FigureKind('longest to shortest bar', '', 1.0),
    'torque_peak': FigureKind('of the crank, the load alone', 'N m', needs='load'),
    'torque_range': FigureKind('greatest - least of the crank torque', 'N m', needs='load'),
    'path_error': FigureKind('rms distance of corresponding points of path', 'm', needs='path'),
    'point_error': FigureKind(
        'rms distance of the given points of path', 'm', is_costly=True, needs='path'
    ),
    'pose_error': FigureKind('rms distance from the poses', 'm', needs='poses'),
    'exact_error': FigureKind('of exact poses, relative to the size of the leg', needs='poses'),
    'area_clearance': FigureKind('from forbidden areas', 'm', -inf, needs='forbidden'),
    'rounding_error': FigureKind('from what can be cut', 'm', is_costly=True, needs='round'),
    'margin': FigureKind('change of a bar until it jams, relative to the size', is_costly=True),
    'turning_fraction': FigureKind(
        'of legs within the tolerance', '', 0.0, 1.0, is_costly=True, needs='tolerance'
    ),
    'motor_margin': FigureKind('available to required torque', '', is_costly=True, needs='motor'),
    'speed': FigureKind('of the walker', 'm/s', -inf, is_costly=True, needs='walker'),
    'static_margin': FigureKind('of the walker', 'm', -inf, is_costly=True, needs='walker'),
    'height_variation': FigureKind('of the walker', 'm', is_costly=True, needs='walker'),
}


def crank_angles(count: int) -> FloatArray:
    """Return the crank angles of a turn [rad]."""
    return np.arange(count, dtype=np.float64) * (TURN / count)


class Judgement(NamedTuple):
    """
    Candidates, n of them.

    `jam` is the share of crank angles that a candidate does not reach, plus its lacking clearance
    relative to its crank; 0 if it turns. `figures` by name, shape (n,), NaN if it does not turn.
    `h`, shape (n, k, 2), is the foot [m].
    """

    jam: FloatArray
    figures: dict[str, FloatArray]
    h: FloatArray

    @property
    def turns(self) -> BoolArray:
        """Return whether each turns."""
        return np.equal(self.jam, 0.0)


def judge(variants: Variants, names: frozenset[str], load: float = 0.0) -> Judgement:
    """Return the named figures of candidates; those that are not computed in bulk are left out."""
    has_box = not names.isdisjoint({'width', 'height'})
    turns = whole_turns(variants, CANDIDATE_ANGLES, box=has_box)
    jam = np.where(variants.refused, 2.0, turns.missing)
    if variants.base.two_circles:
        with np.errstate(invalid='ignore'):
            missing_clearance = np.maximum(0.0, -driven_clearances(variants) / variants.base.size)
        jam += np.where(np.isfinite(missing_clearance), np.minimum(missing_clearance, 1.0), 0.0)
    turning = np.flatnonzero(jam == 0.0)
    paths = SampledPaths(turns.h.take(turning, axis=1), turns.h_1.take(turning, axis=1))
    stance = paths.stance
    columns = path_figures(paths, stance, paths.heights(stance.mid_swing) - paths.lowest)
    if 'minimax_deviation' in names:
        columns['minimax_deviation'] = paths.minimax_deviation()
    columns['torque_peak'] = load * np.maximum(paths.rise_speed, paths.fall_speed)
    columns['torque_range'] = load * (paths.rise_speed + paths.fall_speed)
    columns['transmission_angle'] = turns.transmission_angle[turning]
    numbers = variants.numbers[:, turning]
    kinds = np.array([dimension.kind for dimension in variants.base.structure.dimensions])
    lengths = numbers[kinds == 'length']
    columns['bar_ratio'] = lengths.max(axis=0) / lengths.min(axis=0)
    heights = numbers[kinds == 'y']
    lowest_pivot = heights.min(axis=0) if len(heights) else np.zeros(len(turning))
    columns['ground_clearance'] = lowest_pivot - paths.lowest
    if turns.box is not None:
        columns['width'], columns['height'] = turns.box[:, turning]
    figures = {}
    # In one order, whatever the hashes of names are.
    for name in sorted(names & columns.keys()):
        figures[name] = np.full(len(variants), np.nan)
        figures[name][turning] = columns[name]
    return Judgement(jam, figures, turns.h.transpose(1, 2, 0))


def sheet_figures(sheet: DataSheet, linkage: Linkage) -> dict[str, float]:
    """Return the figures of a leg's data sheet, as far as it has them."""
    (leg,) = sheet.legs
    figures: dict[str, float] = {}
    kinds = np.array([dimension.kind for dimension in linkage.structure.dimensions])
    numbers = np.array(linkage.numbers)
    if leg.path is not None:
        figures |= {'stride': leg.path.stride, 'lift': leg.path.lift}
        figures['path_length'] = leg.path.length
        heights = numbers[kinds == 'y'].tolist()
        figures['ground_clearance'] = min(heights, default=0.0) - leg.path.y_range[0]
    if leg.stance is not None and leg.path is not None:
        poses: Any = linkage_poses(linkage, [leg.stance.mid_swing])
        step_height = float(poses.h[0, 1]) - leg.path.y_range[0]
        figures |= path_figures(leg.path, leg.stance, step_height)
        figures['minimax_deviation'] = leg.stance.minimax_deviation
    angles = [transmission.from_in_line.value for transmission in leg.transmission]
    figures['transmission_angle'] = min(angles, default=0.0)
    figures['width'], figures['height'] = np.ptp(leg.points, axis=(0, 1)).tolist()
    lengths = numbers[kinds == 'length'].tolist()
    figures['bar_ratio'] = max(lengths) / min(lengths)
    changes: list[float] = []
    for dimension, bar in zip(linkage.structure.dimensions, leg.bars, strict=True):
        # Coordinates depend on the plane's axes; no pivot is nearer to a jam than its bars are.
        if dimension.is_length and bar.margin is not None:
            changes += map(abs, bar.margin.changes)
    if changes:
        figures['margin'] = min(changes) / linkage.size
    crank = sheet.cranks[0]
    if crank.loaded is not None:
        torque = crank.loaded.torque
        figures['torque_peak'] = crank.loaded.peak
        figures['torque_range'] = float(torque.max() - torque.min())
    if crank.motor is not None:
        figures['motor_margin'] = crank.motor.margin
    return figures
