// What is drawn over the bodies: contacts and deformation, force arrows, the hand's spring.

import * as THREE from 'three';
import { COLORS } from './colors.js';

export { COLORS };

const calm = window.matchMedia('(prefers-reduced-motion: reduce)');
const FLASH_MS = 300;
const MOST_GLOWS = 12;
const GLARING = 12;        // N
const QUIET_SWING = 1;     // N
const WILD_SWING = 25;     // N
export const TRACE_POINTS = 300;
const MAGNIFIED = 20;
const SAME_SIDE = 0.5;   // cosine between the normals of contacts that count as one
const UP = new THREE.Vector3(0, 1, 0);

const flat = (color, opacity = 1) => new THREE.MeshBasicMaterial({
  color, opacity, transparent: true, depthTest: false, depthWrite: false });
const vector = (values) => new THREE.Vector3(values[0], values[1], values[2]);

/** Discs on the constraint planes, their normals, and lines to the local contact points. */
export class Contacts {
  constructor(size) {
    this.size = size;
    this.group = new THREE.Group();
    this.geometry = new THREE.CylinderGeometry(0.19 * size, 0.19 * size, 0.04 * size, 20);
    this.materials = { predicted: flat(COLORS.predicted, 0.4), active: flat(COLORS.active),
                       ofBodies: flat(COLORS.ofBodies, 0.5), flash: flat(COLORS.flash) };
    this.discs = [];
    this.flashes = [];
    this.lines = new Lines();
    this.points = new Points(4, COLORS.active);
    this.group.add(this.lines.object, this.points.object);
    this.drawn = 0;
  }

  update(contacts, magnify, now) {
    for (const contact of contacts) {
      const collides = contact.state === 'colliding' && contact.of === 'tool_link';
      if (collides) this.flashes.push({ ...contact, until: now + FLASH_MS });
    }
    this.flashes = this.flashes.filter((flash) => flash.until > now).slice(-16);
    const bright = calm.matches || Math.floor(now / 60) % 2 === 0;
    this.drawn = 0;
    this.lines.clear();
    this.points.clear();
    for (const contact of contacts) this.#contact(contact, magnify);
    for (const flash of this.flashes) this.#disc(flash, bright ? 'flash' : 'active', 1.35);
    for (let i = this.drawn; i < this.discs.length; ++i) this.discs[i].visible = false;
    this.lines.commit();
    this.points.commit();
  }

  #contact(contact, magnify) {
    const active = contact.state === 'penetrating' || contact.state === 'colliding';
    if (contact.of !== 'tool_link') {
      this.#disc(contact, active ? 'ofBodies' : 'predicted', 0.6);
      return;
    }
    const color = active ? COLORS.active : COLORS.predicted;
    this.#disc(contact, active ? 'active' : 'predicted', 1);
    const c = vector(contact.c), n = vector(contact.n), p = vector(contact.p);
    this.lines.add(c, c.clone().addScaledVector(n, 0.5 * this.size), color);
    const shown = active && magnify ? c.clone().lerp(p, MAGNIFIED) : p;
    this.lines.add(c, shown, active ? COLORS.local : color);
    if (active) this.points.add(shown);
  }

  #disc(contact, material, scale) {
    const disc = this.discs[this.drawn] ?? this.#newDisc();
    disc.visible = true;
    disc.material = this.materials[material];
    disc.position.set(...contact.c);
    disc.quaternion.setFromUnitVectors(UP, vector(contact.n).normalize());
    disc.scale.set(scale, scale, scale);
    ++this.drawn;
  }

  #newDisc() {
    const disc = new THREE.Mesh(this.geometry);
    disc.renderOrder = 20;
    this.discs.push(disc);
    this.group.add(disc);
    return disc;
  }
}

/** A light at each contact of the tool, as bright as its force, in a halo that grows as the force shakes. */
export class Glows {
  constructor(size) {
    this.size = size;
    this.group = new THREE.Group();
    this.map = glowTexture();
    this.lights = Array.from({ length: MOST_GLOWS }, () => [this.#light(COLORS.flash, 18), this.#light(COLORS.glow, 19)]);
    this.shaking = 0;
  }

  /** `swing`: by how much the force of all went to and fro lately, N. */
  update(contacts, swing) {
    this.shaking = calm.matches ? 0.95 * this.shaking + 0.05 * swing : swing;
    const pressed = contacts.filter(({ of, f }) => of === 'tool_link' && vector(f).length() > 0);
    this.lights.forEach(([halo, core], i) => {
      const contact = pressed[i];
      halo.visible = Boolean(contact) && this.shaking > QUIET_SWING;
      core.visible = Boolean(contact);
      if (!contact) return;
      const strength = Math.min(1, Math.sqrt(vector(contact.f).length() / GLARING));
      const shaking = Math.min(1, this.shaking / WILD_SWING);
      this.#set(core, contact.p, 0.6 + 1.2 * strength, 0.35 + 0.6 * strength);
      this.#set(halo, contact.p, 1.5 + 2.5 * shaking, 0.25 + 0.65 * shaking);
    });
  }

  #set(light, at, radius, opacity) {
    light.position.set(...at);
    light.scale.setScalar(2 * radius * this.size);
    light.material.opacity = opacity;
  }

  #light(color, order) {
    const light = new THREE.Sprite(new THREE.SpriteMaterial({ map: this.map, color, depthTest: false, depthWrite: false }));
    light.renderOrder = order;
    light.visible = false;
    this.group.add(light);
    return light;
  }
}

