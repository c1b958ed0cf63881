// Page Experiment: choose or design a motion, show it, rehearse it and record it.
import { addressOf, find } from "./dom.js";
import { JobPanel, afterCheck } from "./job_panel.js";
import { html } from "./lit.js";
import { showChosenPlan } from "./planned_view.js";
import { CELL, go, on, page } from "./service.js";
import { blocksUrl, modelOf, motionRuns, nameOf, numberOf, offer, press, showBlocks, wanted } from "./work.js";

const OTHER_SEED = 1;
const motion = find("motion");
const kind = find("kind");

// Page and words of the link that is offered after a recording, by the kind of its motion (default: Identify).
/** @type {Record<string, [string, string]>} */
const NEXT = {
  multisine: ["compensation", "Measure the velocity loops"],
  constant_velocity: ["friction", "Measure the friction"],
  reversed: ["friction", "Measure the friction"],
};

/** @type {Api.RunEntry | null} */
let modelled = null; // the newest run with a model, at the start of a recording
/** @type {(address: string, words: string, kind: string | false) => Part} */
const step = (address, words, kind) => html`<a class="button ${kind || ""}" href="${CELL}/${address}">${words}</a>`;

const panel = new JobPanel(find("job"), {
  next: (job) => {
    const record = html`<a class="button main" href="#drive-title">Record this motion</a>`;
    if (job.kind === "check") return afterCheck(job, record);
    if (job.state === "done" && job.kind === "design") return [record];
    if (job.state !== "done" || !job.run) return [];
    const run = encodeURIComponent(job.run);
    if (job.kind !== "record") return [];
    const kind = [...motion.options].find((option) => option.value === job.request.motion)?.dataset.kind?.replaceAll("-", "_");
    const [path, words] = NEXT[kind ?? ""] ?? ["identify", "Identify this run"];
    const own = `${path}?run=${run}`;
    if (kind === "path" || kind === "circle")
      return [step(`compensation?motion=${encodeURIComponent(String(job.request.motion))}`, "Compensate this path", "main"), step(own, words, false)];
    if ((kind ?? "") in NEXT || !modelled) return [step(own, words, "main")];
    const check = `identify?run=${encodeURIComponent(modelled.id)}&other=${run}`;
    const isCheck = kind === "validation" || kind === "multipoint"; // `init` writes a multipoint motion for the validation
    const steps = [step(check, "Validate the model on this run", isCheck && "main"), step(own, words, !isCheck && "main")];
    return isCheck ? steps : steps.reverse();
  },
  begun: async (job) => {
    if (job.kind !== "record") return;
    const runs = await motionRuns().catch(() => []); // without a connection, no validation is offered
    modelled = runs.find((each) => each.id !== job.run && each.files.includes("model.json")) ?? null;
  },
  ended: (job) => {
    if (job.kind === "design" && job.state === "done" && job.document) {
      find("design").open = false;
      offer(motion, job.document.motion, job.document.motion, kind.value);
      motion.scrollIntoView({ block: "center" });
    }
  },
});

// ---- the motion and its plots
function showMotion() {
  find("no-motion").hidden = motion.options.length > 0;
  find("motion-problem").textContent = "";
  find("edit").hidden = !motion.value;
  if (!motion.value) return;
  find("edit").href = `${CELL}/edit/${addressOf(motion.value)}`;
  find("label").placeholder = motion.value.replace(/\.yaml$/, "");
  showBlocks(find("picture"), blocksUrl(`${CELL}/motion`, { file: motion.value, ...modelOf() }), { what: "motion" });
}

motion.addEventListener("change", showMotion);
showChosenPlan(find("view"), motion);
find("model").addEventListener("change", showMotion);
find("payload").addEventListener("change", showMotion);

// ---- design
function showFields() {
  for (const part of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-of]"))) part.hidden = !part.dataset.of?.split(" ").includes(kind.value);
}

kind.addEventListener("change", () => {
  const period = find("period");
  period.value = (kind.value === "multisine" && period.dataset.multisine) || period.defaultValue;
  find("periods").value = kind.value === "multisine" || kind.value === "validation" ? "4" : "16";
  find("name").value = kind.value;
  showFields();
});

/** @type {() => Api.Requests["design"]} */
function designRequest() {
  const isValidation = kind.value === "validation";
  const request = { output: nameOf("name", ".yaml"), kind: /** @type {Api.Requests["design"]["kind"]} */ (isValidation ? "excitation" : kind.value) };
  if (kind.value === "constant-velocity") return request;
  const periods = { period_s: numberOf("period", { least: 0.1 }), periods: numberOf("periods", { least: 2, whole: true }) };
  if (kind.value === "multisine") return { ...request, multisine: periods };
  const quick = find("method").value === "quick";
  const how = quick ? { method: /** @type {const} */ ("two-harmonic") } : { budget_s: 300 };
  const search = isValidation ? { ...how, seed: OTHER_SEED } : how; // the default seed gives the motion of the identification again
  return { ...request, excitation: { ...periods, ...search } };
}

find("design-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await panel.begin("design", designRequest());
  } catch (error) {
    panel.refuse("design", error);
  }
});

find("click-form").addEventListener("submit", (event) => {
  event.preventDefault();
  try {
    go(`${CELL}/edit/${addressOf(nameOf("click-name", ".yaml"))}`);
  } catch (error) {
    if (!error.isShown) find("motion-problem").textContent = error.message;
  }
});

// ---- record
/** @type {(rehearse: boolean) => Api.Requests["record"]} */
function recordRequest(rehearse) {
  if (!motion.value) throw new Error("Choose a motion file, or design one.");
  /** @type {Api.Requests["record"]} */
  const request = { motion: motion.value, rehearse, until: find("until").value.split(",").map((each) => each.trim()).filter(Boolean) };
  const label = find("label").value.trim();
  if (label) request.label = label;
  Object.assign(request, modelOf());
  if (find("feedforward").value) request.feedforward = find("feedforward").value;
  return request;
}

press("rehearse", panel, "record", () => panel.begin("record", recordRequest(true), { moves: true }));
press("record", panel, "record", () => panel.begin("record", recordRequest(false), { moves: true }));
press("check", panel, "check", () => panel.begin("check"));

const wantedKind = wanted.get("kind");
if (wantedKind) {
  kind.value = wantedKind;
  find("design").open = true;
  kind.dispatchEvent(new Event("change"));
}
const wantedMotion = wanted.get("motion");
if (wantedMotion) offer(motion, wantedMotion);
else showMotion();
showFields();
on("again", showMotion);
document.title = `Experiment · ${page.cell}${page.simulated ? " (simulated)" : ""} · rid-daq`;
