// The contacts that Rapier lists of a body, also before they touch, with names that last.
import RAPIER from '@dimforge/rapier3d-compat';
import { Side } from './haptic.js';
import { add, dot, list, normalise, rotate, scale, subtract, toWorld } from './vectors.js';

const UNNAMED = 0; // Parry's PackedFeatureId::UNKNOWN
const CLEARLY_NEARER = 1e-5; // m
const ALONG_AXIS = 1 - 1e-6;
/** Of these Rapier takes four points of the rim that turn against the body: their names say nothing. */
const WITH_RIM = new Set([
  RAPIER.ShapeType.Cylinder, RAPIER.ShapeType.Cone, RAPIER.ShapeType.RoundCylinder, RAPIER.ShapeType.RoundCone,
]);

/** 64 bits of FNV-1a, word by word: names made of numbers. */
function hash(words, seed = 0xcbf29ce484222325n) {
  return words.reduce((h, word) => BigInt.asUintN(64, (h ^ BigInt(word)) * 0x100000001b3n), seed);
}

/** A handle's index and generation, which Rapier packs into a double. */
function bits(handle) {
  return new BigUint64Array(Float64Array.of(handle).buffer)[0];
}

/** Rapier keeps the contacts of a pair that moves less than 5 cm as they were, except between colliders with hooks.
 * This hook is asked for sensors only: it changes nothing else. */
function listAnew(collider) {
  if (collider.shapeType() === RAPIER.ShapeType.Compound) {
    throw new Error('contacts of a compound collider are in the frames of its parts, which JavaScript is not told: ' +
      'add the parts to the body as colliders of their own');
  }
  collider.setActiveHooks(collider.activeHooks() | RAPIER.ActiveHooks.FILTER_INTERSECTION_PAIRS);
}

/** Whether the normal, in the collider's frame, is that of its face. */
function isFaceNormal(collider, normal) {
  const { Cuboid, HalfSpace } = RAPIER.ShapeType;
  return collider.shapeType() === HalfSpace ||
    (collider.shapeType() === Cuboid && Math.max(...normal.map(Math.abs)) > ALONG_AXIS);
}

/** A manifold as seen from side a. */
function sidesOf(manifold, flipped, a, b) {
  const [normalA, normalB, pointA, pointB, nameA, nameB] =
    ['localNormal1', 'localNormal2', 'localContactPoint1', 'localContactPoint2', 'contactFid1', 'contactFid2'].map(
      (name, i, all) => all[flipped ? i ^ 1 : i]);
  return {
    normalA: list(manifold[normalA]()),
    normalB: list(manifold[normalB]()),
    pointA: (i) => toWorld(a, list(manifold[pointA](i))),
    pointB: (i) => toWorld(b, list(manifold[pointB](i))),
    names: (i) => [manifold[nameA](i), manifold[nameB](i)],
  };
}

/** Except between boxes and half-spaces, Rapier lists after a face's corners the closest point, without a name: mostly
 * a corner again. */
function withoutRepeated(contacts) {
  const nearest = Math.min(...contacts.filter(({ closest }) => !closest).map(({ separation }) => separation));
  return contacts.filter(({ closest, separation }) => !closest || separation < nearest - CLEARLY_NEARER);
}

export class NearContacts {
  #world;
  #epsilon;

  /** `epsilon`: contacts are listed from this separation on, m. */
  constructor(world, epsilon) {
    const parameters = world.integrationParameters;
    const least = epsilon / parameters.lengthUnit;
    parameters.normalizedPredictionDistance = Math.max(parameters.normalizedPredictionDistance, least);
    this.#world = world;
    this.#epsilon = epsilon;
    world.forEachCollider(listAnew);
  }

  /** Of a body, side a, with all others; `other` is the collider of side b. Points are where both are now, though
   * Rapier found them before it moved what moves. Without a_kind, a_index, b_index and velocity; identity is 0n where
   * Rapier has no name that lasts. */
  of(body) {
    const found = [];
    for (let i = 0; i < body.numColliders(); ++i) {
      const a = body.collider(i);
      listAnew(a);
      const others = [];
      this.#world.contactPairsWith(a, (other) => others.push(other));
      for (const b of others) {
        listAnew(b);
        this.#world.contactPair(a, b, (manifold, flipped) => found.push(...this.#ofManifold(manifold, flipped, a, b)));
      }
    }
    const names = new Set();
    for (const contact of found) {
      if (names.has(contact.identity)) contact.identity = 0n;
      names.add(contact.identity);
    }
    return found;
  }

  #ofManifold(manifold, flipped, a, b) {
    const sides = sidesOf(manifold, flipped, a, b);
    const plane = isFaceNormal(a, sides.normalA) && !isFaceNormal(b, sides.normalB);
    const normal = normalise(plane ? scale(-1, rotate(a.rotation(), sides.normalA)) :
      rotate(b.rotation(), sides.normalB));
    const named = !WITH_RIM.has(a.shapeType()) && !WITH_RIM.has(b.shapeType());
    const pair = hash([bits(a.handle), bits(b.handle), manifold.subshape1(), manifold.subshape2()]);
    const all = Array.from({ length: manifold.numContacts() }, (_, i) => {
      const onA = sides.pointA(i);
      const onB = sides.pointB(i);
      const separation = dot(normal, subtract(onA, onB));
      const names = sides.names(i);
      return {
        identity: named && !names.includes(UNNAMED) ? hash(names, pair) : 0n,
        closest: names.includes(UNNAMED),
        pair: Number(BigInt.asUintN(32, pair)),
        axis: 0,
        b_kind: b.parent()?.isDynamic() ? Side.MOVABLE_BODY : Side.WORLD,
        point: plane ? onB : add(onA, scale(-separation, normal)),
        normal,
        separation,
        friction: manifold.friction(),
        load: Math.max(0, manifold.contactImpulse(i)) / this.#world.timestep,
        plane: plane ? 1 : 0,
        other: b,
      };
    });
    return withoutRepeated(all).filter(({ separation }) => separation <= this.#epsilon);
  }
}
