// Page Payload: the guided payload session with its warm-up and result, and the load data for the controller.
import { blockParts } from "./blocks.js";
import { find, parseNumber, timeOf } from "./dom.js";
import { forgetEntries } from "./entries.js";
import { doubtField } from "./fields.js";
import { JobPanel, afterCheck, withResult } from "./job_panel.js";
import { html, render } from "./lit.js";
import { followPose } from "./live_pose.js";
import { problemOf } from "./loading.js";
import { LIST_MS } from "./requests.js";
import { RobotView } from "./robot_view.js";
import { CELL, ask, on, page } from "./service.js";
import { blocksUrl, figureIn, fileLink, look, numberOf, offer, press, showRun, wanted } from "./work.js";

/** @type {Record<string, string>} */
const WORDS = { done: "done", now: "now", bad: "problem", wait: "not yet" };
const DRAWN_MS = 3000;
/** @type {{ run: string, payload: string } | null} */
let session = null; // the session whose result is shown
let showings = 0; // counter that increases when a result is requested or closed; an answer to an earlier request is ignored
/** @type {string | null} */
let jobAtOpening = null; // id of the job that was running when the page was opened; empty if no job was running
/** @type {HTMLElement[]} */
const STAGES = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-stage]"))];

on("cell", ({ job }) => {
  jobAtOpening ??= job?.id ?? "";
});
/** @type {(job: EndedJob) => Part[]} */
function next(job) {
  if (job.kind in PAPERS && job.state === "done") return [html`<a class="button main" href="#${PAPERS[job.kind].id}">Show the result</a>`];
  if (job.kind !== "payload_session") return afterCheck(job, html`<a class="button main" href="#prepare">Start the session</a>`);
  if (job.state === "done") return [html`<a class="button main" href="#papers">Create the certificate</a>`];
  if (job.document?.session) return [html`<a class="button main" href="#values">What to do</a>`];
  const began = job.document || job.state === "stopped"; // a process that was terminated leaves no document
  return began ? [html`<a class="button main" href=${resumed ? "#prepare" : "#resume-card"}>Resume the session</a>`] : [];
}
const panel = new JobPanel(find("job"), { next, heard, begun, ended, isBelow });

// ---- stages of the page: each stage shows one or two states of the session

/** @type {(stage: HTMLElement, word: string) => void} */
function show(stage, word) {
  stage.dataset.state = word;
  /** @type {HTMLElement} */ (stage.querySelector("span span")).textContent = WORDS[word];
}

/** @type {(state: Api.SessionState) => HTMLElement | undefined} */
const stageOf = (state) => STAGES.find((stage) => stage.dataset.stage?.split(" ").includes(state));

/** @type {(state: Api.SessionState, word?: string) => void} */
function reach(state, word = "now") {
  const here = STAGES.findIndex((stage) => stage === stageOf(state));
  STAGES.forEach((stage, i) => show(stage, i < here ? "done" : i > here ? "wait" : word));
}

/** @type {(job: Api.Job) => void} */
function begun(job) {
  if (job.kind !== "payload_session") return;
  find("prepare").hidden = !job.ended_s;
  if (!job.ended_s) find("resume-card").hidden = true;
  reach("prepare");
  find("warm-up").hidden = true;
  if (!job.ended_s && jobAtOpening !== null && job.id !== jobAtOpening) leaveLast();
}

// A new session has begun: close the earlier session's result, and forget the entries, which describe one payload.
function leaveLast() {
  session = null;
  showings += 1;
  find("result-card").hidden = true;
  history.replaceState(null, "", location.pathname);
  forgetEntries();
}

// Not null where it is used: the buttons that need a session are shown only with its result.
const chosenSession = () => /** @type {{ run: string, payload: string }} */ (session);
const make = /** @type {HTMLSelectElement} */ (find("make"));

const isSessionRunning = () => panel.job?.kind === "payload_session" && !panel.job.ended_s;

// ---- events of the session
let drawnAt = -Infinity;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let later;

/** @type {(event: JobEvent, job: Api.Job) => void} */
function heard(event, job) {
  if (job.kind !== "payload_session") return;
  if (event.kind === "state") reach(event.state);
  if (event.kind === "warmed_up") drawWarmUp(job.id);
}

/** @type {(job: string) => void} */
function drawWarmUp(job) {
  clearTimeout(later);
  const wait = drawnAt + DRAWN_MS - performance.now();
  if (wait > 0) {
    later = setTimeout(() => drawWarmUp(job), wait);
    return;
  }
  drawnAt = performance.now();
  find("warm-up").hidden = false;
  figureIn(find("warm-figure"), blocksUrl(`/jobs/${encodeURIComponent(job)}/warm-up`, { plot: 0 }));
}

