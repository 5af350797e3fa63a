"""
The parts of a robot as solids for printing and looking at: STL, 3MF and GLB.

manifold3d makes every solid, without gaps by its construction, and trimesh writes the formats.
Both are imported only here, where they are used.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from io import BytesIO
import re
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from klann_ros.kinematics import colour_of
from klann_ros.kinematics.arrays import FloatArray, plane_vectors
from klann_ros.missing_package import install_command
import numpy as np

from .drawing import MM
from .outline import Outline, polyline
from .parts import Part, PlacedLeg, Role

# Distance of a chord from its arc, for printing and for looking at [m].
PRINT_TOLERANCE, VIEW_TOLERANCE = 2e-6, 2e-5
# Space between the parts on a bed, and to its edges, where a skirt needs it [mm].
PART_GAP, BED_MARGIN = 4.0, 10.0
MAX_NAME = 48
# Identifiers of a 3MF, and the namespaces that would demand them.
UNNEEDED = rb'(?<=<item) xmlns="[^"]*"| (\w+:UUID|xmlns:\w+)="[^"]*"'
HARDWARE_COLOUR, FRAME_COLOUR = '#26292e', '#8a8f98'


class NoSolidsError(RuntimeError):
    """Solids without trimesh and manifold3d (the extra `parts`)."""

    def __init__(self, error: ImportError) -> None:
        module = (error.name or '').partition('.')[0]
        super().__init__(f'solids need {module}: {install_command(module, "parts")}')


def _libraries() -> tuple[Any, Any]:
    """Return manifold3d and trimesh; raise a NoSolidsError without them."""
    try:
        import manifold3d  # noqa: PLC0415 - an extra
        import trimesh.visual  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise NoSolidsError(error) from error

    return manifold3d, trimesh


def solid(part: Part, tolerance: float = PRINT_TOLERANCE) -> Any:
    """
    Return a part as a trimesh.Trimesh in millimetres, in its place.

    Raises a NoSolidsError if trimesh or manifold3d is not installed.
    """
    manifold, trimesh = _libraries()

    def section(curves: Iterable[Outline]) -> Any:
        polygons = []
        for curve in curves:
            points = np.array([*polyline(curve, tolerance)], dtype=np.complex128)
            polygons.append(MM * plane_vectors(points))
        return manifold.CrossSection(polygons)

    prisms = []
    for prism in part.prisms:
        base = section(prism.outlines) - section(prism.cuts)
        # Faces of two prisms that touch have one height, to the last bit, and merge.
        heights = MM * np.array([prism.low, prism.high])
        prism_solid = manifold.Manifold.extrude(base, 1.0)
        prisms.append(prism_solid.warp_batch(partial(_lift, heights)))
    mesh = manifold.Manifold.batch_boolean(prisms, manifold.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def _lift(heights: FloatArray, vertices: FloatArray) -> FloatArray:
    """Return vertices with z = 0 and 1 at two heights."""
    return np.column_stack([vertices[:, :2], heights[np.rint(vertices[:, 2]).astype(int)]])


def printed_parts(parts: Sequence[Part], bed: complex = 0j) -> dict[str, tuple[Any, int]]:
    """
    Return the distinct parts as meshes, flat on z = 0, with their number, by a name for files.

    The larger face is down, a beam lies, and the longer side is along x, or else as it fits a bed
    [mm].
    """
    groups: dict[Any, list[Part]] = {}
    for part in parts:
        groups.setdefault(_shape(part), []).append(part)
    meshes: dict[str, tuple[Any, int]] = {}
    stems: set[str] = set()
    for group in groups.values():
        first = group[0]
        names = dict.fromkeys(part.name.removeprefix(f'{first.role.value} ') for part in group)
        words = filter(None, dict.fromkeys([first.role.value, first.legs, *names]))
        count = sum(part.count for part in group)
        plain = re.sub(r'[^A-Za-z0-9-]+', '_', '_'.join(words))[:MAX_NAME].strip('_')
        stem = plain
        for number in range(2, 2 + len(meshes)):
            if stem.lower() in stems:
                stem = f'{plain}_{number}'
        # On macOS and Windows a name in other letters is the same file.
        stems.add(stem.lower())
        meshes[f'{stem}_x{count}'] = _mesh_on_bed(solid(first), first, bed), count
    return meshes


def _shape(part: Part) -> tuple[object, ...]:
    """Return a key that equal parts share, however they stand: role, volume and inertia."""
    mass = part.mass(1.0)
    return part.role, part.legs, f'{mass.mass:.6g} {mass.inertia:.6g}'


def _fits(extent: complex, bed: complex) -> bool:
    return max(extent.real - bed.real, extent.imag - bed.imag) + 2.0 * BED_MARGIN <= 0.0


def _mesh_on_bed(mesh: Any, part: Part, bed: complex) -> Any:
    """Return a part's mesh as it is printed."""
    ends = sorted(part.prisms, key=lambda prism: prism.low)
    areas = [prism.moments[0].real / (prism.high - prism.low) for prism in ends]
    points = mesh.vertices.copy()
    if areas[0] < areas[-1]:
        points *= 1.0, -1.0, -1.0
    if part.role is Role.FRAME and np.ptp(points[:, 2]) > np.ptp(points[:, :2], axis=0).max():
        points = points[:, [2, 0, 1]]
    plane = points[:, 0] + 1j * points[:, 1]

    def cost(rotation: complex) -> tuple[bool, bool, float]:
        rotated = plane * rotation
        extent = complex(np.ptp(rotated.real), np.ptp(rotated.imag))
        return not _fits(extent, bed), extent.real < extent.imag, extent.imag

    plane *= min(np.exp(1j * np.radians(np.arange(180.0))), key=cost)
    points[:, 0] = plane.real
    points[:, 1] = plane.imag
    mesh.vertices = points - points.min(axis=0)
    return mesh


