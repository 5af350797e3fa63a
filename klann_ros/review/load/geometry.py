"""The legs that a run describes: by parameters of its solvers, or by robot_description."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
import json
from math import isfinite
import sys
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, fromstring, ParseError, XMLParser

from klann_ros.dynamics import Dynamics
from klann_ros.kinematics import AnyLeg, GeometryError, KlannGeometry, KlannLeg, LinkageLeg
from klann_ros.kinematics.arrays import IndexArray
from klann_ros.log import MessageBlock, SolverParameters, Topic
from klann_ros.messages import STRING
from klann_ros.review.model.recording import LegRecording, LegSolver
from klann_ros.review.model.times import nanoseconds, Series
from klann_ros.robot import LEG_PARAMETERS, of_leg, Robot, robot_from_parameters, SEPARATORS
from klann_ros.sanitize.text import printable
import numpy as np

# Source of a reference leg.
REFERENCE = '--geometry'
Metadata = Mapping[str, Sequence[Mapping[str, str]]]


def leg_solvers(
    records: Sequence[SolverParameters], namespace: str, reference: Robot | None = None
) -> dict[str, LegSolver]:
    """
    Return the solvers of the legs in a namespace by their names, '' for the unnamed one.

    Without a solver in the namespace, the last node of the run counts. A reference robot replaces
    the legs in the run.
    """
    own = [record for record in records if parent(record.node) == namespace]
    own = own or [record for record in records if record.node == records[-1].node]
    # The last parameters of each node count; several nodes may have the same leg.
    last = {record.node: dict.fromkeys(_names(record.parameters.get('legs'))) for record in own}
    return {
        name: _solver([record for record in own if name in last[record.node]], name, reference)
        for name in dict.fromkeys(name for names in last.values() for name in names)
    }


def _solver(own: Sequence[SolverParameters], name: str, reference: Robot | None) -> LegSolver:
    values = [of_leg(record.parameters, name) for record in own]
    legs = [reference_leg(reference, name)] if reference else [*map(_leg, values)]
    last, source = values[-1], REFERENCE if reference else ''
    if legs[-1] and not reference:
        source = f'the parameters of {printable(own[-1].node)}'
    joint = str(last.get('crank_joint') or LegSolver.crank_joint)
    direction = _number(last.get('direction'), 1)
    ratio = _number(last.get(f'cranks.{joint}.encoder_ratio'), 1)
    zero = _number(last.get(f'cranks.{joint}.zero'), 0.0)
    return LegSolver(
        crank_joint=joint,
        sim_time=any(record.parameters.get('use_sim_time') is True for record in own),
        leg=legs[-1],
        leg_time=0 if reference else _last_change([record.time for record in own], legs),
        direction=direction if ratio in (0, 1) else direction / ratio,
        phase=_number(last.get('phase'), 0.0) - direction * zero,
        nodes=tuple(dict.fromkeys(record.node for record in own)),
        source=source,
        joint_separator='_' if last.get('joint_separator') == '_' else '/',
    )


def _last_change(times: Sequence[int], legs: Sequence[AnyLeg | None]) -> int:
    """Return the time of the last change of a leg; 0 for none."""
    linkages = [leg and leg.linkage for leg in legs]
    changes = zip(times[1:], linkages, linkages[1:], strict=False)
    return max((time for time, before, after in changes if before != after), default=0)


def _names(legs: Any) -> tuple[str, ...]:
    """Return the leg names of an unchecked parameter; '' for the unnamed leg."""
    names = [str(name) for name in legs if name] if isinstance(legs, list) else []
    return tuple(names) or ('',)


def _number(value: Any, otherwise: float) -> float:
    number = isinstance(value, int | float) and abs(value) <= sys.float_info.max
    return value if number else otherwise


def parent(name: str) -> str:
    """Return the namespace of a full name; '' for the root."""
    return name.rpartition('/')[0]


def reference_leg(robot: Robot | None, name: str) -> AnyLeg | None:
    """Return the leg of a robot by its name; None without one."""
    leg = robot and robot.leg(name)
    return LinkageLeg(leg.linkage) if leg else None


def published_legs(names: Sequence[str], joints: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the name and the separator of each leg with all its joints among the names."""
    known = set(names)
    for name in names:
        head = name.removesuffix(joints[0])
        prefix, separator = head[:-1], head[-1:] or SEPARATORS[0]
        is_prefix = head == '' or (prefix and separator in SEPARATORS)
        if head != name and is_prefix and all(f'{head}{other}' in known for other in joints):
            yield prefix, separator