// Return true if the page shows a job's result below the job: a finished session, or a document of the shown session.
/** @type {(job: EndedJob) => boolean} */
function isBelow(job) {
  return job.kind === "payload_session" ? Boolean(job.document?.session) : job.kind in PAPERS && isOf(session, job);
}

/** @type {(job: EndedJob) => Promise<void>} */
async function ended(job) {
  if (job.kind === "payload_session") {
    const run = job.document?.session;
    find("prepare").hidden = false;
    showSessions();
    if (run && resumed) location.replace(`?run=${encodeURIComponent(run)}`); // with an empty form
    else if (run) await showResult(run);
    else if (job.state !== "done") {
      const now = STAGES.find((stage) => stage.dataset.state === "now");
      if (now) show(now, "bad");
    }
  }
}

// The panel shows only the job that was started last; an earlier job can end after it.
on("job", (job) => job.ended_s && isOf(session, job) && loadPaper(job));

// Return the number in a field that can be empty; null if the field is empty.
/** @type {(id: InputId) => number | null} */
const optionalNumber = (id) => (find(id).value.trim() ? numberOf(id, { least: 0 }) : null);

// ---- the session
/** @type {{ run: string, choices: SessionChoices, shown?: Record<string, unknown> } | null} */
let resumed = null; // the resumed session: its run, its settings, and the request of the form when it was filled with these settings

/** @type {() => Api.Requests["payload_session"]} */
function request() {
  const mass = find("mass").value.trim();
  const weighed = mass ? [{ name: "m", value: numberOf("mass", { least: 0.0001 }), sigma: numberOf("mass-sigma", { least: 0 }) }] : [];
  /** @type {Api.Requests["payload_session"]} */
  const asks = {
    known: [...(resumed?.choices.known ?? []).filter((each) => each.name !== "m"), ...weighed],
    label: find("label").value.trim() || "payload",
    limits: {
      mass_percent: numberOf("mass-limit", { least: 0 }),
      mass_kg: optionalNumber("mass-limit-kg"),
      centre_mm: numberOf("centre-limit", { least: 0 }),
      inertia_percent: numberOf("inertia-limit", { least: 0 }),
      inertia_kg_m2: optionalNumber("inertia-limit-kg-m2"),
      residual_percent: numberOf("residual-limit", { least: 0 }),
      residual_nm: optionalNumber("residual-limit-nm"),
    },
    repeats: numberOf("repeats", { least: 1, whole: true }),
    rehearsal_percent: numberOf("rehearsal", { least: 0 }),
    warm_up_percent: numberOf("warm", { least: 0 }),
    warm_up_periods: numberOf("warm-periods", { least: 3, whole: true }),
  };
  if (!find("periods").disabled) asks.periods = numberOf("periods", { least: 2, whole: true });
  asks.payload = find("payload")?.value || null;
  asks.model = find("model").value || null;
  if (find("practise")) asks.practise = find("practise").checked;
  return asks;
}

// Show a warning as soon as a mass is entered that the robot can hardly carry, which the service would refuse, or that
// a simulated flange without payload cannot have.
function doubtMass() {
  const { mostKg, mostWords } = find("mass").dataset;
  const tooHeavy = mostKg && parseNumber(find("mass").value) > Number(mostKg);
  const flange = /** @type {HTMLSelectElement | null} */ (find("payload"));
  const isNothing = flange && flange.options.length > 1 && !flange.value && find("mass").value.trim();
  const empty = isNothing ? "The simulated flange carries nothing: choose a payload, or leave this field empty." : "";
  doubtField(find("mass"), tooHeavy ? `This mass is larger than ${mostWords}, ${Number(mostKg)} kg: correct the mass, or set rated_payload_kg in the robot file.` : empty);
}
find("mass").addEventListener("input", doubtMass);
find("payload")?.addEventListener("change", doubtMass);
doubtMass();

// A motion file contains its own number of periods.
const allowPeriods = () => (find("periods").disabled = Boolean(resumed || find("motion").value));
find("motion").addEventListener("change", allowPeriods);
allowPeriods();

press("begin", panel, "payload_session", () => {
  const asks = resumed ? saidAnew() : { ...request(), motion: find("motion").value || null };
  return panel.begin("payload_session", asks, { moves: true });
});
find("anew").addEventListener("click", forgetEntries);
press("check", panel, "check", () => panel.begin("check"));

