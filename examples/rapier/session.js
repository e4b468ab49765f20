// A Rapier world in the hand.
//
//   const touch = new Session(world, tool, { server: '127.0.0.1:47800', period: 1 / 60 });
//   while (running) {
//     let steps = touch.drive();       // proxy pose onto the tool, impulses onto bodies
//     while (steps-- > 0) world.step();
//     touch.send();                    // where bodies are, and what the tool can push
//   }
//   touch.close();
import RAPIER from '@dimforge/rapier3d-compat';
import { describe, dynamicsOf } from './bodies.js';
import { MAX_BODIES, Session as Client, box } from './haptic.js';
import { WorldShapes } from './world_shapes.js';
import { add, cross, list, object, rotate, scale, subtract } from './vectors.js';

/** Bodies within this are sent, m, and within what the tool travels until the next update but two, up to the farthest, m:
 * one that was not sent is a wall. */
const NEAR_BODIES = 0.02;
const FARTHEST_BODIES = 0.3;
const USUAL_SPEED = 0.3; // m/s: of a hand that was at rest.

/** The virtual tool that a hand holds when it holds this body. */
function linkOf(body) {
  body.recomputeMassPropertiesFromColliders();
  if (!body.isDynamic() || body.mass() === 0) throw new Error('the tool must be a dynamic body with mass');
  const frame = body.principalInertiaLocalFrame();
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(frame, axis));
  const principal = list(body.principalInertia());
  const inertia = Array.from({ length: 9 }, (_, k) =>
    principal.reduce((sum, I, i) => sum + I * axes[i][Math.floor(k / 3)] * axes[i][k % 3], 0));
  return { ...box(body.mass(), [0, 0, 0]), centre: list(body.localCom()), inertia };
}

/** Edge of a cube with that mass and moment of inertia, m. */
function sizeOf({ mass, inertia }) {
  return Math.max(0.01, Math.sqrt(6 * Math.max(inertia[0], inertia[4], inertia[8]) / mass));
}

function configuration(body) {
  const { x, y, z, w } = body.rotation();
  const length = Math.hypot(x, y, z, w);
  return [...list(body.translation()), w / length, x / length, y / length, z / length];
}

/** A client for one world. The server takes a body that joints hold for a free one.
 *
 * From its construction on the tool is kinematic: it is where the proxy is. While the server answers it makes no force
 * of its own, but pushes bodies by the impulses that the hand felt. The bodies near it are kept awake. From drive() to
 * send() these pushes are a part of the bodies' user forces: reset those before drive(). */
export class Session {
  #world;
  #tool;
  #period;
  #frame = 0; // Length of the present one's steps, s.
  #shapes;
  #client;
  #q;
  #v = [0, 0, 0, 0, 0, 0];
  #state = null;
  #told = new Set(); // Numbers of the bodies that the server can hold.
  #groups = new Map(); // Solver groups of the tool's colliders where it makes force, by handle.
  #numbers = new Map(); // { number, body } by handles of bodies.
  #nextNumber = 1; // The server may know of the bodies before.
  #reported = new Map(); // Bodies by number. The server can push no others, whatever it says.
  #pushes = [];
  #held = new Map(); // Of bodies that the hand holds: their own scale of gravity, by handle.

