// Panel of a job: progress, messages, tables, questions, verdict, next steps. The WebSocket sends each event of a job
// once, with its number. If a number is missing, the panel requests the missing events.
import { blockParts, verdictOf } from "./blocks.js";
import { linked } from "./commands.js";
import { confirmClear } from "./dialog.js";
import { clockOf, duration, kindWords } from "./dom.js";
import { holdPad } from "./hold_pad.js";
import { html, keyed, nothing, render } from "./lit.js";
import { JobLog } from "./job_log.js";
import { showNowNext } from "./now_next.js";
import { CELL, ask, lease, now, on } from "./service.js";

/** @type {Record<string, [string, string]>} */
const ENDS = {
  done: ["good", "done"], failed: ["bad", "failed"], stopped: ["bad", "stopped"], interrupted: ["bad", "interrupted"],
};
const BEGIN_MS = 30000; // timeout for starting a job: the service answers only after it has saved the job and the job's worker runs
const SOON_S = 2; // the time left is shown when a step has taken this long
const MOST_RECENT = 3; // messages of the present step that are shown above a question
const URGENT = { urgent: true }; // a request for a job's events must not wait until lists and figures are loaded
/** @type {(job: Api.Job) => boolean} */
const over = (job) => job.state in ENDS;

// Return a job with its result, whose type depends on the kind of the job.
/** @type {(job: Api.Job, document: Record<string, unknown> | undefined) => EndedJob} */
export const withResult = (job, document) => /** @type {EndedJob} */ ({ ...job, document });

// Return the next step after a check on a page with a motion: its start on the same page, or the failed lines.
/** @type {(job: EndedJob, start: Part) => Part[]} */
export function afterCheck(job, start) {
  if (job.kind !== "check" || job.state !== "done") return [];
  return [job.document?.passed ? start : html`<a class="button main" href="${CELL}#preflight-title">Show the failed lines</a>`];
}

// State of the panel for one job; a new state is created when another job is shown.
/** @type {() => JobView} */
const emptyView = () => ({
  known: 0, ahead: new Map(), last: "", over: false, loading: null,
  log: new JobLog(), recent: [], begin: null, share: null, count: "", left: "", words: "", estimate: "", verdicts: [], isFailureShown: false, question: null, pad: null, problem: "", links: [], results: [],
});

// The options are functions. `next(job)` returns links that are shown when a job has ended. `begun(job)` is called when a
// job is shown, `ended(job)` when it has ended, `heard(event, job)` for every event. `job.document` is the job's result. `places`
// contains, by kind of job, the element that shows the result's blocks instead of the panel. `isBelow(job)`
// returns true if the page itself shows the result below the panel; the panel then does not repeat it.
export class JobPanel {
  /** @param {HTMLElement} section @param {JobPanelOptions} [options] */
  constructor(section, { next = () => [], begun = () => {}, ended = () => {}, heard = () => {}, places = {}, isBelow = () => false } = {}) {
    this.section = section;
    this.next = next;
    this.begun = begun;
    this.ended = ended;
    this.heard = heard;
    this.places = places;
    this.isBelow = isBelow;
    /** @type {Api.Job | null} */
    this.job = null;
    /** @type {{ kind: string, text: string } | null} */
    this.refusal = null;
    this.view = emptyView();
    /** @type {Promise<void> | null} */
    this.drawing = null;
    on("event", (job, event, number) => job === this.job?.id && this.receive(event, number));
    on("job", (job) => job.id === this.job?.id && this.change(job));
    on("again", () => this.job && this.refresh());
    on("samples", (picture, job) => job === this.job?.id && this.showPicture(picture));
    on("cell", (status) => this.adopt(status));
    this.key = `rid-daq job ${location.pathname}`;
    this.recall();
  }

  // Start a job and show it. Before a motion, ask the user whether the cell is clear. The promise resolves with the
  // job, or with null if the user cancels or the service refuses; the panel shows the refusal.
  /** @template {Api.JobKind} Kind @param {Kind} kind @param {Api.Requests[Kind]} [request] @param {{ moves?: boolean }} [options] @returns {Promise<Api.Job | null>} */
  async begin(kind, request = /** @type {Api.Requests[Kind]} */ ({}), { moves = false } = {}) {
    const lost = moves ? await confirmClear(kindWords(kind), { held: now.status?.held_kinds.includes(kind) }) : "stop";
    if (lost === null) return null;
    try {
      const job = await ask("POST", `${CELL}/jobs`, { kind, request: { ...request }, cleared: moves, on_lost_client: lost }, BEGIN_MS);
      this.show(job);
      return job;
    } catch (error) {
      this.refuse(kind, error);
      return null;
    }
  }

