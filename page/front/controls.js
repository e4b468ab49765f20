// What the user can set: methods, numbers with their ranges, choices; and what is in effect.

import { typed } from './format.js';
import { fromSi, parseQuantity } from './units.js';

// Conditions worth a try, as the messages that bring them about.
const SITUATIONS = [
  ['Stiff and late', '15 kN/m, 100 N·s/m, 20 ms each way: what the local model bears and IR does not',
   [{ type: 'settings', stiffness: 15000, damping: 100 }, { type: 'environment', delay: 0.02 }]],
  ['Slow engine', '15 frames/s with jitter and loss',
   [{ type: 'environment', rate: 15, jitter: 0.02, loss: 0.1 }]],
];

// Groups of fields: [name, label, in which unit it is shown if not in SI, or CHOICE between words, ends of the slider, SI].
const CHOICE = Symbol('choice');
const GROUPS = [
  ['settings', 'Contact', [
    ['stiffness', 'Stiffness', 'kN/m', [100, 1e5]], ['damping', 'Damping b'], ['friction', 'Friction µ'],
    ['restitution', 'Restitution e']]],
  ['environment', 'Prediction', [
    ['epsilon', 'ε of contacts that are sent', 'mm'], ['rate', 'Frame rate']]],
  ['environment', 'Gripper', [['opening', 'Opening', '%']]],
  ['environment', 'Injected on the network', [
    ['delay', 'Delay, one way', 'ms'], ['jitter', 'Jitter', 'ms'], ['loss', 'Loss', '%']]],
  ['settings', 'Controller', [
    ['controller', 'Controller', CHOICE], ['update_rule', 'Update rule', CHOICE],
    ['coupling_stiffness', 'Coupling stiffness'], ['coupling_damping', 'Coupling damping'],
    ['coupling_angular_stiffness', 'Angular stiffness'], ['coupling_angular_damping', 'Angular damping']]],
];

const SETTLE_MS = 600;     // how long a value just sent is left alone
const REFUSAL_MS = 12000;
const DRAG_SEND_MS = 80;
const SLIDER_STEPS = 1000;

export class Controls {
  constructor(panel, methodBar, send) {
    this.send = send;
    this.fields = new Map();
    this.situations = this.#situations();
    this.groups = GROUPS.map(([kind, title, fields]) => this.#group(kind, title, fields));
    panel.append(this.situations, ...this.groups);
    this.home = this.stiffness.parentElement;
    this.methodBar = methodBar;
    this.methods = [];
  }

  /** Ranges, words and methods of a `world` message; what it does not have is hidden. */
  setWorld({ ranges: given = {}, gripper, controllers = [], update_rules: rules = [], methods = [] }) {
    const ranges = gripper ? given : { ...given, opening: undefined };
    for (const [name, field] of this.fields) {
      if (ranges[name]) field.setRange(ranges[name]);
      field.element.hidden = !ranges[name];
    }
    this.fields.get('controller').setChoices(controllers);
    this.fields.get('update_rule').setChoices(rules.map((name) => ({ name })));
    for (const group of this.groups) group.hidden = !group.querySelector('.field:not([hidden])');
    for (const [i, button] of [...this.situations.children].entries()) {
      button.hidden = !namesOf(SITUATIONS[i][2]).every((name) => ranges[name]);
    }
    this.situations.hidden = !this.situations.querySelector('button:not([hidden])');
    this.methods = methods.map((method) => this.#methodButton(method));
    this.methodBar.replaceChildren(...this.methods.map(({ button }) => button));
    this.methodBar.hidden = methods.length === 0;
  }

  get stiffness() {
    return this.fields.get('stiffness').element;
  }

  /** Brings the stiffness to `bar`, without the others; null: back among them. */
  reduceTo(bar) {
    if (bar) bar.append(this.stiffness);
    else this.home.querySelector('summary').after(this.stiffness);
  }

  /** Whether there is anything to set. */
  get offered() {
    return this.groups.some((group) => !group.hidden);
  }

  /** Shows what is in effect, except where the user is at work. */
  show({ settings, environment, method }) {
    for (const [name, field] of this.fields) {
      const value = settings?.[name] ?? environment?.[name];
      field.forgetOldRefusal();
      if (value !== undefined && value !== null) field.show(value);
    }
    for (const { name, button } of this.methods) {
      button.setAttribute('aria-pressed', String(name === method));
    }
  }

  /** Whether a field of that name shows the refusal. */
  refuse(name, text) {
    const field = this.fields.get(name);
    field?.refuse(text);
    const group = field?.element.closest('details');
    if (group) group.open = true;
    return Boolean(field);
  }

  choose(method) {
    this.send({ type: 'method', name: method });
  }

  #situations() {
    const row = document.createElement('p');
    row.className = 'situations';
    row.append('Try ');
    for (const [label, title, messages] of SITUATIONS) {
      const button = row.appendChild(document.createElement('button'));
      Object.assign(button, { type: 'button', textContent: label, title });
      button.onclick = () => messages.forEach(this.send);
    }
    return row;
  }

  #group(kind, title, fields) {
    const group = document.createElement('details');
    group.open = true;
    const heading = group.appendChild(document.createElement('summary'));
    heading.textContent = title;
    for (const [name, label, shown, ends] of fields) {
      const send = (value) => this.send({ type: kind, [name]: value });
      const field = shown === CHOICE ? new ChoiceField(name, label, send)
        : new NumberField(name, label, send, shown, ends);
      this.fields.set(name, field);
      group.append(field.element);
    }
    return group;
  }

