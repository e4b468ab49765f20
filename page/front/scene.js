// What the scene shows: world, tool, proxy, handle, contacts and forces, drawn with three.js.

import * as THREE from 'three';
import { COLORS, onColors } from './colors.js';
import { magnitude, niceAbove } from './format.js';
import { Arrow, Contacts, ForcePairs, Glows, Spring, Trace, handleObject } from './overlays.js';
import { Light } from './light.js';
import { Quality } from './quality.js';
import { boundsOf, bodyObject, dispose, look, place } from './shapes.js';
import { View } from './view.js';

const PROXY_DIFFERS = { metres: 1e-4, radians: 2e-3 };
const PICK_PIXELS = { mouse: 26, touch: 44 };
const OVERLAY_SHARE = 0.12;   // of the world's radius that handle, contacts and arrows are sized by, at most
const MOST_BODIES = 1000;     // that are all drawn
const NEARBY = 8;             // of more, those so near to the tool, in radii of it
const LONGEST_TRACE = 4.5;     // sizes of the overlays
const FLOOR_COSINE = 0.9;     // of the angle between a floor's normal and up
const PLAIN_ARROW = 1.8;      // times as large, where it is the only one
const FORCES = ['F_env', 'F_hand', 'F_command'];

/** What draws WebGL here: 'none', 'software' or 'hardware'. */
export function graphics() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) return 'none';
  const masked = gl.getParameter(gl.RENDERER) === 'WebKit WebGL';
  const extension = masked && gl.getExtension('WEBGL_debug_renderer_info');
  const name = gl.getParameter(extension ? extension.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name) ? 'software' : 'hardware';
}

const differ = (a, b) => a.some((value, i) => value !== b[i]);

function radiusOf(objects) {
  return boundsOf(objects).getSize(new THREE.Vector3()).length() / 2;
}

/** What there is in a world, without where it is. */
function contentsOf({ bodies }) {
  return JSON.stringify(bodies.map(({ name, fixed, shapes }) => [name, fixed, shapes.length]));
}

