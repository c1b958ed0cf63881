// Page Friction: identify the friction of each joint from runs that were recorded for this purpose.
import { find } from "./dom.js";
import { keptTicks } from "./entries.js";
import { JobPanel } from "./job_panel.js";
import { html, keyed, live, render } from "./lit.js";
import { loadInto } from "./loading.js";
import { on } from "./service.js";
import { completeRuns, press, runWords, showRun, wanted } from "./work.js";

const MEASURE = new Set(["constant_velocity", "reversed"]);
const panel = new JobPanel(find("job"), {
  ended, isBelow: ({ kind }) => kind === "friction",
  next: ({ document }) => (document ? [html`<a class="button main" href="#result-title">Show the result</a>`] : []),
});

// ---- runs to choose from
/** @type {() => string[]} */
const chosenRuns = () => [.../** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll("#runs input:checked"))].map((box) => box.value);

/** @type {Api.RunEntry[]} */
let runs = [];
async function showRuns() {
  const before = chosenRuns();
  runs = (await loadInto(find("runs"), "runs", completeRuns)).filter((run) => MEASURE.has(run.motion));
  const [asked, kept] = [wanted.getAll("run"), keptTicks("run")];
  const chosen = [before, asked, kept].find((each) => each.length) ?? [];
  find("no-runs").hidden = runs.length > 0;
  find("runs").hidden = runs.length === 0;
  render(runs.map((run) => keyed(run.id, html`<label><input type="checkbox" name="run" value=${run.id} .checked=${live(chosen.includes(run.id))}>
    ${runWords(run)} (${run.motion.replaceAll("_", " ")})</label>`)), find("runs"));
}

press("measure", panel, "friction", () => {
  const run = chosenRuns();
  if (!run.length) throw new Error("A run is missing: choose constant-speed runs, or runs of a path that the robot follows forward and backward.");
  const model = find("model").value;
  return panel.begin("friction", model ? { run, model } : { run });
});

// ---- the result
/** @type {(run: string) => Promise<void>} */
async function showResult(run) {
  find("result-card").hidden = false;
  find("result-title").scrollIntoView({ block: "start" });
  await showRun(find("result"), run, "friction");
}

/** @type {(job: EndedJob) => Promise<void>} */
async function ended(job) {
  if (job.kind === "friction" && job.document) await showResult(job.document.run);
}

on("again", showRuns);
await showRuns();
const [first] = wanted.getAll("run");
if (runs.find((run) => run.id === first)?.has_report) await showResult(first);
