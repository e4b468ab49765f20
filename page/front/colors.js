// The colours of scene and charts, for light and dark pages; style sheets have them as --color-NAME.

const LIGHT = {
  tool: '#f4a261', toolLine: '#b8651b', proxy: '#23897d', device: '#1d3557',
  F_env: '#d9532f', F_hand: '#6c7a96', F_command: '#1d3557',
  predicted: '#9b7fc4', active: '#d1495b', ofBodies: '#737d87', onBody: '#2a6f97',
  separation: '#7b5ea7', lateness: '#457b9d', age: '#bc6c25', roundTrip: '#606c38',
  fixed: '#d3d5d4', movable: '#aebfd2', ground: '#f1f1ee', background: '#fbfbfa', spring: '#495057',
  handleDot: '#ffffff', local: '#000000', flash: '#ffd166', glow: '#ff7a1a', trace: '#c2410c',
  axis: '#59636c', grid: '#e9ecef',
};
const DARK = {
  tool: '#f4a261', toolLine: '#e0934a', proxy: '#4fc3b2', device: '#8ec5ff',
  F_env: '#ff8a66', F_hand: '#a9b6cf', F_command: '#8ec5ff',
  predicted: '#b79be0', active: '#ff7285', ofBodies: '#9aa5b0', onBody: '#6fbbe6',
  separation: '#b79be0', lateness: '#7fb3d5', age: '#e09a55', roundTrip: '#a8b86a',
  fixed: '#737a81', movable: '#6f8aa8', ground: '#2b3137', background: '#22272c', spring: '#c3cbd3',
  handleDot: '#10151a', local: '#ffffff', flash: '#ffd166', glow: '#ff9a3d', trace: '#ffb27a',
  axis: '#a7b0b8', grid: '#39414a',
};

const dark = window.matchMedia('(prefers-color-scheme: dark)');

/** Those in effect; they change with the page's scheme. */
export const COLORS = {};

/** Calls `changed()` after the colours have changed. */
export function onColors(changed) {
  dark.addEventListener('change', () => changed());
}

function take() {
  Object.assign(COLORS, dark.matches ? DARK : LIGHT);
  for (const [name, color] of Object.entries(COLORS)) {
    document.documentElement.style.setProperty(`--color-${name}`, color);
  }
}

dark.addEventListener('change', take);
take();
