// Table of runs; with `pick`, each row has a checkbox.
import { table } from "./blocks.js";
import { timeOf } from "./dom.js";
import { html } from "./lit.js";
import { CELL } from "./service.js";

const BAD = ["damaged", "unfinished"];

export function runTable(runs, pick = null, picked = []) {
  const tick = ({ id, status }) => html`<label class="tick"><span class="hidden">pick ${id}</span>
    <input type="checkbox" value=${id} @change=${pick} .checked=${picked.includes(id)} ?disabled=${status === "damaged"}></label>`;
  const name = ({ id, label, status }) => (status === "damaged" ? id : html`<a href="${CELL}/runs/${encodeURIComponent(id)}">${label || id}</a>`);
  const report = ({ id }) => html`<a href="/api/v1/runs/${encodeURIComponent(id)}/report" target="_blank" rel="noopener">Report</a>`;
  const rows = runs.map((run) => [
    ...(pick ? [tick(run)] : []), name(run), run.kind || "–", run.status, run.robot || "–",
    run.created_utc ? timeOf(run.created_utc) : run.id, run.has_report ? report(run) : "–",
  ]);
  const heads = [...(pick ? ["pick"] : []), "run", "kind", "status", "robot", "when", "report"];
  return table(heads, rows, runs.map((run) => BAD.includes(run.status)), "runs");
}
