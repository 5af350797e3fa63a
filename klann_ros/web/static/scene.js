'use strict';
/*
 * A walker in three dimensions on its ground, by three.js, which the page loads before:
 *
 *   new RobotScene(canvas, {isFree})           throws where there is no WebGL
 *     .build(robot)                            robot: {legs: [{shape, mount, model, ...}], body}
 *     .show(poses, place)                      poses: the points of each leg [m], or null
 *     .render()                                at once; .draw(): with the next frame of the screen
 *     .cell                                    between lines of the ground [m]
 *     .dispose()
 *
 * `model` is that of solids.js, and its heights z are at `offset` + `direction` z along the normal of
 * the leg's plane; without a model, bars are drawn. `mount` is {xyz, rpy} in base_link, `body` {size, centre} or null. `place` is where base_link is in the world, {at: [x, y, z], turn:
 * quaternion [x, y, z, w], path: [[x, y, z], ...], slope}: the ground goes through the origin, and
 * rises along x by the angle `slope` [rad]. With a z of null the lowest foot is on level ground. The
 * robot stays in the middle of the picture, and the ground moves.
 */

// Cells of the ground on each side, and in the robot's size.
const GRID_CELLS = 24;
const CELLS_BY_SIZE = 8;
const MAX_PATH = 2200;
// Colours are those of theme.css. The light comes from there, above the ground.
const LIGHT = [-0.35, -0.5, 1];
const METAL = 'quiet';
// The robot fits into a picture that is so much wider than high.
const WIDE = 1.45;
// Of the feet in a simulation [m].
const FOOT_RADIUS = 0.004;
// The ground fades from here to there, in sizes of the robot behind it.
const FOG = [0.5, 2.4];
const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((n) =>
  [n & 1, n & 2, n & 4].map((bit) => (bit ? 0.5 : -0.5)),
);
// From the best on: the pixels of a point of the page, at most, and whether there are shadows.
const QUALITIES = [
  [2, true],
  [1, true],
  [1, false],
  [0.7, false],
];
// A picture that takes longer is too slow, and one that takes less leaves time for the next quality,
// by the median of some [ms].
const SLOW_FRAME = 45;
const FAST_FRAME = 12;
// A fence is noticed late: with fewer under way the renderer waits, with more the view is behind.
const MAX_PENDING = 3;
const MEASUREMENTS = 15;
// On a busy machine a picture is complete long before this is known [ms].
const MAX_FENCE_TIME = 100;
const POLL_PERIOD = 2;

