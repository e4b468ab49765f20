// The contacts of the tool and of the bodies near it in a Rapier world, also before they touch, with names that last.
import RAPIER from '@dimforge/rapier3d-compat';
import { Proximity, Side } from './haptic.js';
import { poseOf, shapeOf } from './shapes.js';
import { list, subtract, toWorld } from './vectors.js';

/** Rapier's rule for two colliders is that of the two which stands later here. */
const COMBINED = [(a, b) => (a + b) / 2, Math.min, (a, b) => a * b, Math.max];

/** Of two colliders, by Rapier's rules. */
function frictionOf(a, b) {
  const rule = Math.max(a.frictionCombineRule(), b.frictionCombineRule());
  return COMBINED[rule](a.friction(), b.friction());
}

/** Whether the low 16 bits of each one's groups, its filter, have one of the other's high ones. */
function mayCollide(a, b) {
  const [inA, inB] = [a.collisionGroups(), b.collisionGroups()];
  const meet = (inA >>> 16) & inB & 0xffff && (inB >>> 16) & inA & 0xffff;
  return Boolean(meet) && !a.isSensor() && !b.isSensor() && a.isEnabled() && b.isEnabled();
}

export class NearContacts {
  #world;
  #tool;
  #epsilon;
  #numberOf;
  #parts = []; // { collider, turn }, in the order of the shapes.
  #state = ''; // Of the colliders for which the shapes were made.
  #proximity = null;

  /** `tool`: a body. `epsilon`: contacts are listed from this separation on, m. `numberOf(body)`: its index. */
  constructor(world, tool, epsilon, numberOf) {
    this.#world = world;
    this.#tool = tool;
    this.#epsilon = epsilon;
    this.#numberOf = numberOf;
  }

  /** Contacts of the tool, side a, and then of the bodies near it, where they are now. `own` and `other` are the
   * colliders. Velocity is 0. What stands still is one surface. */
  find() {
    this.#arrange();
    const poses = this.#parts.map(({ collider, turn }) => poseOf(collider, turn));
    const contacts = this.#proximity.find(poses, this.#epsilon);
    const found = contacts.map(({ contact, shapes: [a, b] }) => {
      const [own, other] = [this.#parts[a].collider, this.#parts[b].collider];
      return { ...contact, own, other, friction: frictionOf(own, other) };
    });
    this.#setLoads(found.filter(({ a_kind }) => a_kind === Side.MOVABLE_BODY));
    return found;
  }

  /** Forgets the shapes. */
  close() {
    this.#proximity?.close();
    this.#proximity = null;
  }

  #sideOf(collider) {
    const body = collider.parent();
    if (body?.handle === this.#tool.handle) return { side: Side.TOOL_LINK, index: 0 };
    if (body?.isDynamic()) return { side: Side.MOVABLE_BODY, index: this.#numberOf(body) };
    return { side: Side.WORLD, index: body ? this.#numberOf(body) : 0 };
  }

  /** What of a collider its shape and filter depend on. */
  #stateOf(collider) {
    const { x, y, z } = collider.halfExtents() ?? { x: 0, y: 0, z: 0 };
    return [collider.handle, this.#sideOf(collider).side, collider.shapeType(), collider.collisionGroups(),
      collider.isSensor(), collider.isEnabled(), collider.radius(), collider.halfHeight(), x, y, z].join(' ');
  }

  /** Shapes are made anew where colliders have come, gone or changed. */
  #arrange() {
    const colliders = [];
    this.#world.forEachCollider((collider) => colliders.push(collider));
    const state = colliders.map((collider) => this.#stateOf(collider)).join();
    if (this.#proximity && state === this.#state) return;
    this.close();
    this.#state = state;
    const shapes = colliders.map((collider) => ({ ...shapeOf(collider), ...this.#sideOf(collider) }));
    this.#parts = colliders.map((collider, i) => ({ collider, turn: shapes[i].turn }));
    const excluded = shapes.flatMap(({ side }, i) => (side === Side.WORLD ? [] :
      shapes.flatMap((_, j) => (mayCollide(colliders[i], colliders[j]) ? [] : [[i, j]]))));
    this.#proximity = new Proximity(shapes, excluded);
  }

  /** Rapier's impulses of the last step as forces, each on the nearest contact of the same two colliders. */
  #setLoads(contacts) {
    const pairs = new Map(contacts.map(({ own, other }) => [`${own.handle} ${other.handle}`, [own, other]]));
    for (const [own, other] of pairs.values()) {
      const between = contacts.filter((contact) => contact.own === own && contact.other === other);
      this.#world.contactPair(own, other, (manifold, flipped) => {
        for (let i = 0; i < manifold.numContacts(); ++i) {
          const point = toWorld(own, list(flipped ? manifold.localContactPoint2(i) : manifold.localContactPoint1(i)));
          const away = between.map((contact) => Math.hypot(...subtract(contact.point, point)));
          const nearest = between[away.indexOf(Math.min(...away))];
          nearest.load += Math.max(0, manifold.contactImpulse(i)) / this.#world.timestep;
        }
      });
    }
  }
}
