// The 3-D view of a page: picture of the robot, its controls, and a joint table with the same pose.
import { element, seen, threeDigits } from "./dom.js";
import { GHOST, JointRows } from "./joint_rows.js";
import { newest, request } from "./requests.js";
import { CELL, now, on } from "./service.js";

const PATIENCE_MS = 30000;
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;
const SHAPES = {
  meshes: "MESHES: shape of the links from the meshes of the URDF",
  bodies: "BODIES: shape of the collision bodies in the robot file",
  schematic: "SCHEMATIC: only the axes and lengths are to scale",
};
/** @type {Record<string, string>} */
const LAYERS = {
  axes: "Joint axes", limits: "Limits", frames: "Base and tool frame", gravity: "Gravity", plate: "Force plate", wrench: "Base wrench",
  payload: "Centre of gravity", path: "Tool path",
};
const HELP = "3-D picture of the robot. Drag or use the arrow keys to turn it, + and - to zoom, Home to reset. The table shows the same pose.";

export class RobotView {
  /** @type {import("./robot_drawing.js").RobotDrawing | null} */
  drawing = null;
  /** @type {JointRows | null} */
  rows = null;
  /** @type {Api.SceneDocument | null} */
  document = null;
  renewedFor = ""; // hash of the cell's files for which the scene was requested again

