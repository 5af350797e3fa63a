"""
Make the manual's picture of printed parts: python docs/parts_picture.py [FILE].

A bed full of parts beside the assembled walker, both drawn from the exported files, by a depth
buffer. It needs trimesh, manifold3d and Pillow.
"""

from io import BytesIO
from pathlib import Path
import sys

from klann_ros.export import placed_legs
from klann_ros.export.parts import distinct_parts
from klann_ros.export.solids import glb, printed_parts, three_mf
from klann_ros.kinematics import colour_of
from klann_ros.robot import robot_of
import numpy as np
from PIL import Image
import trimesh

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'docs' / 'parts.png'
ROBOT, SCALE, BED = ROOT / 'config' / 'walker4.yaml', 0.2, 250 + 210j
PANEL, SAMPLES = (640, 600), 3
LIGHT = np.array([0.35, -0.45, 0.82])
BED_COLOUR, GREY = (0.93, 0.94, 0.95), (0.45, 0.47, 0.5)


Meshes = list[tuple[trimesh.Trimesh, tuple[float, ...]]]


def rgb(colour: str) -> tuple[float, ...]:
    """Return red, green and blue of '#rrggbb'."""
    return tuple(byte / 255.0 for byte in bytes.fromhex(colour[1:]))


def rotation(azimuth: float, elevation: float) -> np.ndarray:
    """Return the axes of a view: right, up, and towards the viewer."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(towards, right), towards])


def render(meshes: Meshes, view: np.ndarray) -> np.ndarray:
    """Return a picture of meshes with their colours, in a frame that they fill."""
    width, height = (SAMPLES * side for side in PANEL)
    corners = np.concatenate([mesh.vertices for mesh, _ in meshes]) @ view.T
    low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    scale = 0.94 * min(np.array([width, height]) / (high - low))
    middle = np.array([width, height]) / 2.0 - scale * (low + high) / 2.0
    picture = np.ones((height, width, 3))
    depth = np.full((height, width), -np.inf)
    light = LIGHT / np.linalg.norm(LIGHT)
    for mesh, colour in meshes:
        shades = 0.5 + 0.5 * np.clip(mesh.face_normals @ light, 0.0, 1.0)
        triangles = mesh.triangles @ view.T
        for face in np.flatnonzero(mesh.face_normals @ view[2] > 0.0):
            triangle, shade = triangles[face], shades[face]
            plane = scale * triangle[:, :2] + middle
            x_0, y_0 = np.maximum(np.floor(plane.min(axis=0)).astype(int), 0)
            x_1, y_1 = np.ceil(plane.max(axis=0)).astype(int) + 1
            x, y = np.meshgrid(np.arange(x_0, min(x_1, width)), np.arange(y_0, min(y_1, height)))
            matrix = np.vstack([plane.T, np.ones(3)])
            if not x.size or abs(np.linalg.det(matrix)) < 1e-9:
                continue
            shares = np.einsum('ij,jkl->ikl', np.linalg.inv(matrix), np.array([x, y, x * 0 + 1]))
            z = np.einsum('i,ikl->kl', triangle[:, 2], shares)
            region = slice(y_0, y_0 + x.shape[0]), slice(x_0, x_0 + x.shape[1])
            is_front = (shares >= -1e-9).all(axis=0) & (z > depth[region])
            depth[region][is_front] = z[is_front]
            picture[region][is_front] = shade * np.array(colour)
    # A dark line where the depth jumps shows edges.
    jumps = np.zeros_like(depth, dtype=bool)
    for axis in (0, 1):
        with np.errstate(invalid='ignore'):
            jumps |= abs(depth - np.roll(depth, 1, axis=axis)) > 1.2 * DEPTH_STEP
    picture[jumps & np.isfinite(depth)] *= 0.55
    shape = PANEL[1], SAMPLES, PANEL[0], SAMPLES, 3
    return np.flipud(picture.reshape(shape).mean(axis=(1, 3)))


# A smaller jump of the depth is no edge [mm].
DEPTH_STEP = 0.5


def bed_meshes(content: bytes, bodies: dict[str, int]) -> Meshes:
    """Return the parts of a 3MF on a plate, in the colours of their bodies."""
    scene = trimesh.load(BytesIO(content), file_type='3mf')
    plate = trimesh.creation.box(bounds=[[0, 0, -3], [BED.real, BED.imag, 0]])
    meshes = [(plate, BED_COLOUR)]
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        body = bodies.get(name.split('_')[1], -1)
        colour = rgb(colour_of(body)) if body >= 0 else GREY
        meshes.append((scene.geometry[name].copy().apply_transform(pose), colour))
    return meshes


def robot_meshes(content: bytes) -> Meshes:
    """Return the parts of a GLB in their colours [mm]."""
    scene = trimesh.load(BytesIO(content), file_type='glb')
    meshes = []
    for node in scene.graph.nodes_geometry:
        pose, name = scene.graph[node]
        mesh = scene.geometry[name].copy().apply_transform(pose)
        # glTF has y up, the view z.
        mesh.vertices = 1e3 * mesh.vertices[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
        rgba = mesh.visual.material.baseColorFactor
        meshes.append((mesh, tuple(np.array(rgba[:3]) / 255.0)))
    return meshes


def save_picture(file: Path) -> None:
    """Save the fullest bed and the walker side by side."""
    legs = placed_legs(robot_of(str(ROBOT)), None, SCALE)
    bodies = {part.name: part.body for part in legs[0].parts}
    beds = three_mf(printed_parts(distinct_parts(legs), BED), BED)
    bed = render(bed_meshes(max(beds, key=len), bodies), rotation(-70.0, 52.0))
    walker = render(robot_meshes(glb(legs)), rotation(-58.0, 24.0))
    picture = np.concatenate([bed, walker], axis=1)
    image = Image.fromarray((255.0 * picture.clip(0.0, 1.0)).astype(np.uint8))
    image.quantize(128).save(file, optimize=True)


if __name__ == '__main__':
    save_picture(Path(sys.argv[1]) if len(sys.argv) > 1 else FILE)
