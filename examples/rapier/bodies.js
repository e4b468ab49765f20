// The bodies of a Rapier world that a tool can push.
import RAPIER from '@dimforge/rapier3d-compat';
import { Roundness } from './haptic.js';
import { add, list, rotate, scale } from './vectors.js';

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

function times(W, force) {
  return force.map((_, i) => force.reduce((sum, f, j) => sum + W[6 * i + j] * f, 0));
}
