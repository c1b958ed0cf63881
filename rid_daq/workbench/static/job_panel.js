// Panel of a job: progress, messages, tables, questions, verdict, next steps.
import { blockParts, verdictOf } from "./blocks.js";
import { confirmClear } from "./dialog.js";
import { duration, element } from "./dom.js";
import { holdPad } from "./hold_pad.js";
import { CELL, ask, lease, now, on, page } from "./service.js";

const ENDS = {
  done: ["good", "Done"], failed: ["bad", "Failed"], stopped: ["bad", "Stopped"],
  interrupted: ["bad", "Interrupted"],
};
const BEGIN_MS = 30000; // timeout of a start: the service answers once the job is saved and its worker runs
const URGENT = { urgent: true }; // a request for a job's events does not wait for requests of lists and figures
const over = (job) => job.state in ENDS;

// Return the title of a kind of job: "Payload export" for "payload_export".
const kindWords = (kind) => kind.charAt(0).toUpperCase() + kind.slice(1).replaceAll("_", " ");

// new JobPanel(section, { next: (job, document) => [element, ...] })
export class JobPanel {
  constructor(section, { next = () => [], ended = () => {} } = {}) {
    this.section = section;
    this.next = next;
    this.ended = ended;
    this.job = null;
    on("event", (job) => job === this.job?.id && this.follow());
    on("job", (job) => job.id === this.job?.id && this.change(job));
    on("again", () => this.job && this.refresh());
    on("samples", (picture, job) => job === this.job?.id && this.showPicture(picture));
    on("cell", (status) => this.adopt(status));
    this.key = `rid-daq job ${location.pathname}`;
    this.recall();
  }

  // Start a job and show it; before a motion, ask if the cell is clear.
  // Resolves with the job, or with null if the user cancels or the service refuses; the panel shows a refusal.
  async begin(kind, request = {}, { moves = false } = {}) {
    const lost = moves ? await confirmClear(kindWords(kind), { held: kind === "jog" }) : "stop";
    if (lost === null) return null;
    try {
      const wanted = { kind, request, cleared: moves, on_lost_client: lost };
      const job = await ask("POST", `${CELL}/jobs`, wanted, BEGIN_MS);
      this.show(job);
      return job;
    } catch (error) {
      this.refuse(kind, error);
      return null;
    }
  }

  refuse(kind, error) {
    this.job = null;
    this.section.replaceChildren(
      element("h2", {}, kindWords(kind)),
      element("p", { class: "verdict bad", role: "alert" }, `Refused: ${error.message}`),
    );
    this.section.hidden = false;
    this.section.scrollIntoView({ block: "nearest" });
  }

  // After a reload: show the job that was started here, if its end has not been shown.
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
  adopt(status) {
    if (status.job && status.job.id !== this.job?.id && (!this.job || over(this.job))) this.show(status.job);
  }

  show(job) {
    this.job = job;
    sessionStorage.setItem(this.key, job.id);
    this.known = 0;
    this.asking = Promise.resolve();
    this.waiting = null;
    this.question = null;
    this.document = null;
    this.progress = element("progress", { max: "1", "aria-label": "progress" });
    this.count = element("p", { class: "count number" });
    this.verdict = element("div", { class: "verdicts", role: "status" });
    this.questions = element("div", { class: "questions" });
    this.after = element("div", { class: "next actions" });
    this.said = element("div", { class: "said", role: "log", tabindex: "0", "aria-label": "messages of the job" });
    const end = element("button", { type: "button", onclick: () => this.cancel() }, "End this job");
    this.cancelling = end;
    const head = element("div", { class: "job-head" }, element("h2", {}, kindWords(job.kind)), end);
    this.way = element("div", { class: "way" }, this.progress, this.count);
    this.section.replaceChildren(head, this.way, this.questions, this.verdict, this.after, this.said);
    this.section.hidden = false;
    this.change(job);
    this.follow();
    this.section.scrollIntoView({ block: "nearest" });
  }

  async refresh() {
    try {
      this.change(await ask("GET", `/jobs/${this.job.id}`, undefined, undefined, undefined, URGENT));
    } catch {
      return; // no connection: the page shows this
    }
    await this.follow();
  }

  async cancel() {
    try {
      await ask("POST", `/jobs/${this.job.id}/cancel`, {});
    } catch (error) {
      this.say("p", `Not ended: ${error.message}`, "problem");
    }
  }

  async change(job) {
    const ended = over(job) && !(this.endedJob === job.id);
    this.job = job;
    this.cancelling.hidden = over(job);
    this.way.hidden = over(job);
    if (job.state === "accepted") this.count.textContent = "Waiting for the end of another job.";
    if (!ended) return;
    this.endedJob = job.id;
    const { verdict } = this;
    await this.follow();
    if (this.verdict !== verdict) return; // another job is shown by now
    this.drop();
    sessionStorage.removeItem(this.key);
    const [kind, word] = ENDS[job.state];
    const reason = job.reason ? `: ${job.reason}` : "";
    this.verdict.append(element("p", { class: `verdict ${kind} end` }, `${kindWords(job.kind)}: ${word.toLowerCase()}${reason}`));
    const links = [...this.next(job, this.document)];
    if (job.run) {
      const address = `/cells/${encodeURIComponent(page.cell)}/runs/${encodeURIComponent(job.run)}`;
      links.push(element("a", { class: "button", href: address }, `Run ${job.run}`));
    }
    this.after.replaceChildren(...links);
    this.ended(job, this.document);
  }

