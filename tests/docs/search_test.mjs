// What the search of the site finds first for a question, by the site's own code and index.
// Usage: node search_test.mjs PROJECT_FOLDER; exit status 77: the packages of docs/site are not installed.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import vm from 'node:vm';

// Where each question may lead first: the page, and the beginning of the heading's identifier.
const QUESTIONS = {
  'my force is held': 'numbers#against-a-held-force',
  firewall: 'answers#which-ports',
  'which port': 'answers#which-ports',
  'how do I add my own device driver': 'contributing#adding-a-device-driver',
  'record a demonstration': 'replay# answers#how-do-i-record',
  'can I use Unity': 'answers#unity',
  'Unity C#': 'answers#unity',
  ROS: 'answers#ros',
  'how stiff can I go': 'answers#how-stiff numbers#how-stiff devices#how-stiff',
  'largest stiffness': 'devices#how-stiff numbers#how-stiff answers#how-stiff',
  '4 kHz': 'answers#can-the-loop-run-at-4-khz',
  rate: 'concepts#two-rates answers#can-the-loop-run',
  'cube falls': 'adapter#time troubleshooting#contacts-feel-wrong',
  'robot arm chatters': 'adapter#bodies troubleshooting#contacts-feel-wrong',
  'no force': 'troubleshooting#nothing-is-felt',
  'nothing is felt': 'troubleshooting#nothing-is-felt',
  'force too weak': 'troubleshooting#force-is-weaker',
  vibrates: 'troubleshooting#the-handle-shakes',
  oscillation: 'troubleshooting#the-handle-shakes',
  buzzing: 'troubleshooting#the-handle-shakes',
  omega: 'first_device#force-dimension devices#force-dimension',
  Phantom: 'first_device#3d-systems devices#openhaptics',
  'device not found': 'first_device#device-not-found',
  'permission denied': 'first_device#device-not-found',
  'workspace scaling': 'answers#scale-the-workspace',
  button: 'answers#buttons',
  'camera frame': 'answers#axes-and-the-camera',
  'e-stop': 'answers#emergency-stop',
  'emergency stop': 'answers#emergency-stop',
  macOS: 'answers#does-it-run-on-macos',
  Mac: 'answers#does-it-run-on-macos',
  Windows: 'answers#does-it-run-on-windows',
  Docker: 'answers#docker',
  'Ubuntu 22.04': 'answers#which-distribution',
  latency: 'answers#latency',
  lag: 'answers#latency',
  'Wi-Fi': 'answers#does-it-work-over-wi-fi',
  wifi: 'answers#does-it-work-over-wi-fi',
  friction: 'answers#how-is-friction-set',
  mesh: 'answers#which-meshes',
  URDF: 'answers#urdf',
  'two arms': 'answers#two-arms worlds#two-hands',
  bimanual: 'answers#two-arms worlds#two-hands',
  deformable: 'answers#soft',
  'plot force': 'answers#plot-the-force',
  CSV: 'answers#plot-the-force',
  cite: 'answers#how-to-cite',
  license: 'answers#which-licence',
  'real-time kernel': 'answers#does-it-need-a-real-time-kernel',
  Jupyter: 'answers#jupyter',
  'gravity compensation': 'answers#does-the-device-bear',
  calibration: 'answers#calibrate',
  'virtual fixture': 'answers#magnets',
  magnet: 'answers#magnets',
  Gazebo: 'answers#gazebo',
  Java: 'answers#java',
  Simulink: 'answers#java',
  install: 'first_ten_minutes#install-it install#',
  sudo: 'first_device#rights',
  token: 'live_page#who-may-open-it',
  encryption: 'install#what-the-key-does',
  'haptic_server@': 'operations#many-sessions',
  'scp key': 'install#two-machines',
  'my own simulator': 'adapter#',
  'hello world': 'adapter#hello-world',
};

const root = process.argv[2];
if (!existsSync(join(root, 'docs/site/node_modules/minisearch'))) {
  console.error('SKIPPED: scripts/site has not installed the packages of docs/site');
  process.exit(77);
}
const out = mkdtempSync(join(tmpdir(), 'site-'));
let find;
try {
  execFileSync(process.execPath, [join(root, 'docs/site/build.mjs'), root, out], { stdio: ['ignore', 'ignore', 'inherit'] });
  find = vm.runInNewContext(`${readFileSync(join(out, 'finder.js'), 'utf8')}\nfind`);
} finally {
  rmSync(out, { recursive: true });
}
const wrong = Object.entries(QUESTIONS).flatMap(([question, places]) => {
  const first = find(question)[0]?.link.replace('.html', '') ?? 'nothing';
  return places.split(' ').some((place) => first.startsWith(place)) ? [] : [`${question}: ${first}, not ${places}`];
});
if (find('').length + find('the of qqqxyz').length > 0) wrong.push('what asks nothing finds something');
if (wrong.length > 0) {
  console.error(wrong.join('\n'));
  process.exit(1);
}
console.log(`${Object.keys(QUESTIONS).length} questions find their answers first`);
