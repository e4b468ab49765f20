// The colliders of a Rapier world as the server takes them, and which bodies are near the tool.
import { MAX_POSES, FrictionRule, Side } from './haptic.js';
import { poseIn, radiusOf, shapeOf } from './shapes.js';
import { list, object, subtract } from './vectors.js';

/** By CoefficientCombineRule: Average, Min, Multiply, Max. */
const RULES = [FrictionRule.AVERAGE, FrictionRule.MINIMUM, FrictionRule.PRODUCT, FrictionRule.MAXIMUM];
const AT_ORIGIN = { position: [0, 0, 0], rotation: [1, 0, 0, 0] };

/** Whether the low 16 bits of each one's groups, its filter, have one of the other's high ones. */
function mayCollide(a, b) {
  const [inA, inB] = [a.collisionGroups(), b.collisionGroups()];
  const meet = (inA >>> 16) & inB & 0xffff && (inB >>> 16) & inA & 0xffff;
  return Boolean(meet) && !a.isSensor() && !b.isSensor() && a.isEnabled() && b.isEnabled();
}

export class WorldShapes {
  #world;
  #tool;
  #numberOf;
  #dynamics;
  #state = null; // Of the colliders that were offered.
  #parts = []; // { collider, body, radius }

  /** `tool`: a body. `numberOf(body)`: its index. `dynamics(bodies)`: as haptic_dynamics, of those that may be held. */
  constructor(world, tool, numberOf, dynamics) {
    this.#dynamics = dynamics;
    this.#world = world;
    this.#tool = tool;
    this.#numberOf = numberOf;
  }

  /** Gives them to the server, again where colliders have come, gone or changed. */
  offer(client) {
    const colliders = [];
    this.#world.forEachCollider((collider) => colliders.push(collider));
    const joints = [this.#world.impulseJoints.len(), this.#world.multibodyJoints.len()];
    const state = [...joints, ...colliders.map((collider) => this.#stateOf(collider))].join();
    if (state === this.#state) return;
    this.#state = state;
    const shapes = colliders.map((collider) => ({ ...shapeOf(collider), ...this.#sideOf(collider) }));
    this.#parts = colliders.map((collider, i) => ({ collider, body: collider.parent(), radius: radiusOf(shapes[i]) }));
    const poses = colliders.map((collider, i) => poseIn(collider, shapes[i].side !== Side.WORLD, shapes[i].turn));
    const materials = colliders.map((collider) => (
      { friction: collider.friction(), rule: RULES[collider.frictionCombineRule()], priority: 0 }));
    const excluded = shapes.flatMap(({ side }, i) => (side === Side.WORLD ? [] :
      shapes.flatMap((_, j) => (i === j || mayCollide(colliders[i], colliders[j]) ? [] : [[i, j]]))));
    const bodies = new Map(this.#parts.map(({ body }) => [body?.handle, body]));
    bodies.delete(this.#tool.handle);
    client.offer(shapes, poses, materials, excluded, this.#dynamics([...bodies.values()].filter((body) => body?.isDynamic())));
  }

  /** The bodies that move, except the tool, those nearest to it first: { body, gap }, at least m. */
  bodies() {
    const ofTool = this.#parts.filter(({ body }) => body?.handle === this.#tool.handle);
    const gaps = new Map();
    for (const { collider, body, radius } of this.#parts) {
      if (!body || body.isFixed() || body.handle === this.#tool.handle) continue;
      const to = ofTool.map((part) => Math.hypot(...subtract(list(collider.translation()), list(part.collider.translation()))) -
        radius - part.radius);
      const gap = Math.min(...to, gaps.get(body.handle)?.gap ?? Infinity);
      gaps.set(body.handle, { body, gap });
    }
    return [...gaps.values()].sort((a, b) => a.gap - b.gap);
  }

  /** Where they are, as haptic_body_pose. */
  poses(bodies) {
    return bodies.slice(0, MAX_POSES).map(({ body }) => {
      const { x, y, z, w } = body.rotation();
      const length = Math.hypot(x, y, z, w);
      const position = list(body.translation());
      return {
        body: this.#numberOf(body),
        kept: 0,
        pose: { position, rotation: [w, x, y, z].map((part) => part / length) },
        velocity: [...list(body.velocityAtPoint(object(position))), ...list(body.angvel())],
      };
    });
  }

  #sideOf(collider) {
    const body = collider.parent();
    if (body?.handle === this.#tool.handle) return { side: Side.TOOL_LINK, index: 0 };
    if (!body || body.isFixed()) return { side: Side.WORLD, index: 0 };
    return { side: Side.MOVABLE_BODY, index: this.#numberOf(body) };
  }

  /** What of a collider its shape, place and filter depend on. */
  #stateOf(collider) {
    const { side, index } = this.#sideOf(collider);
    const { position, rotation } = side === Side.WORLD ? poseIn(collider, false) : AT_ORIGIN;
    const { x, y, z } = collider.halfExtents() ?? { x: 0, y: 0, z: 0 };
    return [collider.handle, side, index, collider.shapeType(), collider.collisionGroups(), collider.isSensor(),
      collider.isEnabled(), collider.radius(), collider.halfHeight(), x, y, z, collider.friction(),
      collider.frictionCombineRule(), ...position, ...rotation].join(' ');
  }
}
