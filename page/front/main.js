// How the parts of the page hang together: what comes in, what is drawn when, what goes out.

import { Address } from './address.js';
import { troubleOf } from './banner.js';
import { Film, savePicture } from './capture.js';
import { Chain } from './chain.js';
import { Charts } from './charts.js';
import { Connection } from './connection.js';
import { Controls, leaveToKeys } from './controls.js';
import { Meter, sentenceOf, showLegend, showRecording, showSpring, showStatus, write } from './display.js';
import { magnitude } from './format.js';
import { Hand } from './hand.js';
import { Loading } from './loading.js';
import { TRACE_POINTS } from './overlays.js';
import { Pad } from './pad.js';
import { Pull } from './pull.js';
import { Scene, graphics } from './scene.js';
import { Sound } from './sound.js';
import { TickStore } from './ticks.js';
import { judge } from './verdict.js';
import { WorldTime } from './world_time.js';

const TEXT_MS = 150;      // how often words and numbers change
const NARROW = window.matchMedia('(max-width: 1100px)');
const TRACE_SECONDS = 0.3;
const FORCE_COLUMNS = ['F_env_x', 'F_env_y', 'F_env_z'];
const REFUSAL_MS = 6000;

// A `world` message may lack what its sender does not offer.
const UNOFFERED = { scenes: [], starts: [], start: '', bodies: [], tool_links: [], tick_columns: [], limits: [],
                    servo_rate: 0 };

const byId = (id) => document.getElementById(id);
const state = { world: null, frame: null, store: new TickStore(1000, []), frameAt: 0, notice: null };
const meters = { page: new Meter(), ticks: new Meter(), frames: new Meter() };

const loading = new Loading(byId('loading'));
const connection = new Connection(sessionUrl(), {
  world: takeWorld,
  frame: takeFrame,
  refused: takeRefusal,
  ticks: takeTicks,
  telemetry: () => state.store.expectAnything(),
  opened: () => {
    state.frameAt = performance.now();
    loading.opened();
  },
  closed: takeLoss,
});
const send = (message) => connection.send(message);
const address = new Address(request, notify, showView);

const scene = makeScene();
const hand = scene && new Hand(byId('scene'), scene, send, showHold);
const pad = scene && new Pad(hand, scene);
const pull = scene && new Pull(byId('scene'), scene, send, () => hand.pointer !== undefined);
const worldTime = new WorldTime(byId('time'), send);
const controls = new Controls(byId('panel'), byId('methods'), request);
const chain = new Chain(byId('chain'), byId('chain-reason'), byId('verdict'));
const charts = new Charts(byId('strips'), {
  pause: byId('pause'), window: byId('window'), back: byId('back'), export: byId('export') });
const sound = new Sound();
charts.setStore(state.store);
wireButtons();
showView();
exposeForTests();
requestAnimationFrame(drawPicture);
setInterval(showText, TEXT_MS);

/** Sends what a person asked for; the address keeps it. */
function request(message) {
  if (message.type === 'scene') loading.choose(message.name);
  const sent = send(message);
  if (sent) address.note(message);
  else if (message.type === 'scene') loading.fail('ve_client takes no messages now');
  if (message.type === 'scene') showScenes(state.world);
  return sent;
}

function notify(text) {
  state.notice = { text, until: performance.now() + REFUSAL_MS };
}

function sessionUrl() {
  return `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/session${token()}`;
}

/** The token with which this page was opened, as a query; without one a cookie may have it. */
function token() {
  const value = new URLSearchParams(location.search).get('token');
  return value ? `?token=${encodeURIComponent(value)}` : '';
}

function makeScene() {
  const drawnBy = graphics();
  if (drawnBy !== 'none') {
    const made = new Scene(byId('scene'), drawnBy === 'hardware');
    const canvas = made.renderer.domElement;
    canvas.addEventListener('webglcontextlost', () => { byId('no-webgl').hidden = false; });
    canvas.addEventListener('webglcontextrestored', () => { byId('no-webgl').hidden = true; });
    return made;
  }
  byId('no-webgl').hidden = false;
  for (const id of ['view-toggle', 'fit', 'picture', 'film', 'hand-tools', 'legend', 'hint', 'spring-force']) byId(id).hidden = true;
  return null;
}

function takeLoss() {
  hand?.release();
  pull?.release();
  sound.update(0, false);
  loading.closed();
  if (state.world) showScenes(state.world);
}

function takeWorld(message) {
  const world = { ...UNOFFERED, ...message };
  loading.take(world);
  hand?.release();
  pull?.release();
  state.store.expectAnything();
  renewStore(world);
  state.world = world;
  document.body.classList.toggle('planar', Boolean(world.planar));
  controls.setWorld(world);
  byId('panel-toggle').hidden = !controls.offered;
  byId('panel').hidden = !controls.offered;
  byId('hand-tools').hidden = !scene || !world.guidable;
  byId('reset').hidden = world.resets === false;
  scene?.setWorld(world);
  showViewMode();
  showStarts(world);
  showScenes(world);
  state.store.session = world.scene;
  address.take(world, loading.chosen);
}

