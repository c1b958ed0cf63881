// Page Friction: identify friction alone, joint by joint, from runs that were made for it.
import { element, find } from "./dom.js";
import { on } from "./service.js";
import { WorkPanel, completeRuns, press, runWords, showRun, wanted } from "./work.js";

const MEASURE = new Set(["constant_velocity", "reversed"]);
const panel = new WorkPanel(find("job"), { ended });

// ---- runs to choose from
const chosenRuns = () => [...document.querySelectorAll("#runs input:checked")].map((box) => box.value);

let runs = [];
async function showRuns() {
  const before = chosenRuns();
  const chosen = before.length ? before : wanted.getAll("run");
  runs = (await completeRuns()).filter((run) => MEASURE.has(run.motion));
  find("no-runs").hidden = runs.length > 0;
  const boxes = runs.map((run) => {
    const box = element("input", { type: "checkbox", value: run.id, name: "run" });
    box.checked = chosen.includes(run.id);
    return element("label", {}, box, `${runWords(run)} (${run.motion.replaceAll("_", " ")})`);
  });
  find("runs").hidden = runs.length === 0;
  find("runs").replaceChildren(element("legend", {}, "Runs to measure from"), ...boxes);
}

press("measure", panel, "friction", () => {
  const run = chosenRuns();
  if (!run.length) throw new Error("A run is missing: choose a constant-speed run, or a forward and reversed run.");
  const model = find("model").value;
  return panel.begin("friction", model ? { run, model } : { run });
});

// ---- the result
async function showResult(run) {
  find("result-card").hidden = false;
  await showRun(find("result"), run, "friction");
}

async function ended(job, document) {
  if (job.kind === "friction" && document) await showResult(document.run);
}

on("again", showRuns);
await showRuns();
const [first] = wanted.getAll("run");
if (runs.find((run) => run.id === first)?.has_report) await showResult(first);
