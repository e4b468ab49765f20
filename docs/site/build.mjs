// Builds the site from the repository's Markdown and from the API's own words, with an index to search it, and checks
// its links.
// Usage: node build.mjs REPOSITORY OUT
import { execFileSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { dirname, join, posix } from 'node:path';
import { Marked } from 'marked';

const [repository, out] = process.argv.slice(2);

// The menu, in this order; other documents of docs/ follow by their own title.
const MENU = {
  'Begin': [
    ['docs/index.md', 'Overview'],
    ['docs/concepts.md', 'Concepts'],
    ['docs/first_ten_minutes.md', 'First ten minutes'],
    ['docs/install.md', 'Installation'],
  ],
  'Connect': [
    ['docs/adapter.md', 'Adapters'],
    ['docs/packages.md', 'Python packages'],
    ['docs/first_device.md', 'Your first device'],
    ['docs/devices.md', 'Devices'],
    ['docs/safety.md', 'Safety case'],
    ['docs/worlds.md', 'Worlds'],
  ],
  'Use': [
    ['docs/live_page.md', 'Live page'],
    ['docs/options.md', 'Options'],
    ['docs/replay.md', 'Record and replay'],
    ['docs/dataset.md', 'Data sets with forces'],
    ['docs/operations.md', 'Service and operation'],
    ['docs/troubleshooting.md', 'Tuning, troubleshooting'],
    ['docs/answers.md', 'Answers'],
    ['docs/limitations.md', 'Limitations'],
  ],
  'Method': [
    ['docs/method.md', 'Index of sections'],
    ['docs/method/tool.md', 'The virtual tool'],
    ['docs/method/updates.md', 'Updates'],
    ['docs/method/forces.md', 'Contact and collision'],
    ['docs/method/control.md', 'Controllers, limits'],
    ['docs/method/energy.md', 'Energy'],
    ['docs/method/device.md', 'Hand and delay'],
    ['docs/method/bodies.md', 'Bodies, two hands'],
    ['docs/method/detection.md', 'Contact detection'],
    ['docs/method/engine.md', 'The engine'],
    ['docs/method/figures.md', "The paper's figures"],
    ['docs/method/limits.md', 'Where it stops'],
    ['docs/method/prior.md', 'Prior local models'],
    ['docs/method/scene.md', 'The geometry near the hand'],
    ['docs/method/external.md', 'External wrenches'],
    ['docs/method/held.md', 'What the hand holds'],
    ['docs/method/gripper.md', 'Grippers'],
  ],
  'Reference': [
    ['protocol/PROTOCOL.md', 'Protocol'],
    ['docs/numbers.md', 'Numbers'],
    ['docs/sweeps.md', 'Sweeps'],
    ['docs/api_python.md', 'API: Python'],
    ['docs/api_c.md', 'API: C'],
    ['docs/page_messages.md', 'Page messages'],
    ['docs/dependencies.md', 'Dependencies'],
  ],
  'Project': [
    ['README.md', 'README'],
    ['CHANGELOG.md', 'Changes'],
    ['CONTRIBUTING.md', 'Contributing'],
  ],
};
// Made from the sources, not files of the repository.
const GENERATED = new Map(['python', 'c'].map((language) => [`docs/api_${language}.md`, execFileSync(
  'python3', [join(repository, 'docs/site/api.py'), repository, language], { encoding: 'utf8' })]));

const text = (source) => GENERATED.get(source) ?? readFileSync(join(repository, source), 'utf8');
const titleOf = (source) => text(source).match(/^# (.+)$/m)[1].replace(/[`*]/g, '');
const escaped = (string) => string.replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/"/g, '&quot;');

function findDocuments(folder) {
  return readdirSync(join(repository, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = posix.join(folder, entry.name);
    if (entry.isDirectory()) return entry.name === 'site' ? [] : findDocuments(path);
    return entry.name.endsWith('.md') ? [path] : [];
  });
}

function findPages() {
  const listed = Object.entries(MENU).flatMap(([group, entries]) => entries.map(([source, label]) => ({ group, source, label })));
  const known = new Set(listed.map(({ source }) => source));
  const others = findDocuments('docs').filter((source) => !known.has(source))
    .map((source) => ({ group: 'More', source, label: titleOf(source) }));
  return [...listed, ...others].map((page) => ({
    ...page,
    file: `${page.source.replace(/^(docs|protocol)\/|\.md$/g, '').replace(/\//g, '_').toLowerCase()}.html`,
  }));
}

// Identifiers of headings as GitHub makes them.
function slugger() {
  const seen = new Map();
  return (heading) => {
    const slug = heading.toLowerCase().replace(/<[^>]*>/g, '').replace(/&#?\w+;/g, '')
      .replace(/[^\p{L}\p{N}\s_-]/gu, '').trim().replace(/\s/g, '-');
    const count = seen.get(slug) ?? 0;
    seen.set(slug, count + 1);
    return count === 0 ? slug : `${slug}-${count}`;
  };
}

const pages = findPages();
const pageOf = new Map(pages.map((page) => [page.source, page]));
const files = new Set(); // Of the repository, that pages link to.
const problems = [];

// Where a link of a source leads on the site.
function target(source, href) {
  if (/^[a-z]+:/i.test(href) || href.startsWith('#')) return href;
  const [path, fragment] = href.split('#');
  const wanted = posix.normalize(posix.join(posix.dirname(source), path)).replace(/\/$/, '');
  if (wanted.startsWith('..') || !(GENERATED.has(wanted) || existsSync(join(repository, wanted)))) {
    problems.push(`${source}: ${href} is not there`);
    return href;
  }
  const page = pageOf.get(wanted);
  if (page) return page.file + (fragment ? `#${fragment}` : '');
  files.add(wanted);
  return statSync(join(repository, wanted)).isDirectory() ? `files/${wanted}/index.html` : `files/${wanted}`;
}

// Where each section of the method is, by its number; in brackets the method's text cites them.
const sections = new Map([...text('docs/method.md').matchAll(/^ *- ([\d.]+) \[.+\]\(([^)]+)\)$/gm)]
  .map(([, number, href]) => [number, target('docs/method.md', href)]));

function linkSections(html) {
  const link = (number) => `<a href="${sections.get(number)}">${number}</a>`;
  return html.split(/(<(pre|code|a|h\d)\b[^]*?<\/\2>)/).filter((_, i) => i % 3 !== 2).map((part, i) => (i % 2 ? part
    : part.replace(/\((\d[\d.]*(?:, \d[\d.]*)*)\)/g, (whole, numbers) => (
      numbers.split(', ').every((number) => sections.has(number)) ? `(${numbers.split(', ').map(link).join(', ')})` : whole))
  )).join('');
}

function render({ source, label, file }) {
  const slug = slugger();
  const marked = new Marked({ gfm: true });
  marked.use({
    walkTokens: (token) => {
      if (token.type === 'link' || token.type === 'image') token.href = target(source, token.href);
    },
    renderer: {
      heading({ tokens, depth }) {
        const inner = this.parser.parseInline(tokens);
        return `<h${depth} id="${slug(inner)}">${inner}</h${depth}>\n`;
      },
    },
  });
  const entry = (page) =>
    `<a href="${page.file}"${page.file === file ? ' aria-current="page"' : ''}>${escaped(page.label)}</a>`;
  const groups = [...new Set(pages.map((page) => page.group))].map((group) =>
    `<h2>${escaped(group)}</h2>\n${pages.filter((page) => page.group === group).map(entry).join('\n')}`);
  return `<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>${escaped(label)} – Haptic local model</title>
<link rel="stylesheet" href="style.css">
<nav><strong><a href="index.html">Haptic local model</a></strong>
<input id="search" type="search" placeholder="Search" aria-label="Search" autocomplete="off">
<div id="found" role="listbox" hidden></div>
${groups.join('\n')}
</nav>
<main>
${source.startsWith('docs/method/') ? linkSections(marked.parse(text(source))) : marked.parse(text(source))}</main>
<script src="finder.js" defer></script>
<script src="search.js" defer></script>
</html>
`;
}

// What a search looks at: of each heading its page, where it leads, its words and those below it.
function searchIndex(html) {
  const plain = (part) => part.replace(/<[^>]*>/g, ' ').replace(/&lt;/g, '<').replace(/&gt;/g, '>').replace(/&quot;/g, '"')
    .replace(/&#39;/g, "'").replace(/&amp;/g, '&').replace(/\s+/g, ' ').trim();
  return pages.flatMap(({ group, label, file }) => {
    const main = html.get(file).match(/<main>([^]*)<\/main>/)[1];
    return main.split(/(?=<h[1-4] id=")/).filter((part) => plain(part)).map((part) => {
      const [, id = '', heading = ''] = part.match(/^<h[1-4] id="([^"]*)">([^]*?)<\/h/) ?? [];
      const below = heading ? part.slice(part.indexOf('</h') + 5) : part;
      return { group, page: label, link: id ? `${file}#${id}` : file, heading: plain(heading), text: plain(below) };
    });
  });
}

function write(file, content) {
  mkdirSync(dirname(join(out, file)), { recursive: true });
  writeFileSync(join(out, file), content);
}

function copy(file) {
  mkdirSync(dirname(join(out, 'files', file)), { recursive: true });
  copyFileSync(join(repository, file), join(out, 'files', file));
}

// A folder is a page that lists its files.
function copyFolder(folder) {
  const names = readdirSync(join(repository, folder)).filter((name) => !/^(node_modules|__pycache__|\..*)$/.test(name)).sort();
  const isFolder = (name) => statSync(join(repository, folder, name)).isDirectory();
  for (const name of names) (isFolder(name) ? copyFolder : copy)(posix.join(folder, name));
  const style = '../'.repeat(folder.split('/').length + 1) + 'style.css';
  const items = names.map((name) => (isFolder(name) ? [`${name}/index.html`, `${name}/`] : [name, name]));
  write(`files/${folder}/index.html`, `<!doctype html>
<html lang="en"><meta charset="utf-8"><title>${escaped(folder)}</title><link rel="stylesheet" href="${style}">
<main><h1>${escaped(folder)}</h1><ul>
${items.map(([href, name]) => `<li><a href="${encodeURI(href)}">${escaped(name)}</a></li>`).join('\n')}
</ul></main></html>
`);
}

// Every link of a page leads to a file of the site, and to a heading that is there.
function check(html) {
  const ids = (file) => new Set([...html.get(file).matchAll(/ id="([^"]+)"/g)].map((match) => match[1]));
  for (const [file, content] of html) {
    for (const [, link] of content.matchAll(/(?:href|src)="([^"]+)"/g)) {
      if (/^[a-z]+:/i.test(link)) continue;
      const [path, fragment] = link.split('#');
      if (path && !existsSync(join(out, decodeURI(path)))) problems.push(`${file}: ${link} is not there`);
      const page = path || file;
      if (fragment && html.has(page) && !ids(page).has(decodeURIComponent(fragment))) {
        problems.push(`${file}: ${link} has no such heading`);
      }
    }
  }
}

rmSync(out, { recursive: true, force: true });
const html = new Map(pages.map((page) => [page.file, render(page)]));
for (const [file, content] of html) write(file, content);
for (const file of files) (statSync(join(repository, file)).isDirectory() ? copyFolder : copy)(file);
const here = (file) => new URL(file, import.meta.url);
for (const file of ['style.css', 'search.js']) copyFileSync(here(file), join(out, file));
write('finder.js', ['node_modules/minisearch/dist/umd/index.js', 'finder.js'].map((file) => readFileSync(here(file), 'utf8'))
  .concat(`const ENTRIES = ${JSON.stringify(searchIndex(html))};\n`).join('\n'));
check(html);
for (const problem of problems) console.error(problem);
if (problems.length > 0) process.exit(1);
console.log(`${pages.length} pages and ${files.size} linked files in ${out}; all links lead somewhere`);
