"""Tables of a leg over its crank angle: arrays, printed, or as CSV."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import StringIO
from math import inf, pi
from typing import Any

from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.linkage import Linkage
from klann_ros.kinematics.validation import check_rate
from klann_ros.sanitize.text import refusal
import numpy as np
from numpy.typing import ArrayLike

from .poses import linkage_poses

# The units that are printed otherwise than as they are with four decimals: name, size, decimals.
PRINTED = {
    'rad': ('deg', 180.0 / pi, 2),
    'm': ('mm', 1000.0, 3),
    'm/s': ('mm/s', 1000.0, 2),
    'm/s^2': ('mm/s^2', 1000.0, 2),
    '': ('', 1.0, 6),
}
# The course's symbols of a four-bar's columns.
SYMBOLS = {'z': 'Z', 'transmission_angle': 'mu', 'mechanical_advantage': 'T4/T2'}
# The ends of the names and units of a quantity and its derivatives.
ORDERS = ('', ''), ('_rate', '/s'), ('_acceleration', '/s^2')
# Rows of the printed table, and characters of its lines; the arrays have all.
MAX_ROWS = 100
MAX_LINE = 99
MIN_COLUMN = 12


@with_short_repr
@dataclass(frozen=True, eq=False)
class LegTable:
    """
    Quantities of a leg at many crank angles; NaN at unreachable ones, and rates at singular ones.

    `table['H.x']` is a column, `table.gamma` the same of a name without a point. `print` shows the
    table, angles in deg and lengths in mm.

    Attributes
    ----------
    columns : mapping of str to numpy.ndarray
        The quantities by name, the crank angle first [rad, m, s]: read-only arrays of the shape of
        the given crank angles.
    units : tuple of str
        The units of the columns; empty of the lengths of a four-bar without a unit.

    """

    columns: Mapping[str, FloatArray]
    units: tuple[str, ...]

    def __getitem__(self, name: str) -> FloatArray:
        """Return a column."""
        return self.columns[name]

    def __getattr__(self, name: str) -> FloatArray:
        """Return a column."""
        if name not in vars(self).get('columns', ()):
            raise AttributeError(refusal('the column', name, 'one of `columns`'))
        return self.columns[name]

    def __str__(self) -> str:
        """Return the table in groups of columns, each with the crank angle."""
        groups: list[list[list[str]]] = []
        for name, unit, decimals, numbers in self._printed_columns():
            # Without the sign of a zero.
            rounded = np.round(numbers[:MAX_ROWS], decimals) + 0.0
            texts = [f'{number:.{decimals}f}' for number in rounded.tolist()]
            width = max(MIN_COLUMN, len(name) + 2)
            column = [text.rjust(width) for text in (name, unit and f'[{unit}]', *texts)]
            if not groups or sum(len(cells[0]) for cells in [*groups[-1], column]) > MAX_LINE:
                groups.append(groups[0][:1] if groups else [])
            groups[-1].append(column)
        blocks = ['\n'.join(map(''.join, zip(*group, strict=True))) for group in groups]
        hidden_count = next(iter(self.columns.values())).size - MAX_ROWS
        if hidden_count > 0:
            blocks[-1] += f'\n... and {hidden_count} more'
        return '\n\n'.join(blocks)

    def csv(self, *, decimal_comma: bool = False) -> str:
        """
        Return the table as CSV in its printed units, with all digits; NaN are empty cells.

        Decimal commas come with semicolons between the cells, as for a Brazilian spreadsheet.
        """
        separator = ';' if decimal_comma else ','
        heads = []
        columns = []
        for name, unit, _, numbers in self._printed_columns():
            heads.append(f'{name} [{unit}]' if unit else name)
            columns.append(numbers)
        file = StringIO()
        np.savetxt(file, np.stack(columns, axis=-1), '%s', separator)
        text = file.getvalue().replace('nan', '')
        return f'{separator.join(heads)}\n{text.replace(".", ",") if decimal_comma else text}'

    def _printed_columns(self) -> Iterator[tuple[str, str, int, FloatArray]]:
        """Yield the symbol, unit, decimals and numbers of each column, as they are printed."""
        for (name, numbers), unit in zip(self.columns.items(), self.units, strict=True):
            printed_unit, scale, decimals = PRINTED.get(unit, (unit, 1.0, 4))
            yield SYMBOLS.get(name, name), printed_unit, decimals, scale * numbers.ravel()


def leg_table(leg: Any, alphas: ArrayLike, crank_rate: float | None = None) -> LegTable:
    """Return the table of a leg: see `Leg.table`."""
    linkage: Linkage = leg.linkage
    structure = linkage.structure
    options: Any = {'angles': True, 'points': True, 'transmission_angles': True}
    poses: Any = linkage_poses(leg, alphas, **options, velocities=crank_rate is not None)
    crank_angles = np.array(alphas, float)
    motions = [(poses.angles, poses.points)]
    if crank_rate is not None:
        check_rate('crank_rate', crank_rate)
        motions.append((crank_rate * poses.angles_1, crank_rate * poses.points_1))
        angles_2, points_2 = _second_derivatives(linkage, crank_angles, poses)
        motions.append((crank_rate**2 * angles_2, crank_rate**2 * points_2))
    columns: dict[str, tuple[FloatArray, str]] = {structure.angles[0]: (crank_angles, 'rad')}
    for (suffix, per_time), (angles, points) in zip(ORDERS, motions, strict=False):
        length_unit = structure.unit + per_time if structure.unit else ''
        for j, name in enumerate(structure.angles[1:]):
            unit = length_unit if structure.bodies[j + 1].slides else f'rad{per_time}'
            columns[name + suffix] = angles[..., j], unit
        for n, point in enumerate(structure.points):
            if point not in structure.pivots:
                columns[f'{point}.x{suffix}'] = points[..., n, 0], length_unit
                columns[f'{point}.y{suffix}'] = points[..., n, 1], length_unit
    for k in range(len(linkage.blocks)):
        columns[f'mu_{k + 1}'] = poses.transmission_angles[..., k], 'rad'
    for j, body in enumerate(structure.bodies[1:] if crank_rate is not None else ()):
        (block,) = (block for block in linkage.blocks if j + 1 in block.unknowns)
        # Where a body turns back its rate is rounding.
        rounding = block.rounding_of_sine * (linkage.size if body.slides else 1.0)
        slopes = poses.angles_1[..., j]
        with np.errstate(divide='ignore'):
            advantage = np.where(np.abs(slopes) <= rounding, inf, 1.0 / slopes)
        columns[f'{structure.angles[j + 1]}_advantage'] = advantage, '1/m' if body.slides else '1'
    return table_of(columns)


def _second_derivatives(linkage: Linkage, alphas: FloatArray, poses: Any) -> tuple[Any, Any]:
    """Return those of angles and points by the crank angle; the loops stay closed, W d2u = 0."""
    structure = linkage.structure
    rates = np.moveaxis(poses.angles_1, -1, 0)
    u = joints.body_vectors(structure, [alphas, *np.moveaxis(poses.angles, -1, 0)])
    products = joints.velocity_product(structure, u, [1.0 + 0.0 * rates[0], *rates])
    with np.errstate(all='ignore'):
        closings = [block.closing(u) for block in linkage.blocks]
        x_2 = np.array(joints.solve_rates(structure, u, closings, 0.0, bent=products)[0])
    for near, pose in linkage.change_points.interpolated_poses(alphas):
        x_2[1:, near] = pose.x_2.T
    u_2 = [joints.vector_velocity(structure, u, x_2, j) for j in range(len(u))]
    ends = np.tensordot(linkage.point_equations[0], np.add(u_2, products), 1)
    points_2 = np.array([ends.real, ends.imag])
    return np.moveaxis(x_2[1:], 0, -1), np.moveaxis(points_2, (0, 1), (-1, -2))


def table_of(columns: Mapping[str, tuple[FloatArray, str]]) -> LegTable:
    """Return a table of columns and their units."""
    arrays = {}
    for name, (numbers, _) in columns.items():
        arrays[name] = np.array(numbers)
        arrays[name].setflags(write=False)
    return LegTable(arrays, tuple(unit for _, unit in columns.values()))
