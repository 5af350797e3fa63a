"""The joints of a linkage in one pose as a table, which `import_linkage` reads."""

from cmath import phase
from math import degrees

from klann_ros.kinematics import FIXED, GROUND, Linkage, LinkageLeg

from .plates import ExportError

# The pose, as a part of the first arc that the crank reaches: it is no dead point.
ARC_PART = 0.37


def joint_table(linkage: Linkage) -> str:
    """Return the joints as CSV, in mm; an ExportError where a line has no direction."""
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
    for body in structure.bodies:
        if body.line:
            x, y = positions[body.line.end]
            way = complex(x, y) - complex(*positions[body.line.start])
            if abs(way) < 1e-3 * linkage.size:
                raise ExportError(f'{body.angle} is at the start of its line: no direction')
            place = f'{x:.15g},{y:.15g},{body.along} {body.angle}'
            rows.append(f'line_{body.angle},{place},P,{degrees(phase(way)):.15g},,')
    return '\n'.join(rows) + '\n'
