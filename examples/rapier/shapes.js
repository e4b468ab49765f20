// The colliders of a Rapier world as haptic.h has them.
import RAPIER from '@dimforge/rapier3d-compat';
import { ShapeKind } from './haptic.js';
import { list } from './vectors.js';

const CONE_SIDES = 32;
/** Rapier's axis of revolution is y, the interface's is z: this turns z onto y. */
const Z_TO_Y = { x: -Math.SQRT1_2, y: 0, z: 0, w: Math.SQRT1_2 };
const NO_TURN = { x: 0, y: 0, z: 0, w: 1 };

/** A turn that brings z onto the unit vector n. */
function toNormal({ x, y, z }) {
  if (z < -1 + 1e-12) return { x: 1, y: 0, z: 0, w: 0 };
  const w = Math.sqrt((1 + z) / 2);
  return { x: -y / (2 * w), y: x / (2 * w), z: 0, w };
}

function cone(radius, half) {
  const ring = Array.from({ length: CONE_SIDES }, (_, i) => (2 * Math.PI * i) / CONE_SIDES);
  return [0, half, 0, ...ring.flatMap((angle) => [radius * Math.cos(angle), -half, radius * Math.sin(angle)])];
}

/** A collider's shape: { kind, size, vertices, triangles, turn }, where `turn` is that of the shape in the collider.
 * Throws where it is none of those. */
export function shapeOf(collider) {
  const type = collider.shapeType();
  const { Ball, Cuboid, Capsule, Cylinder, Cone, ConvexPolyhedron, TriMesh, HalfSpace } = RAPIER.ShapeType;
  switch (type) {
    case Ball:
      return { kind: ShapeKind.SPHERE, size: [collider.radius(), 0, 0] };
    case Cuboid:
      return { kind: ShapeKind.BOX, size: list(collider.halfExtents()).map((half) => 2 * half) };
    case Capsule:
    case Cylinder: {
      const kind = type === Capsule ? ShapeKind.CAPSULE : ShapeKind.CYLINDER;
      return { kind, size: [collider.radius(), 2 * collider.halfHeight(), 0], turn: Z_TO_Y };
    }
    case Cone:
      return { kind: ShapeKind.HULL, vertices: cone(collider.radius(), collider.halfHeight()) };
    case ConvexPolyhedron:
      return { kind: ShapeKind.HULL, vertices: collider.vertices() };
    case TriMesh:
      return { kind: ShapeKind.MESH, vertices: collider.vertices(), triangles: collider.indices() };
    case HalfSpace:
      return { kind: ShapeKind.HALF_SPACE, turn: toNormal(collider.shape.normal) };
    default:
      throw new Error(`a collider of type ${RAPIER.ShapeType[type]} must be a ball, cuboid, capsule, cylinder, cone, ` +
        'convex polyhedron, triangle mesh or half-space: of a compound, add the parts to the body as colliders of ' +
        'their own');
  }
}

/** Radius of a ball about the shape's origin that holds it, m; of a half-space none. */
export function radiusOf({ kind, size, vertices }) {
  switch (kind) {
    case ShapeKind.SPHERE:
      return size[0];
    case ShapeKind.BOX:
      return Math.hypot(...size) / 2;
    case ShapeKind.CAPSULE:
      return size[0] + size[1] / 2;
    case ShapeKind.CYLINDER:
      return Math.hypot(size[0], size[1] / 2);
    case ShapeKind.HALF_SPACE:
      return Infinity;
    default:
      return Math.sqrt(Math.max(...Array.from({ length: vertices.length / 3 }, (_, i) =>
        vertices[3 * i] ** 2 + vertices[3 * i + 1] ** 2 + vertices[3 * i + 2] ** 2)));
  }
}

/** Where a collider's shape is in its body, or in the world: { position, rotation }, w, x, y, z. */
export function poseIn(collider, inBody, turn = NO_TURN) {
  const a = inBody ? collider.rotationWrtParent() : collider.rotation();
  const b = turn;
  const rotation = [
    a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
    a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
    a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
  ];
  const length = Math.hypot(...rotation);
  return {
    position: list(inBody ? collider.translationWrtParent() : collider.translation()),
    rotation: rotation.map((part) => part / length),
  };
}
