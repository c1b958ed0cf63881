// Page of a file: its text with the errors at their lines, help for the key at the cursor, and other pages with the file.
import { linked } from "./commands.js";
import { dialog } from "./dialog.js";
import { addressOf, element, find, timeOf } from "./dom.js";
import { forgetEntries } from "./entries.js";
import { html, render } from "./lit.js";
import { showUnsavedPlan } from "./planned_view.js";
import { PoseBuilder } from "./pose_builder.js";
import { newest } from "./requests.js";
import { ask, CELL, lease, on, page } from "./service.js";

const text = find("text");
const base = find("base"); // version of the file on which the text is based
const FILE = text.dataset.file ?? "";
const PATH = /** @type {const} */ (`/files/${addressOf(FILE)}`);
const TAB = Math.random().toString(36).slice(2); // distinguishes this page from others that have the file open
const CHECK_MS = 500; // the text is checked after a pause of this length
const PRESENT_MS = 5000; // time between two messages to the service that the file is open here
const PATIENCE_MS = 30000;

let saved = text.defaultValue; // content of the file in the version `base`
/** @type {Api.ContentCheck | null} */
let checked = null; // newest result of a check of the present text
/** @type {string | null} */
let seenVersion = null; // version on disk at the newest check
/** @type {Api.Editor[]} */
let others = [];
/** @type {string | null} */
let planned = null; // text of the shown motion
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
const replacing = newest();
const plan = find("view") && showUnsavedPlan(find("view"), FILE, () => text.value);
const builder = plan && new PoseBuilder(plan, setText);

const isChanged = () => text.value !== saved;

// ---- text, with the numbers of its lines
const isNew = () => base.value === "" && text.value.trim() === ""; // an empty new file has no errors yet

function showLines() {
  const wrong = new Set(isNew() ? [] : checked?.problems.map(({ line }) => line));
  const count = text.value.split("\n").length;
  /** @type {(i: number) => Part} */
  const number = (i) => html`<span class=${wrong.has(i) ? "wrong" : ""}>${wrong.has(i) ? "✗ " : ""}${i}</span>`;
  render(Array.from({ length: count }, (_, i) => number(i + 1)), find("lines"));
}

/** @type {(place: Api.FileProblem) => void} */
function goTo({ line, column }) {
  if (line === null || column === null) return;
  const before = text.value.split("\n").slice(0, line - 1).reduce((sum, each) => sum + each.length + 1, 0);
  text.focus();
  text.setSelectionRange(before + column - 1, before + column - 1);
  text.scrollTop = Math.max(0, (line - 5) * parseFloat(getComputedStyle(text).lineHeight));
}

// Return line and column of the cursor, from 1.
function cursor() {
  const before = text.value.slice(0, text.selectionStart).split("\n");
  return { line: before.length, column: before[before.length - 1].length + 1 };
}

// ---- check
async function check() {
  const signal = replacing();
  const { line, column } = cursor();
  const query = new URLSearchParams({ tab: TAB, base: base.value, has_changes: String(isChanged()), cell: page.cell, line: String(line), column: String(column) });
  const sent = text.value;
  try {
    const found = await ask("POST", `${PATH}?${query}`, sent || "\n", PATIENCE_MS, lease.key, { signal });
    checked = found.check;
    others = found.others;
    seenVersion = found.version;
    showProblems();
    showPlace(found.check?.place ?? null);
    showConflict(found);
    if (text.value === sent) showPlan(); // a changed text is checked again
  } catch (error) {
    if (signal.aborted) return;
    find("problem").textContent = error.message;
  }
  showState();
}

// Tell the service that the file is open here; check the text again if the file has changed.
async function stayPresent() {
  const query = new URLSearchParams({ tab: TAB, base: base.value, has_changes: String(isChanged()) });
  try {
    const found = await ask("POST", `${PATH}?${query}`, "");
    others = found.others;
    find("problem").textContent = "";
    if (checked === null || found.version !== seenVersion) await check();
  } catch (error) {
    find("problem").textContent = error.message;
  }
  showState();
}

// Show the motion of the present text, if it has no errors.
function showPlan() {
  if (!plan || !builder || !checked || planned === text.value) return null;
  const isSame = planned !== null;
  planned = text.value;
  if (checked.problems.length > 0) return plan.refuse(text.value.trim() ? "The text has errors: correct them to see the motion." : "");
  builder.read(FILE, text.value);
  return plan.reload({ isSame });
}

function checkLater() {
  clearTimeout(timer);
  timer = setTimeout(check, CHECK_MS);
}

function showProblems() {
  const { problems, cell_problems: unfit } = isNew() || !checked ? { problems: [], cell_problems: [] } : checked;
  /** @type {(each: Api.FileProblem) => Part} */
  const place = (each) => (each.file === "" && each.line !== null
    ? html`<button type="button" @click=${() => goTo(each)}>Line ${each.line}</button> ` : html`<b>${each.file} ${each.line ?? ""}</b> `);
  /** @type {(each: Api.FileProblem) => Part} */
  const item = (each) => html`<li class="bad">${place(each)}${linked(each.text)}</li>`;
  render([...problems.map(item), ...unfit.map(item)], find("problems"));
  find("problem").textContent = "";
  if (problems.length > 0) text.setAttribute("aria-invalid", "true");
  else text.removeAttribute("aria-invalid");
  showLines();
}

