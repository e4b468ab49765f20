// What the page's address keeps: whether all is shown, the scene, where the tool began, the method and what was set, in SI
// units. Opening it brings them back, where the world offers them.

const EXPERT = 'expert';
const PLACES = ['scene', 'start'];
const WORDS = { controller: 'controllers', update_rule: 'update_rules' };
const OF_THE_CLIENT = ['epsilon', 'rate', 'delay', 'jitter', 'loss', 'pace', 'opening'];
const OF_A_METHOD = ['controller', 'update_rule', 'epsilon'];

export class Address {
  /** `request(message)` sends it as if a person had asked for it; `complain(text)` says what cannot be brought back;
   *  `showView()` is called when `expert` may have changed. */
  constructor(request, complain, showView) {
    Object.assign(this, { request, complain, kept: {}, before: {} });
    this.#read();
    window.addEventListener('hashchange', () => {
      this.#read();
      showView();
      if (this.world) this.#restore();
    });
  }

  setExpert(on) {
    this.expert = on;
    this.#write();
  }

  /** A message that a person caused. */
  note({ type, ...values }) {
    if (type === 'hand' || type === 'telemetry') return;
    this.before = this.kept;
    if (type === 'scene') this.kept = { scene: values.name };
    else if (type === 'reset') this.kept = { ...pick(this.kept, PLACES), ...values };
    else if (type === 'method') this.kept = { ...without(this.kept, OF_A_METHOD), method: values.name };
    else this.kept = { ...this.kept, ...values };
    if (this.world?.scenes.length) this.kept = { scene: this.world.scene, ...this.kept };
    this.#write();
  }

  /** `field` was refused. */
  forget(field) {
    if (field === 'scene') this.kept = this.before;
    else this.kept = without(this.kept, [field === 'name' ? 'method' : field]);
    this.#write();
  }

  /** A `world` message; `loading`: a scene that was chosen and has not come. */
  take(world, loading) {
    this.world = world;
    if (loading !== null) return;
    const others = this.kept.scene !== undefined && this.kept.scene !== world.scene;
    if (others) this.kept = { scene: world.scene };     // Somebody else chose it: all is as it begins.
    this.#restore();
    this.#write();
  }

  #restore() {
    const { wanted, world } = this;
    if (!wanted) return;
    const { scene, start, method, ...settings } = wanted;
    if (scene !== undefined && scene !== world.scene) {
      if (this.asked === scene) return this.#giveUp();
      if (!world.scenes.some(({ name }) => name === scene)) {
        this.complain(`The address asks for scene ${scene}, which is not offered here.`);
        return this.#giveUp();
      }
      this.asked = scene;
      return this.request({ type: 'scene', name: scene });
    }
    this.#giveUp();
    if (start !== undefined && start !== world.start && world.starts.includes(start)) this.request({ type: 'reset', start });
    if (world.methods?.some(({ name, suits_tool: suits }) => name === method && suits)) {
      this.request({ type: 'method', name: method });
    }
    for (const [type, values] of Object.entries(this.#offered(settings))) this.request({ type, ...values });
  }

  /** Nothing is waited for any more. */
  #giveUp() {
    this.wanted = this.asked = null;
  }

  /** Those of `texts` that the world has, as what is sent. */
  #offered(texts) {
    const messages = {};
    for (const [name, text] of Object.entries(texts)) {
      const word = (this.world[WORDS[name]] ?? []).some((one) => (one.name ?? one) === text);
      const number = this.world.ranges?.[name] && text !== '' && Number.isFinite(Number(text));
      if (!word && !number) continue;
      const type = OF_THE_CLIENT.includes(name) ? 'environment' : 'settings';
      (messages[type] ??= {})[name] = word ? text : Number(text);
    }
    return messages;
  }

  /** What the address asks for, as texts by name; null: nothing. */
  #read() {
    const { view, ...wanted } = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
    this.expert = view === EXPERT;
    this.wanted = Object.keys(wanted).length ? wanted : null;
  }

  #write() {
    const kept = { ...(this.expert && { view: EXPERT }), ...this.kept };
    const hash = Object.keys(kept).length > 0 ? `#${new URLSearchParams(kept)}` : '';
    if (location.hash !== hash) history.replaceState(null, '', location.pathname + location.search + hash);
  }
}

const pick = (values, names) => Object.fromEntries(Object.entries(values).filter(([name]) => names.includes(name)));
const without = (values, names) => Object.fromEntries(Object.entries(values).filter(([name]) => !names.includes(name)));
