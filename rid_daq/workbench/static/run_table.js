// Runs as a table; with `pick`, each may be ticked.
import { element, moment } from "./dom.js";
import { page } from "./service.js";

const BAD = ["damaged", "unfinished"];
const BASE = `/cells/${encodeURIComponent(page.cell)}/runs`;

export const runAddress = (id) => `${BASE}/${encodeURIComponent(id)}`;

export function runTable(runs, pick = null) {
  const row = (run) => {
    const tick = pick
      ? element(
          "td",
          {},
          element(
            "label",
            { class: "tick" },
            element("span", { class: "hidden" }, `pick ${run.id}`),
            element("input", { type: "checkbox", value: run.id, onchange: pick, disabled: run.status === "damaged" }),
          ),
        )
      : null;
    const name = run.status === "damaged" ? run.id : element("a", { href: runAddress(run.id) }, run.label || run.id);
    const report = `/api/v1/runs/${encodeURIComponent(run.id)}/report`;
    const link = element("a", { href: report, target: "_blank", rel: "noopener" }, "Report");
    return element(
      "tr",
      { class: BAD.includes(run.status) ? "red" : null },
      tick,
      element("td", {}, name),
      element("td", {}, run.kind || "–"),
      element("td", {}, run.status),
      element("td", {}, run.robot || "–"),
      element("td", { class: "number" }, run.created_utc ? moment(Date.parse(run.created_utc) / 1000) : run.id),
      element("td", {}, run.has_report ? link : "–"),
    );
  };
  const heads = [...(pick ? ["pick"] : []), "run", "kind", "status", "robot", "when", "report"];
  return element(
    "div",
    { class: "scroll", tabindex: "0", role: "group", "aria-label": "runs" },
    element(
      "table",
      {},
      element("thead", {}, element("tr", {}, ...heads.map((text) => element("th", { scope: "col" }, text)))),
      element("tbody", {}, ...runs.map(row)),
    ),
  );
}