/** Another store where the ticks are of another kind than those that are kept. */
function renewStore({ servo_rate: rate, tick_columns: columns }) {
  const { store } = state;
  const same = JSON.stringify(columns) === JSON.stringify(store.schema.slice(0, -1));
  if (same && (rate === 0 || rate === store.rate)) return;   // 0: haptic_server has not answered yet
  state.store = new TickStore(rate || store.rate, columns);
  charts.setStore(state.store);
}

function takeFrame(frame) {
  state.frame = frame;
  state.frameAt = performance.now();
  meters.frames.count();
  scene?.setFrame(frame);
  if (!frame.device) hand?.release();
  sound.update(magnitude(frame.F_env), frame.contact_state === 'colliding');
}

function takeTicks(firstStep, count, rows) {
  state.store.append(firstStep, count, rows, state.frame?.round_trip ?? NaN);
  meters.ticks.count(count);
}

function takeRefusal({ field, text }) {
  if (field === 'hand') hand?.release();
  if (field === 'pull') pull?.release();
  if (field === 'scene') {
    loading.fail(text);
    showScenes(state.world);
  }
  if (field !== 'hand' && field !== 'pull') address.forget(field);
  if (!controls.refuse(field, text)) notify(text);
}

function drawPicture(now) {
  requestAnimationFrame(drawPicture);
  meters.page.count();
  if (scene) {
    pad.step(now);
    scene.forces = latestForces(state.store);
    scene.draw(hand.target, !trouble(now)?.cut, pull.held);
    showSpring(scene, hand, byId('spring-force'), byId('hint'), byId('beckon'));
  }
  charts.redraw(now, meters.page.rate());
}

/** F_env of the ticks of the last TRACE_SECONDS, N. */
function latestForces(store) {
  const step = Math.max(1, Math.ceil((TRACE_SECONDS * store.rate) / TRACE_POINTS));
  const forces = [];
  for (let at = store.next - Math.round(TRACE_SECONDS * store.rate); at < store.next; at += step) {
    const force = FORCE_COLUMNS.map((name) => store.at(name, at));
    if (!force.some(Number.isNaN)) forces.push(force);
  }
  return forces;
}

function trouble(now = performance.now()) {
  return troubleOf({ open: connection.open, frameAt: state.frameAt, loading: loading.chosen }, state.frame, now);
}

function showText() {
  const { frame, store } = state;
  const present = trouble();
  if (present?.cut) hand?.release();
  showBanner(present);
  loading.show(connection.open);
  byId('scene').classList.toggle('cut', !connection.open);
  showStatus(byId('status'), { open: connection.open, trouble: present, frame, meters, store });
  showRecording(byId('recording'), frame?.recording);
  chain.show(frame, { trouble: present, holder: holder(), verdict: judge(store, state.world?.limits ?? []) });
  write(byId('sentence'), sentenceOf(frame, hand, state.world));
  worldTime.show(frame?.environment?.pace);
  if (!frame) return;
  controls.show(frame);
  if (scene) showLegend(scene, frame);
}

function showBanner(present) {
  const banner = byId('banner');
  const notice = state.notice?.until > performance.now() ? state.notice.text : null;
  const mismatch = state.world?.mismatch
    && `${state.world.mismatch}: start haptic_server with --device-option freedom=spatial.`;
  const text = [present?.text, mismatch, notice].filter(Boolean).join(' · ');
  banner.hidden = !text;
  if (banner.textContent !== text) banner.textContent = text;
  banner.dataset.kind = present?.kind ?? '';
}

function holder() {
  if (hand?.held) return 'me';
  return hand?.heldByAnother ? 'another' : null;
}

function showHold() {
  byId('latch').checked = hand.latching;
  byId('scene').style.cursor = hand.held ? 'grabbing' : '';
}

/** The first look, or all that there is. */
function showView() {
  const { expert } = address;
  document.body.classList.toggle('first-look', !expert);
  byId('expert').setAttribute('aria-pressed', String(expert));
  if (expert) byId('start-choice').after(byId('time'));
  else byId('touch').append(byId('time'));
  controls.reduceTo(expert ? null : byId('touch'));
  scene?.setPlain(!expert);
}

function showViewMode() {
  if (scene?.view) byId('view-toggle').textContent = scene.view.mode === 'plan' ? '3-D view' : 'Plan view';
}

function showStarts({ starts, start }) {
  byId('start-choice').hidden = starts.length === 0;
  byId('start').replaceChildren(new Option('as placed', ''), ...starts.map((name) => new Option(name, name)));
  byId('start').value = start;
}

