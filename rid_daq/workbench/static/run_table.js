// Table of groups of runs; the user opens a group to see its other runs below its first row.
import { timeOf } from "./dom.js";
import { html, keyed, nothing } from "./lit.js";
import { inPageWords } from "./page_words.js";
import { CELL } from "./service.js";

const BAD = ["damaged", "unfinished"];
/** @type {Record<string, [string, string]>} */
const MARKS = { passed: ["good", "✓"], failed: ["bad", "✗"] };

// Each group has a `head` and `parts`. Options: `pick` is called when a checkbox changes; `picked` contains the ids of
// the ticked runs; `opened` contains the ids of the heads whose parts are shown; `fold(id)` opens or closes a group;
// `cells` returns the table cells of a run.
/** @type {(groups: Api.RunGroup[], options?: RunTableOptions) => Part} */
export function runTable(groups, { pick = null, picked = [], opened = new Set(), fold = null, cells = false } = {}) {
  const heads = [...(pick ? ["pick"] : []), "run", "verdict", "status", ...(cells ? ["cell"] : []), "when", "kind", "report"];
  /** @type {(run: Api.RunEntry, isPart?: boolean, parts?: Api.RunEntry[]) => Part} */
  const row = (run, isPart = false, parts = []) => keyed(run.id, html`<tr class="${BAD.includes(run.status) ? "red" : ""} ${isPart ? "member" : ""}">
    ${pick ? html`<td>${tick(run, pick, picked)}</td>` : nothing}
    <td class="name">${name(run)}${parts.length && fold ? folder(run, parts, opened.has(run.id), fold) : nothing}</td>
    <td>${verdict(run)}</td>
    <td>${run.status}${run.reason ? html`<span class="why">${inPageWords(run.reason)}</span>` : nothing}</td>
    ${cells ? html`<td>${run.cell || "–"}</td>` : nothing}
    <td class="when">${run.created_utc ? timeOf(run.created_utc) : run.id}</td>
    <td>${run.kind || "–"}</td>
    <td>${run.has_report ? report(run) : "–"}</td></tr>`);
  /** @type {(group: Api.RunGroup) => Part[]} */
  const group = ({ head, parts }) => [row(head, false, parts), opened.has(head.id) ? parts.map((run) => row(run, true)) : nothing];
  return html`<div class="scroll" tabindex="0" role="group" aria-label="runs"><table class="stacked">
    <thead><tr>${heads.map((text) => html`<th scope="col">${text}</th>`)}</tr></thead><tbody>${groups.map(group)}</tbody></table></div>`;
}

/** @type {(run: Api.RunEntry) => string} */
const link = ({ id }) => `${CELL}/runs/${encodeURIComponent(id)}`;
/** @type {(run: Api.RunEntry) => Part} */
const name = (run) => (run.status === "damaged" ? run.id : html`<a href=${link(run)}>${run.label || run.id}</a>`);
/** @type {(run: Api.RunEntry) => Part} */
const report = ({ id }) => html`<a href="/api/v1/runs/${encodeURIComponent(id)}/report" target="_blank" rel="noopener">Report</a>`;

/** @type {(run: Api.RunEntry, pick: (event: Event) => void, picked: string[]) => Part} */
const tick = ({ id, label, status }, pick, picked) => html`<label class="tick"><span class="hidden">pick ${label} ${id}</span>
  <input type="checkbox" value=${id} @change=${pick} .checked=${picked.includes(id)} ?disabled=${status === "damaged"}></label>`;

/** @type {(run: Api.RunEntry, parts: Api.RunEntry[], open: boolean, fold: (id: string) => void) => Part} */
const folder = (run, parts, open, fold) => html`<button type="button" class="fold" aria-expanded=${open} @click=${() => fold(run.id)}>
  ${open ? "▾" : "▸"} ${parts.length} ${parts.length === 1 ? "run" : "runs"} with it${counts(parts)}</button>`;

// Return the numbers of passed and failed runs as text, for a group whose runs are not shown.
/** @type {(parts: Api.RunEntry[]) => string} */
function counts(parts) {
  const words = Object.keys(MARKS).map((word) => [parts.filter((run) => run.verdict === word).length, word]);
  return words.filter(([count]) => count).map(([count, word]) => `, ${count} ${word}`).join("");
}

/** @type {(run: Api.RunEntry) => Part} */
function verdict({ verdict: word, headline, has_report: hasReport }) {
  // earlier versions of the program did not write the verdict into the run's manifest
  if (!word) return hasReport ? html`unknown<span class="why">An earlier version of the program made this run: see the verdict in its report.</span>` : "–";
  const [kind, mark] = MARKS[word] ?? ["", "–"];
  return html`<b class="word ${kind}">${mark} ${word}</b><span class="why">${inPageWords(headline)}</span>`;
}
