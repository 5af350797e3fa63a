"""The joints of a linkage in one pose as a table, which `import_linkage` reads."""

from cmath import phase
from math import degrees

from klann_ros.kinematics import FIXED, GROUND, Linkage, LinkageLeg

# The pose, as a part of the first arc that the crank reaches: it is no dead point.
ARC_PART = 0.37


def joint_table(linkage: Linkage) -> str:
    """Return the joints as CSV, in mm."""
    structure = linkage.structure
    leg = LinkageLeg(linkage)
    start, end = leg.reachable_arcs()[0]
    pose = leg.solve(start + ARC_PART * (end - start))
    positions = dict(zip(structure.points, 1e3 * pose.points, strict=True))
    names = {FIXED: GROUND, **dict(enumerate(structure.angles))}
    rows = ['name,x,y,links,type,angle,driven,traced']
    for name, (x, y) in positions.items():
        links = ' '.join(names[j] for j in structure.owners[name])
        motor = structure.crank.angle if name == structure.crank.points[0] else ''
        trace = 'x' if name == structure.foot else ''
        rows.append(f'{name},{x:.15g},{y:.15g},{links},R,,{motor},{trace}')
    for j, body in enumerate(structure.bodies):
        if body.line:
            x, y = positions[body.line.end]
            place = f'{x:.15g},{y:.15g},{body.along} {body.angle}'
            angle = degrees(phase(linkage.line(pose.vectors, j)))
            rows.append(f'line_{body.angle},{place},P,{angle:.15g},,')
    return '\n'.join(rows) + '\n'