def _leg(parameters: Mapping[str, Any]) -> AnyLeg | None:
    # The run has the text of a linkage; a file name in it is never opened.
    names = [name for name in LEG_PARAMETERS if name in parameters and name != 'linkage']
    try:
        return _leg_of(json.dumps({name: parameters[name] for name in names}))
    except (TypeError, ValueError):
        return None


@lru_cache(maxsize=64)
def _leg_of(text: str) -> AnyLeg:
    """Return the leg of parameters as JSON; cached for many runs."""
    (leg,) = robot_from_parameters(json.loads(text), weigh=False).legs
    return LinkageLeg(leg.linkage)


def with_dynamics(
    leg: LegRecording, records: Sequence[SolverParameters], robot: Robot | None = None
) -> LegSolver:
    """Return a leg's solver with its masses by the reference robot, or by the run if known."""
    solver = leg.solver
    if robot is not None:
        return replace(solver, dynamics=_dynamics(robot, leg.name))
    own = [record for record in records if record.node in solver.nodes]
    if solver.leg is None or not own:
        return solver
    # Only this leg matters.
    parameters = own[-1].without_files
    parameters['legs'] = [leg.name] if leg.name else []
    try:
        return replace(solver, dynamics=_dynamics(robot_from_parameters(parameters), leg.name))
    except (TypeError, ValueError, RecursionError):
        return solver


def _dynamics(robot: Robot, name: str) -> Dynamics | None:
    leg = robot.leg(name)
    return robot.dynamics(leg) if leg and leg.masses else None


DESCRIPTION = 'robot_description'
# Longest description that is read [characters], and bytes of its message beside the text.
MAX_DESCRIPTION_SIZE, _MESSAGE_OVERHEAD = 1024 * 1024, 16
# Different descriptions of one namespace that are read.
_MAX_DESCRIPTIONS = 32


class _Described(NamedTuple):
    """Dimensions of legs by their names, since a log time [ns]."""

    time: int
    legs: dict[str, dict[str, float]]


class Descriptions:
    """Collects the legs of robot descriptions, by the namespace of the topic."""

    def __init__(self) -> None:
        self._last: dict[str, bytes] = {}
        self._found: dict[str, list[_Described]] = defaultdict(list)

    def add(self, topic: Topic, block: MessageBlock, rows: IndexArray) -> None:
        """Add the descriptions of a topic in a block."""
        found = self._found[parent(topic.name)]
        for row in rows[block.sizes[rows] <= MAX_DESCRIPTION_SIZE + _MESSAGE_OVERHEAD].tolist():
            data = block.message(row)
            # It is usually repeated.
            if data != self._last.get(topic.name) and len(found) < _MAX_DESCRIPTIONS:
                self._last[topic.name] = data
                time = int(nanoseconds(block.heads['log_time'][[row]])[0])
                found.append(_Described(time, klann_legs_in_urdf(_text(data))))

    def described(self, solver: LegSolver, namespace: str, name: str, poses: Series) -> LegSolver:
        """Return a solver of an unknown leg with the described one, if any."""
        spaces = [space for space, found in self._found.items() if any(d.legs for d in found)]
        # A single description holds for every namespace.
        space = namespace if namespace in spaces or len(spaces) != 1 else spaces[0]
        found = sorted(self._found.get(space, ()), key=lambda described: described.time)
        assembly = _assembly(poses)
        legs = [_klann_leg(described.legs.get(name), assembly) for described in found]
        if not legs or legs[-1] is None:
            return solver
        times = [described.time for described in found]
        source = f'{printable(f"{space}/{DESCRIPTION}")}, assembly mode from its poses'
        return replace(solver, leg=legs[-1], leg_time=_last_change(times, legs), source=source)


def _text(data: bytes) -> str:
    try:
        (text,) = STRING.layout(data).texts['data']
        return text.decode()
    except ValueError:
        return ''


