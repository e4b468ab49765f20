// The contacts of a shape that slides and tilts near a floor, through examples/rapier/near_contacts.js: how far the least
// separation is off, and how many go on under another name. Fails where one is off by more than single precision makes
// of a pose, 5 µm, or a box, hull, ball or capsule loses a name, and where the seam of two floors is felt.
//
// Usage: HAPTIC_LIBRARY=LIBHAPTIC node rapier_contacts.mjs
import RAPIER from '../../examples/rapier/node_modules/@dimforge/rapier3d-compat/dist/rapier.mjs';
import { NearContacts } from '../../examples/rapier/near_contacts.js';
import { rotate, subtract } from '../../examples/rapier/vectors.js';

const FRAMES = 1200;
const EPSILON = 0.005; // m
const R = 0.02; // m, half of every edge
const SAME_PLACE = 0.002; // m, on the tool, from frame to frame
const LARGEST_ERROR = 5e-6; // m
const LARGEST_SIDEWAYS = 1e-3; // of a unit normal: 0.06°, which the geometry takes for none

const corners = [-R, R].flatMap((x) => [-R, R].flatMap((y) => [-R, R].map((z) => [x, y, z])));
const { ColliderDesc } = RAPIER;
const ofCube = (up) => R * up.reduce((sum, x) => sum + Math.abs(x), 0);
/** Each with how far it reaches down: `up` is the world's z in its frame. */
const shapes = {
  box: [() => ColliderDesc.cuboid(R, R, R), ofCube],
  hull: [() => ColliderDesc.convexHull(Float32Array.from(corners.flat())), ofCube],
  ball: [() => ColliderDesc.ball(R), () => R],
  capsule: [() => ColliderDesc.capsule(R / 2, R), (up) => R + (R / 2) * Math.abs(up[1])],
  cylinder: [() => ColliderDesc.cylinder(R, R), (up) => R * Math.abs(up[1]) + R * Math.hypot(up[0], up[2])],
};
const slab = (x) => ColliderDesc.cuboid(0.05, 0.5, 0.1).setTranslation(x, 0, -0.1);
const block = Float32Array.from([-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-0.2, 0].flatMap((z) => [x, y, z]))));
const sides = Uint32Array.from([0, 1, 2, 1, 3, 2, 4, 6, 5, 5, 6, 7, 0, 4, 1, 1, 4, 5, 2, 3, 6, 3, 7, 6, 0, 2, 4, 2, 6, 4,
  1, 5, 3, 3, 5, 7]);
const floors = {
  'half-space': () => [new ColliderDesc(new RAPIER.HalfSpace({ x: 0, y: 0, z: 1 }))],
  box: () => [ColliderDesc.cuboid(0.5, 0.5, 0.1).setTranslation(0, 0, -0.1)],
  'row of boxes': () => [-0.2, -0.1, 0, 0.1, 0.2].map(slab),
  mesh: () => [ColliderDesc.trimesh(block, sides)],
};

/** Tilted by (x, y), rad. */
function turn(x, y) {
  const angle = Math.hypot(x, y);
  const half = angle > 0 ? Math.sin(angle / 2) / angle : 0;
  return { w: Math.cos(angle / 2), x: x * half, y: y * half, z: 0 };
}

function place(body, frame, reach) {
  const t = frame / 60;
  const rotation = turn(0.03 * Math.sin(1.3 * t + 0.2), 0.03 * Math.sin(1.7 * t));
  const down = reach(rotate({ ...rotation, w: -rotation.w }, [0, 0, 1]));
  const height = 0.0003 * Math.sin(3 * t);
  body.setRotation(rotation, true);
  body.setTranslation({ x: 0.1 * Math.sin(0.5 * t), y: 0.1 * Math.sin(0.37 * t), z: down + height }, true);
  return height;
}

/** Where the contact is on the tool, in its frame. */
function onTool(body, { point, normal, separation }) {
  const { x, y, z } = body.translation();
  const rotation = body.rotation();
  const world = subtract(point.map((p, i) => p + separation * normal[i]), [x, y, z]);
  return rotate({ ...rotation, w: -rotation.w }, world);
}

function isRenamed(before, now) {
  if (now.some(({ identity }) => identity === before.identity)) return false;
  return now.some(({ at }) => Math.hypot(...subtract(at, before.at)) < SAME_PLACE);
}

function walk(shape, reach, floor) {
  const world = new RAPIER.World({ x: 0, y: 0, z: -9.81 });
  const body = world.createRigidBody(RAPIER.RigidBodyDesc.kinematicPositionBased());
  world.createCollider(shape(), body);
  floor().forEach((part) => world.createCollider(part));
  const near = new NearContacts(world, body, EPSILON, ({ handle }) => handle);
  const found = { error: 0, renamed: 0, sideways: 0 };
  let before = [];
  for (let frame = 0; frame < FRAMES; ++frame) {
    const height = place(body, frame, reach);
    world.step();
    const all = near.find().filter(({ axis }) => axis === 0);
    const now = all.map((contact) => ({ ...contact, at: onTool(body, contact) }));
    found.error = Math.max(found.error, Math.abs(Math.min(...now.map(({ separation }) => separation)) - height));
    found.renamed += before.filter((contact) => isRenamed(contact, now)).length;
    const touching = now.filter(({ separation }) => separation < 0);
    found.sideways = Math.max(found.sideways, ...touching.map(({ normal: [x, y] }) => Math.hypot(x, y)));
    before = now;
  }
  near.close();
  world.free();
  return found;
}

await RAPIER.init();
for (const [floorName, floor] of Object.entries(floors)) {
  for (const [name, [shape, reach]] of Object.entries(shapes)) {
    const { error, renamed, sideways } = walk(shape, reach, floor);
    console.log(`${name} on a ${floorName}: least separation off by at most ${(1e6 * error).toFixed(2)} µm, ` +
      `${renamed} renamed in ${FRAMES} frames, normals of what touches sideways by at most ${sideways.toExponential(1)}`);
    const keeps = name === 'cylinder' || renamed === 0;
    if (!(error < LARGEST_ERROR && sideways < LARGEST_SIDEWAYS && keeps)) process.exitCode = 1;
  }
}
