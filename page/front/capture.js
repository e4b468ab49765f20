// A picture and a short film of the scene, as files.

import { download } from './download.js';

const FILM_RATE = 30;             // frames/s
const FILM_BITS = 4e6;            // a second
const LONGEST_FILM_MS = 60000;
const FILM_TYPES = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm'];

/** `name` of the scene, which may be anything. */
const fileName = (name, ending) => `${(name || 'scene').replace(/[^\w-]+/g, '_')}.${ending}`;

export async function savePicture(scene, name) {
  download(await scene.picture(), fileName(name, 'png'));
}

export class Film {
  /** `changed(on)` is called when a film begins or ends. */
  constructor(canvas, changed) {
    Object.assign(this, { canvas, changed, recorder: null });
  }

  static get possible() {
    return Boolean(window.MediaRecorder && HTMLCanvasElement.prototype.captureStream);
  }

  /** Begins a film; or ends it, which saves it. */
  toggle(name) {
    if (this.recorder) this.recorder.stop();
    else this.#begin(name);
  }

  #begin(name) {
    const mimeType = FILM_TYPES.find((type) => MediaRecorder.isTypeSupported(type));
    const stream = this.canvas.captureStream(FILM_RATE);
    const parts = [];
    this.recorder = new MediaRecorder(stream, { mimeType, videoBitsPerSecond: FILM_BITS });
    this.recorder.ondataavailable = ({ data }) => parts.push(data);
    const longest = setTimeout(() => this.recorder?.stop(), LONGEST_FILM_MS);
    this.recorder.onstop = () => {
      clearTimeout(longest);
      for (const track of stream.getTracks()) track.stop();
      this.recorder = null;
      this.changed(false);
      download(new Blob(parts, { type: 'video/webm' }), fileName(name, 'webm'));
    };
    this.recorder.start(1000);
    this.changed(true);
  }
}
