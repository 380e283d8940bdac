'use strict';
(() => {
const data = JSON.parse(document.getElementById('data').textContent);
const VERDICTS = [['fail', 'FAIL'], ['error', 'ERROR'], ['flaky', 'FLAKY'], ['lenient', 'LENIENT'],
  ['waived', 'XFAIL'], ['blocked', 'BLOCKED'], ['skip', 'SKIP'], ['pass', 'PASS']];
const NAME = Object.fromEntries(VERDICTS);
/* How many rows of a suite are shown before somebody asks for the rest. */
const ROWS = 200;
const byId = id => document.getElementById(id);

/* An element with its class, its text and what is in it. Text never becomes markup. */
function make(tag, kind, text, ...inside) {
  const it = document.createElement(tag);
  if (kind) it.className = kind;
  if (text !== undefined && text !== null) it.textContent = text;
  it.append(...inside);
  return it;
}

const runs = data.runs.map(([device, test, instance, verdict, ms, frames, reason, details, figures]) => {
  const of = data.cases[test];
  const name = data.suites[of.suite].name + '/' + of.id + (instance === null ? '' : '[' + instance + ']');
  return { device, of, name, verdict, ms, frames, reason, details, figures, place: 0 };
});
const several = data.devices.length > 1;
const fullName = run => data.devices[run.device].name + '/' + run.name;
let words = null;
function wordsOf(run) {
  if (!words) words = new Map();
  let text = words.get(run.of);
  if (text === undefined) {
    const ids = run.of.checks.map(place => data.checks[place]);
    text = (run.of.title + ' ' + ids.map(it => it[0] + ' ' + it[1] + ' ' + it[2]).join(' ')).toLowerCase();
    words.set(run.of, text);
  }
  return text;
}

const chosen = { text: '', verdicts: new Set(VERDICTS.map(it => it[0])), device: -1 };
function fits(run) {
  if (!chosen.verdicts.has(run.verdict)) return false;
  if (chosen.device >= 0 && run.device !== chosen.device) return false;
  return chosen.text.split(/\s+/).every(word =>
    word === '' || word.startsWith('check:') && (run.of.numbers || []).includes(word.slice(6)) || run.name.toLowerCase().includes(word) || wordsOf(run).includes(word));
}

function controls() {
  const counts = {};
  for (const run of runs) counts[run.verdict] = (counts[run.verdict] || 0) + 1;
  for (const [kind, name] of VERDICTS) {
    if (!counts[kind]) continue;
    const box = make('input');
    box.type = 'checkbox';
    box.checked = true;
    box.dataset.verdict = kind;
    box.addEventListener('change', () => {
      if (box.checked) chosen.verdicts.add(kind); else chosen.verdicts.delete(kind);
      show();
    });
    byId('verdicts').append(make('label', '', null, box, ' ', make('b', kind, name), ' ' + counts[kind]));
  }
  const select = byId('device');
  select.hidden = !several;
  select.append(new Option('all devices', -1));
  data.devices.forEach((device, place) => select.append(new Option(device.name, place)));
  select.addEventListener('change', () => { chosen.device = Number(select.value); show(); });
  let later = 0;
  byId('text').addEventListener('input', () => {
    clearTimeout(later);
    later = setTimeout(() => { chosen.text = byId('text').value.trim().toLowerCase(); show(); }, 120);
  });
  byId('filter').addEventListener('submit', event => event.preventDefault());
}

function show() {
  const suites = new Map();
  let count = 0;
  for (const run of runs) {
    if (!fits(run)) continue;
    count += 1;
    const suite = run.of.suite;
    if (!suites.has(suite)) suites.set(suite, []);
    suites.get(suite).push(run);
  }
  byId('shown').value = count + ' of ' + runs.length;
  const list = byId('list');
  list.replaceChildren();
  const open = suites.size === 1 || count <= 60;
  for (const [suite, some] of suites) list.append(group(data.suites[suite], some, open));
}

function group(suite, some, open) {
  const counts = VERDICTS.map(([kind, name]) => [name, some.filter(run => run.verdict === kind).length]);
  const said = counts.filter(it => it[1]).map(([name, count]) => count + ' ' + name).join(', ');
  const it = make('details', 'suite', null, make('summary', '', suite.name, make('span', '', said)));
  const fill = () => {
    if (it.open && it.children.length === 1) rows(it, some, 0);
  };
  it.addEventListener('toggle', fill);
  it.open = open;
  fill();
  return it;
}

function rows(into, some, from) {
  for (const run of some.slice(from, from + ROWS)) into.append(...row(run));
  const left = some.length - from - ROWS;
  if (left > 0) {
    const more = make('button', 'more', left + ' more');
    more.addEventListener('click', () => { more.remove(); rows(into, some, from + ROWS); });
    into.append(more);
  }
}

function row(run) {
  const name = make('span', 'name', run.name.slice(data.suites[run.of.suite].name.length + 1));
  if (several) name.append(' ', make('i', '', data.devices[run.device].name));
  const time = run.verdict === 'skip' ? '' : run.ms + ' ms';
  const button = make('button', 'row', null, make('b', run.verdict, NAME[run.verdict]), name, make('span', 'time', time));
  button.type = 'button';
  button.dataset.name = fullName(run);
  button.setAttribute('aria-expanded', 'false');
  const panel = make('div', 'case');
  panel.hidden = true;
  button.addEventListener('click', () => {
    if (!panel.hasChildNodes()) fillCase(panel, run);
    panel.hidden = !panel.hidden;
    button.setAttribute('aria-expanded', String(!panel.hidden));
    if (!panel.hidden) history.replaceState(null, '', '#case=' + encodeURIComponent(fullName(run)));
  });
  return [button, panel];
}

function field(list, label, ...inside) {
  list.append(make('div', '', null, make('dt', '', label), make('dd', '', null, ...inside)));
}

function fillCase(panel, run) {
  const device = data.devices[run.device];
  panel.append(make('p', '', run.of.title));
  const list = make('dl');
  for (const place of run.of.checks) {
    const [id, document, clause, level, says, decided] = data.checks[place];
    field(list, 'requires', id + ', ' + document + ' clause ' + clause + (level ? ', level ' + level : '') + '\n' + says);
    if (decided) field(list, 'decided', decided);
  }
  if (run.of.numbers) field(list, 'CiA check', run.of.numbers.join(', '));
  if (run.reason) field(list, run.verdict === 'skip' ? 'skipped' : 'blocked', data.reasons[run.reason - 1]);
  const details = run.details ? data.details[run.details - 1] : null;
  if (details) {
    for (const [label, text] of details.fields) field(list, label, text);
    for (const place of details.places) field(list, 'in', place.says, source(place));
  } else {
    field(list, 'in', data.suites[run.of.suite].file + ':' + run.of.line);
  }
  if (device.rerun) {
    const command = device.rerun + ' ' + quoted(run.name);
    const again = [make('code', '', command)];
    /* A page from a server without encryption has no clipboard. */
    if (navigator.clipboard) {
      const copy = make('button', 'copy', 'copy');
      copy.type = 'button';
      copy.addEventListener('click', () => navigator.clipboard.writeText(command).then(() => { copy.textContent = 'copied'; }));
      again.push(copy);
    }
    field(list, 'run again', ...again);
  }
  panel.append(list);
  if (run.figures) for (const figure of data.figures[run.figures - 1]) panel.append(drawn(figure));
  if (details && details.lines.length) panel.append(story(details, device));
}

function quoted(name) {
  return /^[\w\/.:=,+-]+$/.test(name) ? name : "'" + name.replace(/'/g, "'\\''") + "'";
}

/* The line of the file, with the stretch in question marked. */
function source(place) {
  const from = Math.max(0, place.column - 1);
  const to = Math.min(place.source.length, from + place.length);
  const width = String(place.line + place.after.length).length;
  const line = number => String(number).padStart(width) + ' | ';
  const others = (lines, first) => make('span', 'around', lines.map((text, nth) => line(first + nth) + text + '\n').join(''));
  return make('pre', '', null, others(place.before, place.line - place.before.length),
    line(place.line) + place.source.slice(0, from), make('u', '', place.source.slice(from, to) || ' '),
    place.source.slice(to) + '\n', others(place.after, place.line + 1));
}

function story(details, device) {
  const it = make('div', 'story');
  it.append(make('p', '', 'Frames: ' + details.frames));
  it.append(make('div', 'lane head', null, make('span', 'at', 's'), make('span', 'tester', 'tester'),
    make('span', '', ''), make('span', 'unit', device.name), make('span', '', 'meaning')));
  for (const [at, what, frame, text] of details.lines) {
    if (what === 'tx' || what === 'rx') {
      it.append(make('div', 'lane ' + what, null, make('span', 'at', at), make('span', 'tester'),
        make('span', 'arrow frame', frame), make('span', 'unit'), make('span', '', text)));
    } else {
      const says = what === 'bench' ? 'bench: ' + text : text;
      it.append(make('div', 'did ' + what, null, make('span', 'at', what === 'more' ? '\u2026' : at), make('span', '', says)));
    }
  }
  if (details.left) it.append(make('p', '', 'Left out: ' + details.left));
  return it;
}

/* The span of what was measured between its limits. */
function drawn([what, unit, count, min, mean, max, strict, lenient]) {
  const short = number => String(Math.round(number * 1000) / 1000);
  let text = what + ': ' + count + (count === 1 ? ' value, ' : ' values, ') + short(min) + ' to ' + short(max) + ' ' + unit + ', mean ' + short(mean) + ' ' + unit;
  if (strict) text += '\nstrict limits ' + strict;
  if (lenient) text += '\nlenient limits ' + lenient;
  const words = make('span', '', text);
  words.style.whiteSpace = 'pre-wrap';
  const it = make('div', 'figure', null, words);
  const bounds = [strict, lenient].filter(Boolean).map(limits => limits.match(/-?\d+(\.\d+)?/g) || []).flat().map(Number);
  const low = Math.min(min, ...bounds);
  const high = Math.max(max, ...bounds);
  const span = high - low || 1;
  const x = number => 6 + 228 * (number - low) / span;
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 240 26');
  svg.setAttribute('role', 'img');
  const draw = (tag, marks) => {
    const part = document.createElementNS('http://www.w3.org/2000/svg', tag);
    for (const [key, value] of Object.entries(marks)) part.setAttribute(key, value);
    svg.append(part);
  };
  draw('rect', { x: 0, y: 12, width: 240, height: 2 });
  draw('rect', { x: x(min), y: 8, width: Math.max(2, x(max) - x(min)), height: 10, class: 'span' });
  for (const bound of bounds) draw('line', { x1: x(bound), x2: x(bound), y1: 3, y2: 23 });
  it.append(svg);
  return it;
}

/* A link to a case opens it; one to a requirement or a check of CiA filters by it. */
function follow() {
  const hash = location.hash;
  let wanted = '';
  try { wanted = decodeURIComponent(hash.slice(hash.indexOf('=') + 1)); } catch { return; }
  if (hash.startsWith('#find=')) {
    choose(wanted);
    byId('cases').scrollIntoView();
  } else if (hash.startsWith('#check=')) {
    choose('check:' + wanted);
    byId('cases').scrollIntoView();
  } else if (hash.startsWith('#case=')) {
    const run = runs.find(it => fullName(it) === wanted);
    if (!run) return;
    choose(run.name);
    const rows = [...document.querySelectorAll('.row')];
    const row = rows.find(it => it.dataset.name === wanted);
    if (!row) return;
    if (row.getAttribute('aria-expanded') === 'false') row.click();
    row.focus();
    row.scrollIntoView({ block: 'center' });
  }
}

function choose(text) {
  byId('text').value = text;
  chosen.text = text.toLowerCase();
  chosen.device = -1;
  byId('device').value = -1;
  chosen.verdicts = new Set(VERDICTS.map(it => it[0]));
  for (const box of document.querySelectorAll('#verdicts input')) box.checked = true;
  show();
}

document.addEventListener('keydown', event => {
  const typing = event.target.matches('input, select');
  if (event.key === 'Escape') { choose(''); byId('text').blur(); return; }
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === '/') { event.preventDefault(); byId('text').focus(); return; }
  if (event.key !== 'j' && event.key !== 'k') return;
  const all = [...document.querySelectorAll('.suite > summary, .row')].filter(it => it.offsetParent !== null);
  const place = all.indexOf(document.activeElement);
  const next = all[place < 0 ? 0 : place + (event.key === 'j' ? 1 : -1)];
  if (next) { next.focus(); next.scrollIntoView({ block: 'nearest' }); }
});
window.addEventListener('hashchange', follow);
/* What is filed on paper shows its causes. */
window.addEventListener('beforeprint', () => {
  for (const it of document.querySelectorAll('.cause, #devices details')) it.open = true;
});
controls();
show();
follow();
})();