  // Show the robot of this page's cell in a section of the page, once the section is visible.
  // `preview`: the rows of the table can show the positive directions. `hidden`: layers that are hidden at first.
  // `query`: parameters of the scene's address, such as the payload whose centre of gravity is shown.
  /** @param {HTMLElement} section @param {{ preview?: boolean, hidden?: string[], query?: Record<string, string> }} [options] */
  constructor(section, { preview = false, hidden = [], query = {} } = {}) {
    this.section = section;
    this.canPreview = preview;
    this.hidden = hidden;
    this.query = query;
    /** @type {{ position: number[] | null, target: number[] | null }} */
    this.pose = { position: null, target: null };
    /** @type {ShownPose | null} */
    this.last = null; // the pose that the page has requested, also while the scene must be loaded again
    this.hasFailed = false;
    this.replacing = newest();
    /** @type {number | null} */
    this.preview = null; // number of the joint whose positive direction is shown
    this.withGhost = true;
    /** @type {number[] | null} */
    this.ghost = null; // pose in which the joint is moved in its positive direction
    /** @type {number[][]} */
    this.path = [];
    this.state = element("p", { class: "view-state", role: "status" });
    this.shape = element("p", { class: "view-shape" });
    this.wrenchWords = element("p", { class: "view-wrench", hidden: true }); // changes too often to be read aloud
    /** @type {LiveWrench | null} */
    this.wrench = null; // newest wrench of the base on the robot; null without live data
    this.canvas = element("canvas", { tabindex: "0", role: "img", "aria-label": HELP });
    this.labels = element("div", { class: "view-labels", "aria-hidden": "true" });
    this.problem = element("p", { class: "view-problem", hidden: true });
    this.tools = element("div", { class: "view-tools tools" });
    this.table = element("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": "pose of the joints" });
    this.picture = element("div", { class: "view-picture" }, this.canvas, this.labels, this.problem);
    const stage = element("div", { class: "view-stage" }, this.state, this.picture, this.wrenchWords, this.shape, this.tools);
    this.side = element("div", { class: "part" }, this.table); // next to the picture; a page can add its own controls
    section.append(element("div", { class: "view-parts" }, stage, this.side));
    section.robotView = this;
    this.say("NO LIVE DATA", "old");
    this.seen = seen(section, "25%");
    this.seen.then(() => {
      this.load();
      on("cell", () => this.renew());
      on("again", () => this.hasFailed && this.load());
    });
  }

  // True if the cell's files have changed since the scene was loaded, so that the picture shows an outdated robot.
  isOutdated() {
    const { files_hash: ours } = this.document ?? {};
    return Boolean(ours && now.status) && ours !== now.status?.files_hash;
  }

  // Load the scene again if the cell's files have changed; until then, no pose counts as live.
  renew() {
    const present = now.status?.files_hash;
    if (!this.isOutdated() || !present || this.renewedFor === present) return;
    this.renewedFor = present;
    if (this.last) this.show(this.last);
    this.load();
  }

  // Load and show the scene with other query parameters, such as another payload.
  /** @type {(query: Record<string, string>) => Promise<void>} */
  reload(query) {
    this.query = query;
    return this.seen.then(() => this.load());
  }

  // Load the scene and draw it. Without WebGL, only the table shows the pose.
  async load() {
    const signal = this.replacing();
    if (!this.document) this.refuse("Loading the robot …");
    const software = findRenderer();
    const wanted = { ...this.query, detail: software === false ? "full" : "small" };
    try {
      const document = await request(`/view${CELL}/scene?${new URLSearchParams(wanted)}`, {}, { patienceMs: PATIENCE_MS, signal });
      const binary = software === null ? null : await getBinary(document.geometry, signal);
      this.hasFailed = false;
      this.refuse(software === null ? "This browser cannot draw 3-D pictures (it has no WebGL 2). The table shows the pose." : "");
      await this.open(document, binary, software ?? true);
      if (this.last) this.show(this.last);
    } catch (error) {
      if (signal.aborted) return;
      this.hasFailed = true;
      this.refuse(`No picture of the robot: ${error.message}`);
    }
  }

  // Show the robot of a scene. `binary` contains the triangles of the meshes; it is null if the browser cannot draw.
  /** @type {(document: Api.SceneDocument, binary: ArrayBuffer | null, isSoftware?: boolean) => Promise<void>} */
  async open(document, binary, isSoftware = true) {
    this.document = document;
    if (this.pose.position?.length !== document.joints.length) this.pose = { position: null, target: null };
    this.shape.textContent = SHAPES[document.shape];
    this.hideWrenchWords();
    this.rows = new JointRows(document.joints, this.canPreview ? (joint) => this.choose(joint) : null);
    this.table.replaceChildren(this.rows.table);
    this.rows.show(this.pose.position);
    if (binary === null) return;
    const { RobotDrawing } = await import("./robot_drawing.js");
    if (this.document !== document) return; // a newer scene has been loaded meanwhile
    const { section, canvas, labels, hidden } = this;
    this.drawing ??= new RobotDrawing({ section, canvas, labels, hidden, isSoftware, lost: (isLost) => this.showLoss(isLost) });
    this.drawing.open(document, binary, this.position());
    for (const name of this.drawing.hidden) this.drawing.setLayer(name, false);
    this.drawing.showPath(this.path);
    this.drawing.showWrench(this.wrench);
    this.choose(this.preview, { withGhost: this.withGhost });
    await this.addTools(this.drawing);
  }

  /** @type {(drawing: import("./robot_drawing.js").RobotDrawing) => Promise<void>} */
  async addTools(drawing) {
    const { VIEWS } = await import("./drawing_camera.js");
    /** @type {(name: string) => HTMLElement} */
    const look = (name) => element("button", { type: "button", onclick: () => drawing.camera.look(name) }, name);
    /** @type {(text: string, words: string, factor: number) => HTMLElement} */
    const zoom = (text, words, factor) => element("button", { type: "button", "aria-label": words, onclick: () => drawing.camera.zoom(factor) }, text);
    const shown = Object.keys(LAYERS).filter((name) => drawing.isLayerUsed(name)).map((name) => {
      const box = element("input", { type: "checkbox", checked: !drawing.hidden.has(name) });
      box.addEventListener("change", () => drawing.setLayer(name, box.checked));
      return element("label", { class: "tick" }, box, LAYERS[name]);
    });
    const layers = element("details", {}, element("summary", {}, "Shown parts"), element("div", { class: "view-layers" }, ...shown));
    this.tools.replaceChildren(...Object.keys(VIEWS).map(look), zoom("+", "Zoom in", 1 / 1.2), zoom("−", "Zoom out", 1.2), layers);
  }

  // Show a pose [rad or m] (null: unknown), a second pose as a translucent robot, and a text about them. `kind` decides
  // how the pose is marked: "live", "old" (no live data) or "planned".
  /** @type {(last: ShownPose) => void} */
  show(last) {
    this.last = last;
    this.hideWrenchWords();
    if (this.isOutdated()) {
      this.showWrench(null);
      this.say("NO LIVE DATA: the cell's files have changed, and the robot is being loaded.", "old");
      return;
    }
    const { position, target = null, words, kind, wrench = null } = last;
    const isFirst = this.pose.position === null && position !== null;
    this.pose = { position, target };
    if (isFirst && this.ghost !== null) this.choose(this.preview); // draw the second robot again, because without a pose it was drawn relative to the zero pose
    this.say(words, kind);
    this.showWrench(wrench);
    this.rows?.show(position);
    this.refresh();
  }

  // A planned motion has no measured wrench.
  hideWrenchWords() {
    this.wrenchWords.hidden = !this.document?.plate || this.last?.kind === "planned";
  }

  // Show the wrench of the base on the robot, as the force plate measures it; null: no live data.
  /** @type {(wrench: LiveWrench | null) => void} */
  showWrench(wrench) {
    this.wrench = wrench;
    this.drawing?.showWrench(wrench);
    /** @type {(values: Vector, unit: string) => string} */
    const size = (values, unit) => `${threeDigits(Math.hypot(...values))} ${unit} (${values.map((each, i) => `${"xyz"[i]} ${threeDigits(each)}`).join(", ")})`;
    const text = wrench
      ? `Base wrench, LIVE, relative to the plate's zero: force ${size(wrench.force_n, "N")}, moment ${size(wrench.moment_nm, "N m")}.${wrench.overloaded ? " OVERLOAD: a channel of the plate was overloaded." : ""}`
      : "Base wrench: NO LIVE DATA. The force plate is read during a motion.";
    if (this.wrenchWords.textContent !== text) this.wrenchWords.textContent = text;
    this.wrenchWords.dataset.kind = wrench ? (wrench.overloaded ? "bad" : "live") : "old";
  }

  // Show the path of the tool: points in the base frame [m] (empty list: no path).
  /** @type {(places: number[][]) => void} */
  showPath(places) {
    this.path = places;
    this.drawing?.showPath(places);
    if (this.drawing) this.addTools(this.drawing);
  }

  // Show the positive direction of a joint (null: no joint). A translucent robot shows the present pose after a small
  // move of the joint. It stays at that pose while the robot moves, so that the user can compare the two moves.
  /** @type {(joint: number | null, options?: { withGhost?: boolean }) => void} */
  choose(joint, { withGhost = true } = {}) {
    const { document } = this;
    [this.preview, this.withGhost] = [joint, withGhost];
    this.rows?.mark(withGhost ? joint : null);
    this.drawing?.choose(joint);
    /** @type {(value: number, i: number) => number} */
    const moved = (value, i) => value + (i === joint && document ? GHOST[document.joints[i].kind][0] : 0);
    this.ghost = joint !== null && withGhost && document ? this.position().map(moved) : null;
    this.refresh();
  }

  refresh() {
    this.drawing?.show(this.position(), this.ghost ?? this.pose.target);
  }

  // Return the pose to draw: the known pose, or else the zero pose moved inside the joint limits.
  /** @type {() => number[]} */
  position() {
    /** @type {(joint: Api.JointDocument) => number} */
    const zero = ({ limits: [low, high] }) => Math.min(high, Math.max(low, 0));
    return this.pose.position ?? this.document?.joints.map(zero) ?? [];
  }

  /** @type {(words: string, kind: string) => void} */
  say(words, kind) {
    if (this.state.textContent !== words) this.state.textContent = words;
    this.state.dataset.kind = kind;
  }

  /** @type {(text: string) => void} */
  refuse(text) {
    this.problem.textContent = text;
    this.problem.hidden = text === "";
    this.canvas.hidden = text !== "";
    this.labels.hidden = text !== "";
  }

  /** @type {(isLost: boolean) => void} */
  showLoss(isLost) {
    this.problem.textContent = isLost ? "The browser has stopped the 3-D picture. The robot is not affected. The table shows the pose." : "";
    this.problem.hidden = !isLost;
    this.labels.hidden = isLost;
  }
}

/** @type {(address: string, signal: AbortSignal) => Promise<ArrayBuffer>} */
async function getBinary(address, signal) {
  const answer = await fetch(address, { signal: AbortSignal.any([signal, AbortSignal.timeout(PATIENCE_MS)]) });
  if (!answer.ok) throw new Error(`the service refused the robot's shape (status ${answer.status}).`);
  return answer.arrayBuffer();
}

// Return true if WebGL draws on the processor, false if it draws on a graphics card, null if the browser has no WebGL
// 2.
function findRenderer() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (context === null) return null;
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = String(context.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}