export class Scene {
  /** `hardware`: whether a graphics card draws; without one, pixels are dear. */
  constructor(container, hardware) {
    this.container = container;
    this.renderer = new THREE.WebGLRenderer({ antialias: hardware });
    this.pixelRatio = hardware ? Math.min(window.devicePixelRatio, 2) : 1;
    container.prepend(this.renderer.domElement);
    this.root = new THREE.Scene();
    this.light = new Light(this.root, hardware);
    this.quality = new Quality((level) => this.#take(level));
    this.#paint();
    onColors(() => this.#paintAgain());
    this.raycaster = new THREE.Raycaster();
    this.raycaster.params.Line.threshold = 0;   // m: edges are met within 1 m otherwise
    this.magnify = false;
    this.showsBodies = true;   // the contacts of bodies without the tool
    this.plain = false;        // what touches and its force alone
    this.forces = [];          // N, of the latest ticks, oldest first: their trace is drawn
    this.drawn = 0;
    this.peakForce = 1;
    this.world = null;
    this.width = this.height = 1;
    new ResizeObserver(() => this.#resize()).observe(container);
  }

  /** Builds the bodies of a `world` message. The view stays in the same scene, but for more bodies than there were, where
   *  nobody has moved it. */
  setWorld(world) {
    const same = this.world !== null && this.world.scene === world.scene && Boolean(this.world.planar) === Boolean(world.planar);
    const more = !same || contentsOf(this.world) !== contentsOf(world);
    for (const object of this.content?.children.slice() ?? []) dispose(object);
    this.content?.removeFromParent();
    this.world = world;
    this.peakForce = 1;
    this.content = new THREE.Group();
    this.bodies = world.bodies.map((body) => this.#addBody(body));
    this.moving = this.bodies.filter((_, i) => !world.bodies[i].fixed);
    this.tools = world.tool_links.map((i) => this.bodies[i]);
    this.tools.forEach((tool) => this.#show(tool));
    this.nearby = this.bodies.length > MOST_BODIES ? NEARBY * radiusOf(this.tools) : Infinity;
    this.#showNear();
    this.overlays = this.#add(new THREE.Group());
    this.overlays.visible = false;
    this.#addOverlays();
    this.root.add(this.content);
    this.poses = null;
    this.moved = true;
    this.#fitLight();
    if (!same) {
      this.#newView(Boolean(world.planar));
      this.quality.renew();
    } else if (more && !this.view.touched) {
      this.fit();
    }
  }

  setFrame(frame) {
    if (!this.world || frame.bodies.length !== this.moving.length) return;
    this.frame = frame;
    this.changed = true;
    this.moved ||= !this.poses || frame.bodies.some((pose, i) => differ(pose, this.poses[i]));
    this.poses = frame.bodies;
    frame.bodies.forEach((pose, i) => place(this.moving[i], pose));
    if (this.nearby < Infinity) this.#showNear();
    frame.proxy?.forEach((pose, i) => this.#placeProxy(i, pose));
    if (frame.device) place(this.handle, frame.device);
  }

  /** Whether the device is where the last frame says; otherwise nothing that depends on it is shown. */
  get live() {
    return Boolean(this.overlays?.visible && this.frame.device);
  }

  /** Draws a picture if anything changed; `target` is where the hand pulls to, or null; `live`: whether
   *  the last frame is up to date; `pulled`: as bodyAt() with its own target, or none. */
  draw(target, live, pulled) {
    if (this.world) this.#showOverlays(live && Boolean(this.frame?.device));
    const due = Boolean(this.world) && Boolean(this.changed || target || pulled || this.view.moved || this.contacts.flashes.length);
    this.quality.count(performance.now(), due);
    if (!due) return;
    this.changed = this.view.moved = false;
    const { camera } = this.view;
    if (this.live) {
      const contacts = this.frame.contacts ?? [];
      const shown = contacts.filter(({ of, s }) => (this.plain ? of === 'tool_link' && s <= 0 : this.showsBodies || of === 'tool_link'));
      this.contacts.update(shown, this.magnify, performance.now());
      this.#drawForces(this.frame);
      this.pairs.update(this.plain ? [] : contacts, this.metresPerNewton);
      this.spring.update(this.frame.device, target, camera);
      this.pullSpring.update(pulled ? this.placeOf(pulled) : null, pulled?.target, camera);
      this.trace.update(this.frame.device, this.forces, this.metresPerNewton, LONGEST_TRACE * this.overlaySize);
      this.glows.update(contacts, this.trace.swing);
      if (target) this.view.follow(this.frame.device);
    }
    if (this.moved) this.light.drawShadows(this.renderer);
    this.moved = false;
    this.renderer.render(this.root, camera);
    ++this.drawn;
  }

  /** What is to be seen, as a PNG. */
  picture() {
    if (this.view) this.renderer.render(this.root, this.view.camera);   // Its pixels are kept for this turn alone.
    return new Promise((resolve) => this.renderer.domElement.toBlob(resolve, 'image/png'));
  }

  setPlain(on) {
    this.plain = on;
    this.changed = true;
  }

  fit() {
    if (this.view) this.view.fit(this.#action(), this.aspect);
  }

  /** Where a point of the world is on the page, [clientX, clientY]. */
  project(point) {
    if (!this.view) return null;
    const { left, top } = this.renderer.domElement.getBoundingClientRect();
    const [x, y] = this.projectInside(point);
    return [left + x, top + y];
  }

  /** The same from the scene's upper left corner. */
  projectInside(point) {
    const { camera } = this.view;
    camera.updateMatrixWorld();
    const p = new THREE.Vector3(...point).project(camera);
    return [((p.x + 1) / 2) * this.width, ((1 - p.y) / 2) * this.height];
  }

  /** Whether a pointer there means the handle: near it, or on the tool. */
  picks(clientX, clientY, touch) {
    if (!this.live) return false;
    const [x, y] = this.project(this.frame.device);
    if (Math.hypot(x - clientX, y - clientY) < PICK_PIXELS[touch ? 'touch' : 'mouse']) return true;
    this.#aim(clientX, clientY);
    return this.raycaster.intersectObjects(this.tools.concat(this.proxies.filter((p) => p.visible))).length > 0;
  }

  /** The loose body under the pointer that a page may pull: {body, point}, its number and the point in its frame, or null. */
  bodyAt(clientX, clientY) {
    if (!this.live || !this.world.ranges?.pace) return null;
    this.#aim(clientX, clientY);
    const [hit] = this.raycaster.intersectObjects(this.bodies.filter((body) => body.visible));
    const body = this.bodies.findIndex((one) => hit && one.getObjectById(hit.object.id));
    if (body < 0 || this.world.bodies[body].fixed || this.world.bodies[body].tool) return null;
    return { body, point: this.bodies[body].worldToLocal(hit.point.clone()).toArray() };
  }

  /** Where it is in the world. */
  placeOf({ body, point }) {
    return this.bodies[body].localToWorld(new THREE.Vector3(...point)).toArray();
  }

  /** The point under the pointer in the plane of motion through `through`; null if it has none. */
  pointInPlane(clientX, clientY, through) {
    this.#aim(clientX, clientY);
    const normal = this.viewAxes().away;
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, new THREE.Vector3(...through));
    const hit = this.raycaster.ray.intersectPlane(plane, new THREE.Vector3());
    return hit && hit.toArray();
  }

  /** Unit vectors of the view in the world: right, up and away from the viewer. In a planar world away
   *  is normal to the plane, and the others are in it. */
  viewAxes() {
    const { matrixWorld } = this.view.camera;
    const [right, up, near] = [0, 1, 2].map((i) => new THREE.Vector3().setFromMatrixColumn(matrixWorld, i));
    if (!this.world.planar) return { right, up, away: near.negate() };
    const away = new THREE.Vector3(0, 0, -Math.sign(near.z) || 1);
    right.setZ(0).normalize();
    return { right, up: right.clone().cross(away), away };
  }

  /** Pixels for a metre at the handle. */
  pixelsPerMetre() {
    const at = new THREE.Vector3(...this.frame.device);
    const aside = new THREE.Vector3().setFromMatrixColumn(this.view.camera.matrixWorld, 0);
    const [x0, y0] = this.projectInside(at.toArray());
    const [x1, y1] = this.projectInside(at.addScaledVector(aside, 0.01).toArray());
    return Math.hypot(x1 - x0, y1 - y0) / 0.01;
  }

  info() {
    return { mode: this.view?.mode, quality: this.quality.level.name, live: this.live, discs: this.contacts?.drawn ?? 0,
             pairs: this.pairs?.drawn ?? 0,
             metresPerNewton: this.metresPerNewton,
             proxyVisible: Boolean(this.proxies?.some((proxy) => proxy.visible)) };
  }

  /** The largest force on a pressed body, N. */
  get forceOnBodies() {
    return this.pairs.largest;
  }

  get aspect() {
    return this.width / this.height;
  }

  /** One of LEVELS. */
  #take({ shadows, scale }) {
    this.renderer.setPixelRatio(this.pixelRatio * scale);
    this.light.setShadows(shadows);
    this.changed = this.moved = true;
  }

  /** Background, light and materials, in the colours in effect. */
  #paint() {
    this.root.background = new THREE.Color(COLORS.background);
    this.light.paint();
    this.looks = {
      fixed: look(this.light, COLORS.fixed), movable: look(this.light, COLORS.movable),
      tool: look(this.light, COLORS.tool, { order: 1 }),
      proxy: look(this.light, COLORS.proxy, { opacity: 0.25, ghost: true, order: 10 }),
    };
  }

  #paintAgain() {
    const { frame } = this;
    this.#paint();
    if (!this.world) return;
    const { visible } = this.overlays;
    this.setWorld(this.world);
    this.overlays.visible = visible;
    if (frame) this.setFrame(frame);
  }

  #aim(clientX, clientY) {
    const { left, top, width, height } = this.renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
    this.view.camera.updateMatrixWorld();
    this.raycaster.setFromCamera(at, this.view.camera);
  }

  #add(object) {
    this.content.add(object);
    return object;
  }

  #addBody(body) {
    const kind = body.tool ? 'tool' : body.fixed ? 'fixed' : 'movable';
    const object = this.#add(new THREE.Group());
    const isFloor = (shape) => this.#isFloor(body, shape);
    object.userData.draw = () => object.add(...bodyObject(body.shapes, this.looks[kind], isFloor).children);
    object.visible = false;
    place(object, body.pose);
    return object;
  }

