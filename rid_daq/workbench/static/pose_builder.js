// Poses that are chosen with sliders next to the 3-D view. The service writes the text of the motion from them.
import { breakable, element, find, parseNumber } from "./dom.js";
import { refuseField } from "./fields.js";
import { html, render } from "./lit.js";
import { newest, post } from "./requests.js";
import { CELL } from "./service.js";

const PATIENCE_MS = 30000;
const DEGREES = 180 / Math.PI;
/** @type {(kind: string) => [number, string]} */
const scaleOf = (kind) => (kind === "prismatic" ? [1000, "mm"] : [DEGREES, "°"]);

// For each kind of motion: factor and label of the speed, and the initial values of speed and rest.
/** @type {Record<string, { factor: number, label: string, speed: number, dwell_s: number }>} */
const KINDS = {
  pose_sequence: { factor: 100, label: "Speed [% of the joints' limits]", speed: 0.3, dwell_s: 5 },
  joint_path: { factor: 100, label: "Speed [% of the joints' limits]", speed: 0.5, dwell_s: 0.2 },
  path: { factor: 1000, label: "Speed of the tool point [mm/s]", speed: 0.1, dwell_s: 0.2 },
};

export class PoseBuilder {
  // Show the sliders and the list in the section `poses`. `plan` shows poses; `setText` replaces the text of the file.
  /** @param {PlannedView} plan @param {(text: string) => void} setText */
  constructor(plan, setText) {
    this.plan = plan;
    this.setText = setText;
    /** @type {Api.JointDocument[]} */
    this.joints = JSON.parse(find("poses").dataset.joints ?? "[]");
    this.pose = this.joints.map(({ limits: [low, high] }) => Math.min(high, Math.max(low, 0)));
    /** @type {number[][]} */
    this.points = [];
    /** @type {string | null} */
    this.written = null; // the newest text of the file that this section has written or read
    this.replacing = newest();
    this.kind = find("pose-kind");
    plan.side.append(find("pose-sliders"));
    this.rows = this.joints.map((joint, i) => this.addRow(joint, i));
    find("pose-add").addEventListener("click", () => this.change([...this.points, [...this.pose]]));
    find("pose-known").addEventListener("click", () => this.useKnown());
    this.kind.addEventListener("change", () => {
      const { speed, dwell_s: rest } = KINDS[this.kind.value];
      this.showSettings(speed, rest);
      this.write();
    });
    for (const id of /** @type {const} */ (["pose-speed", "pose-rest"])) find(id).addEventListener("change", () => this.write());
    const { speed, dwell_s: rest } = KINDS[this.kind.value];
    this.showSettings(speed, rest);
    this.showPose();
    this.showList();
  }

  /** @type {(joint: Api.JointDocument, i: number) => { slider: HTMLInputElement, field: HTMLInputElement, factor: number }} */
  addRow({ name, kind, limits }, i) {
    const [factor, unit] = scaleOf(kind);
    const [low, high] = limits.map((value) => factor * value);
    const slider = element("input", { type: "range", min: low, max: high, step: "any", "aria-label": `${name} [${unit}]` });
    const field = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", size: "7", id: `pose-${i}`, "aria-label": `${name}, value [${unit}]` });
    /** @type {(value: number) => void} */
    const set = (value) => {
      this.pose[i] = Math.min(limits[1], Math.max(limits[0], value / factor));
      this.showPose();
      this.plan.showPose(this.pose);
    };
    slider.addEventListener("input", () => set(Number(slider.value)));
    field.addEventListener("change", () => {
      const value = parseNumber(field.value);
      if (Number.isNaN(value) || value < low || value > high) refuseField(field, `Enter a number from ${low.toFixed(0)} to ${high.toFixed(0)}.`);
      else set(value);
    });
    const place = element("span", { class: "pose-value" }, field, ` ${unit}`);
    find("sliders").append(element("div", { class: "pose-joint" }, element("b", {}, ...breakable(name)), slider, place));
    return { slider, field, factor };
  }

  showPose() {
    this.rows.forEach(({ slider, field, factor }, i) => {
      const value = factor * this.pose[i];
      if (Number(slider.value) !== value) slider.value = String(value);
      if (document.activeElement !== field) field.value = value.toFixed(1);
    });
  }

