// How the page talks with ve_client: one WebSocket, opened again when it closes. The messages are
// described in docs/page_messages.md.

const TICK_MAGIC = 0x4b434954;
const HEADER_BYTES = 16;
const RETRY_MS = [300, 600, 1200, 2500];
const CONGESTED_BYTES = 65536;

export class Connection {
  #socket = null;
  #failures = 0;
  #retry = 0;

  /** `handlers`: world, frame, refused (messages), ticks(firstStep, count, rows), opened(), closed(). */
  constructor(url, handlers) {
    this.url = url;
    this.handlers = handlers;
    this.open = false;
    this.#connect();
    document.addEventListener('visibilitychange', () => this.#askForTelemetry());
    // A browser may keep the socket of a page that was left open, and unread, for many seconds.
    addEventListener('pagehide', () => this.#leave());
    addEventListener('pageshow', ({ persisted }) => { if (persisted) this.#connect(); });
  }

  /** Whether it could be sent. */
  send(message) {
    if (!this.open || this.#socket.bufferedAmount > CONGESTED_BYTES) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  #connect() {
    const socket = new WebSocket(this.url);
    this.#socket = socket;
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => this.#opened();
    socket.onclose = () => this.#closed();
    socket.onmessage = ({ data }) =>
      typeof data === 'string' ? this.#receiveText(data) : this.#receiveTicks(data);
  }

  #opened() {
    this.open = true;
    this.#failures = 0;
    this.#askForTelemetry();
    this.handlers.opened();
  }

  #closed() {
    this.open = false;
    this.handlers.closed();
    const delay = RETRY_MS[Math.min(this.#failures++, RETRY_MS.length - 1)];
    this.#retry = setTimeout(() => this.#connect(), delay);
  }

  #leave() {
    this.#socket.onclose = null;
    this.#socket.close();
    this.open = false;
    clearTimeout(this.#retry);
    this.handlers.closed();
  }

  #askForTelemetry() {
    const looking = document.visibilityState === 'visible';
    this.send({ type: 'telemetry', on: looking });
    this.handlers.telemetry(looking);
  }

  #receiveText(text) {
    const message = JSON.parse(text);
    if (['world', 'frame', 'refused'].includes(message.type)) this.handlers[message.type](message);
  }

  #receiveTicks(buffer) {
    const view = new DataView(buffer);
    if (buffer.byteLength < HEADER_BYTES || view.getUint32(0, true) !== TICK_MAGIC) return;
    const count = view.getUint32(4, true);
    const rows = new Float32Array(buffer, HEADER_BYTES);
    this.handlers.ticks(Number(view.getBigUint64(8, true)), count, rows);
  }
}
