// Friction alone: from the runs that were made to measure it to models, joint by joint.
import { element, find, table } from "./dom.js";
import { ask, on } from "./service.js";
import { WorkPanel, completeRuns, figuresOf, findingList, gradeOf, measured, number, press, runWords, verdictOf, wanted } from "./work.js";

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
  if (!run.length) throw new Error("A run is missing: choose one at constant speed, or there and back.");
  const model = find("model").value;
  return panel.begin("friction", model ? { run, model } : { run });
});

// ---- the result
async function showResult(run) {
  const { friction, notes } = await ask("GET", `/runs/${encodeURIComponent(run)}/result`);
  if (!friction) return;
  const cards = await figuresOf(run, (name) => name === "friction", () => true);
  const bad = friction.joints.filter((joint) => joint.grade === "bad").map((joint) => joint.joint);
  const judged = bad.length
    ? { passed: false, headline: `No model explains the friction of ${bad.join(", ")}`, sentence: "Look at the curve for a warming or slipping joint, and measure again." }
    : { passed: true, headline: "A model explains the friction of every joint", sentence: friction.sentence };
  find("result").replaceChildren(
    verdictOf(judged),
    findingList([...friction.joints.map((joint) => joint.sentence), ...(notes ?? [])].map((text) => ({ passed: null, text }))),
    ...cards, fitTable(friction.joints), ...friction.joints.map(jointPart));
  find("result").dataset.run = run;
  find("result-card").hidden = false;
}

function fitTable(joints) {
  const rows = joints.map((joint) => {
    const [best] = joint.fits;
    return [
      joint.joint, gradeOf(joint.grade), joint.reason ?? "–", best?.name ?? "–",
      best ? `${number(best.rms, 3)} ${joint.torque_unit}` : "–",
      joint.percent == null ? "–" : `${number(joint.percent, 3)} %`,
      joint.over_noise == null ? "–" : `${number(joint.over_noise, 2)} times`,
    ];
  });
  return table(["joint", "fit", "why", "best model", "error (RMS)", "of friction", "over noise"], rows, null, "fit of each joint");
}

function jointPart({ joint, unit, torque_unit: torque, curve, fits }) {
  const models = fits.map((fit) => [fit.name, fit.parameters.map(coefficient).join(", ") + (fit.at_bound ? " (at its bound)" : "")]);
  const speeds = curve.speed.map((speed, i) => {
    const [value, reach] = measured(curve.odd[i], 2 * curve.odd_std[i]);
    return [`${number(speed, 3)} ${unit}/s`, `${value} ± ${reach} ${torque}`];
  });
  return element("details", {}, element("summary", {}, `${joint}: models and values`),
    table(["model", "coefficients ± 2σ"], models, null, `models of ${joint}`),
    table(["speed", "friction ± 2σ"], speeds, null, `friction of ${joint}`));
}

const coefficient = ({ name, value, std, unit }) => `${name} ${measured(value, 2 * std).join(" ± ")} ${unit}`;

async function ended(job, document) {
  if (job.kind === "friction" && document) await showResult(document.run);
}

on("again", showRuns);
await showRuns();
const [first] = wanted.getAll("run");
if (runs.find((run) => run.id === first)?.has_report) await showResult(first);
