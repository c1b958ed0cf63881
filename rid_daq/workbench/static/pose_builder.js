// Poses that are chosen with sliders next to the 3-D view. The service writes the text of the motion from them.
import { breakable, element, find, parseNumber } from "./dom.js";
import { refuseField } from "./fields.js";
import { html, keyed, render } from "./lit.js";
import { newest, post } from "./requests.js";
import { CELL } from "./service.js";

const PATIENCE_MS = 30000;
const DEGREES = 180 / Math.PI;
/** @type {(kind: string) => [number, string]} */
const scaleOf = (kind) => (kind === "prismatic" ? [1000, "mm"] : [DEGREES, "°"]);

export class PoseBuilder {
  // Show the sliders and the list in the section `poses`. `plan` shows poses; `setText` replaces the text of the file.
  /** @param {PlannedView} plan @param {(text: string) => void} setText */
  constructor(plan, setText) {
    this.plan = plan;
    this.setText = setText;
    /** @type {Api.JointDocument[]} */
    this.joints = JSON.parse(find("poses").dataset.joints ?? "[]");
    this.pose = this.joints.map(({ limits: [low, high] }) => Math.min(high, Math.max(low, 0)));
    /** @type {Record<string, PoseForm>} */
    this.forms = JSON.parse(find("poses").dataset.forms ?? "{}");
    /** @type {Record<string, number | number[]>} */
    this.settings = {};
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
      this.showSettings();
      this.write();
    });
    this.showSettings();
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

  // Show the fields of the chosen kind of motion, with their initial values or the values of a file.
  /** @type {(values?: Record<string, number | number[]>) => void} */
  showSettings(values) {
    const { hint, settings } = this.forms[this.kind.value];
    this.settings = Object.fromEntries(settings.map(({ key, initial }) => [key, values?.[key] ?? initial]));
    /** @type {(setting: PoseSetting) => Part} */
    const field = (setting) => html`<label for="pose-${setting.key}">${setting.label} ${setting.choices.length ? this.choice(setting) : this.number(setting)}</label>`;
    render(settings.map((each) => keyed(`${this.kind.value} ${each.key}`, field(each))), find("pose-settings"));
    find("pose-hint").textContent = hint;
  }

  /** @type {(setting: PoseSetting) => Part} */
  choice({ key, choices }) {
    const chosen = JSON.stringify(this.settings[key]);
    /** @type {(event: Event) => void} */
    const choose = ({ target }) => this.set(key, choices[/** @type {HTMLSelectElement} */ (target).selectedIndex][1]);
    return html`<select id="pose-${key}" @change=${choose}>${choices.map(([label, value]) =>
      html`<option ?selected=${JSON.stringify(value) === chosen}>${label}</option>`)}</select>`;
  }

  /** @type {(setting: PoseSetting) => Part} */
  number({ key, factor }) {
    const shown = Number((factor * Number(this.settings[key])).toPrecision(6));
    /** @type {(event: Event) => void} */
    const enter = ({ target }) => {
      const input = /** @type {HTMLInputElement} */ (target);
      const value = parseNumber(input.value);
      if (Number.isNaN(value)) refuseField(input, "Enter a number.");
      else this.set(key, Number((value / factor).toPrecision(12)));
    };
    return html`<input id="pose-${key}" type="text" inputmode="decimal" autocomplete="off" .value=${String(shown)} @change=${enter}>`;
  }

  /** @type {(key: string, value: number | number[]) => void} */
  set(key, value) {
    this.settings[key] = value;
    this.write();
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
      const wanted = { kind: this.kind.value, points: this.points, settings: this.settings };
      const { text } = /** @type {Api.MotionText} */ (await post(`/view${CELL}/motion-text`, wanted, { patienceMs: PATIENCE_MS, signal }));
      this.refuse("");
      this.written = text;
      this.setText(text);
    } catch (error) {
      if (!signal.aborted) this.refuse(error.message);
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
      this.showSettings(found.settings);
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
