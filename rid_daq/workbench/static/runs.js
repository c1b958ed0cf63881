// Page Runs: search, filter, compare two runs.
import { element, find } from "./dom.js";
import { JobPanel } from "./job_panel.js";
import { runTable } from "./run_table.js";
import { isReplaced, newest } from "./requests.js";
import { ask, lease, mayMove } from "./service.js";

const panel = new JobPanel(find("job"), { ended: (job) => job.kind === "recover" && load() });
const kinds = new Set();
const [search, kind, status] = ["search", "kind", "status"].map(find);
const WAIT_MS = 250;
const LIST_MS = 30000;
let waiting = null;
const replacing = newest();
let picked = [];

async function load() {
  const wanted = new URLSearchParams({ search: search.value.trim(), limit: "500" });
  if (kind.value) wanted.set("kind", kind.value);
  if (status.value) wanted.set("status", status.value);
  try {
    const runs = await ask("GET", `/runs?${wanted}`, undefined, LIST_MS, lease.key, { signal: replacing() });
    for (const run of runs) addKind(run.kind);
    picked = [];
    showPicked();
    const none = element("p", { class: "soft" }, "No run matches this filter.");
    find("runs").replaceChildren(runs.length ? runTable(runs, pick) : none, ...runs.filter((run) => run.problem).map(damaged), ...runs.filter((run) => run.status === "unfinished").map(recover));
  } catch (error) {
    if (isReplaced(error)) return;
    find("runs").replaceChildren(element("p", { class: "problem" }, error.message));
  }
}

function addKind(name) {
  if (!name || kinds.has(name)) return;
  kinds.add(name);
  kind.append(element("option", {}, name));
}

const damaged = (run) =>
  element("div", {}, element("p", { class: "verdict bad" }, run.problem), recover(run));

// Recover a run that was not closed: the parts with valid checksums are written again.
function recover(run) {
  const go = () => panel.begin("recover", { what: run.id });
  const label = `Recover ${run.label || run.id}`;
  return element("p", {}, element("button", { type: "button", "data-needs": "role", disabled: !mayMove, onclick: go }, label));
}

function pick(event) {
  const { checked, value } = event.target;
  picked = checked ? [...picked, value] : picked.filter((id) => id !== value);
  showPicked();
}

function showPicked() {
  find("compare").disabled = picked.length !== 2 || !mayMove;
  find("compare").classList.toggle("main", picked.length === 2);
  find("picked").textContent = picked.length === 2 ? `${picked[0]} with ${picked[1]}` : "Pick two identified runs.";
}

const later = () => {
  clearTimeout(waiting);
  waiting = setTimeout(load, WAIT_MS);
};
search.addEventListener("input", later);
for (const choice of [kind, status]) choice.addEventListener("change", load);
find("filter").addEventListener("submit", (event) => {
  event.preventDefault();
  load();
});
find("compare").addEventListener("click", () => panel.begin("compare", { first: picked[0], second: picked[1] }));
load();
