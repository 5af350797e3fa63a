"""The legs that a run describes: by parameters of its solvers, or by robot_description."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
import json
from math import isfinite
from operator import attrgetter
import sys
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, fromstring, ParseError, XMLParser

from klann_ros.dynamics import Dynamics
from klann_ros.kinematics import AnyLeg, GeometryError, KlannGeometry, KlannLeg, LinkageLeg
from klann_ros.log import SolverParameters
from klann_ros.review.model.recording import LegRecording, LegSolver
from klann_ros.review.model.times import Series
from klann_ros.robot import LEG_PARAMETERS, of_leg, Robot, robot_from_parameters, SEPARATORS
from klann_ros.sanitize.text import printable
import numpy as np

from .columns import MAX_DESCRIPTION_SIZE
from .roles import DESCRIPTION

# Source of a reference leg.
REFERENCE = '--geometry'


def leg_solvers(
    records: Sequence[SolverParameters], namespace: str, reference: Robot | None = None
) -> dict[str, LegSolver]:
    """
    Return the solvers of the legs in a namespace by their names, '' for the unnamed one.

    Without a solver in the namespace, the last node of the run counts. A reference robot replaces
    the legs in the run.
    """
    local = [record for record in records if parent(record.node) == namespace]
    local = local or [record for record in records if record.node == records[-1].node]
    # The last parameters of each node count; several nodes may have the same leg.
    names_of_nodes = {record.node: _names(record.parameters.get('legs')) for record in local}
    solvers: dict[str, LegSolver] = {}
    for names in names_of_nodes.values():
        for name in names:
            if name not in solvers:
                leg_records = [record for record in local if name in names_of_nodes[record.node]]
                solvers[name] = _solver(leg_records, name, reference)
    return solvers


def _solver(records: Sequence[SolverParameters], name: str, reference: Robot | None) -> LegSolver:
    """Return the solver of a leg by its recorded parameters, or by the reference."""
    parameter_sets = [of_leg(record.parameters, name) for record in records]
    parameters = parameter_sets[-1]
    if reference:
        leg = reference_leg(reference, name)
        leg_time = 0
        source = REFERENCE
    else:
        legs = [*map(_leg, parameter_sets)]
        leg = legs[-1]
        leg_time = _last_change([record.time for record in records], legs)
        source = f'the parameters of {printable(records[-1].node)}' if leg else ''
    joint = str(parameters.get('crank_joint') or LegSolver.crank_joint)
    direction = _number(parameters.get('direction'), 1)
    ratio = _number(parameters.get(f'cranks.{joint}.encoder_ratio'), 1)
    zero = _number(parameters.get(f'cranks.{joint}.zero'), 0.0)
    return LegSolver(
        crank_joint=joint,
        sim_time=any(record.parameters.get('use_sim_time') is True for record in records),
        leg=leg,
        leg_time=leg_time,
        direction=direction if ratio in (0, 1) else direction / ratio,
        phase=_number(parameters.get('phase'), 0.0) - direction * zero,
        nodes=tuple(dict.fromkeys(record.node for record in records)),
        source=source,
        joint_separator='_' if parameters.get('joint_separator') == '_' else '/',
        counts_per_turn=_counts_per_turn(parameters),
    )


def _last_change(times: Sequence[int], legs: Sequence[AnyLeg | None]) -> int:
    """Return the latest time when a leg changed; 0 for none."""
    linkages = [leg and leg.linkage for leg in legs]
    last_change = 0
    for time, linkage, last_linkage in zip(times[1:], linkages[1:], linkages, strict=False):
        if linkage != last_linkage:
            last_change = max(last_change, time)
    return last_change


def _names(legs: Any) -> tuple[str, ...]:
    """Return the leg names of an unchecked parameter; '' for the unnamed leg."""
    names = [str(name) for name in legs if name] if isinstance(legs, list) else []
    return tuple(names) or ('',)


def _number(parameter: Any, default: float) -> float:
    is_number = isinstance(parameter, int | float) and abs(parameter) <= sys.float_info.max
    return parameter if is_number else default


def _counts_per_turn(parameters: Mapping[str, Any]) -> float:
    """Return the counts of an encoder in a turn; 0 where cranks are in JointStates."""
    if parameters.get('crank_state_type') != 'ticks':
        return 0.0
    return max(0.0, _number(parameters.get('counts_per_turn'), 0.0))


def parent(name: str) -> str:
    """Return the namespace of a full name; '' for the root."""
    return name.rpartition('/')[0]


def reference_leg(robot: Robot | None, name: str) -> AnyLeg | None:
    """Return the leg of a robot by its name; None without one."""
    leg = robot and robot.leg(name)
    return LinkageLeg(leg.linkage) if leg else None


def published_legs(names: Sequence[str], joints: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the name and the separator of each leg with all its joints among the names."""
    published = set(names)
    for name in names:
        head = name.removesuffix(joints[0])
        leg = head[:-1]
        separator = head[-1:] or SEPARATORS[0]
        is_prefix = head == '' or (leg and separator in SEPARATORS)
        if head != name and is_prefix and published.issuperset(head + joint for joint in joints):
            yield leg, separator


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
    leg_records = [record for record in records if record.node in solver.nodes]
    if solver.leg is None or not leg_records:
        return solver
    # Only this leg matters.
    parameters = leg_records[-1].without_files
    parameters['legs'] = [leg.name] if leg.name else []
    try:
        return replace(solver, dynamics=_dynamics(robot_from_parameters(parameters), leg.name))
    except (TypeError, ValueError, RecursionError):
        return solver


