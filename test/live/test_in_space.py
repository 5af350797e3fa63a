"""The live page draws a walker in three dimensions, by its own files and without leaks."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
import json
from typing import Any
from urllib.parse import urlsplit

from browser import find
from browser_page import OpenedPage
from fake_live_state import EVIL, FakeState
from klann_ros.export import placed_legs, scene_parts
from klann_ros.export.outline import polyline
from klann_ros.kinematics import FIXED, KlannGeometry, Linkage, linkage_poses
from klann_ros.live import Guard, LiveServer, new_token, solver_of, walker_data
from klann_ros.log import SolverParameters
from klann_ros.robot import Robot, robot_from_parameters
import numpy as np
import pytest

pytest.importorskip('playwright')
if find() is None:
    pytest.skip('no Chromium: apt-get install chromium', allow_module_level=True)

LEG = asdict(KlannGeometry.sem104())
LEG['assembly'] = list(LEG['assembly'])
WALKER = {
    **LEG,
    'legs': ['left', 'right'],
    'left.mount_xyz': [0.1, 0.2, 0.3],
    'right.mount_xyz': [-0.1, -0.2, 0.3],
    'right.mount_rpy': [np.pi / 2, 0.0, np.pi],
    'right.phase': 1.0,
    'body_size': [0.5, 0.3, 0.1],
}
ALPHAS = {'left': 0.4, 'right': 1.4}
# Half of what an arc loses by its chords, and of what a coordinate does by its digits [m].
CHORD = 1e-3
# Where the vertices of all links are, in base_link.
BOX = """() => {
    const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
    live.stage.scene.robot.traverse((mesh) => {
        if (mesh.geometry && mesh.material.vertexColors) {
            const { array } = mesh.geometry.attributes.position;
            for (let n = 0; n < (mesh.count || 1); n += 1) {
                const matrix = new THREE.Matrix4();
                if (mesh.isInstancedMesh) mesh.getMatrixAt(n, matrix);
                for (let i = 0; i < array.length; i += 3) {
                    const at = new THREE.Vector3(...array.slice(i, i + 3)).applyMatrix4(matrix);
                    at.toArray().forEach((value, k) => {
                        low[k] = Math.min(low[k], value);
                        high[k] = Math.max(high[k], value);
                    });
                }
            }
        }
    });
    return [low, high];
}"""
NO_WEBGL = """
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...options) {
        return kind === '2d' ? context.call(this, kind, ...options) : null;
    };
"""
MEMORY = """() => {
    const { scene } = live.stage;
    const sizes = [];
    // A small picture: its pixels cost most.
    scene.canvas.style.width = scene.canvas.style.height = '8px';
    for (let k = 0; k < 40; k += 1) {
        scene.build({ ...scene.data });
        scene.show([[[NaN, 0]], null], { at: [k, 0, null], turn: [0, 0, 0, 1], path: [] });
        scene.render();
        const { info } = scene.renderer;
        sizes.push([info.memory.geometries, info.programs.length]);
    }
    return sizes;
}"""

# The browser takes the pointer of a finger that scrolls.
SCROLL = """() => {
    const { canvas, orbit } = live.stage.scene;
    const views = [orbit.elevation];
    canvas.setPointerCapture = () => {};
    ['pointerdown', 'pointermove', 'pointercancel'].forEach((name, k) => {
        canvas.dispatchEvent(new PointerEvent(name, { pointerId: 7, clientY: -10 * k }));
        if (k) views.push(orbit.elevation);
    });
    return views;
}"""

ODOMETRY_OF = '(names) => live.odomOf(Object.fromEntries(names.map((name) => [name, name])))'


def solved(linkage: Linkage, alpha: float) -> tuple[list[float], dict[str, complex]]:
    """Return the coordinates of a leg, the crank's first, and its points."""
    poses: Any = linkage_poses(linkage, [alpha], angles=True, points=True)
    x, y = poses.points[0].T
    return [alpha, *poses.angles[0].tolist()], dict(
        zip(linkage.structure.points, x + 1j * y, strict=True)
    )


