// Page Runs: search and filter the runs, compare two runs, recover a run.
import { find } from "./dom.js";
import { keptChoice } from "./entries.js";
import { JobPanel } from "./job_panel.js";
import { html, nothing, render } from "./lit.js";
import { failedPart, loadingPart } from "./loading.js";
import { runTable } from "./run_table.js";
import { LIST_MS, isReplaced, newest } from "./requests.js";
import { ask, lease, mayMove, now, on, page } from "./service.js";

const compared = find("compared");
const panel = new JobPanel(find("job"), { begun: () => render(nothing, compared), ended, places: { compare: compared } });
const search = find("search");
const choices = [find("cell"), find("kind"), find("status"), find("verdict")];
const kind = find("kind");
const WAIT_MS = 250;
const PAGE = 100;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let waiting;
const replacing = newest();
/** @type {{ groups: Api.RunGroup[] | null, total: number, problem: Error | null }} */
let shown = { groups: null, total: 0, problem: null };
let kinds = [keptChoice(kind) ?? ""].filter(Boolean);
/** @type {string[]} */
let picked = [];
/** @type {Set<string>} */
const opened = new Set();

/** @type {(job: Api.Job) => void} */
function ended({ kind, state }) {
  if (kind === "recover") load();
  if (kind === "compare" && state !== "stopped") find("job").scrollIntoView({ block: "start" });
}

/** @type {(groups: Api.RunGroup[] | null) => Api.RunEntry[]} */
const runsOf = (groups) => (groups ?? []).flatMap(({ head, parts }) => [head, ...parts]);

// Load the first page of the list, or the page that follows the loaded `groups`.
/** @type {(groups?: Api.RunGroup[]) => Promise<void>} */
async function load(groups = []) {
  const wanted = new URLSearchParams({ search: search.value.trim(), offset: String(groups.length), limit: String(PAGE) });
  for (const choice of choices) if (choice.value) wanted.set(choice.id, choice.value);
  try {
    const page = await ask("GET", `/run-groups?${wanted}`, undefined, LIST_MS, lease.key, { signal: replacing() });
    shown = { groups: [...groups, ...page.groups], total: page.total, problem: null };
    picked = picked.filter((id) => runsOf(shown.groups).some((run) => run.id === id));
    kinds = [...new Set([...kinds, ...page.kinds])];
  } catch (error) {
    if (isReplaced(error)) return;
    shown = { groups: null, total: 0, problem: error };
  }
  draw();
}

const drawKinds = () => render(kinds.map((name) => html`<option>${name}</option>`), kind);

function draw() {
  drawKinds();
  render(shown.problem ? failedPart(shown.problem, load) : shown.groups ? listOf(shown.groups) : loadingPart("runs"), find("runs"));
  find("compare").disabled = picked.length !== 2 || !mayMove;
  find("compare").classList.toggle("main", picked.length === 2);
  find("picked").textContent = picked.length === 2 ? `${labelOf(picked[0])} with ${labelOf(picked[1])}` : "Pick two runs of the same robot.";
}

/** @type {(id: string) => string} */
function labelOf(id) {
  const run = runsOf(shown.groups).find((each) => each.id === id);
  return run?.label ? `${run.label} (${id})` : id;
}

/** @type {(groups: Api.RunGroup[]) => Part[]} */
const listOf = (groups) => [
  groups.length
    ? runTable(groups, { pick, picked, opened, fold, cells: !find("cell").value })
    : html`<p class="soft">No run matches this filter.</p>`,
  groups.length < shown.total
    ? html`<p><button type="button" id="more" @click=${() => load(groups)}>Show more</button> ${groups.length} of ${shown.total} are shown.</p>`
    : nothing,
  runsOf(groups).filter((run) => run.problem || (run.status === "unfinished" && !isRecorded(run))).map(recovery),
];

// Return true if the present job of this cell may record the run: the run was created after the job began.
/** @type {(run: Api.RunEntry) => boolean} */
function isRecorded(run) {
  const job = now.status?.job;
  return job != null && ["", page.cell].includes(run.cell) && Date.parse(run.created_utc) / 1000 >= Math.floor(job.created_s);
}

// Return a button that recovers a run that was not closed or whose manifest cannot be read: a job writes the parts
// with valid checksums into a new run.
/** @type {(run: Api.RunEntry) => Part} */
const recovery = (run) => html`
  ${run.problem ? html`<p class="verdict bad">${run.problem}</p>` : nothing}
  <p><button type="button" data-needs="role" ?disabled=${!mayMove} @click=${() => panel.begin("recover", { what: run.id })}>
    Recover ${run.label || run.id}</button></p>`;

/** @type {(event: Event) => void} */
function pick({ target }) {
  const { checked, value } = /** @type {HTMLInputElement} */ (target);
  picked = checked ? [...picked, value] : picked.filter((id) => id !== value);
  draw();
}

/** @type {(id: string) => void} */
function fold(id) {
  if (!opened.delete(id)) opened.add(id);
  draw();
}

search.addEventListener("input", () => {
  clearTimeout(waiting);
  waiting = setTimeout(load, WAIT_MS);
});
for (const choice of choices) choice.addEventListener("change", () => load());
find("filter").addEventListener("submit", (event) => {
  event.preventDefault();
  load();
});
find("compare").addEventListener("click", () => panel.begin("compare", { first: picked[0], second: picked[1] }));
/** @type {string | null | undefined} */
let job = null;
on("cell", (status) => {
  if (status.job?.id !== job && shown.groups) draw();
  job = status.job?.id;
});
on("again", () => shown.problem && load());
draw();
if (kinds.length) kind.value = kinds[0];
load();
