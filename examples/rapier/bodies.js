// The bodies of a Rapier world that a tool can push.
import RAPIER from '@dimforge/rapier3d-compat';
import { Roundness } from './haptic.js';
import { add, list, rotate, scale } from './vectors.js';

const FREE = 4; // HAPTIC_FREE
const AT_ORIGIN = { position: [0, 0, 0], rotation: [1, 0, 0, 0] };

/** What turning leaves the body's one collider as it is: { round, axis }. */
function roundness(body) {
  const round = body.numColliders() === 1 && body.collider(0);
  const centred = round && Math.hypot(...list(round.translationWrtParent())) === 0;
  if (!centred) return { round: Roundness.NONE, axis: [0, 0, 0] };
  const { Ball, Capsule, Cylinder, Cone } = RAPIER.ShapeType;
  if (round.shapeType() === Ball) return { round: Roundness.SPHERE, axis: [0, 0, 0] };
  if (![Capsule, Cylinder, Cone].includes(round.shapeType())) return { round: Roundness.NONE, axis: [0, 0, 0] };
  return { round: Roundness.AXIS, axis: rotate(round.rotation(), [0, 1, 0]) };
}

/** The 6x6 matrix of what locked translations and rotations leave. */
function inverseInertia(body) {
  const W = new Float64Array(36);
  list(body.effectiveInvMass()).forEach((x, i) => { W[7 * i] = x; });
  // One buffer of Rapier's holds what was asked for last: copied before it changes.
  const { m11, m12, m13, m22, m23, m33 } = body.effectiveWorldInvInertia();
  [[m11, m12, m13], [m12, m22, m23], [m13, m23, m33]].forEach((row, i) => W.set(row, 6 * (i + 3) + 3));
  return W;
}

/** The body in its present state, as if no joint held it. */
export function describe(body, id, gravity) {
  const W = inverseInertia(body);
  const pulled = scale(body.gravityScale(), list(gravity)).map((g, i) => (W[7 * i] > 0 ? g : 0));
  return {
    id,
    ...roundness(body),
    centre: list(body.worldCom()),
    velocity: [...list(body.linvel()), ...list(body.angvel())],
    inverse_inertia: W,
    acceleration: add([...pulled, 0, 0, 0], times(W, [...list(body.userForce()), ...list(body.userTorque())])),
  };
}

/** What the server must know of a free body to move it, as haptic_dynamics; null where translations or rotations are
 * locked. `gravity`: what its weight accelerates it by. */
export function dynamicsOf(body, id, gravity) {
  const W = inverseInertia(body);
  if ([0, 1, 2, 3, 4, 5].some((i) => W[7 * i] === 0)) return null;
  const turn = body.principalInertiaLocalFrame();
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(turn, axis));
  const moments = list(body.principalInertia());
  const inertia = Float64Array.from({ length: 9 }, (_, i) => (
    axes.reduce((sum, axis, k) => sum + moments[k] * axis[Math.floor(i / 3)] * axis[i % 3], 0)));
  return {
    body: id, joint: FREE, mass: body.mass(), centre: list(body.localCom()), inertia, gravity,
    damping: body.linearDamping(), angular_damping: body.angularDamping(), parent: 0, reserved: 0, in_parent: AT_ORIGIN,
    in_body: AT_ORIGIN, axis: [0, 0, 1], lower: 0, upper: 0, stiffness: 0, reference: 0, joint_damping: 0, friction: 0,
    armature: 0,
  };
}

function times(W, force) {
  return force.map((_, i) => force.reduce((sum, f, j) => sum + W[6 * i + j] * f, 0));
}
