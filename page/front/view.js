// Where the scene is seen from: plan view (orthographic, from above) or 3-D (perspective).

import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const MARGIN = 1.06;
const FOLLOWED_FROM = new THREE.Vector3(-0.88, -0.88, -1), FOLLOWED_TO = new THREE.Vector3(0.88, 0.88, 1);
const HALF_FIELD = Math.tan(THREE.MathUtils.degToRad(20));  // of the shorter side, in 3-D

export class View {
  /** A planar world's +z points away from the viewer, so that x points right and y down. */
  constructor(element, planar) {
    const above = planar ? -1 : 1;
    this.planar = planar;
    this.plan = new THREE.OrthographicCamera();
    this.plan.up.set(0, above, 0);
    this.planFrom = new THREE.Vector3(0, 0, above);
    this.space = new THREE.PerspectiveCamera(40, 1, 0.005, 20);
    this.space.up.set(0, 0, above);
    this.spaceFrom = new THREE.Vector3(0.38, -0.82 * above, 0.62 * above).normalize();
    this.planOrbit = new OrbitControls(this.plan, element);
    this.planOrbit.enableRotate = false;
    this.planOrbit.mouseButtons = { LEFT: THREE.MOUSE.PAN, MIDDLE: THREE.MOUSE.DOLLY, RIGHT: THREE.MOUSE.PAN };
    this.planOrbit.touches = { ONE: THREE.TOUCH.PAN, TWO: THREE.TOUCH.DOLLY_PAN };
    this.spaceOrbit = new OrbitControls(this.space, element);
    for (const orbit of [this.planOrbit, this.spaceOrbit]) {
      orbit.addEventListener('change', () => { this.moved = true; });
      orbit.addEventListener('start', () => { this.touched = true; });
    }
    this.show(planar ? 'plan' : 'space');
  }

  get camera() {
    return this.mode === 'plan' ? this.plan : this.space;
  }

  show(mode) {
    this.mode = mode;
    this.moved = true;      // since the last picture
    this.planOrbit.enabled = mode === 'plan';
    this.spaceOrbit.enabled = mode === 'space';
  }

  /** Moves with a point that leaves the picture. */
  follow(point) {
    const { camera } = this;
    camera.updateMatrixWorld();
    const seen = new THREE.Vector3(...point).project(camera);
    const kept = seen.clone().clamp(FOLLOWED_FROM, FOLLOWED_TO);
    if (seen.x === kept.x && seen.y === kept.y) return;
    kept.z = seen.z;
    const step = seen.unproject(camera).sub(kept.unproject(camera));
    camera.position.add(step);
    (this.mode === 'plan' ? this.planOrbit : this.spaceOrbit).target.add(step);
    this.moved = true;
  }

  /** All of `bounds` in both cameras, for a picture of `aspect` (width / height), now and when it is resized. */
  fit(bounds, aspect) {
    const center = bounds.getCenter(new THREE.Vector3());
    this.size = bounds.getSize(new THREE.Vector3());
    this.touched = false;     // by a person
    const radius = this.size.length() / 2;
    this.plan.position.copy(center).addScaledVector(this.planFrom, 4 * radius);
    this.plan.near = 0;
    this.plan.far = 8 * radius;
    this.plan.zoom = 1;
    this.space.position.copy(center).addScaledVector(this.spaceFrom, this.#distanceTo(bounds));
    this.planOrbit.target.copy(center);
    this.spaceOrbit.target.copy(center);
    this.resize(aspect);
    this.planOrbit.update();
    this.spaceOrbit.update();
    this.moved = true;
  }

  /** From its middle, that shows all corners of `bounds` in the shorter side of the picture. */
  #distanceTo(bounds) {
    const right = this.space.up.clone().cross(this.spaceFrom).normalize();
    const up = this.spaceFrom.clone().cross(right);
    const center = bounds.getCenter(new THREE.Vector3());
    const distances = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => {
      const corner = new THREE.Vector3(...['x', 'y', 'z'].map((axis, j) => bounds[(i >> j) & 1 ? 'max' : 'min'][axis])).sub(center);
      const aside = Math.max(Math.abs(corner.dot(right)), Math.abs(corner.dot(up)));
      return corner.dot(this.spaceFrom) + (aside * MARGIN) / HALF_FIELD;
    });
    return Math.max(...distances);
  }

  resize(aspect) {
    if (this.size) {
      const top = (Math.max(this.size.y, this.size.x / aspect) / 2) * MARGIN;
      Object.assign(this.plan, { top, bottom: -top, left: -top * aspect, right: top * aspect });
    }
    this.space.aspect = aspect;
    this.space.fov = THREE.MathUtils.radToDeg(2 * Math.atan(HALF_FIELD / Math.min(1, aspect)));
    this.plan.updateProjectionMatrix();
    this.space.updateProjectionMatrix();
  }

  dispose() {
    this.planOrbit.dispose();
    this.spaceOrbit.dispose();
  }
}