def _dynamics(robot: Robot, name: str) -> Dynamics | None:
    leg = robot.leg(name)
    return robot.dynamics(leg) if leg and leg.masses else None


class _Described(NamedTuple):
    """Dimensions of legs by their names, since a log time [ns]."""

    time: int
    legs: dict[str, dict[str, float]]


class RobotDescriptions:
    """
    The legs of robot descriptions, by the namespace of the topic.

    `contents` are the topics, log times [ns] and contents of their messages.
    """

    def __init__(self, contents: Iterable[tuple[str, int, Mapping[str, Any]]]) -> None:
        self._described: dict[str, list[_Described]] = defaultdict(list)
        for topic, time, content in contents:
            legs = klann_legs_in_urdf(content['data'])
            self._described[parent(topic)].append(_Described(time, legs))

    def described(self, solver: LegSolver, namespace: str, name: str, poses: Series) -> LegSolver:
        """Return a solver of an unknown leg with the described one, if any."""
        with_legs = []
        for described_namespace, descriptions in self._described.items():
            if any(description.legs for description in descriptions):
                with_legs.append(described_namespace)
        # A single description holds for every namespace.
        if namespace not in with_legs and len(with_legs) == 1:
            (namespace,) = with_legs
        descriptions = sorted(self._described.get(namespace, ()), key=attrgetter('time'))
        assembly = _assembly(poses)
        legs = [_klann_leg(description.legs.get(name), assembly) for description in descriptions]
        if not legs or legs[-1] is None:
            return solver
        times = [description.time for description in descriptions]
        source = f'{printable(f"{namespace}/{DESCRIPTION}")}, assembly mode from its poses'
        return replace(solver, leg=legs[-1], leg_time=_last_change(times, legs), source=source)


def _assembly(poses: Series) -> tuple[int, int]:
    """Return the assembly mode of most poses of a Klann leg, which no URDF has."""
    _, gamma, beta, delta, theta = poses.values.T
    with np.errstate(over='ignore', invalid='ignore'):
        signs = np.sign(np.sin([gamma + beta, delta + theta]))
    front, back = np.where(np.nansum(signs, axis=1) >= 0.0, 1, -1).tolist()
    return front, back


def _klann_leg(numbers: dict[str, float] | None, assembly: tuple[int, int]) -> KlannLeg | None:
    try:
        return None if numbers is None else KlannLeg(KlannGeometry(**numbers, assembly=assembly))
    except GeometryError:
        return None


# The joints of a leg by `klann.urdf.xacro`, and the dimensions in their origins, by the indices of
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
    elements = robot.findall('joint')
    joints = {joint.get('name', ''): joint for joint in elements}
    if robot.tag != 'robot' or len(joints) < len(elements):
        return {}
    boxes = {link.get('name'): link.find('visual/geometry/box') for link in robot.iterfind('link')}
    legs = {}
    for name in joints:
        prefix = name.removesuffix('alpha')
        if prefix != name and (not prefix or prefix[-1] in SEPARATORS):
            # Joints of another robot may have such names.
            with suppress(KeyError, ValueError):
                legs[prefix[:-1]] = _dimensions(joints, boxes, prefix)
    return legs


def _dimensions(
    joints: Mapping[str, Element], boxes: Mapping[str | None, Element | None], prefix: str
) -> dict[str, float]:
    """Return the dimensions of the leg whose joints have a prefix; a ValueError for another."""
    dimensions: dict[str, float] = {}
    for joint, names in _JOINTS.items():
        origin = joints[f'{prefix}{joint}'].find('origin')
        numbers = _numbers(origin, 'xyz', '0 0 0') + _numbers(origin, 'rpy', '0 0 0')
        for index, number in enumerate(numbers):
            if index in names:
                dimensions[names[index]] = number
            elif number:
                raise ValueError(f'{joint} is a joint of another robot')
    dimensions['angle_fgh'] *= -1
    for name, joint in _BAR_LENGTHS.items():
        child = joints[f'{prefix}{joint}'].find('child')
        box = None if child is None else boxes[child.get('link')]
        dimensions[name] = _numbers(box, 'size', '')[0]
    return dimensions


def _numbers(element: Element | None, name: str, default: str) -> tuple[float, ...]:
    text = default if element is None else element.get(name, default)
    numbers = tuple(map(float, text.split()))
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise ValueError('these are not three numbers')
    return numbers
