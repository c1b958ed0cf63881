// Page Identify with the steps Data, Model, Check, Solve and Result.
import { find } from "./dom.js";
import { keptTicks } from "./entries.js";
import { JobPanel } from "./job_panel.js";
import { html, keyed, live, render } from "./lit.js";
import { loadInto } from "./loading.js";
import { newest } from "./requests.js";
import { CELL, mayMove, on } from "./service.js";
import { fileLink, findings, look, motionRuns, nameOf, numberOf, options, press, runWords, showRun, wanted } from "./work.js";

const solve = find("solve");
/** @type {Api.RunEntry[]} */
let runs = [];
/** @type {Api.DataCheck | null} */
let checked = null; // result of the check of the chosen runs; null until the check has ended
/** @type {string | null} */
let solvedWith = null;
/** @type {{ run: string, path: string } | null} */
let model = null;
let solving = false;

/** @type {Record<string, Part[]>} */
const NEXT = {
  identify: [html`<a class="button main" href="#after">Validate this model</a>`],
  validate: [
    html`<a class="button main" href="${CELL}/compensation">Compensate a path</a>`,
    html`<a class="button" href="${CELL}/payload">Identify a payload</a>`,
  ],
};
/** @type {(job: Api.Job) => Part[]} */
const next = ({ kind, state }) => (state === "done" && NEXT[kind]) || [];
const panel = new JobPanel(find("job"), { next, begun, ended, isBelow: ({ kind }) => ["identify", "validate", "export"].includes(kind) });

// ---- stages
/** @type {Record<string, string>} */
const WORDS = { done: "complete", bad: "problem", now: "running", wait: "not yet" };
/** @type {(name: string, state: string) => void} */
function stage(name, state) {
  const line = /** @type {HTMLElement} */ (document.querySelector(`[data-stage="${name}"]`));
  line.dataset.state = state;
  /** @type {HTMLElement} */ (line.querySelector("span")).textContent = WORDS[state];
}

