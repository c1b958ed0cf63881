// Table of runs; with `pick`, each row has a checkbox.
import { element, moment, table } from "./dom.js";
import { page } from "./service.js";

const BAD = ["damaged", "unfinished"];
const BASE = `/cells/${encodeURIComponent(page.cell)}/runs`;

export function runTable(runs, pick = null) {
  const tick = ({ id, status }) =>
    element("label", { class: "tick" }, element("span", { class: "hidden" }, `pick ${id}`),
      element("input", { type: "checkbox", value: id, onchange: pick, disabled: status === "damaged" }));
  const name = ({ id, label, status }) => (status === "damaged" ? id : element("a", { href: `${BASE}/${encodeURIComponent(id)}` }, label || id));
  const report = ({ id }) => element("a", { href: `/api/v1/runs/${encodeURIComponent(id)}/report`, target: "_blank", rel: "noopener" }, "Report");
  const rows = runs.map((run) => [
    ...(pick ? [tick(run)] : []), name(run), run.kind || "–", run.status, run.robot || "–",
    run.created_utc ? moment(Date.parse(run.created_utc) / 1000) : run.id, run.has_report ? report(run) : "–",
  ]);
  const heads = [...(pick ? ["pick"] : []), "run", "kind", "status", "robot", "when", "report"];
  return table(heads, rows, runs.map((run) => BAD.includes(run.status)), "runs");
}