class WalkerState(FakeState):
    """A state with the legs of a robot."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        super().__init__()
        self.robot = robot_from_parameters(parameters, weigh=False)
        solver = solver_of(SolverParameters('/solver_node', 0, dict(parameters)))
        parts = scene_parts(self.robot) if solver.is_walker else None
        data = {
            **solver.as_data(),
            **walker_data(parameters),
            'parts': parts,
            'topics': [EVIL],
            'numbers': [*range(len(solver.legs))],
            'cranks': [],
        }
        self.set_part('legs', [data])
        self.set_part('diagnostics', [])

    def poses(self) -> str:
        legs = {}
        for number, leg in enumerate(self.robot.legs):
            alpha = ALPHAS.get(leg.name, 0.0)
            legs[number] = [0.0, 1.0, *solved(leg.linkage, alpha)[0]]
        return json.dumps({'of': 1, 'legs': legs, 'odom': {}, 'truth': {}})


@pytest.fixture
def visit_live(new_page: Callable[..., Any]) -> Iterator[Callable[..., OpenedPage]]:
    servers = []

    def visit(state: WalkerState, script: str = '') -> OpenedPage:
        servers.append(LiveServer(Guard('127.0.0.1', 0, new_token()), state))
        page = new_page(viewport={'width': 500, 'height': 600})
        page.add_init_script(script or '0')
        opened = OpenedPage(page, servers[-1].guard.url)
        opened.until('live.tracks.length && live.tracks.every((track) => track.x)')
        return opened

    yield visit
    for server in servers:
        server.close()


def test_a_walker_is_drawn_as_its_parts_by_files_of_this_server(
    visit_live: Callable[..., OpenedPage],
) -> None:
    state = WalkerState(WALKER)
    opened = visit_live(state)
    opened.until('live.stage.scene?.renderer.info.render.triangles > 1000')
    assert np.abs(np.array(opened.page.evaluate(BOX)) - box_of_parts(state.robot)).max() < CHORD
    assert len({urlsplit(request).netloc for request in opened.requests}) == 1
    assert opened.barriers() == []
    sizes = opened.page.evaluate(MEMORY)
    assert sizes[1:] == sizes[1:2] * 39
    # A browser without a graphics card says that it copies the picture.
    assert [line for line in opened.complaints if 'GPU stall' not in line] == []


def box_of_parts(robot: Robot) -> np.ndarray:
    """Return the lowest and the highest coordinates of all parts in base_link [m]."""
    vertices = []
    for placed in placed_legs(robot):
        _, points = solved(placed.leg.linkage, ALPHAS[placed.leg.name])
        mount = placed.leg.mount
        for part in placed.parts:
            origin, turn = 0j, 1 + 0j
            if part.body != FIXED:
                body = placed.leg.linkage.structure.bodies[part.body]
                origin = points[body.points[0]]
                along = points[body.bars[0].end] - points[body.bars[0].start]
                turn = along / abs(along)
            for prism in part.prisms:
                for outline in prism.outlines:
                    at = [origin + turn * corner for corner in polyline(outline, 1e-5)]
                    plane = np.array([[p.real, p.imag] for p in at])
                    for z in (prism.low, prism.high):
                        height = placed.offset + placed.direction * z
                        vertices.append(mount.transform(plane) + height * mount.rotation[:, 2])
    corners = np.concatenate(vertices)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def test_a_leg_alone_stays_in_its_plane_and_messages_in_units_of_the_page(
    visit_live: Callable[..., OpenedPage],
) -> None:
    opened = visit_live(WalkerState(LEG))
    assert not [request for request in opened.requests if 'three' in request]
    assert opened.page.locator('#space').is_hidden()
    told = 'left +0.021 rad (+1.2 deg), right -0.35 rad (-20.1 deg), 0.25 m'
    in_page_units = opened.page.evaluate('(text) => inPageUnits(text)', told)
    assert in_page_units == 'left +1.2°, right -20.1°, 250 mm'


@pytest.mark.slow
def test_without_webgl_a_line_says_so_and_the_flat_views_stay(
    visit_live: Callable[..., OpenedPage],
) -> None:
    opened = visit_live(WalkerState(WALKER), NO_WEBGL)
    opened.until("!document.getElementById('space-note').hidden")
    opened.until("document.querySelector('#above circle.joint').getAttribute('cx')")
    assert opened.page.locator('#space').is_hidden()
    assert opened.page.locator('#view-space').is_disabled()
    assert opened.barriers() == []


@pytest.mark.slow
def test_a_finger_that_scrolls_the_page_leaves_the_view(
    visit_live: Callable[..., OpenedPage],
) -> None:
    opened = visit_live(WalkerState(WALKER))
    opened.until('live.stage.scene')
    views = opened.page.evaluate(SCROLL)
    assert views[1] != views[0]
    assert views[2] == views[0]


@pytest.mark.slow
def test_another_walkers_odometry_and_path_are_not_the_shown_ones(
    visit_live: Callable[..., OpenedPage],
) -> None:
    state = WalkerState(WALKER)
    (walker,) = json.loads(state.parts['legs'][1])
    walkers = [walker, {**walker, 'node': '/twin/solver_node', 'numbers': [2, 3]}]
    opened = visit_live(state)
    opened.page.evaluate('live.ground.move([1, 2, 0, 0, 0, 0, 0, 0, 0, 1])')
    assert opened.page.evaluate(ODOMETRY_OF, ['/other/odom']) == '/other/odom'
    state.set_part('legs', walkers)
    opened.until('live.solvers.length === 2')
    assert opened.page.evaluate(ODOMETRY_OF, ['/twin/odom']) is None
    assert opened.page.evaluate(ODOMETRY_OF, ['/odom', '/twin/odom']) == '/odom'
    state.set_part('legs', [{**walker, 'node': '/third/solver_node'}])
    opened.until('live.solvers.length === 1 && live.stage.legs.length')
    assert opened.page.evaluate('live.ground.path') == []


@pytest.mark.slow
def test_pictures_go_on_where_their_completion_is_not_told(
    visit_live: Callable[..., OpenedPage],
) -> None:
    opened = visit_live(WalkerState(WALKER))
    opened.until('live.stage.scene')
    opened.page.evaluate('live.stage.scene.renderer.getContext().getSyncParameter = () => 0')
    start = opened.page.evaluate('live.stage.scene.renderer.info.render.frame')
    is_later = f'live.stage.scene.renderer.info.render.frame > {start} + 8'
    opened.until(f'live.stage.scene.draw(), {is_later}')
