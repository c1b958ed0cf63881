// Page Runs: search, filter, compare two runs, recover runs.
import { find } from "./dom.js";
import { keptChoice } from "./entries.js";
import { JobPanel } from "./job_panel.js";
import { html, nothing, render } from "./lit.js";
import { runTable } from "./run_table.js";
import { isReplaced, newest } from "./requests.js";
import { ask, lease, mayMove } from "./service.js";

const panel = new JobPanel(find("job"), { ended: (job) => job.kind === "recover" && load() });
const [search, kind, status] = ["search", "kind", "status"].map(find);
const WAIT_MS = 250;
const LIST_MS = 30000;
let waiting = null;
const replacing = newest();
let shown = { runs: null, problem: "" };
let kinds = [keptChoice(kind)].filter(Boolean);
let picked = [];

async function load() {
  const wanted = new URLSearchParams({ search: search.value.trim(), limit: "500" });
  if (kind.value) wanted.set("kind", kind.value);
  if (status.value) wanted.set("status", status.value);
  try {
    const runs = await ask("GET", `/runs?${wanted}`, undefined, LIST_MS, lease.key, { signal: replacing() });
    shown = { runs, problem: "" };
    picked = picked.filter((id) => runs.some((run) => run.id === id));
    kinds = [...new Set([...kinds, ...runs.map((run) => run.kind)])].filter(Boolean);
  } catch (error) {
    if (isReplaced(error)) return;
    shown = { runs: null, problem: error.message };
  }
  draw();
}

const drawKinds = () => render(kinds.map((name) => html`<option>${name}</option>`), kind);

function draw() {
  drawKinds();
  render(shown.problem ? html`<p class="problem">${shown.problem}</p>` : listOf(shown.runs), find("runs"));
  find("compare").disabled = picked.length !== 2 || !mayMove;
  find("compare").classList.toggle("main", picked.length === 2);
  find("picked").textContent = picked.length === 2 ? `${picked[0]} with ${picked[1]}` : "Pick two identified runs.";
}

const listOf = (runs) => [
  runs.length ? runTable(runs, pick, picked) : html`<p class="soft">No run matches this filter.</p>`,
  runs.filter((run) => run.problem || run.status === "unfinished").map(recovery),
];

// Recover a run that was not closed: the parts with valid checksums are written again.
const recovery = (run) => html`
  ${run.problem ? html`<p class="verdict bad">${run.problem}</p>` : nothing}
  <p><button type="button" data-needs="role" ?disabled=${!mayMove} @click=${() => panel.begin("recover", { what: run.id })}>
    Recover ${run.label || run.id}</button></p>`;

function pick({ target: { checked, value } }) {
  picked = checked ? [...picked, value] : picked.filter((id) => id !== value);
  draw();
}

search.addEventListener("input", () => {
  clearTimeout(waiting);
  waiting = setTimeout(load, WAIT_MS);
});
for (const choice of [kind, status]) choice.addEventListener("change", load);
find("filter").addEventListener("submit", (event) => {
  event.preventDefault();
  load();
});
find("compare").addEventListener("click", () => panel.begin("compare", { first: picked[0], second: picked[1] }));
drawKinds();
if (kinds.length) kind.value = kinds[0];
load();
