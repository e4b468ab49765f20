// What the servo did over the last 60 s: strip charts of every tick, with pause, scroll and export.

import uPlot from 'uplot';
import { COLORS, onColors } from './colors.js';
import { decimate } from './decimate.js';
import { download } from './download.js';
import { fixed, niceAbove } from './format.js';
import { csvParts } from './ticks.js';
import { scaleOf } from './units.js';

const REDRAW_MS = { usual: 67, longWindow: 250, busy: 250 };
const LONG_WINDOW_SECONDS = 20;
const BUSY_BELOW_FPS = 38;
const STRIPS_PER_PICTURE = 2;    // so that no picture of the scene waits for all charts
const VALUES_MS = 200;
const HEIGHT = 104;

// `column` is the name of a tick's column; `color` one of COLORS; `least` the smallest range shown; `floor` makes the axis
// logarithmic; `write` says how values are written.
const CHARTS = [
  { title: 'Force', unit: 'N', least: 0.5, series: [
    { column: 'F_hand', label: 'hand', color: 'F_hand', width: 2.5 },
    { column: 'F_env', label: 'F_env', color: 'F_env' },
    { column: 'F_command', label: 'command', color: 'F_command' }] },
  { title: 'Smallest separation', unit: 'mm', least: 0.2, series: [
    { column: 'smallest_separation', label: 'separation', color: 'separation' }] },
  { title: 'Drift', unit: 'mm', least: 0.1, series: [
    { column: 'proxy_tool', label: 'proxy–tool', color: 'toolLine' },
    { column: 'device_proxy', label: 'device–proxy', color: 'device' }] },
  { title: 'Contacts', unit: '', least: 2, write: String, series: [
    { column: 'predicted_contacts', label: 'predicted', color: 'predicted', stepped: true },
    { column: 'active_contacts', label: 'active', color: 'active', stepped: true }] },
  { title: 'Torque', unit: 'mN·m', least: 5, series: [
    { column: 'torque', label: 'command', color: 'F_command' }] },
  { title: 'Tick', unit: 'µs', least: 10, series: [
    { column: 'lateness', label: 'lateness', color: 'lateness', floor: 1 },
    { column: 'execution', label: 'execution', color: 'proxy', floor: 1 }] },
  { title: 'Network', unit: 'ms', least: 1, series: [
    { column: 'age', label: 'age of contacts', color: 'age' },
    { column: 'round_trip', label: 'round trip', color: 'roundTrip' }] },
];

export class Charts {
  /** `tools`: the elements pause, window, back, export; `list`: where the charts go. */
  constructor(list, tools) {
    this.tools = tools;
    this.live = null;
    this.held = null;        // what is looked at while paused
    this.end = 0;            // step after the last one shown, while paused
    this.seconds = Number(tools.window.value);
    this.redraws = 0;
    this.strips = [];
    this.strips = CHARTS.map((chart) => new Strip(list, chart, this));
    onColors(() => this.#redrawAll());
    tools.pause.onclick = () => (this.held ? this.resume() : this.pause());
    tools.window.onchange = () => this.#setSeconds(Number(tools.window.value));
    tools.back.oninput = () => this.scrollTo(Number(tools.back.value));
    tools.export.onclick = () => this.export();
  }

  setStore(store) {
    this.live = store;
    this.resume();
  }

  get store() {
    return this.held ?? this.live;
  }

  get range() {
    const end = this.held ? this.end : this.live.next;
    return [Math.round(end - this.seconds * this.live.rate), end];
  }

  pause() {
    if (this.held || !this.live) return;
    this.held = this.live.snapshot();
    this.end = this.held.next;
    this.#showState();
  }

  resume() {
    this.held = null;
    this.tools.back.value = 0;
    this.#showState();
  }

  /** Shows what was `seconds` before the pause (or before now, which pauses). */
  scrollTo(seconds) {
    this.pause();
    if (!this.held) return;
    const { oldest, next, rate } = this.held;
    const earliest = Math.min(next, oldest + this.seconds * rate);
    this.end = Math.round(Math.max(earliest, Math.min(next, next - seconds * rate)));
    this.tools.back.value = (next - this.end) / rate;
    this.#showState();
  }

  /** Drags the picture by a number of seconds, to the past if positive. */
  drag(seconds) {
    this.pause();
    if (this.held) this.scrollTo((this.held.next - this.end) / this.held.rate + seconds);
  }

  /** Draws a few of the charts that can be seen and must be drawn; rarer where the page is slow. */
  redraw(now, fps) {
    if (!this.live || !this.live.received) return;
    const pause = this.held ? Infinity : this.#pauseBetween(fps);
    const due = this.strips.filter((strip) => strip.visible && (strip.blank || now - strip.drawnAt >= pause));
    due.sort((a, b) => a.drawnAt - b.drawnAt);
    for (const strip of due.slice(0, STRIPS_PER_PICTURE)) strip.redraw(now);
    if (due.length) ++this.redraws;
  }

  async export() {
    if (!this.live) return;
    const parts = await csvParts(this.held ?? this.live.snapshot());
    download(new Blob(parts, { type: 'text/csv' }), 'ticks.csv');
  }

  info() {
    const [from, to] = this.live ? this.range : [0, 0];
    return { count: this.strips.length, visible: this.strips.filter((s) => s.visible).length,
             paused: Boolean(this.held), seconds: this.seconds, from, to, redraws: this.redraws,
             marks: this.store?.marks ?? [] };
  }

  #pauseBetween(fps) {
    if (fps < BUSY_BELOW_FPS) return REDRAW_MS.busy;
    return this.seconds > LONG_WINDOW_SECONDS ? REDRAW_MS.longWindow : REDRAW_MS.usual;
  }