/** White in the middle, nothing at the edge. */
function glowTexture(pixels = 64) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = pixels;
  const context = canvas.getContext('2d');
  const middle = pixels / 2;
  const gradient = context.createRadialGradient(middle, middle, 0, middle, middle, middle);
  gradient.addColorStop(0, '#ffff');
  gradient.addColorStop(0.35, '#fffa');
  gradient.addColorStop(1, '#fff0');
  context.fillStyle = gradient;
  context.fillRect(0, 0, pixels, pixels);
  return new THREE.CanvasTexture(canvas);
}

/** Where the tip of the force was in the last ticks: a point where it rests, a scribble where it shakes. */
export class Trace {
  constructor() {
    this.lines = new Lines(TRACE_POINTS);
    this.object = this.lines.object;
    this.swing = 0;      // N, of the component that changed most
  }

  /** `forces`: of consecutive ticks, N; drawn from the point `at`, none longer than `longest`, m. */
  update(at, forces, metresPerNewton, longest) {
    const origin = vector(at);
    const tips = forces.map((force) => vector(force).multiplyScalar(metresPerNewton).clampLength(0, longest).add(origin));
    this.lines.clear();
    for (let i = 1; i < tips.length; ++i) this.lines.add(tips[i - 1], tips[i], COLORS.trace);
    this.lines.commit();
    this.swing = Math.max(0, ...[0, 1, 2].map((axis) => rangeOf(forces.map((force) => force[axis]))));
  }
}

const rangeOf = (values) => (values.length ? Math.max(...values) - Math.min(...values) : 0);

/** The force on the tool and its opposite on the body, at each side of a body that the tool presses. */
export class ForcePairs {
  constructor(size) {
    this.size = size;
    this.group = new THREE.Group();
    this.arrows = [];    // on the tool and on the body, by turns
    this.drawn = 0;
    this.largest = 0;
  }

  update(contacts, metresPerNewton) {
    const pressed = pressedSides(contacts);
    this.drawn = pressed.length;
    this.largest = Math.max(0, ...pressed.map(({ force }) => force.length()));
    while (this.arrows.length < 2 * pressed.length) this.#addPair();
    for (const arrow of this.arrows) arrow.object.visible = false;
    pressed.forEach(({ at, force }, i) => {
      this.arrows[2 * i].set(at.toArray(), force.toArray(), metresPerNewton);
      this.arrows[2 * i + 1].set(at.toArray(), force.negate().toArray(), metresPerNewton);
    });
  }

  #addPair() {
    for (const color of [COLORS.F_env, COLORS.onBody]) {
      const arrow = new Arrow(color, 0.035 * this.size, 18);
      this.arrows.push(arrow);
      this.group.add(arrow.object);
    }
  }
}

/** The tool's contacts with each side of a movable body as one force (N, on the tool) at its centre of
 *  pressure; of a body that is pinched, two. */
function pressedSides(contacts) {
  const sides = [];
  for (const { of, body, n, p, f } of contacts) {
    const force = vector(f), normal = vector(n), weight = force.length();
    if (of !== 'tool_link' || body === null || weight === 0) continue;
    let side = sides.find((one) => one.body === body && one.normal.dot(normal) > SAME_SIDE);
    if (!side) {
      side = { body, normal, at: new THREE.Vector3(), force: new THREE.Vector3(), weight: 0 };
      sides.push(side);
    }
    side.at.addScaledVector(vector(p), weight);
    side.force.add(force);
    side.weight += weight;
  }
  return sides.map(({ at, force, weight }) => ({ at: at.divideScalar(weight), force }));
}

