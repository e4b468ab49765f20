// A person's mouse or finger on a loose body: it follows the pointer as on a spring, with a limited force.

const SEND_MS = 1000 / 60;

export class Pull {
  /** `busy()`: whether the pointer is taken by something else. */
  constructor(surface, scene, send, busy) {
    Object.assign(this, { surface, scene, send, busy });
    surface.addEventListener('pointerdown', (event) => this.#down(event), true);   // before it orbits the camera
    surface.addEventListener('pointermove', (event) => this.#move(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) surface.addEventListener(end, (event) => this.#end(event));
    setInterval(() => this.#repeat(), SEND_MS);
  }

  #down(event) {
    if (event.button !== 0 || this.held || this.busy() || event.target.tagName !== 'CANVAS') return;
    const held = this.scene.bodyAt(event.clientX, event.clientY);
    if (!held) return;
    event.stopPropagation();
    event.target.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.held = { ...held, target: this.scene.placeOf(held) };
  }

  #move(event) {
    if (!this.held || event.pointerId !== this.pointer) return;
    this.held.target = this.scene.pointInPlane(event.clientX, event.clientY, this.held.target) ?? this.held.target;
  }

  #end(event) {
    if (event.pointerId === this.pointer) this.release();
  }

  #repeat() {
    if (this.held) this.send({ type: 'pull', hold: true, body: this.held.body, point: this.held.point, target: this.held.target });
  }

  release() {
    if (!this.held) return;
    this.held = this.pointer = undefined;
    this.send({ type: 'pull', hold: false });
  }
}
