"""Files of linkages by the coordinates of their points in one pose."""

import json
from typing import Any

from klann_ros.kinematics import LinkagePose


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