class RobotScene {
  constructor(canvas, { isFree } = {}) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !isSoftware() });
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.scene = new THREE.Scene();
    this.light = new THREE.DirectionalLight(0xffffff, 2.2);
    this.light.position.set(...LIGHT);
    this.scene.add(this.light, new THREE.HemisphereLight(0xffffff, 0x8890a0, 1.6));
    this.ground = new THREE.Group();
    this.robot = new THREE.Group();
    this.shadow = new THREE.Group();
    for (const group of [this.robot, this.shadow]) group.matrixAutoUpdate = false;
    this.scene.add(this.ground, this.robot, this.shadow);
    this.materials = sceneMaterials();
    this.legs = [];
    this.meshes = [];
    this.quality = 0;
    // Pictures under way.
    this.pending = 0;
    this.costs = [];
    this.isDue = false;
    this.orbit = new Orbit(canvas, () => this.draw(), isFree);
    this.isSeen = true;
    this.observers = [
      new ResizeObserver(() => this.resize()),
      new IntersectionObserver(([entry]) => {
        this.isSeen = entry.isIntersecting;
        this.draw();
      }),
    ];
    for (const observer of this.observers) observer.observe(canvas);
  }

  /** Make the meshes of a robot, in place of those before. */
  build(robot) {
    this.clear();
    this.data = robot;
    this.measure();
    this.paint();
    this.grid = new THREE.LineSegments(gridGeometry(this.cell), this.materials.grid);
    const path = new THREE.BufferGeometry();
    path.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * MAX_PATH), 3));
    this.path = new THREE.Line(path, this.materials.path);
    this.ground.add(this.grid, this.path);
    [this.shadow, this.grid, this.path].forEach((node, i) => (node.renderOrder = i - 3));
    this.path.frustumCulled = this.grid.frustumCulled = false;
    this.buildBody();
    this.buildLegs();
    this.restartMeasurements(0);
    this.resize();
  }

  /** Find the middle and the size of the robot, and round cells of the ground. */
  measure() {
    const { legs, body } = this.data;
    const corners = legs.flatMap((leg) => {
      const [left, bottom, right, top] = leg.shape.box || [-1, -1, 1, 1];
      const { matrix } = mountMatrix(leg, [0, 0, 0]);
      return [
        [left, bottom],
        [left, top],
        [right, bottom],
        [right, top],
      ].map(([x, y]) => new THREE.Vector3(x, y, 0).applyMatrix4(matrix));
    });
    for (const corner of body ? CORNERS : []) corners.push(bodyCorner(body, corner));
    const [low, high] = [corners[0].clone(), corners[0].clone()];
    for (const corner of corners) {
      low.min(corner);
      high.max(corner);
    }
    this.middle = low.clone().add(high).multiplyScalar(0.5);
    this.size = high.distanceTo(low);
    const power = 10 ** Math.floor(Math.log10(this.size / CELLS_BY_SIZE));
    this.cell =
      [1, 2, 5]
        .map((n) => n * power)
        .filter((cell) => cell <= this.size / CELLS_BY_SIZE)
        .pop() || power;
    this.camera.near = 0.02 * this.size;
    this.camera.far = 40 * this.size;
  }

  /** Take the colours of the page. */
  paint() {
    const { materials, scene } = this;
    const [paper, quiet] = ['card', 'quiet'].map(sceneColour);
    scene.background = paper;
    scene.fog = new THREE.Fog(paper);
    materials.shadow.color.copy(paper).multiplyScalar(0.6);
    materials.grid.color.copy(quiet).lerp(paper, 0.7);
    materials.path.color.copy(sceneColour('accent'));
    materials.body.color.copy(quiet);
  }

  buildBody() {
    const { body } = this.data;
    if (!body) return;
    const geometry = new THREE.BoxGeometry(...body.size);
    geometry.translate(...body.centre);
    this.robot.add(new THREE.Mesh(geometry, this.materials.body));
    this.shadow.add(new THREE.Mesh(geometry, this.materials.shadow));
  }

  /** Make the legs; those without a model when their points are known. */
  buildLegs() {
    const middle = this.data.body ? this.data.body.centre : [0, 0, 0];
    this.legs = this.data.legs.map((leg) => ({
      ...leg,
      meshes: null,
      ...mountMatrix(leg, middle),
    }));
    const groups = new Map();
    for (const leg of this.legs.filter(({ model }) => model)) {
      const { bodies, parts } = leg.model;
      const key = JSON.stringify([
        leg.isMirrored,
        bodies,
        parts.filter(({ body }) => body !== FIXED),
      ]);
      groups.set(key, [...(groups.get(key) || []), leg]);
    }
    for (const legs of groups.values()) this.addMeshes(legs[0].model, legs);
    this.robot.add(new THREE.Mesh(groundGeometry(this.legs, partColour), this.materials.part));
  }

  /** Add the meshes of legs that have a model, and are mirrored, alike. */
  addMeshes(model, legs) {
    const mounts = legs.map((leg) => leg.matrix);
    const meshes = new LegMeshes(model, mounts, legs[0].isMirrored, partColour, [
      this.materials.part,
      this.materials.shadow,
    ]);
    legs.forEach((leg, number) => Object.assign(leg, { meshes, number }));
    for (const { mesh, shadow } of meshes.bodies) {
      this.robot.add(mesh);
      this.shadow.add(shadow);
    }
    this.meshes.push(meshes);
  }

  show(poses, place) {
    this.legs.forEach((leg, i) => {
      const points = poses[i] && poses[i].flat().every(Number.isFinite) ? poses[i] : null;
      if (points && !leg.meshes) {
        this.addMeshes(barModel(leg.shape, points), [leg]);
      }
      if (leg.meshes) leg.meshes.show(leg.number, points);
      leg.points = points;
    });
    this.put(place);
  }

  /** Put the robot into the middle, and the ground under it. */
  put({ at, turn, path, slope = 0 }) {
    const incline = new THREE.Quaternion().setFromEuler(new THREE.Euler(0, -slope, 0));
    const normal = new THREE.Vector3(0, 0, 1).applyQuaternion(incline);
    const pose = new THREE.Quaternion(...turn);
    const isOnGround = at[2] === null;
    // Of base_link above the ground, along its normal.
    const height = isOnGround
      ? -this.lowest(pose, normal)
      : new THREE.Vector3(...at).dot(normal) + Math.max(0, this.sole - FOOT_RADIUS);
    this.robot.matrix.makeRotationFromQuaternion(pose);
    this.robot.matrixWorldNeedsUpdate = true;
    this.ground.quaternion.copy(incline);
    this.ground.position.copy(normal).multiplyScalar(-height);
    const onGround = ([x, y, z]) => [
      isOnGround ? x : x * Math.cos(slope) + z * Math.sin(slope),
      y,
    ];
    this.drawGround([...path, at].map(onGround));
    this.castShadow(normal, height);
    this.draw();
  }

  /** Return how far half a link is below the foot's point [m]. */
  get sole() {
    const radii = this.legs.map((leg) => (leg.meshes && leg.meshes.model.radius) || 0);
    return Math.max(0, ...radii);
  }

  /** Return the lowest place of the feet and the body along a normal, from base_link [m]. */
  lowest(pose, normal) {
    const along = (point) => new THREE.Vector3(...point).applyQuaternion(pose).dot(normal);
    let low = Infinity;
    for (const leg of this.legs) {
      if (!leg.points) continue;
      const foot = leg.points[leg.shape.points.findIndex(({ name }) => name === leg.shape.foot)];
      const place = new THREE.Vector3(...foot, 0).applyMatrix4(leg.matrix);
      low = Math.min(low, along(place.toArray()) - this.sole);
    }
    const { body } = this.data;
    for (const corner of body ? CORNERS : []) {
      low = Math.min(low, along(bodyCorner(body, corner).toArray()));
    }
    return Number.isFinite(low) ? low : 0;
  }

  /** Move the grid, and draw the path: its last point is under the robot. */
  drawGround(path) {
    const [x, y] = path[path.length - 1];
    const offset = (place) => (Math.round(place / this.cell) * this.cell || 0) - place;
    this.grid.position.set(offset(x), offset(y), 0);
    const { position } = this.path.geometry.attributes;
    const points = path.slice(-MAX_PATH);
    points.forEach((point, i) => position.setXYZ(i, point[0] - x, point[1] - y, 0));
    position.needsUpdate = true;
    this.path.geometry.setDrawRange(0, points.length);
  }

  /** Flatten the robot onto the ground, along the light. */
  castShadow(normal, height) {
    const light = new THREE.Vector3(...LIGHT);
    const [l, n] = [light.toArray(), normal.toArray()];
    const scale = 1 / light.dot(normal);
    const rows = [0, 1, 2].map((i) => [
      ...[0, 1, 2].map((k) => (i === k ? 1 : 0) - l[i] * n[k] * scale),
      -height * l[i] * scale,
    ]);
    this.shadow.matrix.set(...rows.flat(), 0, 0, 0, 1).multiply(this.robot.matrix);
    this.shadow.matrixWorldNeedsUpdate = true;
  }

  /** Render with the next frame of the screen, once, but not with several pictures under way. */
  draw() {
    if (this.isDue || !this.isSeen) return;
    this.isDue = true;
    if (this.pending < MAX_PENDING) this.request();
  }

  request() {
    requestAnimationFrame(() => this.isDue && this.render());
  }

  render() {
    this.isDue = false;
    if (!this.data || !this.canvas.clientWidth) return;
    const begin = performance.now();
    const distance = this.orbit.zoom * this.size * Math.max(1, WIDE / this.camera.aspect);
    const middle = this.middle.clone().applyMatrix4(this.robot.matrix);
    this.camera.position
      .set(...this.orbit.direction)
      .multiplyScalar(distance)
      .add(middle);
    this.camera.lookAt(middle);
    [this.scene.fog.near, this.scene.fog.far] = FOG.map((part) => distance + part * this.size);
    this.renderer.render(this.scene, this.camera);
    this.follow(begin);
  }

  /** Notice when a picture is complete: without this a slow renderer would be behind for seconds. */
  follow(begin) {
    const gl = this.renderer.getContext();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.pending += 1;
    const poll = () => {
      const isLost = gl.isContextLost();
      const isLate = performance.now() - begin > MAX_FENCE_TIME;
      if (!isLost && !isLate && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) {
        setTimeout(poll, POLL_PERIOD);
        return;
      }
      gl.deleteSync(fence);
      this.pending -= 1;
      if (!isLost) this.adapt(performance.now() - begin);
      if (this.isDue) this.request();
    };
    setTimeout(poll);
  }

  /** Reduce the quality where most of the measured pictures took too long; raise it where not. */
  adapt(cost) {
    this.costs.push(cost);
    if (this.costs.length < MEASUREMENTS) return;
    const median = this.costs.sort((a, b) => a - b)[(MEASUREMENTS - 1) / 2];
    this.cost = median;
    const step = median > SLOW_FRAME ? 1 : median < FAST_FRAME ? -1 : 0;
    this.restartMeasurements(Math.min(QUALITIES.length - 1, Math.max(0, this.quality + step)));
  }

  restartMeasurements(quality) {
    this.costs = [];
    const isNew = quality !== this.quality;
    this.quality = quality;
    this.shadow.visible = QUALITIES[quality][1];
    if (isNew) this.resize();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    const ratio = Math.min(devicePixelRatio, QUALITIES[this.quality][0]);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Free what `build` has made. */
  clear() {
    for (const meshes of this.meshes) meshes.dispose();
    for (const group of [this.ground, this.robot, this.shadow]) {
      group.traverse((node) => {
        if (!node.isInstancedMesh && node.geometry) node.geometry.dispose();
      });
      group.clear();
    }
    this.meshes = [];
    this.legs = [];
  }

  dispose() {
    this.isDue = false;
    for (const observer of this.observers) observer.disconnect();
    this.clear();
    for (const material of Object.values(this.materials)) material.dispose();
    this.renderer.dispose();
  }
}

