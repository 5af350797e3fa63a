'use strict';
/*
 * The parts of a leg as meshes that move with its points. A model is one of those that
 * klann_ros.export.scene_parts returns:
 *
 *   {bodies: [{origin: i, along: [p, q] | null}], radius, parts: [{body, isLink, prisms}]}
 *   prism: {low, high, outlines: [curve], cuts: [curve]}
 *
 * A body's coordinates begin in the point `origin`, along the line from p to q; those of the ground,
 * body -1, are the leg's plane. `low` and `high` are along the plane's normal [m]. A curve is [x, y,
 * bulge, x, y, bulge, ...] as in DXF, counter-clockwise around material, clockwise around a window.
 * `radius` is half of a link's width [m].
 */

const FIXED = -1;
// Bars of a leg without parts, as parts of its size: half of the width, and the thickness.
const BAR_RADIUS = 0.014;
const BAR_THICKNESS = 0.016;
// Of arcs, between two of their points: of links, and of pins and what is on them [rad].
const LINK_STEP = 0.6;
const PIN_STEP = 0.9;
// The bulge of half a circle.
const HALF_TURN = 1;

/** Return the pose of a body in its plane: x, y, cosine and sine; null where it is unknown. */
function bodyFrame(model, body, points) {
  if (body === FIXED) return [0, 0, 1, 0];
  const { origin, along } = model.bodies[body];
  const [x, y] = points[origin];
  if (!along) return [x, y, 1, 0];
  const [p, q] = along.map((i) => points[i]);
  const [u, v] = [q[0] - p[0], q[1] - p[1]];
  const length = Math.hypot(u, v);
  return Number.isFinite(x + y + length) && length > 0 ? [x, y, u / length, v / length] : null;
}

/** Return a model of bars, by the shape of a leg and its points in any pose. */
function barModel(shape, points) {
  const x = points.map((point) => point[0]);
  const y = points.map((point) => point[1]);
  const size = Math.hypot(Math.max(...x) - Math.min(...x), Math.max(...y) - Math.min(...y));
  const [radius, thickness] = [BAR_RADIUS * size, BAR_THICKNESS * size];
  const model = { bodies: [], parts: [], radius };
  shape.bodies.forEach((body, j) => {
    const [first] = body.bars.length ? body.bars : [body.line || [0, 1]];
    model.bodies.push({ origin: first[0], along: first });
    const frame = bodyFrame(model, j, points);
    if (!frame) return;
    const prisms = body.bars.map((bar) => ({
      low: (j + 0.05) * thickness,
      high: (j + 0.95) * thickness,
      outlines: [stadium(...bar.map((i) => inFrame(frame, points[i])), radius)],
      cuts: [],
    }));
    model.parts.push({ body: j, isLink: true, prisms });
  });
  return model;
}

function inFrame([x, y, c, s], [u, v]) {
  return [c * (u - x) + s * (v - y), c * (v - y) - s * (u - x)];
}

/** Return the curve around a bar with round ends. */
function stadium([x, y], [u, v], radius) {
  const length = Math.hypot(u - x, v - y) || 1;
  const [s, c] = [((v - y) * radius) / length, ((u - x) * radius) / length];
  return [x + s, y - c, 0, u + s, v - c, HALF_TURN, u - s, v + c, 0, x - s, y + c, HALF_TURN];
}

/** Return the points of a curve. */
function pointsOn(curve, step) {
  const points = [];
  for (let i = 0; i < curve.length; i += 3) {
    const [x, y, bulge] = curve.slice(i, i + 3);
    const next = (i + 3) % curve.length;
    const [u, v] = [curve[next] - x, curve[next + 1] - y];
    const angle = 4 * Math.atan(bulge);
    // The centre is beside the middle of the chord.
    const beside = bulge ? (1 - bulge * bulge) / (4 * bulge) : 0;
    const [middleX, middleY] = [x + u / 2 - beside * v, y + v / 2 + beside * u];
    const count = Math.ceil(Math.abs(angle) / step) || 1;
    points.push(new THREE.Vector2(x, y));
    for (let k = 1; k < count; k += 1) {
      const [c, s] = [Math.cos((k * angle) / count), Math.sin((k * angle) / count)];
      const [p, q] = [x - middleX, y - middleY];
      points.push(new THREE.Vector2(middleX + c * p - s * q, middleY + s * p + c * q));
    }
  }
  return points;
}

/** Return the outlines of a prism of a part, each with the holes in it; a pin fills its own. */
function shapesOf(prism, isLink) {
  const step = isLink ? LINK_STEP : PIN_STEP;
  const outer = [];
  const holes = isLink ? prism.cuts.map((cut) => pointsOn(cut, step)) : [];
  for (const points of prism.outlines.map((outline) => pointsOn(outline, step))) {
    if (areaOf(points) > 0) outer.push({ points, shape: new THREE.Shape(points) });
    else holes.push(points);
  }
  for (const hole of holes) {
    const around = outer.find(({ points }) => isInside(hole[0], points));
    if (around) around.shape.holes.push(new THREE.Path(hole));
  }
  return outer.map(({ shape }) => shape);
}

