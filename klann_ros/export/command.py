"""`export`: a robot as MJCF and URDF, its plates for a cutter, and its parts for a printer."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from os.path import lexists
from pathlib import Path
import sys
from typing import Any

from klann_ros.cli import (
    ArgumentParser,
    check_new_folder,
    NOT_READ,
    NOT_WRITTEN,
    number_type,
    Output,
    output_files,
    path,
    save_folder,
    UsageError,
)
from klann_ros.kinematics import KinematicsError
from klann_ros.robot import Robot, robot_of, SEPARATORS
from klann_ros.sanitize.text import counted, printable, printable_line
from klann_ros.sanitize.yaml_text import parse
from klann_ros.twin import robot_mjcf

from .assembly import assembly, spacers
from .drawing import drawing, dxf, NoEzdxfError, svg
from .frame import placed_legs
from .joints import joint_table
from .layers import Layers
from .parts import distinct_parts, HOLE_CLEARANCE, Part, PlacedLeg, WALL_LAYER
from .plates import ExportError, slot_conflict
from .ros2_control import ros2_control_files
from .solids import glb, NoSolidsError, oversize_warnings, printed_parts, stl_files, three_mf
from .urdf import loops_urdf, urdf
from .weights import MATERIALS, part_settings, part_sizes, weighed, weighed_file

# Length of a sliding body without bars, as a part of the linkage's size.
SLIDER_LENGTH = 0.1
FORMATS = ('mjcf', 'urdf', 'joints', 'svg', 'dxf', 'assembly', '3mf', 'glb')
FOLDERS = ('loops-urdf', 'ros2-control', 'stl')
PLATES = ('svg', 'dxf', 'assembly', '3mf', 'glb', 'stl')
WEIGHED = 'weighed'
DESCRIPTION = """\
Write a leg or a walker for MuJoCo, ROS, a laser cutter or a printer; several formats at once.

FILE is a parameter file of solver_node, a linkage's YAML file, or a shipped name: sem104."""
EPILOG = """\
SVG and DXF show each distinct plate once, with its holes and its number, in mm.
Sizes and material are those of `parts` in FILE; options win over them.
The shell's own `export` comes before this one: `ros2 run klann_ros export FILE ...`,
`env export FILE ...` start this one.
Exit code: 0 written, 2 FILE or an option is refused, 3 an OUT cannot be written. No OUT may be
FILE, or a YAML file."""


def main(argv: Sequence[str] | None = None) -> int:
    """Export a robot; return the exit code."""
    codes: dict[type[Exception], int] = {KinematicsError: NOT_READ, ValueError: NOT_READ}
    codes |= {NoEzdxfError: NOT_WRITTEN, NoSolidsError: NOT_WRITTEN}
    return _parser().run(_export, codes, argv)


def _export(options: argparse.Namespace) -> int:
    """Write the files that the options ask for; return the exit code."""
    folders = {f'--{name}': getattr(options, name.replace('-', '_')) for name in FOLDERS}
    folders = {option: folder for option, folder in folders.items() if folder is not None}
    outputs = *FORMATS, WEIGHED
    if not folders and all(getattr(options, name) is None for name in outputs):
        names = ', '.join(f'--{name}' for name in (*FORMATS, *FOLDERS))
        raise UsageError(f'no output is given; one of {names} is needed')
    robot = robot_of(options.file)
    if options.bar_density is None:
        robot = weighed(options.file, robot)
    else:
        robot = robot.with_rods(options.bar_density, slider_length=SLIDER_LENGTH)
    files = output_files(options, outputs, [options.file], refuse_yaml=FORMATS)
    if options.weighed is not None:
        if lexists(options.weighed):
            raise ExportError(f'--{WEIGHED} {printable(options.weighed)} is there already')
        if options.scale != 1.0:
            raise ExportError(f'--{WEIGHED} takes no --scale')
    targets = [*files]
    for option, folder in folders.items():
        check_new_folder(option, folder, [options.file])
        targets.append(Output(option, folder))
        targets[-1].check_distinct(targets[:-1])
    # All contents before the first file is written: an error leaves no partial set.
    contents, folder_contents = _contents(robot, options)
    beds = _further_beds(contents, options)
    for bed in beds:
        bed.check_distinct(targets)
    for output in (*files, *beds):
        output.write(contents[output.option])
        print(f'written: {output.option} {printable(output.path)}')
    for option, folder in folders.items():
        save_folder(option, folder, folder_contents[option])
        print(f'written: {option} {printable(folder)}: {", ".join(folder_contents[option])}')
    return 0


