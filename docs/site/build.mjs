// Builds the site from the repository's Markdown and checks its links.
// Usage: node build.mjs REPOSITORY OUT
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, join, posix } from 'node:path';
import { Marked } from 'marked';

const [repository, out] = process.argv.slice(2);

// The menu, in this order; other documents of docs/ follow by their own title.
const MENU = [
  ['docs/concepts.md', 'Concepts'],
  ['docs/first_ten_minutes.md', 'First ten minutes'],
  ['docs/adapter.md', 'Write an adapter'],
  ['docs/devices.md', 'Devices'],
  ['docs/worlds.md', 'Worlds'],
  ['docs/operations.md', 'Operation'],
  ['protocol/PROTOCOL.md', 'Protocol'],
  ['docs/method.md', 'Method'],
  ['docs/numbers.md', 'Numbers'],
];
const LAST = [
  ['README.md', 'README'],
  ['CHANGELOG.md', 'Changes'],
  ['CONTRIBUTING.md', 'Contributing'],
];

const text = (source) => readFileSync(join(repository, source), 'utf8');
const titleOf = (source) => text(source).match(/^# (.+)$/m)[1].replace(/[`*]/g, '');
const escaped = (string) => string.replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/"/g, '&quot;');

function findPages() {
  const listed = new Set(MENU.map(([source]) => source));
  const others = readdirSync(join(repository, 'docs'))
    .filter((name) => name.endsWith('.md') && !listed.has(`docs/${name}`))
    .map((name) => [`docs/${name}`, titleOf(`docs/${name}`)]);
  const pages = [...MENU, ...others, ...LAST].filter(([source]) => existsSync(join(repository, source)));
  return pages.map(([source, label], index) => ({
    source,
    label,
    file: index === 0 ? 'index.html' : `${basename(source, '.md').toLowerCase()}.html`,
  }));
}

// Identifiers of headings as GitHub makes them.
function slugger() {
  const seen = new Map();
  return (heading) => {
    const slug = heading.toLowerCase().replace(/<[^>]*>/g, '').replace(/&[a-z]+;/g, '')
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
  if (wanted.startsWith('..') || !existsSync(join(repository, wanted))) {
    problems.push(`${source}: ${href} is not there`);
    return href;
  }
  const page = pageOf.get(wanted);
  if (page) return page.file + (fragment ? `#${fragment}` : '');
  files.add(wanted);
  return statSync(join(repository, wanted)).isDirectory() ? `files/${wanted}/index.html` : `files/${wanted}`;
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
  return `<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>${escaped(label)} – Haptic local model</title>
<link rel="stylesheet" href="style.css">
<nav><strong>Haptic local model</strong>
${pages.map(entry).join('\n')}
</nav>
<main>
${marked.parse(text(source))}</main>
</html>
`;
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
copyFileSync(new URL('style.css', import.meta.url), join(out, 'style.css'));
check(html);
for (const problem of problems) console.error(problem);
if (problems.length > 0) process.exit(1);
console.log(`${pages.length} pages and ${files.size} linked files in ${out}; all links lead somewhere`);