  // Get the new events of the job. At most one request is running and one is waiting.
  // The waiting request serves all calls until it starts, so that no event is missed.
  follow() {
    const { job: { id }, said } = this;
    const left = () => this.job?.id !== id || this.said !== said; // another job is shown, or this one again
    this.waiting ??= this.asking.then(async () => {
      if (left()) return;
      [this.asking, this.waiting] = [this.waiting, null];
      try {
        const events = await ask("GET", `/jobs/${id}/events?after=${this.known}`, undefined, undefined, undefined, URGENT);
        if (left()) return;
        this.known += events.length;
        for (const event of events) this.take(event);
      } catch {
        // no connection: `refresh` is called once the service answers again
      }
    });
    return this.waiting;
  }

  take(event) {
    switch (event.kind) {
      case "said": return event.text && this.say("p", event.text);
      case "key_refused": return this.say("p", event.text, "problem");
      case "judged": return this.verdict.append(verdictOf(event));
      case "result": return this.showResult(event);
      case "state": return this.say("h3", event.text);
      case "motion": return this.say("h3", event.title);
      case "progress": return this.showProgress(event);
      case "asked": return this.askPerson(event);
      case "answered": return this.drop();
      case "ended": return event.message && this.verdict.append(verdictOf({ passed: false, text: event.message }));
    }
  }

  showResult({ document, blocks }) {
    [this.document, this.blocks] = [document, blocks];
    this.verdict.append(...blocks.filter(({ kind }) => kind === "verdict").map(verdictOf));
    this.said.append(...blockParts(blocks.filter(({ kind }) => kind !== "verdict")));
  }

  say(tag, text, kind = null) {
    const near = this.said.scrollHeight - this.said.scrollTop - this.said.clientHeight < 40;
    this.said.append(element(tag, { class: kind }, text));
    if (near) this.said.scrollTop = this.said.scrollHeight;
  }

  showProgress({ title, done, total, unit, line }) {
    if (total) this.progress.value = done / total;
    else this.progress.removeAttribute("value");
    const of = total ? `${Math.round(done)} of ${Math.round(total)} ${unit}` : `${Math.round(done)} ${unit}`;
    this.count.textContent = [title, of, line].filter(Boolean).join(" · ");
  }

  showPicture({ words, share, count, left_s: left, stop, problem }) {
    if (share === null) this.progress.removeAttribute("value");
    else this.progress.value = share;
    const rest = left === null || left === undefined ? "" : `${duration(left)} left`;
    this.count.textContent = [words, count, rest, stop, problem].filter(Boolean).join(" · ");
  }

  drop() {
    this.question?.leave?.();
    this.question = null;
    this.questions.replaceChildren();
  }

  askPerson(event) {
    this.drop();
    const job = this.job;
    const problem = element("p", { class: "problem", role: "alert" });
    const answer = async (text) => {
      problem.textContent = "";
      try {
        await ask("POST", `/jobs/${job.id}/answer`, { question: event.question, text });
      } catch (error) {
        problem.textContent = error.message;
      }
    };
    let parts = [];
    if (event.form === "hold") {
      this.question = holdPad(job, now.status?.joints ?? []);
      parts = [this.question.pad];
    } else if (event.form === "yes_no") {
      const choice = (text, said) => element("button", { type: "button", class: "answer", onclick: () => answer(said) }, text);
      parts = [element("div", { class: "answers" }, choice("Yes", "yes"), choice("No", "no"))];
    } else {
      const input = element("input", { id: "answer", type: "text", autocomplete: "off" });
      const send = element("button", { type: "submit", class: "main" }, "Answer");
      const form = element("form", { class: "free" }, element("label", { for: "answer" }, "Answer"), input, send);
      form.addEventListener("submit", (submitted) => {
        submitted.preventDefault();
        answer(input.value.trim());
      });
      const large = (event.choices ?? []).map(({ text, label }) =>
        element("button", { type: "button", class: "answer", onclick: () => answer(text) }, label),
      );
      parts = [large.length ? element("div", { class: "answers" }, ...large) : null, form].filter(Boolean);
    }
    const text = event.text ? element("p", { class: "question" }, event.text) : null;
    const mine = lease.key ? null : element("p", { class: "problem" }, "Only the holder of the cell can answer: take the cell first.");
    this.questions.replaceChildren(...[text, mine, ...parts, problem].filter(Boolean));
    this.questions.scrollIntoView({ block: "nearest" });
  }
}
