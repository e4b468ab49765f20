// What a body looks like: meshes of the shapes of docs/page_messages.md.

import * as THREE from 'three';
import { COLORS } from './colors.js';

const PANE_SIZE = 1.2;      // m, of a plane that is no floor
const FLOOR_RADIUS = 14;    // m; it fades before
const GRID = 1;             // m, on a floor: what says without shadows where it is
const CELL = 0.05;          // m

/** Puts `object` at the pose [x,y,z, w,x,y,z]. */
export function place(object, pose) {
  object.position.set(pose[0], pose[1], pose[2]);
  object.quaternion.set(pose[4], pose[5], pose[6], pose[3]);
}

/** A group with one mesh (and its edges) per shape; `isFloor(shape)`: a plane on which the world stands. */
export function bodyObject(shapes, look, isFloor = () => false) {
  const group = new THREE.Group();
  for (const shape of shapes) {
    const floor = shape.kind === 'plane' && isFloor(shape);
    const geometry = floor ? new THREE.CircleGeometry(FLOOR_RADIUS, 64) : geometryOf(shape);
    if (!geometry) continue;
    const part = new THREE.Group();
    place(part, shape.pose);
    const mesh = new THREE.Mesh(geometry, floor ? look.floor : shape.kind === 'plane' ? look.pane : look.surface);
    if (look.casts && shape.kind !== 'plane') look.light.cast(mesh);
    part.add(mesh);
    if (floor) part.add(grid(look.lines));
    else part.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 40), look.edges));
    part.userData.infinite = shape.kind === 'plane';
    group.add(part);
  }
  group.traverse((object) => { object.renderOrder = look.order; });
  return group;
}

/** In the floor's plane, z = 0, and a little above it. */
function grid(material) {
  const points = [];
  const half = GRID / 2;
  for (let at = -half; at <= half + CELL / 2; at += CELL) points.push(at, -half, 0, at, half, 0, -half, at, 0, half, at, 0);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
  const lines = new THREE.LineSegments(geometry, material);
  lines.position.z = 2e-4;
  return lines;
}

/** How bodies of one kind are painted under `light`. Ghosts are drawn over everything. */
export function look(light, color, { opacity = 1, ghost = false, order = 0 } = {}) {
  const edge = new THREE.Color(color).multiplyScalar(ghost ? 1 : 0.35);
  return {
    light,
    surface: light.material(color, { opacity, depthTest: !ghost, depthWrite: opacity === 1, polygonOffset: true,
                                     polygonOffsetFactor: 1, polygonOffsetUnits: 1 }),
    floor: light.material(COLORS.ground, { ground: true }),
    pane: new THREE.MeshBasicMaterial({ color, transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthWrite: false }),
    edges: new THREE.LineBasicMaterial({ color: edge, depthTest: !ghost, transparent: ghost }),
    lines: new THREE.LineBasicMaterial({ color: COLORS.fixed }),
    casts: !ghost,
    order,
  };
}

/** Bounds of the finite shapes of `objects`. */
export function boundsOf(objects) {
  const bounds = new THREE.Box3();
  for (const object of objects) {
    object.updateWorldMatrix(true, true);
    for (const part of object.children) {
      if (!part.userData.infinite) bounds.expandByObject(part);
    }
  }
  if (bounds.isEmpty()) bounds.set(new THREE.Vector3(-0.2, -0.2, -0.2), new THREE.Vector3(0.2, 0.2, 0.2));
  return bounds;
}

/** Frees what the graphics card holds of `object`; materials are shared and stay. */
export function dispose(object) {
  object.traverse((part) => part.geometry?.dispose());
  object.removeFromParent();
}

function geometryOf(shape) {
  const upright = (geometry) => geometry.rotateX(Math.PI / 2);  // three's axis is y, SDF's is z
  switch (shape.kind) {
    case 'box': return new THREE.BoxGeometry(...shape.size);
    case 'sphere': return new THREE.SphereGeometry(shape.radius, 24, 14);
    case 'cylinder': return upright(new THREE.CylinderGeometry(shape.radius, shape.radius, shape.length, 24));
    case 'capsule': return upright(new THREE.CapsuleGeometry(shape.radius, shape.length, 6, 18));
    case 'ellipsoid': return new THREE.SphereGeometry(1, 24, 14).scale(...shape.radii);
    case 'mesh': return meshOf(shape);
    case 'plane': return new THREE.PlaneGeometry(PANE_SIZE, PANE_SIZE);
    default: return null;
  }
}

/** Flat triangles. */
function meshOf({ points, corners }) {
  const geometry = new THREE.BufferGeometry();
  const coordinates = corners.flatMap((corner) => points.slice(3 * corner, 3 * corner + 3));
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(coordinates, 3));
  geometry.computeVertexNormals();
  return geometry;
}
