// What lights the scene: a sky, and a lamp that throws soft shadows. Light is worked out at corners and only the
// shadow for each pixel: the processor can afford that where there is no graphics card.

import * as THREE from 'three';
import { COLORS } from './colors.js';

const LAMP_FROM = [-0.5, 0.6, 1.3];
// Pixels of the shadow map, pixels of it between two looks at it, and looks to each side of a point.
const SHADOW = { software: { size: 512, spread: 1.5, looks: 1 }, hardware: { size: 2048, spread: 1.6, looks: 2 } };
const CASTER_LAYER = 1;
const GROUND_RADIUS = 14;         // radii of the world
const HAZE = [3, 13];             // from and to where the ground fades into the background, radii

const VERTEX = `
  uniform vec3 color, lamp, up;
  uniform mat4 toShadow;
  uniform float inset;
  varying vec3 lit, dark, shadowAt;
  varying vec2 place;
  vec3 encoded(vec3 light) { return pow(light, vec3(0.4545)); }
  void main() {
    vec4 world = modelMatrix * vec4(position, 1.0);
    vec3 n = normalize(mat3(modelMatrix) * normal);
    float sky = mix(0.34, 0.66, 0.5 + 0.5 * dot(n, up));
    dark = encoded(color * sky);
    lit = encoded(color * (sky + 0.39 * max(0.0, dot(n, lamp))));
    shadowAt = (toShadow * vec4(world.xyz + inset * n, 1.0)).xyz;
    place = position.xy;
    gl_Position = projectionMatrix * viewMatrix * world;
  }`;

const FRAGMENT = `
  uniform float opacity, pixel;
  uniform lowp sampler2DShadow shadow;
  uniform vec3 haze;
  uniform vec2 hazeRange;
  varying vec3 lit, dark, shadowAt;
  varying vec2 place;
  float look(int i, int j) { return texture(shadow, shadowAt + pixel * vec3(float(i) + 0.5, float(j) + 0.5, 0.0)); }
  float light() {
    vec2 aside = abs(shadowAt.xy - 0.5);
    if (max(aside.x, aside.y) > 0.5 || lit.g - dark.g < 0.01) return 1.0;
    // Most points are far from any edge of a shadow: two corners say so.
    float corner = look(-LOOKS, -LOOKS);
    if ((corner == 0.0 || corner == 1.0) && corner == look(LOOKS - 1, LOOKS - 1)) return corner;
    float sum = 0.0;
    for (int i = -LOOKS; i < LOOKS; ++i) {
      for (int j = -LOOKS; j < LOOKS; ++j) sum += look(i, j);
    }
    return sum / float(4 * LOOKS * LOOKS);
  }
  void main() {
    vec3 color = LOOKS > 0 ? mix(dark, lit, light()) : lit;
    if (GROUND > 0) color = mix(color, haze, smoothstep(hazeRange.x, hazeRange.y, length(place)));
    gl_FragColor = vec4(color, opacity);
  }`;

/** What the page writes for a colour, without the conversion that three makes. */
const asWritten = (color) => new THREE.Color().setStyle(color, THREE.LinearSRGBColorSpace);

export class Light {
  /** `hardware`: whether a graphics card draws. */
  constructor(root, hardware) {
    this.root = root;
    this.shadow = SHADOW[hardware ? 'hardware' : 'software'];
    this.shadows = true;
    this.receivers = [];       // materials with shadows on them
    this.camera = new THREE.OrthographicCamera();
    this.camera.layers.set(CASTER_LAYER);
    this.map = shadowMap(this.shadow.size);
    this.caster = new THREE.MeshBasicMaterial({ colorWrite: false });
    this.shared = {
      lamp: { value: new THREE.Vector3() }, up: { value: new THREE.Vector3() }, toShadow: { value: new THREE.Matrix4() },
      inset: { value: 0 }, pixel: { value: this.shadow.spread / this.shadow.size }, shadow: { value: this.map.depthTexture },
      haze: { value: asWritten(COLORS.background) }, hazeRange: { value: new THREE.Vector2(...HAZE) },
    };
    this.ground = new THREE.Mesh(new THREE.CircleGeometry(GROUND_RADIUS, 64));
    root.add(this.ground);
  }

  /** In the colours in effect; what was made before is not painted any more. */
  paint() {
    this.receivers = [];
    this.shared.haze.value = asWritten(COLORS.background);
    this.ground.material = this.material(COLORS.ground, { ground: true });
  }

  setShadows(on) {
    this.shadows = on;
    for (const material of this.receivers) {
      material.defines.LOOKS = this.#looks;
      material.needsUpdate = true;
    }
  }

  get #looks() {
    return this.shadows ? this.shadow.looks : 0;
  }

  /** Of bodies; `ground`: of a floor whose centre is its frame's, and which fades with the distance in its unit. */
  material(color, { opacity = 1, ground = false, ...others } = {}) {
    const made = new THREE.ShaderMaterial({
      ...others, transparent: opacity < 1, vertexShader: VERTEX, fragmentShader: FRAGMENT,
      defines: { LOOKS: opacity === 1 ? this.#looks : 0, GROUND: Number(ground) },
      uniforms: { ...this.shared, color: { value: new THREE.Color(color) }, opacity: { value: opacity } },
    });
    if (opacity === 1) this.receivers.push(made);
    return made;
  }

  /** `mesh` throws a shadow. */
  cast(mesh) {
    mesh.layers.enable(CASTER_LAYER);
  }

  /** For bodies within `bounds`, seen from above (1) or, in planar worlds, from below (-1); `bare`: they have no floor. */
  fit(bounds, above, bare) {
    const center = bounds.getCenter(new THREE.Vector3());
    const radius = bounds.getSize(new THREE.Vector3()).length() / 2;
    const from = new THREE.Vector3(LAMP_FROM[0], above * LAMP_FROM[1], above * LAMP_FROM[2]).normalize();
    this.shared.lamp.value.copy(from);
    this.shared.up.value.set(0, 0, above);
    this.shared.inset.value = 0.012 * radius;
    Object.assign(this.camera, { left: -radius, right: radius, bottom: -radius, top: radius, near: radius, far: 5 * radius });
    this.camera.position.copy(center).addScaledVector(from, 3 * radius);
    this.camera.lookAt(center);
    this.camera.updateMatrixWorld();
    this.camera.updateProjectionMatrix();
    this.shared.toShadow.value.makeScale(0.5, 0.5, 0.5).setPosition(0.5, 0.5, 0.5)
      .multiply(this.camera.projectionMatrix).multiply(this.camera.matrixWorldInverse);
    this.ground.visible = bare;
    this.ground.position.set(center.x, center.y, above > 0 ? bounds.min.z - 0.01 * radius : bounds.max.z + 0.01 * radius);
    this.ground.rotation.x = above > 0 ? 0 : Math.PI;
    this.ground.scale.setScalar(radius);
  }

  /** Before a picture in which bodies have moved. */
  drawShadows(renderer) {
    if (!this.shadows) return;
    const { background } = this.root;
    Object.assign(this.root, { background: null, overrideMaterial: this.caster });
    renderer.setRenderTarget(this.map);
    renderer.render(this.root, this.camera);
    renderer.setRenderTarget(null);
    Object.assign(this.root, { background, overrideMaterial: null });
  }
}

/** Looks at its depth texture say how much of four pixels is nearer to the lamp. */
function shadowMap(size) {
  const depthTexture = new THREE.DepthTexture(size, size);
  Object.assign(depthTexture, { compareFunction: THREE.LessEqualCompare, minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter });
  return new THREE.WebGLRenderTarget(size, size, { depthTexture });
}
