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
const LAYERS = {
  axes: "Joint axes", limits: "Limits", frames: "Base and tool frame", gravity: "Gravity", plate: "Force plate", wrench: "Base wrench",
  payload: "Centre of gravity", path: "Tool path",
};
const HELP = "3-D picture of the robot. Drag or use the arrow keys to turn it, + and - to zoom, Home to reset. The table shows the same pose.";

export class RobotView {
  // Show the robot of this page's cell in a section of the page, once the section is visible.
  // `preview`: the rows of the table can show the positive directions. `hidden`: layers that are hidden at first.
  // `query`: parameters of the scene's address, such as the payload whose centre of gravity is shown.
  constructor(section, { preview = false, hidden = [], query = {} } = {}) {
    this.section = section;
    this.canPreview = preview;
    this.hidden = hidden;
    this.query = query;
    this.pose = { position: null, target: null };
    this.last = null; // the pose that the page has requested, also while the scene must be loaded again
    this.hasFailed = false;
    this.replacing = newest();
    this.preview = null; // number of the joint whose positive direction is shown
    this.withGhost = true;
    this.ghost = null; // pose in which the joint is moved in its positive direction
    this.path = [];
    this.state = element("p", { class: "view-state", role: "status" });
    this.shape = element("p", { class: "view-shape" });
    this.wrenchWords = element("p", { class: "view-wrench", hidden: true }); // changes too often to be read aloud
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
    return Boolean(ours && now.status) && ours !== now.status.files_hash;
  }

  // Load the scene again if the cell's files have changed; until then, no pose counts as live.
  renew() {
    if (!this.isOutdated() || this.renewedFor === now.status.files_hash) return;
    this.renewedFor = now.status.files_hash;
    if (this.last) this.show(this.last);
    this.load();
  }

  // Load and show the scene with other query parameters, such as another payload.
  reload(query) {
    this.query = query;
    return this.seen.then(() => this.load());
  }

  // Load the scene and draw it. Without WebGL, only the table shows the pose.
  async load() {
    const signal = this.replacing();
    const software = findRenderer();
    const wanted = { ...this.query, detail: software === false ? "full" : "small" };
    try {
      const document = await request(`/view${CELL}/scene?${new URLSearchParams(wanted)}`, {}, { patienceMs: PATIENCE_MS, signal });
      const binary = software === null ? null : await getBinary(document.geometry, signal);
      this.hasFailed = false;
      this.refuse(software === null ? "This browser cannot draw 3-D pictures (it has no WebGL 2). The table shows the pose." : "");
      await this.open(document, binary, software);
      if (this.last) this.show(this.last);
    } catch (error) {
      if (signal.aborted) return;
      this.hasFailed = true;
      this.refuse(`No picture of the robot: ${error.message}`);
    }
  }

  // Show the robot of a scene. `binary` contains the triangles of the meshes; it is null if the browser cannot draw.
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
    await this.addTools();
  }

  async addTools() {
    const { VIEWS } = await import("./drawing_camera.js");
    const look = (name) => element("button", { type: "button", onclick: () => this.drawing.camera.look(name) }, name);
    const zoom = (text, words, factor) => element("button", { type: "button", "aria-label": words, onclick: () => this.drawing.camera.zoom(factor) }, text);
    const shown = Object.keys(LAYERS).filter((name) => this.drawing.isLayerUsed(name)).map((name) => {
      const box = element("input", { type: "checkbox", checked: !this.drawing.hidden.has(name) });
      box.addEventListener("change", () => this.drawing.setLayer(name, box.checked));
      return element("label", { class: "tick" }, box, LAYERS[name]);
    });
    const layers = element("details", {}, element("summary", {}, "Shown parts"), element("div", { class: "view-layers" }, ...shown));
    this.tools.replaceChildren(...Object.keys(VIEWS).map(look), zoom("+", "Zoom in", 1 / 1.2), zoom("−", "Zoom out", 1.2), layers);
  }

  // Show a pose [rad or m] (null: unknown), a second pose as a translucent robot, and a text about them. `kind` decides
  // how the pose is marked: "live", "old" (no live data) or "planned".
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
  showWrench(wrench) {
    this.wrench = wrench;
    this.drawing?.showWrench(wrench);
    const size = (values, unit) => `${threeDigits(Math.hypot(...values))} ${unit} (${values.map((each, i) => `${"xyz"[i]} ${threeDigits(each)}`).join(", ")})`;
    const text = wrench
      ? `Base wrench, LIVE, relative to the plate's zero: force ${size(wrench.force_n, "N")}, moment ${size(wrench.moment_nm, "N m")}.${wrench.overloaded ? " OVERLOAD: a channel of the plate was overloaded." : ""}`
      : "Base wrench: NO LIVE DATA. The force plate is read during a motion.";
    if (this.wrenchWords.textContent !== text) this.wrenchWords.textContent = text;
    this.wrenchWords.dataset.kind = wrench ? (wrench.overloaded ? "bad" : "live") : "old";
  }

  // Show the path of the tool: points in the base frame [m] (empty list: no path).
  showPath(places) {
    this.path = places;
    this.drawing?.showPath(places);
    if (this.drawing) this.addTools();
  }

  // Show the positive direction of a joint (null: no joint). A translucent robot shows the present pose after a small
  // move of the joint. It stays at that pose while the robot moves, so that the user can compare the two moves.
  choose(joint, { withGhost = true } = {}) {
    [this.preview, this.withGhost] = [joint, withGhost];
    this.rows?.mark(withGhost ? joint : null);
    this.drawing?.choose(joint);
    const moved = (value, i) => value + (i === joint ? GHOST[this.document.joints[i].kind][0] : 0);
    this.ghost = joint !== null && withGhost && this.document ? this.position().map(moved) : null;
    this.refresh();
  }

  refresh() {
    this.drawing?.show(this.position(), this.ghost ?? this.pose.target);
  }

  // Return the pose to draw: the known pose, or else the zero pose moved inside the joint limits.
  position() {
    const zero = ({ limits: [low, high] }) => Math.min(high, Math.max(low, 0));
    return this.pose.position ?? this.document?.joints.map(zero) ?? null;
  }

  say(words, kind) {
    if (this.state.textContent !== words) this.state.textContent = words;
    this.state.dataset.kind = kind;
  }

  refuse(text) {
    this.problem.textContent = text;
    this.problem.hidden = text === "";
    this.canvas.hidden = text !== "";
    this.labels.hidden = text !== "";
  }

  showLoss(isLost) {
    this.problem.textContent = isLost ? "The browser has stopped the 3-D picture. The robot is not affected. The table shows the pose." : "";
    this.problem.hidden = !isLost;
    this.labels.hidden = isLost;
  }
}

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
