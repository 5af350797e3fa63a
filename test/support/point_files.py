"""Files of linkages by the coordinates of their points in one pose."""

import json
from typing import Any

from klann_ros.kinematics import GeometryError, KinematicsError, Linkage, LinkageLeg, LinkagePose
import numpy as np


def point_file(pose: LinkagePose, *, directions: bool = False, digits: int = 17) -> str:
    """Return the file of a pose's linkage by its points; the directions of lines if asked for."""
    linkage = pose.linkage
    structure = linkage.structure
    links: dict[str, Any] = {}
    for body in structure.bodies:
        content: dict[str, Any] = {'clockwise': body.clockwise}
        if body.line:
            slides = {'along': body.along, 'from': body.line.start, 'to': body.line.end}
            content['slides'] = slides
            if directions:
                line = f'direction of {body.line.start}-{body.line.end}'
                names = (line, f'{line} of {body.angle}')
                slides['direction'] = next(
                    linkage.dimensions[name] for name in names if name in linkage.dimensions
                )
        if len(body.points) > 1 or not body.slides:
            content['points'] = [*body.points]
        # A list has the points alone.
        links[body.angle] = content if body.slides or body.clockwise else [*body.points]
    return json.dumps(
        {
            'name': linkage.name,
            'points': dict(zip(structure.points, pose.points.round(digits).tolist(), strict=True)),
            'ground': [*structure.pivots],
            'crank': structure.crank.angle,
            'foot': structure.foot,
            'links': links,
            'at_change_points': linkage.at_change_points,
        }
    )


def smallest_sine(pose: LinkagePose) -> float:
    return float(np.abs(pose.sines).min())


def firm_pose(linkage: Linkage) -> LinkagePose:
    """Return a pose far from dead points and change points; a GeometryError where it has none."""
    leg = LinkageLeg(linkage)
    poses = []
    for alpha in np.linspace(-3.1, 3.1, 32).tolist():
        try:
            poses.append(leg.solve(alpha))
        except KinematicsError:
            continue
    pose = max(poses, key=smallest_sine, default=None)
    if pose is None or smallest_sine(pose) < 0.03:
        raise GeometryError('it has no such pose')
    return pose