  #methodButton({ name, label, help, suits_tool }) {
    const button = document.createElement('button');
    const title = suits_tool ? help : `${help}. Not for a tool of several links.`;
    Object.assign(button, { type: 'button', textContent: label, title, disabled: !suits_tool });
    button.dataset.method = name;
    button.onclick = () => this.choose(name);
    return { name, button };
  }
}

class Field {
  constructor(name, label, send) {
    this.send = send;
    this.leftAloneUntil = 0;
    this.element = document.createElement('div');
    this.element.className = 'field';
    this.element.dataset.field = name;
    this.label = this.element.appendChild(document.createElement('label'));
    this.label.textContent = label;
    this.label.htmlFor = `field-${name}`;
    this.message = document.createElement('p');
    this.message.setAttribute('role', 'alert');
  }

  settle() {
    this.leftAloneUntil = performance.now() + SETTLE_MS;
  }

  get settling() {
    return performance.now() < this.leftAloneUntil;
  }

  refuse(text) {
    this.message.textContent = text;
    this.element.classList.toggle('refused', Boolean(text));
    this.leftAloneUntil = 0;
    this.refusedAt = text ? performance.now() : undefined;
  }

  forgetOldRefusal() {
    if (performance.now() - this.refusedAt > REFUSAL_MS) this.refuse('');
  }
}

class ChoiceField extends Field {
  constructor(name, label, send) {
    super(name, label, send);
    this.select = this.element.appendChild(document.createElement('select'));
    this.select.id = this.label.htmlFor;
    this.element.append(this.message);
    this.select.onchange = () => {
      this.refuse('');
      this.settle();
      send(this.select.value);
      leaveToKeys(this.select);
    };
  }

  setChoices(choices) {
    this.element.hidden = choices.length === 0;
    this.select.replaceChildren(...choices.map(({ name, suits_tool }) => {
      const option = new Option(name.replaceAll('_', ' '), name);
      option.disabled = suits_tool === false;
      return option;
    }));
  }

  show(value) {
    if (document.activeElement === this.select || this.settling) return;
    if (this.select.value !== value) this.select.value = value;
  }
}