/** An arrow of unit thickness `width` from a point along a force. */
export class Arrow {
  constructor(color, width, order) {
    this.object = new THREE.Group();
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(width, width, 1, 8), flat(color));
    this.head = new THREE.Mesh(new THREE.ConeGeometry(2.6 * width, 6 * width, 12), flat(color));
    this.headLength = 6 * width;
    this.object.add(this.shaft, this.head);
    this.object.traverse((part) => { part.renderOrder = order; });
  }

  set(origin, force, metresPerNewton) {
    const direction = vector(force);
    const length = direction.length() * metresPerNewton;
    this.object.visible = length > 0.3 * this.headLength;
    if (!this.object.visible) return;
    this.object.position.set(origin[0], origin[1], origin[2]);
    this.object.quaternion.setFromUnitVectors(UP, direction.normalize());
    const shaft = Math.max(length - this.headLength, 1e-6);
    this.shaft.scale.y = shaft;
    this.shaft.position.y = shaft / 2;
    this.head.scale.setScalar(Math.min(1, length / this.headLength));
    this.head.position.y = shaft + (this.headLength * this.head.scale.y) / 2;
  }
}

/** A zigzag from the handle to the hand's target. */
export class Spring {
  constructor(size) {
    this.size = size;
    this.object = new THREE.Group();
    this.line = new Lines();
    this.target = new THREE.Mesh(new THREE.TorusGeometry(0.16 * size, 0.025 * size, 6, 24), flat(COLORS.spring));
    this.target.renderOrder = 24;
    this.object.add(this.line.object, this.target);
    this.object.visible = false;
  }

  update(from, target, camera) {
    this.object.visible = Boolean(target);
    if (!target) return;
    const begin = vector(from), end = vector(target);
    const along = end.clone().sub(begin);
    const view = camera.getWorldDirection(new THREE.Vector3());
    const across = along.clone().cross(view).normalize().multiplyScalar(0.09 * this.size);
    const turns = 12;
    this.line.clear();
    let last = begin;
    for (let i = 1; i <= turns; ++i) {
      const point = begin.clone().addScaledVector(along, i / turns);
      if (i < turns) point.addScaledVector(across, i % 2 ? 1 : -1);
      this.line.add(last, point, COLORS.spring);
      last = point;
    }
    this.line.commit();
    this.target.position.copy(end);
    this.target.quaternion.copy(camera.quaternion);
  }
}

/** The device's handle: a ball with a bar along its x axis, so that rotation shows. */
export function handleObject(size) {
  const group = new THREE.Group();
  const ball = new THREE.Mesh(new THREE.SphereGeometry(0.13 * size, 20, 12), flat(COLORS.device));
  const bar = new THREE.Mesh(new THREE.BoxGeometry(0.5 * size, 0.05 * size, 0.05 * size), flat(COLORS.device));
  const dot = new THREE.Mesh(new THREE.SphereGeometry(0.05 * size, 12, 8), flat(COLORS.handleDot));
  group.add(ball, bar, dot);
  group.children.forEach((part, i) => { part.renderOrder = 21 + i; });
  return group;
}

/** Coloured line segments that change every frame. */
class Lines {
  constructor(limit = 256) {
    this.limit = limit;
    this.geometry = new THREE.BufferGeometry();
    this.position = new THREE.BufferAttribute(new Float32Array(limit * 6), 3);
    this.color = new THREE.BufferAttribute(new Float32Array(limit * 6), 3);
    this.geometry.setAttribute('position', this.position);
    this.geometry.setAttribute('color', this.color);
    const material = new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false, transparent: true });
    this.object = new THREE.LineSegments(this.geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 22;
    this.paint = new THREE.Color();
    this.count = 0;
  }

  clear() {
    this.count = 0;
  }

  add(from, to, color) {
    if (this.count === this.limit) return;
    this.paint.set(color);
    for (const [i, point] of [from, to].entries()) {
      this.position.setXYZ(2 * this.count + i, point.x, point.y, point.z);
      this.color.setXYZ(2 * this.count + i, this.paint.r, this.paint.g, this.paint.b);
    }
    ++this.count;
  }

  commit() {
    this.geometry.setDrawRange(0, 2 * this.count);
    this.position.needsUpdate = true;
    this.color.needsUpdate = true;
  }
}

/** Square points of a fixed size in pixels. */
class Points {
  constructor(pixels, color, limit = 64) {
    this.limit = limit;
    this.geometry = new THREE.BufferGeometry();
    this.position = new THREE.BufferAttribute(new Float32Array(limit * 3), 3);
    this.geometry.setAttribute('position', this.position);
    this.object = new THREE.Points(this.geometry, new THREE.PointsMaterial({
      color, size: pixels, sizeAttenuation: false, depthTest: false, transparent: true }));
    this.object.frustumCulled = false;
    this.object.renderOrder = 23;
    this.count = 0;
  }

  clear() {
    this.count = 0;
  }

  add(point) {
    if (this.count < this.limit) this.position.setXYZ(this.count++, point.x, point.y, point.z);
  }

  commit() {
    this.geometry.setDrawRange(0, this.count);
    this.position.needsUpdate = true;
  }
}