  #setSeconds(seconds) {
    this.seconds = seconds;
    if (this.held) this.scrollTo((this.held.next - this.end) / this.held.rate);
    this.#redrawAll();
  }

  #redrawAll() {
    for (const strip of this.strips) strip.blank = true;
  }

  #showState() {
    this.#redrawAll();
    this.tools.pause.textContent = this.held ? 'Resume' : 'Pause';
    this.tools.pause.classList.toggle('pressed', Boolean(this.held));
  }
}

/** One chart with its heading, which folds it and shows the values under the pointer. */
class Strip {
  constructor(list, chart, charts) {
    this.chart = chart;
    this.charts = charts;
    this.onScreen = true;
    this.blank = true;       // shows nothing, or not what it should
    this.drawnAt = 0;
    this.valuesAt = 0;
    this.element = document.createElement('details');
    this.element.className = 'strip';
    this.element.open = true;
    this.element.append(this.#heading());
    this.body = this.element.appendChild(document.createElement('div'));
    list.append(this.element);
    const empty = [[], ...chart.series.map(() => [])];
    this.plot = drawnByProcessor(() => new uPlot(this.#options(), empty, this.body));
    this.#dragToScroll(this.plot.over);
    new IntersectionObserver(([entry]) => { this.onScreen = entry.isIntersecting; this.blank = true; })
      .observe(this.element);
    new ResizeObserver(() => this.#fitWidth()).observe(this.element);
    this.element.addEventListener('toggle', () => { this.blank = true; });
  }

  get visible() {
    return this.element.open && this.onScreen;
  }

  redraw(now) {
    const { store, range: [from, to] } = this.charts;
    const pixels = Math.max(50, Math.floor(this.plot.bbox.width / devicePixelRatio));
    const series = this.chart.series.map((one) => (
      { ...one, scale: scaleOf(store.unitOf(one.column), this.chart.unit) }));
    const data = decimate(store, series, from, to, pixels);
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale('x', { min: from / store.rate, max: to / store.rate });
    });
    this.blank = false;
    this.drawnAt = now;
    if (now - this.valuesAt >= VALUES_MS) this.#showValues(now);
  }

  #heading() {
    const heading = document.createElement('summary');
    const title = heading.appendChild(document.createElement('b'));
    title.textContent = this.chart.title;
    const unit = heading.appendChild(document.createElement('i'));
    unit.textContent = this.chart.unit;
    this.values = this.chart.series.map(({ label, color }) => {
      const entry = heading.appendChild(document.createElement('span'));
      entry.style.setProperty('--color', `var(--color-${color})`);
      entry.append(`${label} `);
      return entry.appendChild(document.createElement('output'));
    });
    return heading;
  }

  /** The values under the pointer, or else the latest shown. */
  #showValues(now = performance.now()) {
    this.valuesAt = now;
    const { data, cursor } = this.plot;
    const last = data[0].length - 1;
    const at = cursor.idx ?? last;
    this.values.forEach((output, i) => {
      const value = data[i + 1][at] ?? (cursor.idx === null ? data[i + 1][last - 1] : null);
      const text = value === null || value === undefined ? '–' : (this.chart.write ?? fixed)(value);
      if (output.value !== text) output.value = text;
    });
  }