def stl_files(meshes: Mapping[str, tuple[Any, int]]) -> dict[str, bytes]:
    """Return printed parts as binary STL in millimetres, by the names of their files."""
    return {f'{name}.stl': mesh.export(file_type='stl') for name, (mesh, _) in meshes.items()}


def oversize_warnings(meshes: Mapping[str, tuple[Any, int]], bed: complex) -> Iterator[str]:
    """Yield a line for each printed part that is larger than a bed [mm]."""
    for name, (mesh, _) in meshes.items():
        width, depth, _ = mesh.extents
        if not _fits(complex(width, depth), bed):
            yield (
                f'{name} is {width:.0f} x {depth:.0f} mm, larger than the bed with a margin of '
                f'{BED_MARGIN:g} mm: cut it in the slicer, or use another --scale or --bed'
            )


def three_mf(meshes: Mapping[str, tuple[Any, int]], bed: complex) -> list[bytes]:
    """Return all printed parts as 3MF, a file for each bed of a size [mm]."""
    scenes = [_libraries()[1].Scene()]
    x = y = BED_MARGIN
    row_height = 0.0
    for name, (mesh, count) in sorted(meshes.items(), key=lambda item: -item[1][0].extents[1]):
        width, depth, _ = mesh.extents
        for copy in range(count):
            if x > BED_MARGIN and x + width + BED_MARGIN > bed.real:
                x = BED_MARGIN
                y += row_height + PART_GAP
                row_height = 0.0
            if y > BED_MARGIN and y + depth + BED_MARGIN > bed.imag:
                scenes.append(_libraries()[1].Scene())
                x = y = BED_MARGIN
            row_height = max(row_height, depth)
            place = np.eye(4)
            place[:2, 3] = x, y
            _add(scenes[-1], mesh, name, f'{name.rpartition("_")[0]}_{copy + 1}', place)
            x += width + PART_GAP
    return [_without_uuids(scene.export(file_type='3mf')) for scene in scenes]


def _without_uuids(content: bytes) -> bytes:
    """Return a 3MF without the random identifiers that strict readers refuse."""
    stream = BytesIO()
    with ZipFile(BytesIO(content)) as source, ZipFile(stream, 'w') as target:
        for name in source.namelist():
            text = re.sub(UNNEEDED, b'', source.read(name))
            target.writestr(ZipInfo(name), text, ZIP_DEFLATED)
    return stream.getvalue()


def glb(legs: Sequence[PlacedLeg]) -> bytes:
    """Return the assembled robot as GLB in metres, y up, its cranks' joints at 0."""
    scene = _libraries()[1].Scene()
    meshes: dict[Part, Any] = {}
    up = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    for placed in legs:
        sample = placed.stack.motion.nearest(placed.leg.phase)
        for number, part in enumerate(placed.parts):
            if part not in meshes:
                meshes[part] = _coloured(solid(part, VIEW_TOLERANCE).apply_scale(1.0 / MM), part)
            pose = up @ placed.pose(part.body, sample)
            name = f'{part.legs}/{part.name}/{number}'
            _add(scene, meshes[part], name, f'{placed.leg.prefix}{part.name}/{number}', pose)
    content: bytes = scene.export(file_type='glb')
    return content


def _coloured(mesh: Any, part: Part) -> Any:
    visual = _libraries()[1].visual
    colour = HARDWARE_COLOUR if part.role.is_hardware or part.role is Role.SPACER else FRAME_COLOUR
    if part.role in {Role.LINK, Role.CRANK}:
        colour = colour_of(part.body)
    rgba = [*bytes.fromhex(colour[1:]), 255]
    material = visual.material.PBRMaterial(baseColorFactor=rgba, metallicFactor=0.1)
    mesh.visual = visual.TextureVisuals(material=material)
    return mesh


def _add(scene: Any, mesh: Any, name: str, node: str, pose: Any) -> None:
    """Add a copy of a mesh to a scene, which holds the mesh once by its name."""
    scene.geometry.setdefault(name, mesh)
    scene.graph.update(frame_to=node, matrix=pose, geometry=name)
