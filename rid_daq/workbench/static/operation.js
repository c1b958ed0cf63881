// Form of an operation. The page sends the form's content as a request, and the service checks the request.
import { linked } from "./commands.js";
import { element, find, parseNumber } from "./dom.js";
import { refuseField } from "./fields.js";
import { JobPanel } from "./job_panel.js";
import { html, render } from "./lit.js";
import { completeRuns, ofRun, press, runWords, showBlocks, wanted } from "./work.js";

for (const place of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-linked]"))) {
  const text = place.textContent;
  place.replaceChildren();
  render(linked(text), place);
}

const form = find("operation");
if (form) show();

function show() {
  const kind = /** @type {Api.JobKind} */ (form.dataset.kind);
  const moves = "moves" in form.dataset;
  const figures = element("div", {});
  /** @type {(block: PageBlock) => boolean} */
  const keep = ({ kind }) => kind === "plot"; // the job's panel shows all other blocks
  const panel = new JobPanel(find("job"), { ended: (job) => job.run && showBlocks(figures, ofRun(job.run), { keep }) });
  find("job").after(figures);
  for (const input of /** @type {Iterable<Control>} */ (form.elements)) {
    if (input.name && wanted.has(input.name)) input.value = wanted.getAll(input.name).join("\n");
  }
  completeRuns().then((runs) => render(runs.map((run) => html`<option value=${run.id} label=${runWords(run)}></option>`), find("runs")));
  form.addEventListener("submit", (event) => event.preventDefault());
  press("begin", panel, kind, () => panel.begin(kind, /** @type {any} */ (request()), { moves }));
}

// Return a request with the fields that the user has changed; the service uses the defaults of all others.
/** @type {() => Record<string, any>} */
function request() {
  /** @type {Record<string, any>} */
  const asks = {};
  for (const input of /** @type {Iterable<Control>} */ (form.elements)) {
    if (!input.name) continue;
    const value = checkedValue(input);
    if (value === null) continue;
    const [last, ...path] = input.name.split(".").reverse();
    const place = path.reverse().reduce((inner, part) => (inner[part] ??= {}), asks);
    place[last] = value;
  }
  return asks;
}

// Return the value of a field; if it is invalid, show the error at the field and throw it.
/** @type {(input: Control) => unknown} */
function checkedValue(input) {
  try {
    return valueOf(input);
  } catch (error) {
    throw refuseField(input, error.message);
  }
}

// Return the value of a field, or null if the user has not changed the field.
/** @type {(input: Control) => unknown} */
function valueOf(input) {
  const { kind = "", many, parts = "" } = input.dataset;
  if (kind === "flag" && input instanceof HTMLInputElement) return input.checked === input.defaultChecked ? null : input.checked;
  const text = input.value.trim();
  if (!text || (kind === "choice" && input instanceof HTMLSelectElement && [...input.options].some((each) => each.defaultSelected && each.value === text))) return null;
  /** @type {(part: string) => unknown} */
  const one = (part) => (parts ? whole(part.trim(), parts, input.name) : read(part.trim(), kind, input.name));
  if (many === "list") return text.split("\n").filter((line) => line.trim()).map(one);
  if (many === "numbers") return text.split(/[\s;]+/).map(one);
  if (many === "pairs") return Object.fromEntries(text.split("\n").map((line) => pair(line, kind, input.name)));
  return one(text);
}

// Parse a value with several parts in one line: "m 2.805 0.005".
/** @type {(line: string, parts: string, name: string) => Record<string, unknown>} */
function whole(line, parts, name) {
  const names = parts.trim().split(" ").map((each) => each.split(":"));
  const words = line.split(/\s+/);
  if (words.length !== names.length) throw new Error(`${name}: "${line}" must have ${names.map(([part]) => part).join(", ")}.`);
  return Object.fromEntries(names.map(([part, kind], i) => [part, read(words[i], kind, `${name}, ${part}`)]));
}

/** @type {(line: string, kind: string, name: string) => [string, unknown]} */
function pair(line, kind, name) {
  const at = line.indexOf("=");
  if (at < 1) throw new Error(`${name}: "${line}" is not of the form NAME=VALUE.`);
  return [line.slice(0, at).trim(), read(line.slice(at + 1).trim(), kind, name)];
}

/** @type {(text: string, kind: string, name: string) => string | number} */
function read(text, kind, name) {
  if (kind !== "number" && kind !== "whole") return text;
  const value = parseNumber(text);
  if (Number.isNaN(value) || (kind === "whole" && !Number.isInteger(value))) {
    throw new Error(`${name}: "${text}" is not a ${kind === "whole" ? "whole " : ""}number, such as ${kind === "whole" ? "3" : "9.6"}.`);
  }
  return value;
}