  #options() {
    const axis = { stroke: () => COLORS.axis, font: '10px system-ui', grid: { stroke: () => COLORS.grid, width: 1 },
                   ticks: { show: false } };
    const logarithmic = this.chart.series[0].floor !== undefined;
    return {
      width: 380, height: HEIGHT, legend: { show: false }, padding: [6, 8, 0, 0],
      cursor: { sync: { key: 'ticks' }, drag: { x: false, y: false }, points: { size: 5 } },
      scales: {
        x: { time: false, auto: false },
        y: { distr: logarithmic ? 3 : 1, range: logarithmic ? decadesAround : niceAround(this.chart.least) },
      },
      axes: [
        { ...axis, size: 18, gap: 2, values: (_, splits) => splits.map((v) => `${+v.toFixed(2)} s`) },
        { ...axis, size: 46, gap: 3, space: 22,
          values: (_, splits) => splits.map((v) => (v === null ? '' : `${+v.toPrecision(4)}`)) },
      ],
      series: [{}, ...this.chart.series.map(lineOf)],
      hooks: { setCursor: [() => this.#showValues()], draw: [(plot) => drawMarks(plot, this.charts.store)] },
    };
  }

  #dragToScroll(over) {
    over.style.touchAction = 'pan-y';
    let last = null;
    over.addEventListener('pointerdown', (event) => {
      last = event.clientX;
      over.setPointerCapture(event.pointerId);
    });
    over.addEventListener('pointermove', (event) => {
      if (last === null || event.clientX === last) return;
      this.charts.drag(((event.clientX - last) * this.charts.seconds) / over.clientWidth);
      last = event.clientX;
    });
    for (const end of ['pointerup', 'pointercancel']) over.addEventListener(end, () => { last = null; });
  }

  #fitWidth() {
    const width = this.body.clientWidth;
    if (width && width !== this.plot.width) {
      this.plot.setSize({ width, height: HEIGHT });
      this.blank = true;
    }
  }
}

/** A line where another session began, with its name. */
function drawMarks(plot, store) {
  const { ctx, bbox: { left, top, width, height } } = plot;
  ctx.save();
  ctx.fillStyle = COLORS.axis;
  ctx.font = `${10 * devicePixelRatio}px system-ui`;
  ctx.textAlign = 'left';
  ctx.textBaseline = 'top';
  for (const [step, name] of store?.marks ?? []) {
    const x = Math.round(plot.valToPos(step / store.rate, 'x', true));
    if (x < left || x > left + width) continue;
    ctx.fillRect(x, top, devicePixelRatio, height);
    ctx.fillText(` ${name}`, x, top);
  }
  ctx.restore();
}

/** Canvases made by `make` are drawn by the processor: without a real GPU that is ten times faster. */
function drawnByProcessor(make) {
  const prototype = HTMLCanvasElement.prototype;
  const { getContext } = prototype;
  prototype.getContext = function (kind, options) {
    return getContext.call(this, kind, { ...options, willReadFrequently: true });
  };
  try {
    return make();
  } finally {
    prototype.getContext = getContext;
  }
}

function lineOf({ color, width = 1.25, stepped }) {
  return { stroke: () => COLORS[color], width, points: { show: false }, spanGaps: false,
           paths: stepped ? uPlot.paths.stepped({ align: 1 }) : uPlot.paths.linear() };
}

/** A range with round ends, so that the axis does not jump with every tick. */
function niceAround(least) {
  return (_, min, max) => {
    if (min === null || max === null) return [0, least];
    let low = Math.min(min, 0), high = Math.max(max, 0);
    if (high - low < least) {
      if (low < 0) low = high - least;
      else high = least;
    }
    const step = niceAbove((high - low) / 4);
    const beyond = (value) => (value ? value / step + 0.05 * Math.sign(value) : 0);
    return [Math.floor(beyond(low)) * step, Math.ceil(beyond(high)) * step];
  };
}

function decadesAround(_, min, max) {
  if (min === null || max === null) return [1, 100];
  return [10 ** Math.floor(Math.log10(min)), 10 ** Math.ceil(Math.log10(max * 1.01))];
}