// ---- sessions that can be resumed, and sessions with a result
/** @type {() => Promise<void>} */
async function showSessions() {
  let interrupted, finished;
  try {
    ({ interrupted, finished } = /** @type {Api.CellSessions} */ (await look(`${CELL}/payload/sessions`, { patienceMs: LIST_MS })));
  } catch (error) {
    render(problemOf(error), find("interrupted"));
    return;
  }
  find("resume-card").hidden = !interrupted.length || isSessionRunning();
  render(interrupted.map((each) => html`<div class="tools">
    <p><b>${each.label}</b>, started ${timeOf(each.created_utc)}. Next step: ${stageOf(each.state)?.querySelector("b")?.textContent}.</p>
    <button type="button" class="resume" data-run=${each.run} data-needs="role" disabled @click=${() => goOn(each)}>Resume</button></div>`),
  find("interrupted"));
  find("finished-card").hidden = !finished.length;
  render(finished.map((each) => html`<li><a href="?run=${encodeURIComponent(each.run)}">${each.label}, ${timeOf(each.created_utc)}</a></li>`),
    find("finished"));
}

// Fill the form with the settings of an interrupted session, so that the user can change them before the session is
// resumed.
/** @type {(session: Api.InterruptedSession) => void} */
function goOn({ run, label, state, choices: settings }) {
  const choices = /** @type {SessionChoices} */ (settings);
  const { known, limits } = choices;
  const mass = known.find((each) => each.name === "m");
  /** @type {Record<string, string | number>} */
  const fields = {
    mass: mass?.value ?? "", "mass-sigma": mass?.sigma ?? find("mass-sigma").defaultValue, label: choices.label,
    "mass-limit": limits.mass_percent, "centre-limit": limits.centre_mm,
    "inertia-limit": limits.inertia_percent, "residual-limit": limits.residual_percent,
    "mass-limit-kg": limits.mass_kg ?? "", "inertia-limit-kg-m2": limits.inertia_kg_m2 ?? "", "residual-limit-nm": limits.residual_nm ?? "",
    repeats: choices.repeats, rehearsal: choices.rehearsal_percent,
    warm: choices.warm_up_percent, "warm-periods": choices.warm_up_periods,
  };
  for (const [id, value] of Object.entries(fields)) find(/** @type {InputId} */ (id)).value = String(value);
  for (const id of /** @type {const} */ (["payload", "model"])) {
    const chosen = choices[id];
    if (chosen && find(id)) offer(find(id), chosen);
    else if (find(id)) find(id).value = "";
  }
  if (find("practise")) find("practise").checked = choices.practise;
  find("prepare").dataset.keep = "no"; // do not store these entries in the browser tab, because they belong to the resumed session
  resumed = { run, choices };
  find("motion").disabled = true; // the session's run folder was made with its motion
  allowPeriods();
  resumed.shown = { ...request() };
  const more = known.filter((each) => each !== mass).map((each) => `${each.name} is known: ${each.value} ± ${each.sigma}.`);
  if (choices.until_mass_kg !== null) more.push(`A run with the payload ends as soon as 2σ of the mass is at most ${choices.until_mass_kg} kg.`);
  find("going-on").textContent = [`Session ${label} will be resumed with these values, with which it was last started or resumed. Correct them if necessary.`, ...more].join(" ");
  for (const id of /** @type {const} */ (["going-on", "anew"])) find(id).hidden = false;
  find("begin").textContent = `Resume ${label}`;
  find("lengths").open = true;
  reach(state, "bad");
  find("prepare").scrollIntoView({ block: "start" });
}

// Return the values that the user has changed since the start of the session, even if they equal the defaults.
/** @type {() => Api.Requests["payload_session"]} */
function saidAnew() {
  const changed = Object.entries(request()).filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(resumed?.shown?.[name]));
  return { ...Object.fromEntries(changed), resume: resumed?.run };
}

// ---- the result; the page's address contains the session, so that a reload shows the same result
/** @type {(run: string) => Promise<void>} */
async function showResult(run) {
  const showing = ++showings;
  session = null;
  for (const id of /** @type {const} */ (["papers", "after", "view"])) find(id).hidden = true;
  render([], find("values"));
  find("result-card").hidden = false;
  history.replaceState(null, "", `?run=${encodeURIComponent(run)}`);
  const blocks = await showRun(find("result"), run, "verdict");
  if (blocks === null || showing !== showings) return;
  session = { run, payload: `runs/${run}/payload.json` };
  const passed = blocks.find((block) => block.kind === "verdict")?.passed === true;
  find("papers").hidden = false;
  find("report").href = `/api/v1/runs/${encodeURIComponent(run)}/report`;
  find("after").hidden = !passed;
  for (const place of Object.values(PAPERS)) render([], place);
  if (!isSessionRunning()) {
    reach("done", passed ? "done" : "bad");
    find("result-card").scrollIntoView({ block: "start" });
  }
  await Promise.all([showPapers(), showRun(find("values"), run, "payload")]);
  if (showing === showings) showCentre(session.payload);
}