/** The menu, with the scene that is played or will be. */
function showScenes({ scenes, scene }) {
  const present = loading.chosen ?? scene;
  byId('scene-choice').hidden = scenes.length === 0;
  const options = scenes.map(({ name, description }) => (
    new Option(description ? `${name}: ${description}` : name, name)));
  byId('scenes').replaceChildren(...options);
  byId('scenes').value = present;
}

function wireButtons() {
  byId('skip').onclick = (event) => {   // The address stays as it is.
    event.preventDefault();
    byId('scene').focus();
  };
  byId('expert').onclick = () => {
    address.setExpert(!address.expert);
    showView();
  };
  byId('reset').onclick = () => request({ type: 'reset' });
  byId('start').onchange = ({ target }) => {
    request({ type: 'reset', start: target.value });
    leaveToKeys(target);
  };
  byId('scenes').onchange = ({ target }) => {
    request({ type: 'scene', name: target.value });
    leaveToKeys(target);
  };
  byId('fit').onclick = () => scene.fit();
  byId('magnify').onchange = ({ target }) => { if (scene) scene.magnify = target.checked; };
  byId('bodies-contacts').onchange = ({ target }) => { if (scene) scene.showsBodies = target.checked; };
  byId('sound').onchange = ({ target }) => sound.setOn(target.checked);
  byId('latch').onchange = ({ target }) => hand.setLatching(target.checked);
  wirePanel();
  byId('view-toggle').onclick = () => {
    scene.view?.show(scene.view.mode === 'plan' ? 'space' : 'plan');
    showViewMode();
  };
  if (scene) wireCapture();
  byId('full-screen').hidden = !document.fullscreenEnabled;
  byId('full-screen').onclick = () => (
    document.fullscreenElement ? document.exitFullscreen() : byId('stage').requestFullscreen());
  document.addEventListener('fullscreenchange', () => {
    byId('full-screen').setAttribute('aria-pressed', String(Boolean(document.fullscreenElement)));
  });
  for (const button of document.querySelectorAll('[data-move]')) {
    hand?.listenToButton(button, button.dataset.move);
  }
}

function wireCapture() {
  const film = new Film(scene.renderer.domElement, (on) => byId('film').setAttribute('aria-pressed', String(on)));
  byId('picture').onclick = () => savePicture(scene, state.world?.scene);
  byId('film').onclick = () => film.toggle(state.world?.scene);
  byId('film').hidden = !Film.possible;
}

function wirePanel() {
  const fold = (folded) => {
    byId('panel').classList.toggle('folded', folded);
    byId('panel-toggle').setAttribute('aria-expanded', String(!folded));
  };
  const close = () => {
    fold(true);
    byId('panel-toggle').focus();
  };
  byId('panel-toggle').onclick = () => {
    fold(!byId('panel').classList.contains('folded'));
    if (NARROW.matches) byId('panel-close').focus();    // It lies over the scene.
  };
  byId('panel-close').onclick = close;
  byId('panel').onkeydown = ({ key }) => { if (key === 'Escape' && NARROW.matches) close(); };
  NARROW.onchange = () => fold(NARROW.matches);
  fold(NARROW.matches);
}

/**
 * For tests and the curious:
 *   frame, world            the latest messages, or null
 *   ticks                   {received, lost, lastStep, rate}; rate in ticks/s as received
 *   ticksOf(name)           the kept ticks of one of world.tick_columns, or round_trip; oldest first
 *   fps(), drawn            frames/s of the page; scene frames drawn so far
 *   project([x,y,z])        [clientX, clientY] of a point of the world
 *   charts()                {count, visible, paused, seconds, from, to, redraws, marks}
 *   scene()                 {mode, quality, live, discs, pairs, proxyVisible, metresPerNewton}, or null without WebGL
 *   quality(name)           keeps to one of LEVELS; without a name it goes by the time again
 *   hand                    {held, target, grab(), moveBy(dx,dy,dz), turnBy(rad, axis), release()}
 *   chain()                 {link, reason} of the first link that stops the force, or null
 *   verdict()               {kind, swings, clipped, ticks} of the last second, or null
 *   banner()                its text, or ''
 *   send(message)           to ve_client
 */
function exposeForTests() {
  window.haptic = {
    get frame() { return state.frame; },
    get world() { return state.world; },
    get ticks() {
      const { received, lost, lastStep } = state.store;
      return { received, lost, lastStep, rate: meters.ticks.rate() };
    },
    ticksOf: (name) => state.store.valuesOf(name),
    get drawn() { return scene?.drawn ?? 0; },
    fps: () => meters.page.rate(),
    project: (point) => scene?.project(point) ?? null,
    charts: () => charts.info(),
    scene: () => scene && scene.info(),
    quality: (name) => scene?.quality.keep(name),
    hand,
    chain: () => chain.stops,
    verdict: () => judge(state.store, state.world?.limits ?? []),
    banner: () => (byId('banner').hidden ? '' : byId('banner').textContent),
    send,
  };
}