  /** @type {(kind: string, error: Error & { isShown?: boolean, original?: string }) => void} */
  refuse(kind, error) {
    if (error.isShown) return; // at its field
    this.job = null;
    this.refusal = { kind, text: error.original ?? error.message };
    this.draw();
    this.section.scrollIntoView({ block: "nearest" });
  }

  // After a reload of the page: show the job that was started on this page, unless its end has already been shown.
  async recall() {
    const id = sessionStorage.getItem(this.key);
    if (!id) return;
    try {
      const job = await ask("GET", `/jobs/${id}`, undefined, undefined, undefined, URGENT);
      if (this.job === null) this.show(job);
    } catch (error) {
      if (error.status === 404) sessionStorage.removeItem(this.key);
    }
  }

  // Show the running job of the cell if this panel shows no running job.
  /** @type {(status: Api.CellStatus) => void} */
  adopt(status) {
    if (status.job && status.job.id !== this.job?.id && (!this.job || over(this.job))) this.show(status.job);
    else if (this.view.question) this.update(); // another client may hold the cell now
  }

  /** @type {(job: Api.Job) => void} */
  show(job) {
    this.view.pad?.leave();
    this.view = emptyView();
    this.refusal = null;
    this.job = job;
    sessionStorage.setItem(this.key, job.id);
    this.draw();
    this.section.scrollIntoView({ block: "nearest" });
    this.begun(job);
    this.load();
    this.change(job);
  }

  async refresh() {
    if (!this.job) return;
    try {
      this.change(await ask("GET", `/jobs/${this.job.id}`, undefined, undefined, undefined, URGENT));
    } catch {
      return; // without a connection, the page itself shows a warning
    }
    await this.load();
  }

  async cancel() {
    if (!this.job) return;
    try {
      await ask("POST", `/jobs/${this.job.id}/cancel`, {});
    } catch (error) {
      this.say("p", `Not ended: ${error.message}`, "problem");
    }
  }

  /** @type {(job: Api.Job) => Promise<void>} */
  async change(job) {
    const { view } = this;
    this.job = job;
    this.update();
    if (!over(job) || view.over) return;
    view.over = true;
    // If `ended` is missing after one load, load once more: the first request may have been sent before the last event
    // existed. A killed job never sends `ended`, so there is no third attempt.
    for (let i = 0; i < 2 && view.last !== "ended"; i++) await this.load();
    if (this.view !== view) return; // the user has chosen another job meanwhile
    this.drop();
    sessionStorage.removeItem(this.key);
    const [kind, word] = ENDS[job.state];
    view.end = { kind, words: `${kindWords(job.kind)}: ${word}` };
    const isShown = job.state === "failed" && view.isFailureShown;
    const reason = isShown ? "" : job.reason;
    const ending = reason.startsWith(word) ? reason : [word, reason].filter(Boolean).join(": ");
    view.verdicts.push(html`<p class="verdict ${kind} end">${kindWords(job.kind)}: ${linked(ending)}</p>`);
    const ended = withResult(job, view.document);
    view.links = [...this.next(ended)];
    if (job.run) view.links.push(html`<a class="button" href="${CELL}/runs/${encodeURIComponent(job.run)}">Open the run</a>`);
    this.draw();
    this.ended(ended);
  }

  // ---- events
  /** @type {(event: JobEvent, number: number) => void} */
  receive(event, number) {
    const { view } = this;
    if (number >= view.known) view.ahead.set(number, event);
    this.takeNext(view);
    if (view.ahead.size) this.load();
  }

  // Process the received events that directly follow the last processed event.
  /** @type {(view: JobView) => void} */
  takeNext(view) {
    for (let event; (event = view.ahead.get(view.known)); ) {
      view.ahead.delete(view.known);
      this.take(event);
    }
  }

  // Request the events that did not arrive. Only one such request runs at a time.
  /** @type {() => Promise<void>} */
  load() {
    const { view, job } = this;
    if (!job) return Promise.resolve();
    view.loading ??= (async () => {
      try {
        const after = view.known;
        const events = await ask("GET", `/jobs/${job.id}/events?after=${after}`, undefined, undefined, undefined, URGENT);
        if (this.view !== view) return;
        for (const event of events.slice(view.known - after)) this.take(event);
        for (const number of view.ahead.keys()) if (number < view.known) view.ahead.delete(number);
        this.takeNext(view);
      } catch {
        // no connection: `refresh` is called when the service answers again
      } finally {
        view.loading = null;
      }
    })();
    return view.loading;
  }