// Show the newest certificate, load data and comparison that were made from the session, also after a reload.
async function showPapers() {
  const shown = session;
  try {
    const jobs = await ask("GET", `/jobs?cell=${encodeURIComponent(page.cell)}&limit=1000`);
    for (const kind of Object.keys(PAPERS)) {
      const job = jobs.find((each) => each.kind === kind && isOf(shown, each));
      if (job) await loadPaper(job);
    }
  } catch (error) {
    render(problemOf(error), find("certificate"));
  }
}

/** @type {(job: Api.Job) => Promise<void>} */
async function loadPaper(job) {
  const events = await ask("GET", `/jobs/${job.id}/events`);
  const result = events.findLast((event) => event.kind === "result");
  if (result && isOf(session, job)) showPaper(withResult(job, result.document), result.blocks);
}

// Return true if a job has computed its result from a session.
/** @type {(of: { run: string, payload: string } | null, job: Pick<Api.Job, "request">) => boolean} */
const isOf = (of, { request: { session: run, payload } }) => of !== null && (run === of.run || payload === of.payload);

// Show the payload's centre of gravity on the robot.
/** @type {RobotView | null} */
let view = null;
/** @type {(payload: string) => void} */
function showCentre(payload) {
  find("view").hidden = false;
  if (view !== null) {
    view.reload({ payload });
    return;
  }
  view = new RobotView(find("view"), { hidden: ["axes", "limits"], query: { payload } });
  followPose(view);
}

/** @type {(job: { ended_s: number | null }) => Part} */
const madeAt = (job) => html`<p class="soft">Made ${timeOf(job.ended_s ?? NaN)}</p>`;

// The places of the documents that jobs make from a session, by kind of job.
/** @type {Record<string, HTMLElement>} */
const PAPERS = { payload_certificate: find("certificate"), payload_export: find("load-data"), payload_read_back: find("compared") };

/** @type {(job: EndedJob, blocks: ResultBlock[]) => void} */
function showPaper(job, blocks) {
  if (!job.document || !(job.kind in PAPERS)) return;
  render([paperPart(job, blocks), madeAt(job)], PAPERS[job.kind]);
}

/** @type {(job: EndedJob, blocks: ResultBlock[]) => unknown} */
function paperPart(job, blocks) {
  if (job.kind === "payload_certificate" && job.document) return fileLink(job.document.file, "Save the certificate");
  if (job.kind !== "payload_export" || !job.document) return blockParts(blocks);
  const { robot, text, file } = job.document;
  return html`<p>For robot ${robot}. Enter these data in the controller, then compare the controller's data below.</p>
    <pre tabindex="0" aria-label="load data">${text}</pre>
    <div class="actions">${fileLink(file, `Save ${file}`)}</div>`;
}

press("certify", panel, "payload_certificate", () => {
  const by = find("by").value.trim();
  const asks = { session: chosenSession().run, output: `certificate-${chosenSession().run}.html`, overwrite: true };
  return panel.begin("payload_certificate", by ? { ...asks, by } : asks);
});

// ---- the controller
press("export", panel, "payload_export", async () => {
  const { value: to, dataset: { ending } } = make.selectedOptions[0];
  await panel.begin("payload_export", {
    payload: chosenSession().payload, to: /** @type {Api.Requests["payload_export"]["to"]} */ (to), output: `load-data-${chosenSession().run}-${to}${ending}`, overwrite: true,
  });
});

press("read-back", panel, "payload_read_back", async () => {
  const text = find("typed").value;
  if (!text.trim()) throw new Error("Type or paste the controller's load data.");
  await panel.begin("payload_read_back", { payload: chosenSession().payload, form: /** @type {Api.Requests["payload_read_back"]["form"]} */ (make.value), text });
});

reach("prepare");
on("again", () => {
  showSessions();
  if (session) showPapers();
});
showSessions();
const wantedRun = wanted.get("run");
if (wantedRun) await showResult(wantedRun);
