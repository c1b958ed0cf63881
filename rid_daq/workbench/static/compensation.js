// Compensation: velocity loops, feedforward, paths before and after, refinement, streaming.
import { element, find, table } from "./dom.js";
import { ask, on } from "./service.js";
import { WorkPanel, completeRuns, figuresOf, findingList, gradeOf, nameOf, number, numberOf, offer, options, press, runWords, wanted } from "./work.js";

const told = (text) => ({ passed: null, text });
const panel = new WorkPanel(find("job"), { ended });

// ---- runs to choose from
async function showRuns(newest = null) {
  const runs = await completeRuns();
  const list = runs.map((run) => ({ value: run.id, words: runWords(run), files: run.files }));
  for (const select of document.querySelectorAll("select.runs")) options(select, list);
  if (newest) for (const id of ["after", "refine-run"]) find(id).value = newest;
}

const value = (id, words) => {
  const chosen = find(id).value;
  if (!chosen) throw new Error(`${words} is missing: choose one.`);
  return chosen;
};

const model = () => {
  const asks = { model: value("model", "A model: identify the robot first. It") };
  const temperature = find("temperature").value.trim();
  return temperature ? { ...asks, temperature } : asks;
};

const byModel = () => ({
  ...model(),
  loop: value("loop", "A file of velocity loops: measure them in step 1. It"),
});

// ---- 1: loops
press("measure", panel, "loop", () => panel.begin("loop", { run: value("loop-run", "A run of a multisine") }));

async function showLoops(run) {
  const place = find("loops-result");
  const result = await ask("GET", `/runs/${encodeURIComponent(run)}/result`);
  const loops = result.velocity_loops;
  if (!loops) return;
  const rows = loops.axes.map((axis) => [
    axis.joint, gradeOf(axis.grade), `${number(axis.gain, 4)} ${axis.unit}`, `${number(1e3 * axis.integral_time_s, 3)} ms`,
    margins(axis.velocity_margins), margins(axis.position_margins),
    axis.largest_position_gain_per_s === null ? "–" : `${number(axis.largest_position_gain_per_s, 3)} 1/s`,
  ]);
  const columns = ["axis", "fit", "gain", "integral time", "margins, velocity loop", "margins, position loop", "largest position gain"];
  const notes = loops.axes.flatMap((axis) => axis.findings.map((text) => told(`${axis.joint}: ${text}`)));
  const cards = await figuresOf(run, (name) => name.startsWith("bode-"), (name) => name === `bode-${loops.axes[0].joint}`);
  place.replaceChildren(...[table(columns, rows, null, "velocity loops"), notes.length ? findingList(notes) : null, ...cards].filter(Boolean));
}

function margins(each) {
  const phase = each.phase_deg === null || each.phase_deg === undefined ? "–" : `${number(each.phase_deg, 3)}°`;
  const gain = each.gain_db === null || each.gain_db === undefined ? "–" : `${number(each.gain_db, 3)} dB`;
  return `${phase}, ${gain}`;
}

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
  const feedforward = value("feedforward", "A feedforward: make it first. It");
  return panel.begin("record", { motion: motionOf(), feedforward, label: "compensated" }, { moves: true });
});
press("drive-plain", panel, "record", () => panel.begin("record", { motion: motionOf(), label: "plain" }, { moves: true }));

// ---- 3: paths
press("compare", panel, "tracking", () => {
  const [before, after] = [value("before", "The run before"), value("after", "The run after")];
  if (before === after) throw new Error("Before and after are the same run: choose another one.");
  return panel.begin("tracking", { run: [after], against: [before] });
});

function reduced(ratio) {
  if (!ratio) return "–";
  return ratio < 1 ? `error grew ${number(1 / ratio, 3)} times` : `error reduced ${number(ratio, 3)} times`;
}

async function showPaths(run) {
  const place = find("path-result");
  const { tracking, notes } = await ask("GET", `/runs/${encodeURIComponent(run)}/result`);
  const mm = (metres) => `${number(1e3 * metres, 3)} mm`;
  const rows = tracking.motions.map((each) => [
    each.sentence, each.before ? mm(each.before.mean_m) : "–", mm(each.after.mean_m),
    reduced(each.mean_ratio),
    each.before ? mm(each.before.max_m) : "–", mm(each.after.max_m),
  ]);
  const columns = ["motion", "mean before", "mean after", "", "largest before", "largest after"];
  const cards = await figuresOf(run, (name) => name.startsWith("path-"), (name) => name === "path-1");
  const list = [...new Set([tracking.unseen, ...(notes ?? []), ...tracking.motions.map((each) => each.use)])].filter(Boolean);
  place.replaceChildren(table(columns, rows, null, "distance from the path, at the motor encoders"), findingList(list.map(told)), ...cards);
}

// ---- 4: refine
press("refine", panel, "refine", () => {
  const run = [value("refine-run", "A run with the feedforward")];
  return panel.begin("refine", { run, ...byModel(), output: nameOf("refined-name", ".json"), overwrite: true });
});

// ---- 5: stream
press("stream", panel, "stream", () => {
  const asks = { motion: motionOf(), ...byModel(), label: "stream", options: { compensated: find("compensated").checked } };
  return panel.begin("stream", asks, { moves: true });
});

async function ended(job, document) {
  if (job.kind === "loop" && document) {
    await showLoops(document.run);
    offer(find("loop"), `runs/${document.run}/loops.json`);
  }
  if (job.kind === "retime" && document) offer(find("motion"), document.motion);
  if ((job.kind === "compensate" || job.kind === "refine") && document) {
    offer(find("feedforward"), document.feedforward);
  }
  if (job.kind === "refine" && document) {
    const words = document.finished ? "Refined enough: what is left is noise, or does not repeat." : "Next: record with the new file, then refine again.";
    panel.after.append(element("p", {}, words));
  }
  if (job.kind === "tracking" && document) await showPaths(job.request.run[0]);
  if (job.kind === "record" || job.kind === "stream") await showRuns(job.run);
}

on("again", () => showRuns());
await showRuns();
const first = wanted.get("run");
if (first) {
  find("loop-run").value = first;
  await showLoops(first);
}
