// The page of a cell: state, actions, joints, preflight, last runs.
import { duration, element, find, kindWords } from "./dom.js";
import { JobPanel } from "./job_panel.js";
import { showEnd, showJoints, showReturn, showSilence, showTemperatures } from "./joints.js";
import { html, render } from "./lit.js";
import { followPose } from "./live_pose.js";
import { loadPreflight } from "./preflight.js";
import { LIST_MS } from "./requests.js";
import { RobotView } from "./robot_view.js";
import { runTable } from "./run_table.js";
import { CELL, OLD_MS, ask, on, page, preflightAge, reach } from "./service.js";

const view = new RobotView(find("view"), { preview: true });
followPose(view);
const panel = new JobPanel(find("job"), { next, ended, heard });
/** @type {Api.CellStatus | null} */
let status = null;

const STARTS = [["experiment", "Record a motion", "main"], ["payload", "Identify a payload", ""]].map(([path, words, kind]) =>
  html`<a class="button ${kind}" href="${CELL}/${path}">${words}</a>`);

/** @type {Record<string, () => unknown>} */
const actions = {
  check: () => panel.begin("check"),
  accept: () => panel.begin("check", { accept_pose: true }),
  reset: () => panel.begin("reset"),
  watch: () => panel.begin("watch"),
  plate: () => panel.begin("plate_zero", {}, { moves: true }),
  axes: () => panel.begin("axes", {}, { moves: true }),
  jog: () => panel.begin("jog", {}, { moves: true }),
  home: () => panel.begin("jog", { home: true }, { moves: true }),
};
for (const [id, action] of Object.entries(actions)) document.getElementById(id)?.addEventListener("click", action);

// Return the place of the button that writes a measured zero of the force plate; its module is loaded only now.
/** @type {(run: string) => Node} */
function zeroPart(run) {
  const place = element("div", {});
  import("./plate_zero.js").then(({ zeroButton }) => place.append(zeroButton(run, actions.check)));
  return place;
}

/** @type {(job: EndedJob) => Part[]} */
function next(job) {
  /** @type {(text: string, action: () => unknown) => Part} */
  const again = (text, action) => html`<button type="button" class="main" @click=${action}>${text}</button>`;
  if (job.kind === "check" && job.document?.lines.some((line) => line.code === "RID-POSE-MOVED"))
    return [again("Check again", actions.check), again("The positions are correct: accept them", actions.accept)];
  if (job.kind === "axes" && job.state === "done") return STARTS;
  if (job.kind === "check") return job.document?.passed ? STARTS : [again("Check again", actions.check)];
  if (job.kind === "plate_zero" && job.document?.verdict?.passed && job.run) return [zeroPart(job.run)];
  if (job.kind === "reset" && job.state === "done") return [again("Check", actions.check)];
  if (job.state !== "done" && status?.fault) return [again("Reset after the cause was found", actions.reset)];
  if (job.state === "done") return [];
  const isReady = status !== null && status.not_held_because === "" && job.kind in actions;
  return isReady ? [again(`${kindWords(job.kind)} again`, actions[job.kind])] : [again("Check", actions.check)];
}

// During an axis test, the 3-D view shows the positive direction of the joint that is tested.
/** @type {(event: JobEvent, job: Api.Job) => void} */
function heard(event, job) {
  if (job.kind !== "axes" || event.kind !== "motion") return;
  const joint = (status?.joints ?? []).indexOf(event.tested_joint ?? "");
  view.choose(joint < 0 ? null : joint, { withGhost: false });
}

document.addEventListener("joint-chosen", ({ detail }) => view.choose(detail));

/** @type {(job: Api.Job) => void} */
function ended(job) {
  if (job.kind === "axes") view.choose(null);
  if (job.run) showEnd(find("joints-words"));
  refresh();
}

async function refresh() {
  loadRuns();
  const lines = await loadPreflight(find("preflight"), find("preflight-words"));
  // the state "checking" does not count: the status can still have it after the check has ended
  const moves = status?.state === "moving" || status?.state === "stopping";
  if (lines && !moves) showTemperatures(find("joints"), lines);
}

async function loadRuns() {
  try {
    if (!status) render(html`<p class="soft">Loading the runs …</p>`, find("last-runs"));
    const { groups } = await ask("GET", `/run-groups?limit=5&cell=${encodeURIComponent(page.cell)}`, undefined, LIST_MS);
    render(groups.length ? runTable(groups) : html`<p class="soft">No runs yet.</p>`, find("last-runs"));
  } catch (error) {
    render(html`<p class="problem">${error.message}</p>`, find("last-runs"));
  }
}

function showState() {
  if (!status) return;
  const words = find("now");
  const age = preflightAge();
  const job = status.job;
  const what = job && kindWords(job.kind);
  let text = "", kind = "";
  if (!reach.values && !reach.requests) [text, kind] = ["Unknown: the service does not answer.", "bad"];
  else if (status.state === "fault") [text, kind] = [`Fault: ${status.fault} Find its cause, then reset.`, "bad"];
  else if (status.state === "moving") text = `The robot moves, or can move at once: ${what}, by ${job?.owner}.`;
  else if (status.state === "at rest") text = `Nothing moves now, but a motion can begin at any time: ${what}, by ${job?.owner}.`;
  else if (status.state === "waiting") text = `Nothing moves: ${what}, by ${job?.owner}, waits for an answer.`;
  else if (status.state === "stopping") text = "The robot is being stopped.";
  else if (status.state === "checking") text = `Nothing moves: ${what} is running.`;
  else if (status.state === "ready") {
    const left = Math.max(0, status.preflight_limit_s - (age ?? 0));
    text = `Ready to move. Preflight ${duration(age ?? 0)} ago, valid for another ${duration(left)}.`;
    kind = "good";
  } else text = `Not ready to move: ${status.not_ready_because}`;
  if (words.textContent !== text) words.textContent = text;
  words.className = `verdict ${kind}`;
  const main = status.state === "fault" ? "reset" : status.state === "closed" ? "check" : null;
  for (const id of /** @type {const} */ (["check", "reset"])) find(id).classList.toggle("main", id === main);
}

on("cell", (now) => {
  status = now;
  showState();
});
// ---- live values
/** @type {LivePicture | null} */
let picture = null;
let pictureAt = 0;

on("samples", (newest) => {
  [picture, pictureAt] = [newest, performance.now()];
  showJoints(find("joints"), find("joints-words"), newest);
});

function showLive() {
  const silent = picture?.moving && performance.now() - pictureAt > OLD_MS;
  if (status?.job && (!reach.values || silent)) showSilence(find("joints-words"));
  else if (!status?.job) showReturn(find("joints-words"));
}

on("reach", () => {
  showState();
  showLive();
});
on("again", refresh);
setInterval(() => {
  showState();
  showLive();
}, 500);
refresh();