/** @type {(box: string) => string[]} */
const ticked = (box) => [.../** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll(`${box}:checked`))].map((each) => each.value);

const chosenRuns = () => ticked("#runs input");
const friction = () => ticked("input[name=friction]")[0];
/** @type {() => NonNullable<Api.Request_identify_ModelOptions["friction_terms"]>} */
const terms = () => /** @type {any} */ (ticked("#terms input"));

function modelProblem() {
  if (friction() === "terms" && !terms().length) return "Choose at least one friction term.";
  if (friction() === "terms" && terms().includes("asymmetric") && (terms().includes("coulomb") || terms().includes("offset")))
    return "asymmetric replaces coulomb and offset: choose either asymmetric, or the other two.";
  try {
    numberOf("band", { least: 0.01 });
  } catch (error) {
    return error.message;
  }
  return "";
}

/** @type {() => Api.Requests["identify"]} */
function request() {
  const friction_terms = friction() === "terms" ? terms() : null;
  return {
    names: chosenRuns(),
    choose: friction() === "data",
    cross_check: find("cross").checked,
    diagnose: find("diagnose").checked,
    how: {
      options: {
        weighting: /** @type {Api.Request_identify_EstimationOptions["weighting"]} */ (find("weighting").value),
        band_hz: Number(find("band").value.replace(",", ".")),
        model: { kind: /** @type {Api.Request_identify_ModelOptions["kind"]} */ (find("measured").value), ...(friction_terms ? { friction_terms } : {}) },
      },
    },
  };
}

function show() {
  const names = chosenRuns();
  const dataGood = names.length > 0 && checked !== null && checked.data.every((each) => each.passed !== false);
  const problem = modelProblem();
  const checkGood = dataGood && !problem && checked?.model.every((each) => each.passed !== false);
  stage("data", dataGood ? "done" : names.length && checked ? "bad" : "wait");
  stage("model", problem ? "bad" : "done");
  stage("check", checkGood ? "done" : dataGood ? "bad" : "wait");
  const same = solvedWith !== null && JSON.stringify(request()) === solvedWith;
  stage("solve", solving ? "now" : same ? "done" : "wait");
  find("terms").hidden = friction() !== "terms";
  render(names.length && checked ? findings(checked.data) : [], find("data-findings"));
  render(findings([problem ? { passed: false, text: problem } : { passed: true, text: modelWords() }]), find("model-findings"));
  render(dataGood && checked ? findings(checked.model) : [], find("check-findings"));
  find("check-words").textContent = dataGood ? "Check of data and model together:" : !names.length ? "Choose runs first." : checked === null ? "The data are being checked." : "The data cannot be used: see Data.";
  let why = "";
  if (!mayMove) why = "This device has read-only access. An administrator can revoke it in Settings and admit it as operator.";
  else if (!names.length) why = "Data are missing: choose a run.";
  else if (checked === null) why = "The data are being checked.";
  else if (!dataGood) why = "The data cannot be used: see Data.";
  else if (problem) why = "The model is not complete: see Model.";
  else if (!checkGood) why = "The check has found a problem: see Check.";
  else if (solving) why = "Running.";
  solve.disabled = why !== "";
  find("solve-why").textContent = why;
}

function modelWords() {
  const many = checked === null ? "" : `${checked.parameters} base parameters. `;
  if (friction() === "data") return `${many}The friction terms of each joint are selected from the data.`;
  if (friction() === "terms") return `${many}Friction of every joint: ${terms().join(", ").replaceAll("_", " ")}.`;
  const each = Object.entries(checked?.friction ?? {}).map(([joint, own]) => ({ joint, own: own.join(", ").replaceAll("_", " ") || "none" }));
  const [first] = each;
  const words = each.every(({ own }) => own === first.own) ? `: ${first?.own}, for every joint` : `: ${each.map(({ joint, own }) => `${joint} ${own}`).join("; ")}`;
  return `${many}Friction terms of the robot file${first ? words : ""}.`;
}

const replacing = newest();
async function check() {
  const signal = replacing();
  checked = null;
  show();
  try {
    const query = chosenRuns().map((name) => `run=${encodeURIComponent(name)}`).join("&");
    const answer = await look(`${CELL}/identify/check?${query}`, { signal });
    if (signal.aborted) return;
    checked = answer;
  } catch (error) {
    if (signal.aborted) return;
    checked = { data: [{ passed: false, text: error.message }], model: [], parameters: 0, friction: {} };
  }
  show();
}

async function showRuns() {
  const before = chosenRuns();
  runs = await loadInto(find("runs"), "runs", motionRuns);
  find("no-runs").hidden = runs.length > 0;
  find("runs").hidden = runs.length === 0;
  const [asked, kept] = [wanted.getAll("run"), keptTicks("run")];
  const chosen = [before, asked, kept].find((each) => each.length) ?? [];
  render(runs.map((run) => keyed(run.id, html`<label><input type="checkbox" name="run" value=${run.id} .checked=${live(chosen.includes(run.id))}>
    ${runWords(run)}${run.files.includes("model.json") ? " (has a model)" : ""}</label>`)), find("runs"));
  await check();
}

find("runs").addEventListener("change", check);
find("stage-model").addEventListener("input", show);
press("solve", panel, "identify", async () => {
  const asks = request();
  solving = true;
  show();
  const job = await panel.begin("identify", asks);
  if (job) solvedWith = JSON.stringify(asks);
  else solving = false;
  show();
});

// ---- start and end of jobs
/** @type {(job: Api.Job) => void} */
function begun(job) {
  if (job.kind !== "identify" || job.ended_s) return;
  solving = true;
  show();
}

/** @type {(job: EndedJob) => Promise<void>} */
async function ended(job) {
  if (job.kind === "identify") {
    solving = false;
    const run = job.document ? runOf(job.document.model) : null;
    if (run === null) {
      solvedWith = null;
      stage("result", "bad");
    }
    show();
    if (run !== null) await showResult(run);
  }
  if (job.kind === "validate" && job.document) await showValidation(String(job.request.run));
  if (job.kind === "export" && job.document) {
    const { document } = job;
    const name = document.file.split("/").at(-1) ?? "";
    render(html`<p>${"sentence" in document ? document.sentence : ""}</p>${fileLink(name, `Save ${name}`)}`, find("exported"));
  }
}

/** @type {(path: string) => string} */
const runOf = (path) => path.split("/").at(-2) ?? "";

/** @type {(run: string) => Promise<void>} */
async function showResult(run) {
  find("no-result").hidden = true;
  const blocks = await showRun(find("result"), run, "estimate", "comparison", "curves");
  if (blocks === null) return;
  model = { run, path: `runs/${run}/model.json` };
  find("after").hidden = false;
  stage("result", blocks.some((block) => block.kind === "verdict" && block.passed === false) ? "bad" : "done");
  const used = new Set(chosenRuns());
  used.add(run);
  options(find("other"), runs.filter((each) => !used.has(each.id)).map((each) => ({ value: each.id, words: runWords(each) })), wanted.get("other"));
  find("no-other").hidden = find("other").value !== "";
  find(wanted.has("other") ? "after" : "result-title").scrollIntoView({ block: "start" });
}

press("validate", panel, "validate", async () => {
  if (!find("other").value) throw new Error("There is no other run: record a run for the validation.");
  await panel.begin("validate", { model: model?.path ?? "", run: find("other").value });
});

/** @type {(run: string) => Promise<void>} */
async function showValidation(run) {
  find("validation").scrollIntoView({ block: "start" });
  await showRun(find("validation"), run, "verdict", "validation", "curves");
}

press("export", panel, "export", async () => {
  const { value: to, dataset: { ending = "" } } = find("format").selectedOptions[0];
  render([], find("exported"));
  await panel.begin("export", { what: model?.path ?? "", to: /** @type {Api.Request_export_Format} */ (to), output: nameOf("export-name", ending), overwrite: true });
});

on("again", showRuns);
stage("solve", "wait");
stage("result", "wait");
await showRuns();
const [first] = wanted.getAll("run");
if (first && runs.find((run) => run.id === first)?.files.includes("model.json")) await showResult(first);
