// Writes a measured zero of the force plate into the cell file, after the user has compared old and new values.
import { table } from "./blocks.js";
import { dialog } from "./dialog.js";
import { element, find, timeOf } from "./dom.js";
import { html, render } from "./lit.js";
import { CELL, ask, lease, mayMove, page } from "./service.js";

const WRITE_MS = 30000;

// Return a button that writes the zero of the plate, as a run measured it, into the cell file, with the result below it.
// A second button calls `check`, because the cell must be checked again.
/** @type {(run: string, check?: () => unknown) => HTMLElement} */
export function zeroButton(run, check = () => location.assign(CELL)) {
  const outcome = element("div", { class: "part", role: "status" });
  /** @type {(parts: Part) => void} */
  const say = (parts) => render(parts, outcome);
  const button = element("button", { type: "button", class: "main", disabled: !mayMove }, "Write the zero into the cell file");
  button.addEventListener("click", async () => {
    say([]);
    button.disabled = true; // a second click would read the file while it is written
    try {
      button.hidden = await write(run, check, say);
    } catch (error) {
      say(html`<p class="problem">${error.message}</p>`);
    }
    button.disabled = false;
  });
  return element("div", { class: "part zero" }, element("div", { class: "actions" }, button), outcome);
}

// Resolves with true if the zero is in the cell file at the end.
/** @type {(run: string, check: () => unknown, say: (parts: Part) => void) => Promise<boolean>} */
async function write(run, check, say) {
  const planned = await ask("GET", `${CELL}/plate-zero?run=${encodeURIComponent(run)}`);
  /** @type {(next: Part) => void} */
  const state = (next) => say(html`<p class="verdict good">✓ The zero is in ${planned.file}.</p>${next}`);
  if (isSame(planned.before, planned.after)) {
    state([]);
    return true;
  }
  const values = element("div", {});
  render(comparison(planned), values);
  const afterwards = page.simulated ? "The cell must be checked again afterwards." : "Afterwards the cell needs its axis test and its check again.";
  const words = element("p", {}, `Measured at ${timeOf(planned.measured_utc)}. The other lines of ${planned.file} stay as they are. ${afterwards}`);
  if (!(await dialog("Write this zero into the cell file?", [words, values], "Write the zero"))) return false;
  await ask("POST", `${CELL}/plate-zero`, { run, version: planned.version }, WRITE_MS, lease.key);
  state(html`<div class="actions"><button type="button" class="main" @click=${check}>Check the cell before the next motion</button></div>`);
  return true;
}

/** @type {(before: object | null, after: object) => boolean} */
const isSame = (before, after) => JSON.stringify(before) === JSON.stringify(after);

/** @type {(planned: Api.PlannedZero) => Part} */
function comparison({ channels, before, after }) {
  /** @type {(value: number, digits: number) => string} */
  const number = (value, digits) => value.toFixed(digits).replace("-", "−");
  /** @type {(zero: Api.PlateZero | null, i: number) => string} */
  const offset = (zero, i) => (zero === null ? "none" : number(zero.offset_n[i], 3));
  /** @type {(zero: Api.PlateZero | null, i: number) => string} */
  const drift = (zero, i) => (zero === null ? "none" : number(1e3 * zero.drift_n_s[i], 1));
  const rows = channels.map((name, i) => [name, offset(before, i), offset(after, i), drift(before, i), drift(after, i)]);
  const columns = ["channel", "old offset [N]", "new offset [N]", "old drift [mN/s]", "new drift [mN/s]"];
  return table(columns, rows, null, "old and new zero");
}

const place = find("zero-of-run"); // on the page of a run
if (place) place.append(zeroButton(place.dataset.run ?? ""));