  useKnown() {
    const known = this.plan.knownPose();
    if (known === null) return this.refuse("No pose of the robot is known: check the cell first.");
    this.pose = [...known];
    this.showPose();
    this.plan.showPose(this.pose);
    return this.refuse("");
  }

  /** @type {(speed: number, rest: number) => void} */
  showSettings(speed, rest) {
    const { factor, label } = KINDS[this.kind.value];
    find("pose-speed-label").textContent = label;
    find("pose-speed").value = String(Number((factor * speed).toPrecision(6)));
    find("pose-rest").value = String(rest);
    find("pose-path").hidden = this.kind.value !== "path" || this.joints.length === 3;
  }

  showList() {
    /** @type {(point: number[]) => string} */
    const words = (point) => point.map((value, i) => {
      const [factor, unit] = scaleOf(this.joints[i].kind);
      return `${(factor * value).toFixed(1)} ${unit}`;
    }).join(", ");
    /** @type {(i: number) => number[][]} */
    const without = (i) => this.points.filter((_, each) => each !== i);
    /** @type {(i: number) => number[][]} */
    const earlier = (i) => without(i).toSpliced(i - 1, 0, this.points[i]);
    /** @type {(i: number) => number[][]} */
    const replaced = (i) => this.points.with(i, [...this.pose]);
    /** @type {(text: string, i: number, action: () => void, isOff?: boolean) => Part} */
    const button = (text, i, action, isOff = false) =>
      html`<button type="button" class="fold" aria-label="${text} pose ${i + 1}" ?disabled=${isOff} @click=${action}>${text}</button>`;
    /** @type {(point: number[], i: number) => Part} */
    const row = (point, i) => html`<li><span class="number">${words(point)}</span> <span class="pose-buttons">
      ${button("Show", i, () => this.choose(i))}
      ${button("Replace", i, () => this.change(replaced(i)))}
      ${button("Earlier", i, () => this.change(earlier(i)), i === 0)}
      ${button("Remove", i, () => this.change(without(i)), this.points.length === 1)}</span></li>`;
    render(this.points.length > 0 ? this.points.map(row) : html`<p class="soft">No pose yet.</p>`, find("pose-list"));
  }

  /** @type {(i: number) => void} */
  choose(i) {
    this.pose = [...this.points[i]];
    this.showPose();
    this.plan.showPose(this.pose);
  }

  /** @type {(points: number[][]) => void} */
  change(points) {
    this.points = points;
    this.showList();
    this.write();
  }

  // Let the service write the text of the motion.
  async write() {
    if (this.points.length === 0) return;
    const signal = this.replacing();
    try {
      /** @type {(id: "pose-speed" | "pose-rest", factor: number) => number} */
      const number = (id, factor) => {
        const value = parseNumber(find(id).value) / factor;
        if (Number.isNaN(value)) throw refuseField(find(id), "Enter a number.");
        return value;
      };
      const { factor } = KINDS[this.kind.value];
      const wanted = { kind: this.kind.value, points: this.points, speed: number("pose-speed", factor), dwell_s: number("pose-rest", 1) };
      const { text } = /** @type {Api.MotionText} */ (await post(`/view${CELL}/motion-text`, wanted, { patienceMs: PATIENCE_MS, signal }));
      this.refuse("");
      this.written = text;
      this.setText(text);
    } catch (error) {
      if (!signal.aborted && !error.isShown) this.refuse(error.message);
    }
  }

  // Read the poses from a text that this page's sliders did not write.
  /** @type {(file: string, text: string) => Promise<void>} */
  async read(file, text) {
    if (text === this.written || !text.trim()) return;
    this.written = text;
    const signal = this.replacing();
    try {
      /** @type {Api.PoseList | null} */
      const found = await post(`/view${CELL}/poses`, { file, text }, { patienceMs: PATIENCE_MS, signal });
      for (const id of /** @type {const} */ (["pose-controls", "pose-sliders"])) find(id).hidden = found === null;
      find("pose-other").hidden = found !== null;
      if (found === null) return;
      this.kind.value = found.kind;
      this.showSettings(found.speed, found.dwell_s);
      this.points = found.points;
      this.showList();
    } catch (error) {
      if (!signal.aborted) this.refuse(error.message);
    }
  }

  /** @type {(words: string) => void} */
  refuse(words) {
    find("pose-problem").textContent = words;
  }
}