def _further_beds(contents: Iterable[str], options: argparse.Namespace) -> list[Output]:
    """Return the files of further beds, which stand beside the first: plate_2.3mf."""
    outputs = []
    for option in contents:
        name, _, number = option.partition(' ')
        if number:
            bed = Path(getattr(options, name.removeprefix('--')))
            outputs.append(Output(option, str(bed.with_stem(f'{bed.stem}_{number}'))))
            outputs[-1].check([options.file])
    return outputs


def _contents(
    robot: Robot, options: argparse.Namespace
) -> tuple[dict[str, bytes], dict[str, dict[str, bytes]]]:
    """Return the content of each file, and the files of each folder, by its option."""
    contents = _models(robot, options)
    folders: dict[str, dict[str, bytes]] = {}
    if options.loops_urdf is not None:
        folders['--loops-urdf'] = loops_urdf(robot, options.joint_separator)
    if options.ros2_control is not None:
        folders['--ros2-control'] = ros2_control_files(options.file, robot)
    if any(getattr(options, name) is not None for name in (*PLATES, WEIGHED)):
        settings = _part_settings(robot, options)
        legs = placed_legs(robot, part_sizes(settings), options.scale)
        contents |= _plates(legs, settings, options)
        if options.glb is not None:
            contents['--glb'] = glb(legs)
        if options.stl is not None or getattr(options, '3mf') is not None:
            meshes = printed_parts(_parts_to_print(legs, settings), options.bed)
            if options.stl is not None:
                folders['--stl'] = stl_files(meshes)
            contents |= _beds(meshes, options)
    return contents, folders


def _models(robot: Robot, options: argparse.Namespace) -> dict[str, bytes]:
    """Return the models that the options ask for, by their options."""
    contents: dict[str, bytes] = {}
    if options.mjcf is not None:
        contents['--mjcf'] = robot_mjcf(robot).encode()
        for origin in dict.fromkeys(leg.masses.origin for leg in robot.legs if leg.masses):
            print(f'masses: {origin}')
    if options.urdf is not None:
        separator = options.joint_separator
        contents['--urdf'] = urdf(robot, joint_separator=separator).encode()
        if robot.is_walker and separator != SEPARATORS[0]:
            joints = f'{robot.joint_names(separator)[0]} ... of the URDF'
            print(f'solver_node needs joint_separator: {separator} for {joints}')
    if options.joints is not None:
        contents['--joints'] = joint_table(robot.legs[0].linkage).encode()
    return contents


def _beds(meshes: Mapping[str, tuple[Any, int]], options: argparse.Namespace) -> dict[str, bytes]:
    """Return the 3MF of each bed by its option and number, if they are asked for."""
    if getattr(options, '3mf') is None:
        return {}
    for warning in oversize_warnings(meshes, options.bed):
        print(f'export: {warning}', file=sys.stderr)
    beds = three_mf(meshes, options.bed)
    print(f'{counted(len(beds), "bed")} of {options.bed.real:g} x {options.bed.imag:g} mm')
    return {f'--3mf {n}' if n > 1 else '--3mf': bed for n, bed in enumerate(beds, 1)}


def _parts_to_print(legs: Sequence[PlacedLeg], settings: Mapping[str, Any]) -> Sequence[Part]:
    """Return the parts of legs, without pins of another material, which are bought."""
    parts = distinct_parts(legs)
    material = settings.get('material')
    if settings.get('pins', material) == material:
        return parts
    return [part for part in parts if not part.role.is_hardware]