def _assembly(poses: Series) -> tuple[int, int]:
    """Return the assembly mode of most poses of a Klann leg, which no URDF has."""
    _, gamma, beta, delta, theta = poses.values.T
    with np.errstate(over='ignore', invalid='ignore'):
        sums = [float(np.nansum(np.sign(np.sin(both)))) for both in (gamma + beta, delta + theta)]
    return (1 if sums[0] >= 0 else -1), (1 if sums[1] >= 0 else -1)


def _klann_leg(numbers: dict[str, float] | None, assembly: tuple[int, int]) -> KlannLeg | None:
    try:
        return None if numbers is None else KlannLeg(KlannGeometry(**numbers, assembly=assembly))
    except GeometryError:
        return None


# The joints of a leg by `klann.urdf.xacro`, and the dimensions in their origins, by the places of
# x, y, z, roll, pitch and yaw; the other numbers are zero.
_JOINTS: dict[str, dict[int, str]] = {
    'alpha': {1: 'y_a'},
    'alpha_back': {0: 'l_ab'},
    'gamma': {},
    'bend_c': {0: 'l_bc', 5: 'angle_bcg'},
    'beta': {0: 'x_d'},
    'delta': {0: 'x_e', 1: 'y_e'},
    'delta_back': {0: 'l_ef'},
    'theta': {},
    'bend_g': {0: 'l_fg', 5: 'angle_fgh'},
    'foot': {0: 'l_gh'},
}
# A tree cannot close loops: these bars end freely, and have the length of the box on this joint.
_BAR_LENGTHS = {'l_dc': 'beta', 'l_cg': 'bend_c'}


def klann_legs_in_urdf(text: str) -> dict[str, dict[str, float]]:
    """
    Return the lengths [m], pivots [m] and bends [rad] of the legs in a URDF, by the legs' names.

    They are the arguments of `KlannGeometry` without the assembly, which no URDF has. Of
    other robots, and of an invalid URDF, nothing is returned. The text is untrusted: a document
    type declaration is refused, so nothing is expanded or fetched.
    """
    if len(text) > MAX_DESCRIPTION_SIZE or '<!DOCTYPE' in text:
        return {}
    try:
        # The text is decoded already, whatever encoding it declares.
        parser = XMLParser(encoding='utf-8')  # noqa: S314 - it cannot declare an entity
        robot = fromstring(text.encode(), parser)  # noqa: S314 - as above
    except (ParseError, UnicodeEncodeError):
        return {}
    named = [(joint.get('name', ''), joint) for joint in robot.iterfind('joint')]
    joints, boxes = dict(named), {}
    if robot.tag != 'robot' or len(joints) < len(named):
        return {}
    for link in robot.iterfind('link'):
        boxes[link.get('name')] = link.find('visual/geometry/box')
    prefixes = (name.removesuffix('alpha') for name in joints if name.endswith('alpha'))
    found = {}
    for prefix in (each for each in prefixes if not each or each[-1] in SEPARATORS):
        # Joints of another robot may have such names.
        with suppress(KeyError, ValueError):
            found[prefix[:-1]] = _dimensions(joints, boxes, prefix)
    return found


def _dimensions(
    joints: Mapping[str, Element], boxes: Mapping[str | None, Element | None], prefix: str
) -> dict[str, float]:
    """Return the dimensions of the leg whose joints have a prefix; a ValueError for another."""
    found: dict[str, float] = {}
    for name, places in _JOINTS.items():
        origin = joints[f'{prefix}{name}'].find('origin')
        values = _numbers(origin, 'xyz', '0 0 0') + _numbers(origin, 'rpy', '0 0 0')
        if any(value for place, value in enumerate(values) if place not in places):
            raise ValueError(f'{name} is a joint of another robot')
        found |= {dimension: values[place] for place, dimension in places.items()}
    found['angle_fgh'] *= -1
    for name, on in _BAR_LENGTHS.items():
        child = joints[f'{prefix}{on}'].find('child')
        box = None if child is None else boxes[child.get('link')]
        found[name] = _numbers(box, 'size', '')[0]
    return found


def _numbers(element: Element | None, name: str, default: str) -> tuple[float, ...]:
    text = default if element is None else element.get(name, default)
    numbers = tuple(map(float, text.split()))
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ValueError('these are not three numbers')
    return numbers