class NumberField extends Field {
  /** `shown`: the unit in which numbers are shown; none: the SI unit. `ends`: of the slider; none: those of the range. */
  constructor(name, label, send, shown, ends) {
    super(name, label, send);
    Object.assign(this, { shown, ends });
    this.input = this.element.appendChild(document.createElement('input'));
    Object.assign(this.input, { type: 'text', inputMode: 'decimal', id: this.label.htmlFor, autocomplete: 'off' });
    this.unit = this.element.appendChild(document.createElement('span'));
    this.slider = this.element.appendChild(document.createElement('input'));
    Object.assign(this.slider, { type: 'range', min: 0, max: SLIDER_STEPS, disabled: true });
    this.slider.setAttribute('aria-label', label);
    this.element.append(this.message);
    this.#listen();
  }

  setRange(range) {
    this.range = range;
    this.slid = this.ends ? { ...range, least: this.ends[0], most: this.ends[1] } : range;
    this.shown ??= range.unit;
    this.unit.textContent = this.shown;
    this.slider.disabled = false;
    this.allowed = `${this.#inShown(range.least)} to ${this.#inShown(range.most)} ${this.shown}`.trim();
    this.input.title = this.slider.title = this.allowed;
  }

  /** A number as it is shown, without its unit. */
  #inShown(value) {
    return typed(fromSi(value, this.range.unit, this.shown));
  }

  show(value) {
    if (this.settling || this.sliding || !this.range) return;
    const text = this.#inShown(value);
    if (document.activeElement !== this.input && this.input.value !== text) this.input.value = text;
    this.slider.value = positionOf(value, this.slid);
    this.slider.setAttribute('aria-valuetext', `${text} ${this.shown}`);
  }

  #listen() {
    this.input.onchange = () => this.#enter();
    this.input.oninput = () => this.refuse('');
    this.input.onkeydown = (event) => {
      if (event.key === 'Escape') this.input.blur();
    };
    this.slider.onpointerdown = () => { this.sliding = true; };
    this.slider.onpointerup = this.slider.onpointercancel = () => { this.sliding = false; };
    this.slider.oninput = () => this.#slide(false);
    this.slider.onchange = () => this.#slide(true);
  }

  #enter() {
    const value = parseQuantity(this.input.value, this.range.unit, this.shown);
    if (!(value >= this.range.least && value <= this.range.most)) {
      this.refuse(`“${this.input.value}” must be ${this.allowed}`);
      return;
    }
    this.settle();
    this.send(value);
  }

  #slide(done) {
    const value = valueAt(Number(this.slider.value), this.slid);
    this.input.value = this.#inShown(value);
    this.refuse('');
    this.settle();
    const now = performance.now();
    if (!done && now - (this.slidAt ?? 0) < DRAG_SEND_MS) return;
    this.slidAt = now;
    this.send(value);
  }
}

/** What messages set. */
const namesOf = (messages) => messages.flatMap(({ type, ...values }) => Object.keys(values));

/** After a choice with the pointer, keys move the tool again; after one with keys, the focus stays. */
export function leaveToKeys(select) {
  if (!select.matches(':focus-visible')) select.blur();
}

// Sliders: logarithmic where the range spans decades, cubic where it begins at 0 and has a unit.
const isLogarithmic = ({ least, most }) => least > 0 && most / least >= 100;
const isCubic = ({ least, unit }) => least === 0 && Boolean(unit);

function valueAt(position, range) {
  const { least, most } = range;
  const t = position / SLIDER_STEPS;
  const value = isLogarithmic(range) ? least * (most / least) ** t
    : least + (most - least) * (isCubic(range) ? t ** 3 : t);
  return Math.min(most, Math.max(least, Number(value.toPrecision(3))));
}

function positionOf(value, range) {
  const { least, most } = range;
  const t = isLogarithmic(range) ? Math.log(Math.max(value, least) / least) / Math.log(most / least)
    : (value - least) / (most - least);
  return Math.round(SLIDER_STEPS * (isCubic(range) ? Math.cbrt(t) : t));
}