def _part_settings(robot: Robot, options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of parts in the file, and of the options, which win [m]."""
    holes = dict(options.hole or ())
    seats = dict(options.seat or ())
    changes = {'hole': holes.pop('', None), 'seat': seats.pop('', None)}
    for name in ('thickness', 'washer', 'clearance', 'width', 'material', 'infill'):
        changes[name] = getattr(options, name)
    changes = {name: change for name, change in changes.items() if change is not None}
    return part_settings(robot.legs, {**changes, 'holes': holes, 'seats': seats}, 1e-3)


def _plates(
    legs: Sequence[PlacedLeg], settings: Mapping[str, Any], options: argparse.Namespace
) -> dict[str, bytes]:
    """Return the content of each file of parts, by its option; print their numbers."""
    sizes = part_sizes(settings)
    stacks = [*{leg.leg.linkage: leg.stack for leg in legs}.values()]
    robot_plates = [*chain.from_iterable(stack.plates for stack in stacks)]
    for plate in robot_plates:
        if warning := slot_conflict(plate):
            print(f'export: {warning}: they need a plate each', file=sys.stderr)
    rings = chain.from_iterable(map(spacers, stacks))
    sheet = drawing([*robot_plates, *rings], kerf=options.kerf / 1e3)
    contents: dict[str, bytes] = {}
    holes = chain.from_iterable(plate.holes for plate in robot_plates)
    if (options.svg or options.dxf) and any(hole.bore for hole in holes):
        print('seats that do not go through are not in SVG and DXF')
    if options.svg is not None:
        contents['--svg'] = svg(sheet, filled=options.cad).encode()
    if options.dxf is not None:
        contents['--dxf'] = dxf(sheet, exploded=options.cad)
    if options.weighed is not None:
        contents[f'--{WEIGHED}'] = weighed_file(options.file, legs, settings).encode()
    if options.assembly is not None:
        # The walls of a frame are below the layers.
        lows = [prism.low for leg in legs for part in leg.parts for prism in part.prisms]
        is_framed = min(lows) <= WALL_LAYER * sizes.pitch
        page = assembly(
            stacks, thickness=sizes.thickness, washer=sizes.washer, is_framed=is_framed
        )
        contents['--assembly'] = page.encode()
    plate_count = counted(sum(plate.count for plate in robot_plates), 'plate')
    layer_count = counted(max(stack.count for stack in stacks), 'layer')
    widths = f'bars {1e3 * robot_plates[0].width:.4g} mm wide, holes {1e3 * sizes.hole:g} mm'
    size = f'{sheet.size.real:.0f} x {sheet.size.imag:.0f} mm'
    print(f'{plate_count}, {widths}, in {layer_count}, drawn on {size}')
    _print_remarks(legs, stacks)
    return contents


def _print_remarks(legs: Sequence[PlacedLeg], stacks: Sequence[Layers]) -> None:
    """Print which legs had to move out, and which pins cannot be whole."""
    for leg in legs:
        if leg.offset:
            name = printable(leg.leg.name)
            print(f'{name} is {1e3 * abs(leg.offset):.4g} mm further out than its mount_xyz')
    if len(legs) > 1 and all(part.name != 'wall' for leg in legs for part in leg.parts):
        problem = 'their planes are not parallel, or their ground is not outermost'
        print(f'export: the legs get no frame, and none moves out: {problem}', file=sys.stderr)
    for stack in stacks:
        for stub in stack.stubs:
            crossing = printable_line(', '.join(stack.plates[p].name for p in stub.crossing))
            name = printable(stub.shaft.name)
            problem = f'the pin {name} must be a stub: {crossing} passes through it'
            print(f'export: no arrangement leaves all pins whole; {problem}', file=sys.stderr)


_positive = number_type(lambda n: 0.0 < n < 1e6, 'a number > 0 (and < 1e6)')
_not_negative = number_type(lambda n: 0.0 <= n < 1e6, 'a number >= 0 (and < 1e6)')
_side = number_type(lambda n: 0.0 < n < 1e6, 'sizes in mm, such as 220x220, or A=10x4 for a seat')
_diameter = number_type(lambda n: 0.0 < n < 1e6, 'a diameter in mm, such as 4.2 or A=6')
_fraction = number_type(lambda n: 0.0 < n <= 1.0, 'a number > 0 and <= 1, such as 0.3')


def _bed(text: str) -> complex:
    """Return the width and depth in WIDTHxDEPTH."""
    width, _, depth = text.partition('x')
    return complex(_side(width), _side(depth))


def _hole(text: str) -> tuple[str, float]:
    """Return the joint, '' for all, and the diameter in NAME=MM or MM."""
    name, _, diameter = text.rpartition('=')
    return name, _diameter(diameter)


def _seat(text: str) -> tuple[str, tuple[float, float]]:
    """Return the joint, '' for all, diameter and depth in NAME=DIAMETERxDEPTH."""
    name, _, size = text.rpartition('=')
    seat = _bed(size)
    return name, (seat.real, seat.imag)


def _parser() -> ArgumentParser:
    parser = ArgumentParser('export', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('file', metavar='FILE', type=path, help='a leg, a walker or a linkage')
    add('--mjcf', metavar='OUT.xml', help='a model of MuJoCo, with its masses')
    add('--urdf', metavar='OUT.urdf', help='for robot_state_publisher')
    add('--joints', metavar='OUT.csv', help="the first leg's joints, for import_linkage [mm]")
    loops = 'a new folder: URDF and loop_closures.yaml, for scikit-robot and import_linkage'
    add('--loops-urdf', metavar='FOLDER', type=path, help=loops)
    control = 'a new folder: the walker in MuJoCo or on hardware, by ros2_control'
    add('--ros2-control', metavar='FOLDER', type=path, help=control)
    separator = "between a leg's name and its joint's in the URDF (_), as solver_node's parameter"
    add('--joint-separator', choices=SEPARATORS, default='_', help=separator)
    add('--svg', metavar='OUT.svg', help='the plates, in mm')
    add('--dxf', metavar='OUT.dxf', help="the plates, in mm (extra 'dxf')")
    cad = 'SVG and DXF for programs that extrude: filled plates; LINE and ARC, no polylines'
    add('--cad', action='store_true', help=cad)
    add('--assembly', metavar='OUT.svg', help='the leg layer by layer, with screws and spacers')
    stl = "a new folder: each part for a printer, its number in its name (extra 'parts')"
    add('--stl', metavar='FOLDER', type=path, help=stl)
    add('--3mf', metavar='OUT.3mf', help="all parts on a printer's beds (extra 'parts')")
    bed = 'size of a bed for --3mf [mm], 220x220'
    add('--bed', metavar='WIDTHxDEPTH', type=_bed, default=220 + 220j, help=bed)
    add('--glb', metavar='OUT.glb', help="the assembled robot, to look at (extra 'parts')")
    hole = 'diameter of holes [mm], 3.2: for M3; A=6 of a joint; repeatable'
    add('--hole', metavar='[JOINT=]MM', type=_hole, action='append', help=hole)
    seat = 'bearing or bush in plates that turn on a pin [mm]: 10x4, A=7x3 of a joint; repeatable'
    add('--seat', metavar='[JOINT=]DIAMETERxDEPTH', type=_seat, action='append', help=seat)
    size = partial(add, metavar='MM')
    size('--kerf', type=_not_negative, default=0.0, help='width of the cut [mm], 0')
    size('--thickness', type=_positive, help='of the plates [mm], 3')
    washer = 'thickness between two layers [mm], 0.5; 0 for none'
    size('--washer', type=_not_negative, help=washer)
    clearance = f'added to the diameter of printed holes and slots [mm], {1e3 * HOLE_CLEARANCE:g}'
    size('--clearance', type=_not_negative, help=clearance)
    size('--width', type=_positive, help='width of bars [mm]; 4 %% of the size')
    weighed = 'a new file: FILE with the masses of its parts'
    add(f'--{WEIGHED}', metavar='OUT.yaml', help=weighed)
    material = f'of the parts: {", ".join(MATERIALS)}, or a density [kg/m^3]'
    add('--material', metavar='NAME', type=parse, help=material)
    infill = 'of printed parts, inside of their walls, > 0 to 1; 1'
    add('--infill', metavar='PART', type=_fraction, help=infill)
    add('--scale', type=_positive, default=1.0, help='of the plates; hole and width stay')
    density = 'of bars in MJCF and --ros2-control, in place of the masses in FILE [kg/m]'
    add('--bar-density', metavar='KG_PER_M', type=_positive, help=density)
    return parser
