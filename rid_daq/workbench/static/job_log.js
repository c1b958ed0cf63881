// Messages of a job. New lines are added in batches. The lines of a long log are grouped, and the browser lays out only
// the groups that are visible. The time for a new line is therefore independent of the log's length.
import { linked } from "./commands.js";
import { element } from "./dom.js";
import { render } from "./lit.js";

const PART_LINES = 200;
const NEAR_PX = 40; // if the user has scrolled to within this distance of the end, the log scrolls to each new line

export class JobLog {
  constructor() {
    this.place = element("div", { class: "said", role: "log", tabindex: "0", "aria-label": "messages of the job" });
    /** @type {HTMLElement[]} */
    this.waiting = [];
    /** @type {HTMLElement | null} */
    this.part = null;
  }

  /** @type {(tag: "p" | "h3", text: string, kind?: string | null) => void} */
  say(tag, text, kind) {
    const line = element(tag, { class: kind });
    render(linked(text), line);
    this.waiting.push(line);
  }

  get isEmpty() {
    return this.part === null && this.waiting.length === 0;
  }

  // Move the waiting lines into the page. The panel calls `flush` once per change.
  flush() {
    if (!this.waiting.length) return;
    const { place } = this;
    const near = place.scrollHeight - place.scrollTop - place.clientHeight < NEAR_PX;
    while (this.waiting.length) {
      if (!this.part || this.part.childElementCount >= PART_LINES) {
        this.part?.classList.add("full");
        this.part = element("div", { class: "lines" });
        place.append(this.part);
      }
      this.part.append(...this.waiting.splice(0, PART_LINES - this.part.childElementCount));
    }
    if (near) place.scrollTop = place.scrollHeight;
  }
}