  /** `tool`: a dynamic body. `period`: about that of the frames, s. Other options are those of haptic_options. */
  constructor(world, tool, { period, ...options }) {
    this.#world = world;
    this.#tool = tool;
    const link = linkOf(tool);
    this.#q = configuration(tool);
    this.#client = new Client({
      links: [link], length: sizeOf(link), gravity: scale(tool.gravityScale(), list(world.gravity)), q: this.#q,
      rate: 1 / period, ...options,
    });
    this.#period = period;
    this.#shapes = new WorldShapes(world, tool, (body) => this.#numberOf(body), (bodies) => this.#dynamicsOf(bodies));
    this.#shapes.offer(this.#client);
    tool.setBodyType(RAPIER.RigidBodyType.KinematicPositionBased, true);
    for (const collider of this.#colliders()) {
      this.#groups.set(collider.handle, collider.solverGroups());
    }
  }

  /** Before a frame: the tool where the proxy is, and the tool's impulses on bodies, as forces for all of its steps.
   * Returns how many steps to take: they bring the world's time up to the hand's, so frames may come late. 0 where less
   * than a step has passed. */
  drive() {
    this.#takeBackPushes(); // of a frame that was not sent
    const state = this.#client.poll();
    this.#state = state;
    if (state.fresh) {
      this.#q = [...state.q.slice(0, 7)];
      this.#v = [...state.v.slice(0, 6)];
    }
    const steps = this.#client.takeSteps(this.#world.timestep);
    this.#frame = steps * this.#world.timestep;
    this.#placeHeld();
    this.#place(this.#client.toolPushes());
    for (const { body, impulse } of this.#client.takeImpulses(this.#frame)) {
      const pushed = this.#reported.get(body);
      if (!pushed?.isValid() || !pushed.isDynamic()) continue;
      this.#pushes.push([pushed, scale(1 / this.#frame, [...impulse])]);
    }
    this.#push(1);
    return steps;
  }

  /** After a frame: where bodies are. Throws where something in Rapier's state is out of a server's range. */
  send() {
    this.#takeBackPushes();
    if (this.#frame === 0) return;
    this.#forgetRemoved();
    this.#client.sample(this.#q, this.#v, this.#frame);
    this.#shapes.offer(this.#client);
    const bodies = this.#shapes.bodies();
    this.#client.place(this.#shapes.poses(bodies));
    this.#client.send([], this.#near(bodies));
  }

  /** Ends the session. */
  close() {
    this.#client.close();
    for (const { body } of this.#numbers.values()) if (body.isValid()) this.#letGo(body);
  }

  /** The newest news of the server, as haptic_state; null before the first drive(). */
  get state() {
    return this.#state;
  }

  /** Where the tool is: position (m) and quaternion (w, x, y, z). */
  get q() {
    return this.#q;
  }

  #colliders() {
    return Array.from({ length: this.#tool.numColliders() }, (_, i) => this.#tool.collider(i));
  }

  /** Of those that no joint holds, and that may move and turn freely: the server can move them. */
  #dynamicsOf(bodies) {
    const jointed = new Set();
    this.#world.impulseJoints.forEach((joint) => [joint.body1(), joint.body2()].forEach(({ handle }) => jointed.add(handle)));
    if (this.#world.multibodyJoints.len() > 0) bodies.forEach(({ handle }) => jointed.add(handle)); // Whose is not said.
    const gravity = list(this.#world.gravity);
    const told = bodies.filter(({ handle }) => !jointed.has(handle)).map((body) => (
      dynamicsOf(body, this.#numberOf(body), scale(this.#held.get(body.handle) ?? body.gravityScale(), gravity))))
      .filter((each) => each !== null);
    this.#told = new Set(told.map(({ body }) => body));
    return told;
  }

  /** The bodies that the hand holds where the server has them; they do not fall within a frame. */
  #placeHeld() {
    const numbered = new Map([...this.#numbers.values()].map(({ number, body }) => [number, body]));
    for (const { body: number, let_go: letGo, pose, velocity } of this.#client.takeHeld()) {
      const body = numbered.get(number);
      if (!body?.isValid() || !body.isDynamic()) continue;
      const [w, x, y, z] = pose.rotation;
      body.setTranslation(object(pose.position), true);
      body.setRotation({ w, x, y, z }, true);
      const spin = velocity.slice(3);
      const arm = subtract(list(body.worldCom()), [...pose.position]);
      body.setLinvel(object(add([...velocity.slice(0, 3)], cross(spin, arm))), true);
      body.setAngvel(object(spin), true);
      if (letGo) this.#letGo(body);
      else if (!this.#held.has(body.handle)) this.#held.set(body.handle, body.gravityScale());
      if (!letGo) body.setGravityScale(0, true);
    }
  }

  #letGo(body) {
    if (this.#held.has(body.handle)) body.setGravityScale(this.#held.get(body.handle), true);
    this.#held.delete(body.handle);
  }

  /** `collides`: whether it pushes what it touches in Rapier. */
  #place(collides) {
    const [w, x, y, z] = this.#q.slice(3);
    this.#tool.setTranslation(object(this.#q), true);
    this.#tool.setRotation({ w, x, y, z }, true);
    for (const collider of this.#colliders()) {
      const groups = collides ? this.#groups.get(collider.handle) ?? 0 : 0;
      if (collider.solverGroups() !== groups) collider.setSolverGroups(groups);
    }
  }

  #push(sign) {
    for (const [body, wrench] of this.#pushes) {
      if (!body.isValid()) continue;
      body.addForce(object(scale(sign, wrench.slice(0, 3))), true);
      body.addTorque(object(scale(sign, wrench.slice(3))), true);
    }
  }

  #takeBackPushes() {
    this.#push(-1);
    this.#pushes = [];
  }

  #numberOf(body) {
    if (!this.#numbers.has(body.handle)) this.#numbers.set(body.handle, { number: this.#nextNumber++, body });
    return this.#numbers.get(body.handle).number;
  }

  #forgetRemoved() {
    for (const [handle, { number, body }] of this.#numbers) {
      if (body.isValid()) continue;
      this.#reported.delete(number);
      this.#held.delete(handle);
      this.#numbers.delete(handle);
    }
  }

  /** Those that the tool may reach soon, the nearest first. All are kept awake, as many as can be are sent. */
  #near(bodies) {
    const delay = (this.#state?.round_trip ?? 0) + 2 * Math.max(this.#frame, this.#period);
    const speed = Math.max(Math.hypot(...this.#v.slice(0, 3)), USUAL_SPEED);
    const reach = Math.min(NEAR_BODIES + 4.5 * delay * speed, FARTHEST_BODIES);
    const isHeld = (body) => this.#state.holds && this.#told.has(this.#numberOf(body));
    const near = bodies.map(({ body, gap }) => gap < reach && body.isDynamic() && !isHeld(body) && body).filter(Boolean);
    near.forEach((body) => body.wakeUp());
    return near.slice(0, MAX_BODIES).map((body) => {
      const number = this.#numberOf(body);
      this.#reported.set(number, body);
      return describe(body, number, this.#world.gravity);
    });
  }
}