  /** @type {(event: JobEvent) => void} */
  take(event) {
    const { view } = this;
    view.known += 1;
    view.last = event.kind;
    switch (event.kind) {
      case "said": if (event.text) this.takeMessage(event.text); break;
      case "key_refused": this.say("p", event.text, "problem"); break;
      case "state": this.beginPart(event.text, event.text); break;
      case "motion": this.beginPart(event.title, view.words ? "" : view.count); break;
      case "judged": this.addVerdict(event); break;
      case "result": this.takeResult(event); break;
      case "progress": this.takeProgress(event); break;
      case "asked": this.askPerson(event); break;
      case "answered": this.drop(); break;
      case "ended": if (event.message && event.error !== "Failure") this.addVerdict({ passed: false, text: event.message });
    }
    this.update();
    if (this.job) this.heard(event, this.job);
  }

  /** @type {(event: Api.ResultEvent) => void} */
  takeResult({ document, blocks }) {
    const { job } = this;
    if (!job) return;
    Object.assign(this.view, { document, blocks });
    if (this.isBelow(withResult(job, document))) return;
    for (const block of blocks) if (block.kind === "verdict") this.addVerdict(block);
    const shown = blocks.filter(({ kind }) => kind !== "verdict");
    const place = this.places[job.kind];
    if (place) render(blockParts(shown, null, Infinity), place);
    else this.view.results = blockParts(shown);
  }

  /** @type {(verdict: { passed: boolean | null, text: string }) => void} */
  addVerdict(verdict) {
    this.view.isFailureShown ||= verdict.passed === false;
    this.view.verdicts.push(verdictOf(verdict));
  }

  /** @type {(tag: "p" | "h3", text: string, kind?: string | null) => void} */
  say(tag, text, kind = null) {
    this.view.log.say(tag, text, kind);
    this.update();
  }

  /** @type {(text: string) => void} */
  takeMessage(text) {
    this.say("p", text);
    this.view.recent = [...this.view.recent, text].slice(-MOST_RECENT);
  }

  // A step of the session or a motion begins: the progress of the one before it no longer applies.
  /** @type {(text: string, count: string) => void} */
  beginPart(text, count) {
    this.say("h3", text);
    Object.assign(this.view, { share: null, words: "", count, left: "", estimate: "", recent: [] });
  }

  /** @type {(event: Api.ProgressEvent) => void} */
  takeProgress({ at_s: now, title, done, total, unit, line }) {
    const { view } = this;
    const isSame = view.begin?.title === title && done >= view.begin.done;
    const begin = isSame && view.begin ? view.begin : { title, done, at_s: now };
    const left = total && done > begin.done && now > begin.at_s + SOON_S ? `${duration(((now - begin.at_s) * (total - done)) / (done - begin.done))} left` : "";
    const of = total ? `${Math.round(done)} of ${Math.round(total)} ${unit}` : `${Math.round(done)} ${Math.round(done) === 1 ? unit.replace(/s$/, "") : unit}`;
    const count = [title, total || done ? of : ""].filter(Boolean).join(" · ");
    Object.assign(view, { begin, share: total ? done / total : null, count, left: view.words ? "" : left, estimate: line ?? "" });
  }

  /** @type {(picture: LivePicture) => void} */
  showPicture({ title, words, share, count, left_s: left, stop, problem }) {
    if (!title) return; // a job that reads the drives at rest has no title: its events show the progress
    const rest = stop || left === null || left === undefined ? "" : `${duration(left)} left`;
    Object.assign(this.view, { share, words, left: rest, count: [words, count, stop, problem].filter(Boolean).join(" · ") });
    this.update();
  }

  // ---- questions
  drop() {
    this.view.pad?.leave();
    Object.assign(this.view, { pad: null, question: null, problem: "" });
  }

  /** @type {(event: Api.QuestionEvent) => void} */
  askPerson(event) {
    this.drop();
    if (!this.job) return;
    this.view.question = event;
    if (event.form === "hold") this.view.pad = holdPad(this.job, now.status?.joints ?? []);
    this.draw();
    this.section.querySelector(".questions")?.scrollIntoView({ block: "nearest" });
  }

  /** @type {(text: string) => Promise<void>} */
  async answer(text) {
    const { view, job } = this;
    if (!job || !view.question) return;
    view.problem = "";
    try {
      await ask("POST", `/jobs/${job.id}/answer`, { question: view.question.question, text });
    } catch (error) {
      view.problem = error.message;
    }
    this.update();
  }

