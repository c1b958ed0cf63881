// Compensation: velocity loops, feedforward, paths before and after, refinement, streaming.
import { find } from "./dom.js";
import { JobPanel } from "./job_panel.js";
import { html, nothing, render } from "./lit.js";
import { loadInto } from "./loading.js";
import { showChosenPlan } from "./planned_view.js";
import { on } from "./service.js";
import { modelOf, motionRuns, nameOf, numberOf, offer, options, press, runWords, showRun, wanted } from "./work.js";

const panel = new JobPanel(find("job"), { next, begun, ended, isBelow: ({ kind }) => ["loop", "tracking"].includes(kind) });

/** @type {(place: string, words: string) => Part} */
const step = (place, words) => html`<a class="button main" href="#${place}">${words}</a>`;
/** @type {Record<string, Part>} */
const STEPS = {
  loop: step("make-title", "Create a feedforward"),
  compensate: step("feedforward", "Record with the feedforward"),
  record: step("path-title", "Compare the paths"),
  tracking: step("path-title", "Show the result"),
  retime: step("make-title", "Create a feedforward for it"),
  stream: step("path-title", "Compare the paths"),
};

/** @type {(job: EndedJob) => Part[]} */
function next(job) {
  if (job.state === "done" && job.kind === "record" && !job.request.feedforward) return [STEPS.compensate];
  if (job.state === "done" && job.kind in STEPS) return [STEPS[job.kind]];
  if (job.kind === "loop" && job.document) return [step("loops-part", "What to do")];
  if (job.kind !== "refine" || !job.document) return [];
  return job.document.finished
    ? [STEPS.record, html`<p>The refinement is complete: the remaining error is noise, or no longer shrinks.</p>`]
    : [step("feedforward", "Record with the new file"), html`<p>Then refine again.</p>`];
}

// ---- runs to choose from
const selectAfter = /** @type {HTMLSelectElement} */ (find("after"));

/** @type {(newest?: string | null) => Promise<void>} */
async function showRuns(newest = null) {
  const runs = await loadInto(find("runs-state"), "runs", motionRuns);
  render(nothing, find("runs-state"));
  /** @type {(chosen: Api.RunEntry[]) => { value: string, words: string }[]} */
  const list = (chosen) => chosen.map((run) => ({ value: run.id, words: runWords(run) }));
  for (const select of /** @type {NodeListOf<HTMLSelectElement>} */ (document.querySelectorAll("select.runs"))) options(select, list(runs));
  options(find("loop-run"), list(runs.filter(({ motion }) => motion === "multisine")));
  if (newest) for (const select of [find("refine-run"), selectAfter]) select.value = newest;
  const [before, after] = [find("before"), selectAfter].map((select) => runs.find((run) => run.id === select.value));
  if (!after || (before?.id !== after.id && before?.motion === after.motion)) return; // the chosen runs can be compared
  const other = runs.find((run) => run.id !== after.id && run.motion && run.motion === after.motion);
  if (other) find("before").value = other.id;
}

/** @type {(id: SelectId, words: string) => string} */
const value = (id, words) => {
  const chosen = /** @type {HTMLSelectElement} */ (find(id)).value;
  if (!chosen) throw new Error(`${words} is missing: choose one.`);
  return chosen;
};

const model = () => {
  const asks = { ...modelOf(), model: value("model", "A model (identify the robot first)") };
  const temperature = find("temperature").value.trim();
  return temperature ? { ...asks, temperature } : asks;
};

const byModel = () => ({
  ...model(),
  loop: value("loop", "A file of velocity loops (measure them in step 1)"),
});

// ---- 1: loops
press("measure", panel, "loop", () => panel.begin("loop", { run: value("loop-run", "A run of a multisine motion") }));

// ---- 2: timing, feedforward
press("retime", panel, "retime", () => panel.begin("retime", {
  motion: motionOf(), ...model(),
  margin: numberOf("kept-free", { least: 0 }) / 100, output: nameOf("timed-name", ".yaml"), overwrite: true,
}));

press("make", panel, "compensate", () => {
  const asks = { motion: value("motion", "A motion"), ...byModel(), output: nameOf("feedforward-name", ".json"), overwrite: true };
  const reference = find("reference").value;
  return panel.begin("compensate", reference ? { ...asks, reference } : asks);
});

const motionOf = () => value("motion", "A motion");
press("drive", panel, "record", () => {
  const feedforward = value("feedforward", "A feedforward (create it first)");
  return panel.begin("record", { motion: motionOf(), feedforward, label: "compensated" }, { moves: true });
});
press("drive-plain", panel, "record", () => panel.begin("record", { motion: motionOf(), label: "plain" }, { moves: true }));

// ---- 3: paths
press("compare", panel, "tracking", () => {
  const [before, after] = [value("before", "The run before"), value("after", "The run after")];
  if (before === after) throw new Error("The runs before and after are the same: choose another run.");
  return panel.begin("tracking", { run: [after], against: [before] });
});

// ---- 4: refine
press("refine", panel, "refine", () => {
  const [first, second] = [value("refine-run", "A run with the feedforward"), find("refine-run-2").value];
  if (first === second) throw new Error("The two runs are the same: choose another run.");
  const run = second ? [first, second] : [first];
  return panel.begin("refine", { run, ...byModel(), output: nameOf("refined-name", ".json"), overwrite: true });
});

// ---- 5: stream
press("stream", panel, "stream", () => {
  const asks = { motion: motionOf(), ...byModel(), label: "stream", options: { compensated: find("compensated").checked } };
  return panel.begin("stream", asks, { moves: true });
});

// Show the measured loops of a run, unfolded until another job begins.
/** @type {(run: string) => Promise<void>} */
async function showLoops(run) {
  const part = find("loops-part");
  [part.hidden, part.open] = [false, true];
  await showRun(find("loops-result"), run, "velocity_loops");
}

function begun() {
  find("loops-part").open = false; // it is long, and later steps are below it
}

/** @type {(job: EndedJob) => Promise<void>} */
async function ended(job) {
  if (job.kind === "loop" && job.document) {
    const { document } = job;
    showLoops(document.run);
    const run = [...find("loop-run").options].find((option) => option.value === document.run);
    offer(find("loop"), `runs/${document.run}/loops.json`, run?.textContent);
  }
  if (job.kind === "retime" && job.document) offer(find("motion"), job.document.motion);
  if ((job.kind === "compensate" || job.kind === "refine") && job.document) offer(find("feedforward"), job.document.feedforward);
  if (job.kind === "tracking" && job.document) {
    find("path-title").scrollIntoView({ block: "start" });
    await showRun(find("path-result"), /** @type {string[]} */ (job.request.run)[0], "tracking");
  }
  if (job.kind === "record" || job.kind === "stream") await showRuns(job.run);
}

on("again", () => showRuns());
const wantedMotion = wanted.get("motion");
if (wantedMotion) offer(find("motion"), wantedMotion);
showChosenPlan(find("view"), find("motion"));
await showRuns();
const first = wanted.get("run");
if (first) {
  find("loop-run").value = first;
  await showLoops(first);
}
