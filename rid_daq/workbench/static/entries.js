// Stores the user's entries of a page in this browser tab. They are filled in again after a change of page, a reload,
// or Back. Parts of a page with data-keep="no", panels of jobs and dialogs are not stored.
import { find } from "./dom.js";

const KEY = `rid-daq entries ${location.pathname}`;
/** @type {Record<string, string | boolean>} */
const kept = read();

function read() {
  try {
    return JSON.parse(sessionStorage.getItem(KEY) ?? "{}");
  } catch {
    return {}; // the browser has no session storage
  }
}

/** @param {Control} control @returns {control is HTMLInputElement} */
const isTick = (control) => control.type === "checkbox" || control.type === "radio";
/** @type {(control: Control) => string} */
const nameOf = (control) => control.id || (control.name && isTick(control) ? `${control.name}=${control.value}` : control.name);

/** @type {(event: Event) => void} */
function keep({ target }) {
  const control = /** @type {Control} */ (target);
  if (!nameOf(control) || control.closest("[data-keep=no], .job")) return;
  if (control.type === "radio") for (const name of Object.keys(kept)) if (name.startsWith(`${control.name}=`)) delete kept[name];
  kept[nameOf(control)] = isTick(control) ? control.checked : control.value;
  try {
    sessionStorage.setItem(KEY, JSON.stringify(kept));
  } catch {
    // the browser has no session storage: the entries are lost when the page is left
  }
}

// Fill in the stored entries. The stored entry of a selection that is still loading is filled in later by `keptChoice`
// or `keptTicks`.
for (const control of /** @type {NodeListOf<Control>} */ (find("main").querySelectorAll("input, select, textarea"))) {
  const value = kept[nameOf(control)];
  if (value === undefined || control.closest("[data-keep=no]")) continue;
  if (isTick(control)) control.checked = value === true;
  else if (!(control instanceof HTMLSelectElement) || [...control.options].some((option) => option.value === value)) control.value = String(value);
  for (let part = control.closest("details"); part; part = part.parentElement?.closest("details") ?? null) part.open = true;
}
for (const type of ["input", "change"]) find("main").addEventListener(type, keep);

// Delete the stored entries of this page once the job that uses them has begun.
export function forgetEntries() {
  for (const name of Object.keys(kept)) delete kept[name];
  try {
    sessionStorage.removeItem(KEY);
  } catch {
    // the browser has no session storage
  }
}

/** @type {(select: HTMLSelectElement) => string | undefined} */
export const keptChoice = (select) => /** @type {string | undefined} */ (kept[select.id]);
/** @type {(name: string) => string[]} */
export const keptTicks = (name) =>
  Object.keys(kept).filter((each) => each.startsWith(`${name}=`) && kept[each]).map((each) => each.slice(name.length + 1));