  /** 1: seen from above; -1: a planar world, seen from below. */
  get #above() {
    return this.world.planar ? -1 : 1;
  }

  #isFloor(body, shape) {
    if (!body.fixed || shape.kind !== 'plane') return false;
    const normal = new THREE.Vector3(0, 0, 1);
    for (const { pose } of [shape, body]) normal.applyQuaternion(new THREE.Quaternion(pose[4], pose[5], pose[6], pose[3]));
    return normal.z * this.#above > FLOOR_COSINE;
  }

  #fitLight() {
    const bare = !this.world.bodies.some((body) => body.shapes.some((shape) => this.#isFloor(body, shape)));
    this.light.fit(this.#action(), this.#above, bare);
  }

  /** What there is to see: bodies that are drawn. */
  #action() {
    return boundsOf(this.bodies.filter((body) => body.visible));
  }

  /** Where there are very many bodies, those near the tool and infinite ones are drawn; each is made when it first is. */
  #showNear() {
    this.bodies.forEach((body, i) => {
      const near = this.tools.some((tool) => tool.position.distanceTo(body.position) < this.nearby);
      if (near || this.world.bodies[i].shapes.some(({ kind }) => kind === 'plane')) this.#show(body);
      else body.visible = false;
    });
  }

  #show(body) {
    if (body.children.length === 0) body.userData.draw();
    body.visible = true;
  }

  #addOverlays() {
    const size = Math.min(radiusOf(this.tools), OVERLAY_SHARE * radiusOf(this.bodies));
    this.overlaySize = size;
    this.proxies = this.world.tool_links.map((i) => bodyObject(this.world.bodies[i].shapes, this.looks.proxy));
    this.handle = handleObject(size);
    this.contacts = new Contacts(size);
    this.pairs = new ForcePairs(size);
    this.spring = new Spring(size);
    this.pullSpring = new Spring(size);
    this.glows = new Glows(size);
    this.trace = new Trace();
    this.arrows = FORCES.map((name, i) => new Arrow(COLORS[name], size * [0.05, 0.05, 0.024][i], 15 + i));
    this.overlays.add(...this.proxies, this.handle, this.glows.group, this.trace.object, this.contacts.group, this.pairs.group,
                      this.spring.object, this.pullSpring.object, ...this.arrows.map((arrow) => arrow.object));
  }

  #showOverlays(on) {
    if (this.overlays.visible === on) return;
    this.overlays.visible = on;
    this.changed = true;
  }

  #newView(planar) {
    this.view?.dispose();
    this.view = new View(this.renderer.domElement, planar);
    this.#resize();
    this.fit();
  }

  #placeProxy(i, pose) {
    const proxy = this.proxies[i], tool = this.tools[i];
    if (!proxy) return;
    place(proxy, pose);
    proxy.visible = !this.plain && (proxy.position.distanceTo(tool.position) > PROXY_DIFFERS.metres
      || proxy.quaternion.angleTo(tool.quaternion) > PROXY_DIFFERS.radians);
  }

  /** Arrows share one scale that follows the largest force, in steps of 1, 2, 5. */
  #drawForces(frame) {
    const largest = Math.max(...FORCES.map((name) => magnitude(frame[name])));
    this.peakForce = Math.max(largest, 0.995 * this.peakForce, 1);
    const scale = this.plain ? PLAIN_ARROW : 1;
    this.metresPerNewton = (2.2 * scale * this.overlaySize) / niceAbove(this.peakForce);
    this.arrows.forEach((arrow, i) => {
      const force = this.plain && i > 0 ? null : frame[FORCES[i]];
      arrow.object.visible = Boolean(force);
      arrow.object.scale.setScalar(scale);
      if (force) arrow.set(frame.device, force, this.metresPerNewton / scale);
    });
  }

  #resize() {
    const { clientWidth, clientHeight } = this.container;
    if (!clientWidth || !clientHeight) return;
    this.width = clientWidth;
    this.height = clientHeight;
    this.renderer.setSize(clientWidth, clientHeight);
    this.view?.resize(this.aspect);
    this.changed = true;
  }
}