  /** @type {(event: Api.QuestionEvent) => Part[]} */
  questionParts({ form, text, choices, question }) {
    /** @type {(event: SubmitEvent) => void} */
    const send = (submitted) => {
      submitted.preventDefault();
      this.answer(String(new FormData(/** @type {HTMLFormElement} */ (submitted.target)).get("answer")).trim());
    };
    const buttons = form === "yes_no" ? [{ text: "yes", label: "Yes" }, { text: "no", label: "No" }] : choices ?? [];
    const answers = buttons.map((each) => html`<button type="button" class="answer" @click=${() => this.answer(each.text)}>${each.label}</button>`);
    return [
      this.view.recent.map((each) => html`<p>${linked(each)}</p>`),
      text ? html`<p class="question">${linked(text)}</p>` : nothing,
      lease.key ? nothing : html`<p class="problem">Only the holder of the cell can answer: take the cell first.</p>`,
      form === "hold" ? this.view.pad?.pad
        : answers.length ? html`<div class="answers">${answers}</div>`
        : keyed(question, html`<form class="free" @submit=${send}>
        <label for="answer">Answer</label><input id="answer" name="answer" type="text" autocomplete="off">
        <button type="submit" class="main">Answer</button></form>`),
      html`<p class="problem" role="alert">${this.view.problem}</p>`,
    ];
  }

  // ---- drawing: several changes in one task of the browser cause a single redraw
  update() {
    this.drawing ??= Promise.resolve().then(() => this.draw());
  }

  draw() {
    this.drawing = null;
    this.section.hidden = this.job === null && this.refusal === null;
    render(this.job ? this.jobParts(this.job) : this.refusal ? this.refusalParts(this.refusal) : nothing, this.section);
    this.view.log.flush();
    showNowNext(this.job && this.nowNext(this.job));
  }

  // Return the state of the job for the line "now and next" of the header.
  /** @type {(job: Api.Job) => NowNext} */
  nowNext(job) {
    const { end, count, left, share, links, question } = this.view;
    /** @type {() => void} */
    const show = () => (this.section.querySelector(".questions:has(*)") ?? this.section).scrollIntoView({ block: "start" });
    const [first] = links;
    // a node can be in one place only: it stays in the panel, and the header gets a button that scrolls to it
    if (end && first instanceof Node) return { ...end, isRunning: false, steps: [html`<button type="button" class="main" @click=${show}>Show the next step</button>`] };
    if (end) return { ...end, isRunning: false, steps: first ? [first] : [] };
    const step = question
      ? html`<button type="button" class="main" @click=${show}>${question.form === "hold" ? "Show the buttons" : "Answer the question"}</button>`
      : html`<button type="button" @click=${show}>Show</button>`;
    return { isRunning: true, words: kindWords(job.kind), count: question?.text || count, left: question ? "" : left, share, steps: [step] };
  }

  /** @type {(refusal: { kind: string, text: string }) => Part} */
  refusalParts({ kind, text }) {
    return html`<h2>${kindWords(kind)}</h2><p class="verdict bad" role="alert">Refused: ${linked(text)}</p>`;
  }

  /** @type {(job: Api.Job) => Part} */
  jobParts(job) {
    const { view } = this;
    const count = job.state === "accepted" && !view.count ? "Waiting for the end of another job." : view.count || (job.began_s ? `Running since ${clockOf(job.began_s)}.` : "");
    const estimate = view.words ? view.estimate.replace(/^[^;]*; /, "") : view.estimate; // `count` shows the state
    return html`
      <div class="job-head"><h2>${kindWords(job.kind)}</h2>
        <button type="button" ?hidden=${over(job)} @click=${() => this.cancel()}>End this job</button></div>
      <div class="way" ?hidden=${over(job) || (view.question && view.question.form !== "hold")}>
        <progress max="1" aria-label="progress" value=${view.share ?? nothing}></progress>
        <p class="count number">${[count, view.left].filter(Boolean).join(" · ")}</p>
        <p class="estimate number" ?hidden=${!estimate}>${estimate}</p>
      </div>
      <div class="questions">${view.question ? this.questionParts(view.question) : nothing}</div>
      <div class="verdicts" role="status">${view.verdicts}</div>
      <div class="next actions">${view.links}</div>
      <div class="part results">${view.results}</div>
      <details class="messages" ?open=${!over(job)} ?hidden=${view.log.isEmpty}><summary>Messages of this job</summary>${view.log.place}</details>`;
  }
}