function areaOf(points) {
  return points.reduce((sum, { x, y }, i) => {
    const next = points[(i + 1) % points.length];
    return sum + (x * next.y - next.x * y) / 2;
  }, 0);
}

function isInside({ x, y }, points) {
  let isIn = false;
  points.forEach((a, i) => {
    const b = points[(i + 1) % points.length];
    if (a.y > y !== b.y > y && x < a.x + ((y - a.y) / (b.y - a.y)) * (b.x - a.x)) isIn = !isIn;
  });
  return isIn;
}

/** Return the geometry of a body: its parts in one mesh, each in its colour. */
function bodyGeometry(parts, colourOf, isMirrored) {
  const columns = { position: [], normal: [], color: [] };
  for (const part of parts) {
    const { r, g, b } = colourOf(part);
    for (const prism of part.prisms) {
      const low = isMirrored ? -prism.high : prism.low;
      for (const shape of shapesOf(prism, part.isLink)) {
        const options = { depth: prism.high - prism.low, bevelEnabled: false, curveSegments: 1 };
        const { attributes } = new THREE.ExtrudeGeometry(shape, options).translate(0, 0, low);
        for (const name of ['position', 'normal']) {
          for (const value of attributes[name].array) columns[name].push(value);
        }
        for (let i = 0; i < attributes.position.count; i += 1) columns.color.push(r, g, b);
      }
    }
  }
  return geometryOf(columns);
}

/** Return what a body's links look like from far along their normal: flat, without holes. */
function shadowGeometry(parts) {
  const position = [];
  for (const { prisms } of parts.filter((part) => part.isLink)) {
    for (const { outlines, low } of prisms) {
      for (const shape of shapesOf({ outlines: outlines.slice(0, 1), cuts: [] }, true)) {
        const flat = new THREE.ShapeGeometry(shape).translate(0, 0, low).toNonIndexed();
        position.push(...flat.attributes.position.array);
      }
    }
  }
  return geometryOf({ position });
}

/** Return a geometry of columns of triples; equal vertices are one. */
function geometryOf(columns) {
  const numbers = new Map();
  const index = [];
  const kept = Object.keys(columns).map(() => []);
  const values = Object.values(columns);
  for (let i = 0; i < values[0].length; i += 3) {
    const triples = values.map((column) => column.slice(i, i + 3));
    const key = triples.join();
    if (!numbers.has(key)) {
      numbers.set(key, numbers.size);
      triples.forEach((triple, k) => kept[k].push(...triple));
    }
    index.push(numbers.get(key));
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(index);
  Object.keys(columns).forEach((name, k) => {
    geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(kept[k]), 3));
  });
  return geometry;
}

/** Return the geometry of what does not move: the grounds of legs, each at its mount. */
function groundGeometry(legs, colourOf) {
  const columns = { position: [], normal: [], color: [] };
  for (const { model, matrix, isMirrored } of legs) {
    const parts = model ? model.parts.filter((part) => part.body === FIXED) : [];
    const { attributes } = bodyGeometry(parts, colourOf, isMirrored)
      .applyMatrix4(matrix)
      .toNonIndexed();
    for (const [name, column] of Object.entries(columns)) {
      for (const value of attributes[name].array) column.push(value);
    }
  }
  return geometryOf(columns);
}

/** Legs whose bodies are alike, and mounted alike: an instanced mesh for each body that moves. */
class LegMeshes {
  constructor(model, mounts, isMirrored, colourOf, materials) {
    this.model = model;
    this.mounts = mounts;
    this.bodies = [];
    const bodies = new Map();
    for (const part of model.parts)
      bodies.set(part.body, [...(bodies.get(part.body) || []), part]);
    bodies.delete(FIXED);
    for (const [body, parts] of bodies) {
      const geometries = [bodyGeometry(parts, colourOf, isMirrored), shadowGeometry(parts)];
      const [mesh, shadow] = geometries.map((geometry, i) => {
        const instances = new THREE.InstancedMesh(geometry, materials[i], mounts.length);
        instances.frustumCulled = false;
        return instances;
      });
      // One array of matrices for both.
      shadow.instanceMatrix = mesh.instanceMatrix;
      this.bodies.push({ body, mesh, shadow });
    }
    this.local = new THREE.Matrix4();
    this.nowhere = new THREE.Matrix4().makeScale(0, 0, 0);
  }

  /** Move the leg of a number to its points; null hides it. */
  show(number, points) {
    for (const { body, mesh } of this.bodies) {
      const frame = points && bodyFrame(this.model, body, points);
      if (frame) {
        const [x, y, c, s] = frame;
        this.local.set(c, -s, 0, x, s, c, 0, y, 0, 0, 1, 0, 0, 0, 0, 1);
        mesh.setMatrixAt(number, this.local.premultiply(this.mounts[number]));
      } else {
        mesh.setMatrixAt(number, this.nowhere);
      }
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  dispose() {
    for (const { mesh, shadow } of this.bodies) {
      for (const instances of [mesh, shadow]) {
        instances.geometry.dispose();
        instances.dispose();
      }
    }
  }
}