/** @type {(place: Api.PlaceText | null) => void} */
function showPlace(place) {
  if (place === null) return;
  /** @type {(key: Api.KeyText) => Part} */
  const line = ({ name, kind, default: value, meaning }) => html`<dt><code>${name}</code></dt><dd>${linked(meaning)} <span class="soft">${kind}; default: ${value}</span></dd>`;
  const { key, path, allowed } = place;
  render(html`
    <p><b>${key ? path : "The file"}</b>${key ? html`: ${key.kind}. Default: ${key.default}. ${linked(key.meaning)}` : ""}</p>
    <details><summary>All ${allowed.length} keys that are allowed here</summary><dl class="named">${allowed.map(line)}</dl></details>`, find("place"));
}

// ---- versions and other editors
/** @type {(found: Api.FileCheck) => void} */
function showConflict({ version, differences }) {
  const section = find("conflict");
  section.hidden = version === base.value;
  if (section.hidden) return;
  const words = version === "" ? "The file was removed since you opened it." : "The file has changed since you opened it.";
  const keep = () => {
    base.value = version;
    base.dispatchEvent(new Event("input", { bubbles: true }));
    save();
  };
  /** @type {(line: string) => string} */
  const kind = (line) => (line.startsWith("+") ? "good" : line.startsWith("-") ? "bad" : "soft");
  render(html`
    <p class="verdict bad">${words} Nothing is overwritten until you decide.</p>
    <p>Lines with - are only in the file, lines with + only in your text.</p>
    <pre tabindex="0" aria-label="differences">${differences.map((line) => html`<span class=${kind(line)}>${line}\n</span>`)}</pre>
    <div class="actions">
      <button type="button" class="main" @click=${discard}>Use the file, discard my text</button>
      <button type="button" ?disabled=${!checked || checked.problems.length > 0} @click=${keep}>Save my text in its place</button>
    </div>`, find("versions"));
}

function showState() {
  /** @type {(editor: Api.Editor) => string} */
  const words = ({ who, since_s: since, has_changes: changes }) =>
    `${who === page.who ? "Another page that is open on this device" : who} has had this file open since ${timeOf(since)}${changes ? ", with changes that are not saved" : ""}.`;
  find("others").textContent = others.map(words).join(" ");
  find("others").hidden = others.length === 0;
  const isWrong = checked === null || checked.problems.length > 0;
  find("state-words").textContent = isChanged() ? "Your changes are not saved yet." : base.value ? "Saved." : "This file does not exist yet.";
  find("save").disabled = isWrong || !isChanged() || !find("conflict").hidden;
  find("discard").disabled = !isChanged();
}

function discard() {
  forgetEntries();
  location.reload();
}

// ---- save
async function save() {
  const unfit = checked?.cell_problems ?? [];
  if (unfit.length > 0) {
    const reasons = element("ul", {}, ...unfit.map((each) => element("li", {}, `${each.file} ${each.line ?? ""} ${each.text}`)));
    const words = element("p", {}, "Nothing moves until all files of the cell fit together. Change the other file next.");
    if (!(await dialog("The cell cannot be loaded with this file", [reasons, words], "Save it nevertheless"))) return;
  }
  const content = text.value;
  find("save").disabled = true; // a second click would save against the version that the first one replaces
  try {
    const found = await ask("PUT", `${PATH}${unfit.length > 0 ? "?incomplete=true" : ""}`, content, PATIENCE_MS, lease.key, { version: base.value });
    [saved, base.value] = [content, found.version];
    forgetEntries();
    const next = plan ? html`<a class="button main" href="${CELL}/experiment?${new URLSearchParams({ motion: FILE })}">Record this motion</a>`
      : html`<a class="button main" href=${CELL}>Check the cell before the next motion</a>`;
    render(html`<p class="verdict good">✓ Saved.</p>${next}`, find("saved"));
  } catch (error) {
    render(html`<p class="problem">${error.message}</p>`, find("saved"));
  }
  await check();
}

// Replace the text as if it were typed.
/** @type {(content: string) => void} */
function setText(content) {
  text.value = content;
  text.dispatchEvent(new Event("input", { bubbles: true }));
}

text.addEventListener("input", () => {
  base.dispatchEvent(new Event("input", { bubbles: true })); // the version is kept together with the text
  render([], find("saved"));
  showLines();
  showState();
  checkLater();
});
text.addEventListener("scroll", () => (find("lines").scrollTop = text.scrollTop));
for (const type of ["keyup", "click"]) text.addEventListener(type, checkLater);
find("save").addEventListener("click", save);
find("discard").addEventListener("click", discard);
window.addEventListener("pagehide", () => {
  const query = new URLSearchParams({ tab: TAB, is_leaving: "true" });
  // if this request fails, the service removes the entry of this page after some seconds
  ask("POST", `${PATH}?${query}`, "", PATIENCE_MS, lease.key, { keepalive: true }).catch(() => null);
});
on("again", check);
setInterval(() => document.visibilityState === "visible" && stayPresent(), PRESENT_MS);
showLines();
showState();
check();
