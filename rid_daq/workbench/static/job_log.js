// Messages of a job. Lines are added in batches, and long logs in parts that the browser lays out only where they are
// visible: the time for a line does not grow with the length of the log.
import { element } from "./dom.js";
import { render } from "./lit.js";

const PART_LINES = 200;
const NEAR_PX = 40; // a reader this close to the end follows the new lines

export class JobLog {
  constructor() {
    this.place = element("div", { class: "said", role: "log", tabindex: "0", "aria-label": "messages of the job" });
    this.waiting = [];
    this.part = null;
  }

  say(tag, text, kind) {
    this.waiting.push(element(tag, { class: kind }, text));
  }

  // Add blocks of a result.
  add(parts) {
    if (!parts.length) return;
    const place = element("div", { class: "part" });
    render(parts, place);
    this.waiting.push(place);
  }

  // Show the waiting lines, at most once per change of the panel.
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
