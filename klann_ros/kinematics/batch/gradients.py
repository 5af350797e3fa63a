"""Derivatives by the dimensions where joints slide or loops are coupled, at many poses."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics.linkage import joints
from klann_ros.kinematics.linkage.dimension_derivatives import bar_derivatives, pivot_derivatives
from klann_ros.kinematics.linkage.equations import path_terms
from klann_ros.kinematics.linkage.structure import Dimension, Structure
from klann_ros.kinematics.linkage.topology import Path
import numpy as np

from .results import LinkagePoses


def store_gradients(
    results: LinkagePoses,
    structure: Structure,
    poses: tuple[Any, Any, Any],
    blocks: Sequence[joints.Closing],
    vectors: tuple[Sequence[Any], Sequence[Any]],
) -> None:
    """
    Store the requested derivatives by the dimensions, by the implicit function theorem.

    `poses` are the bodies' vectors u, dx/dalpha and du/dalpha, `blocks` close their loops, and
    `vectors` are the pivots and the bars.
    """
    wanted = {
        name: array for name, array in results.arrays().items() if name.endswith('_gradient')
    }
    if not wanted:
        return
    singular = np.isnan(np.sum(poses[1], axis=0))
    for place, dimension in enumerate(structure.dimensions):
        moved = _Moved(structure, poses, blocks, vectors, dimension)
        for name, array in wanted.items():
            if name == 'angles_gradient':
                for j in range(1, len(structure.bodies)):
                    array[..., j - 1, place] = moved.x[j]
            elif name == 'points_gradient':
                for n, path in enumerate(structure.paths.points):
                    _set(array[..., n, :, place], moved.path(path))
            else:
                path = structure.paths.points[structure.points.index(structure.foot)]
                rates = name == 'h_1_gradient'
                _set(array[..., place], moved.path_rate(path) if rates else moved.path(path))
    for array in wanted.values():
        array[np.broadcast_to(singular, results.reason.shape)] = np.nan


def _set(plane: Any, values: Any) -> None:
    plane[..., 0], plane[..., 1] = np.real(values), np.imag(values)


class _Moved:
    """The poses' derivatives by one dimension; see `store_gradients`."""

    def __init__(
        self,
        structure: Structure,
        poses: tuple[Any, Any, Any],
        blocks: Sequence[joints.Closing],
        vectors: tuple[Sequence[Any], Sequence[Any]],
        dimension: Dimension,
    ) -> None:
        self._structure, self._blocks, self._vectors = structure, blocks, vectors
        self._u, self._x_1, self._u_1 = poses
        moved_bars = bar_derivatives(structure, vectors[1], dimension)
        self._moved = pivot_derivatives(structure, dimension), moved_bars
        self.x, self._du = self._solve(self._u, constant=1.0)

    def path(self, path: Path) -> Any:
        """Return the derivative of a path's end."""
        return self._sum(path, self._vectors, self._du, 0.0) + self._direct(path, self._u, 1.0)

    def path_rate(self, path: Path) -> Any:
        """Return the derivative of its derivative by the crank angle."""
        bent = joints.velocity_product(self._structure, self._u, self._x_1, self.x)
        _, du_1 = self._solve(self._u_1, constant=0.0, bent=bent)
        return self._sum(path, self._vectors, du_1, 0.0) + self._direct(path, self._u_1, 0.0)

    def _solve(self, u: Any, constant: float, bent: Sequence[Any] = ()) -> tuple[Any, Any]:
        paths = self._structure.paths
        opened = [
            [self._direct(paths.loops[k], u, constant) for k in loops] for loops in paths.rows
        ]
        return joints.solve_rates(
            self._structure, self._u, self._blocks, 0.0, opened=opened, bent=bent
        )

    def _direct(self, path: Path, u: Any, constant: float) -> Any:
        """Return what the dimension changes in a path at fixed coordinates."""
        return self._sum(path, self._moved, u, constant)

    def _sum(self, path: Path, vectors: Any, u: Any, constant: float) -> Any:
        terms, fixed = path_terms(self._structure, path, *vectors)
        return sum((w * u[j] for j, w in terms.items()), constant * fixed + 0j * self._u[-1])