function bodyCorner({ centre, size }, corner) {
  return new THREE.Vector3(...corner.map((part, i) => centre[i] + part * size[i]));
}

function sceneColour(name) {
  return new THREE.Color(themeColour(name));
}

function partColour({ body, isLink }) {
  return sceneColour(isLink && body !== FIXED ? `body-${body % BODY_COLOURS}` : METAL);
}

function sceneMaterials() {
  const onGround = { depthWrite: false };
  return {
    part: new THREE.MeshLambertMaterial({ vertexColors: true }),
    body: new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.55 }),
    shadow: new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, ...onGround }),
    grid: new THREE.LineBasicMaterial(onGround),
    path: new THREE.LineBasicMaterial(onGround),
  };
}

/** Return whether no graphics card draws: smooth edges then cost as much as the robot. */
function isSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  const names = gl && gl.getExtension('WEBGL_debug_renderer_info');
  const name = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : '';
  if (gl) gl.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

/** Return lines in pieces of a cell: a software renderer loses long ones that begin behind it. */
function gridGeometry(cell) {
  const points = [];
  for (let i = -GRID_CELLS; i <= GRID_CELLS; i += 1) {
    for (let k = -GRID_CELLS; k < GRID_CELLS; k += 1) {
      points.push(i, k, 0, i, k + 1, 0, k, i, 0, k + 1, i, 0);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(points), 3));
  return geometry.scale(cell, cell, cell);
}

/** Return legs with the models of what klann_ros.export.scene_parts returns; without, of bars. */
function withModels(legs, parts) {
  return legs.map((leg) => {
    const placed = parts?.legs[leg.name];
    return { ...leg, ...placed, model: placed && parts.models[placed.model] };
  });
}

/** Return a leg's mount as a matrix, and whether its heights are against the normal. */
function mountMatrix({ mount, direction, offset = 0 }, middle) {
  const matrix = new THREE.Matrix4().makeRotationFromEuler(new THREE.Euler(...mount.rpy, 'ZYX'));
  const normal = new THREE.Vector3().setFromMatrixColumn(matrix, 2);
  const place = new THREE.Vector3(...mount.xyz);
  const outward = place.clone().sub(new THREE.Vector3(...middle));
  const isMirrored = direction ? direction < 0 : normal.dot(outward) < 0;
  matrix.setPosition(place.addScaledVector(normal, offset));
  return { matrix, isMirrored };
}
