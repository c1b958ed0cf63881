// Table of the joints next to the 3-D view; it shows the same pose as numbers.
import { breakable, element } from "./dom.js";

const DEGREES = 180 / Math.PI;
const PERIOD_MS = 200; // time between updates of the table: faster ones could not be read, and would cost time for the layout
/** @type {Record<Api.JointDocument["kind"], [number, string]>} */
export const GHOST = { revolute: [2 / DEGREES, "+2°"], prismatic: [0.01, "+10 mm"] };

/** @type {(kind: string) => [number, string]} */
const scaleOf = (kind) => (kind === "prismatic" ? [1000, "mm"] : [DEGREES, "°"]);

export class JointRows {
  // `preview(joint)` shows a joint moved in positive direction (null: none); without it, the rows have no buttons.
  /** @param {Api.JointDocument[]} joints @param {((joint: number | null) => void) | null} preview */
  constructor(joints, preview = null) {
    this.joints = joints;
    this.cells = joints.map(() => element("td", { class: "number" }, "–"));
    /** @type {HTMLElement[]} */
    this.buttons = [];
    /** @type {number[] | null} */
    this.position = null;
    /** @type {ReturnType<typeof setTimeout> | null} */
    this.timer = null;
    this.written = false;
    /** @type {HTMLElement[]} */
    const rows = joints.map(({ name, kind, limits }, i) => {
      const [factor, unit] = scaleOf(kind);
      const [low, high] = limits.map((value) => (factor * value).toFixed(0));
      const range = element("td", { class: "number soft" }, `${low} to ${high} ${unit}`);
      const cells = [element("th", { scope: "row" }, ...breakable(name)), this.cells[i], range];
      if (preview) cells.push(element("td", {}, this.button(i, kind, name, preview)));
      return element("tr", {}, ...cells);
    });
    const heads = ["joint", "position", "range", ...(preview ? ["positive direction"] : [])];
    const head = element("tr", {}, ...heads.map((each) => element("th", { scope: "col" }, each)));
    this.table = element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows));
  }

  /** @type {(i: number, kind: Api.JointDocument["kind"], name: string, preview: (joint: number | null) => void) => HTMLElement} */
  button(i, kind, name, preview) {
    const words = GHOST[kind][1];
    const made = element("button", { type: "button", class: "ghost", "aria-pressed": "false", "aria-label": `Show ${name} ${words}` }, `Show ${words}`);
    made.addEventListener("click", () => {
      const isOn = made.getAttribute("aria-pressed") === "false";
      preview(isOn ? i : null);
    });
    this.buttons.push(made);
    return made;
  }

  // Mark the row of the joint whose positive direction is shown (null: no joint).
  /** @type {(joint: number | null) => void} */
  mark(joint) {
    this.buttons.forEach((each, i) => each.setAttribute("aria-pressed", String(i === joint)));
  }

  /** @type {(position: number[] | null) => void} */
  show(position) {
    this.position = position;
    this.timer ??= setTimeout(() => {
      this.timer = null;
      this.write();
    }, this.written ? PERIOD_MS : 0);
  }

  write() {
    this.written = true;
    const { position } = this;
    this.joints.forEach(({ kind }, i) => {
      const [factor, unit] = scaleOf(kind);
      this.cells[i].textContent = position === null ? "unknown" : `${(factor * position[i]).toFixed(1)} ${unit}`;
    });
  }
}
