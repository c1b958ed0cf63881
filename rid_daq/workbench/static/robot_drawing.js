// Drawing of the robot with three.js: links, joint axes, limits, tool, gravity, plate. The picture is drawn only after
// a change.
import { Box3, BoxGeometry, BufferGeometry, Color, DirectionalLight, Group, HemisphereLight, Line, LineBasicMaterial, Mesh, Scene, SphereGeometry, Vector3, WebGLRenderer } from "./three.js";
import { DrawingCamera } from "./drawing_camera.js";
import { DrawingLabels } from "./drawing_labels.js";
import { Paints, WrenchArrows, alongAxis, arrow, frameArrows, limitMarks, turnArrow } from "./drawing_marks.js";
import { RobotArm, linkGeometries, matrixOf, vectorOf } from "./robot_arm.js";

const DOWN = new Vector3(0, 0, -1);
const NEAR_LIMIT = 0.03; // of the range
const HARDLY_MOVED = 1e-3; // of the reach
const FRAME_SHARE = 1.3; // length of a frame's arrows, as a multiple of the size of the marks
const PATIENCE_MS = 5000;
const LAYERS = ["axes", "limits", "frames", "gravity", "plate", "wrench", "payload", "path"];

export class RobotDrawing {
  /** @type {Api.SceneDocument} */
  document;
  /** @type {Group} */
  world;
  /** @type {RobotArm} */
  arm;
  /** @type {RobotArm} */
  ghost;
  /** @type {Record<string, import("three").Object3D[]>} */
  layers;
  size = 1; // of the marks [m]
  /** @type {import("./drawing_marks.js").Arrow | null} */
  gravity = null;
  /** @type {WrenchArrows | null} */
  wrench = null;
  /** @type {Vector3[]} */
  corners;
  /** @type {Vector3[]} */
  seen;
  /** @type {Box3} */
  box;
  /** @type {number[]} */
  position;
  /** @type {number[] | null} */
  target = null;
  /** @type {Group[]} */
  turns = [];

  // `lost(true)` is called if the browser ends the drawing (WebGL context lost), `lost(false)` when it can draw again.
  /** @param {{ section: HTMLElement, canvas: HTMLCanvasElement, labels: HTMLElement, hidden: Iterable<string>, isSoftware: boolean, lost: (isLost: boolean) => void }} options */
  constructor({ section, canvas, labels, hidden, isSoftware, lost }) {
    this.canvas = canvas;
    this.paints = new Paints(section);
    this.labels = new DrawingLabels(labels);
    this.renderer = new WebGLRenderer({ canvas, antialias: !isSoftware });
    this.renderer.setPixelRatio(isSoftware ? 1 : Math.min(devicePixelRatio, 2));
    this.stage = new Scene();
    this.hidden = new Set(hidden); // names of the hidden layers
    this.frames = 0; // number of pictures drawn so far
    this.isWaiting = false;
    /** @type {WebGLSync | null} */
    this.last = null; // signalled when the last picture is complete
    this.patience = 0; // time after which the next picture is drawn anyway [ms]
    this.camera = new DrawingCamera(canvas, () => this.draw());
    const sun = new DirectionalLight("#ffffff", 1.5);
    sun.position.set(0.5, 0.8, 1);
    this.camera.eye.add(sun);
    this.stage.add(this.camera.eye, new HemisphereLight("#ffffff", "#8f9aa5", 2.1));
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.repaint());
    canvas.addEventListener("webglcontextlost", () => {
      this.last = null; // it belongs to the lost context
      lost(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      lost(false);
      this.draw();
    });
    this.resize();
    this.repaint();
  }

  // Draw a robot from the description of its scene and from the binary with the triangles of its meshes.
  /** @type {(document: Api.SceneDocument, binary: ArrayBuffer, position: number[]) => void} */
  open(document, binary, position) {
    this.world?.removeFromParent();
    for (const old of [this.world, this.gravity]) old?.traverse((each) => each instanceof Mesh && each.geometry.dispose());
    this.labels.clear();
    this.document = document;
    this.world = new Group(); // the base frame, turned so that gravity points down on the screen
    this.world.setRotationFromMatrix(matrixOf([...document.upright.map((row) => [...row, 0]), [0, 0, 0, 1]]));
    this.stage.add(this.world);
    const geometries = linkGeometries(document, binary);
    this.arm = new RobotArm(document, geometries, (link) => this.paints.of(link % 2 ? "link-odd" : "link-even"));
    this.ghost = new RobotArm(document, geometries, () => this.paints.of("ghost", 0.45));
    this.world.add(this.arm.base, this.ghost.base);
    this.world.updateWorldMatrix(true, true);
    this.removePath();
    this.layers = Object.fromEntries(LAYERS.map((name) => [name, []]));
    this.size = 0.11 * this.arm.reach();
    this.gravity = null;
    this.wrench = null;
    this.arm.set(position);
    this.addJoints();
    this.addFrames();
    this.addGravity();
    if (document.payload_centre) this.addPayload(vectorOf(document.payload_centre));
    this.world.updateWorldMatrix(true, true);
    this.corners = [...this.cornersOfAll(), ...this.placesOf(this.arm)];
    this.seen = [...this.corners];
    this.box = new Box3().setFromPoints(this.seen);
    this.camera.frame(this.seen, 0.2 * this.size);
    this.show(position, null);
    this.camera.look("3-D");
  }

  addJoints() {
    const { arm, paints } = this;
    /** @type {import("three").Mesh[]} */
    this.needles = [];
    /** @type {Group[]} */
    this.turns = [];
    arm.joints.forEach((joint, i) => {
      const size = this.size * (1 - (0.5 * i) / arm.joints.length); // marks become smaller towards the wrist, whose joints are close together
      const axis = vectorOf(joint.axis);
      const holder = alongAxis(new Group(), axis);
      holder.add(arrow(paints, "axis", 0.03 * size).aim(new Vector3(0, 0, 1), 1.5 * size));
      arm.fixed[i].add(holder);
      this.layers.axes.push(holder);
      this.labels.add(joint.name, holder, new Vector3(0, 0, 1.75 * size), "axes");
      const sense = new Group();
      if (joint.kind === "prismatic") sense.add(arrow(paints, "chosen", 0.07 * size).aim(new Vector3(0, 0, 1), 2.2 * size));
      else sense.add(turnArrow(paints, "chosen", 0.8 * size));
      sense.position.z = 0.9 * size;
      sense.visible = false;
      holder.add(sense);
      this.labels.add("+", sense, new Vector3(0, 0, 0.4 * size), "chosen");
      this.turns.push(sense);
      const next = (arm.fixed[i + 1] ?? arm.tool).position;
      const { dial, pointer, needle } = limitMarks(paints, joint, next, size);
      arm.fixed[i].add(dial);
      arm.links[i + 1].add(pointer);
      this.layers.limits.push(dial, pointer);
      this.needles.push(needle);
    });
  }

  addFrames() {
    const { arm, size, paints, labels } = this;
    if (this.document.plate) this.addWrench(); // first, because its labels precede those of the base frame
    for (const [name, group] of /** @type {[string, Group][]} */ ([["base", arm.base], ["tool", arm.tool]])) {
      const frame = frameArrows(paints, FRAME_SHARE * size, 0.045 * size);
      group.add(frame);
      this.layers.frames.push(frame);
      ["X", "Y", "Z"].forEach((axis, i) => labels.add(`${name} ${axis}`, frame, new Vector3().setComponent(i, 1.5 * size), "frames"));
    }
    const mounting = paints.part(new BoxGeometry(2.2 * size, 2.2 * size, 0.12 * size), "mounting");
    // the mounting plate is on the side of the base away from the robot
    mounting.position.z = (this.measure(arm.base).getCenter(new Vector3()).applyMatrix4(this.world.matrixWorld.clone().invert()).z >= 0 ? -0.07 : 0.07) * size;
    arm.base.add(mounting);
    if (!this.document.plate) return;
    const plate = new Group();
    plate.applyMatrix4(matrixOf(this.document.plate));
    const frame = frameArrows(paints, 1.8 * size, 0.03 * size);
    plate.add(paints.part(new BoxGeometry(5 * size, 4 * size, 0.08 * size), "plate", 0.7), frame);
    arm.base.add(plate);
    this.layers.plate.push(plate);
    labels.add("force plate X", plate, new Vector3(2.1 * size, 0, 0), "plate");
  }

  addWrench() {
    const { arm, size, paints, labels } = this;
    this.wrench = new WrenchArrows({ paints, labels, size });
    arm.base.add(this.wrench.group);
    this.layers.wrench.push(this.wrench.group);
  }

  addGravity() {
    const { size } = this;
    const { gravity } = this.document;
    this.stage.getObjectByName("gravity")?.removeFromParent();
    if (Math.hypot(...gravity) === 0) return;
    this.gravity = arrow(this.paints, "gravity", 0.07 * size).aim(DOWN, 2.4 * size);
    this.gravity.position.set(-2.4 * size, -2.4 * size, this.measure(this.arm.base).min.z + 3.4 * size);
    this.stage.add(Object.assign(this.gravity, { name: "gravity" }));
    this.layers.gravity.push(this.gravity);
    this.labels.add(`gravity ${Math.hypot(...gravity).toFixed(2)} m/s²`, this.gravity, new Vector3(0, 0, 0.35 * size), "gravity");
  }

  // Show the centre of gravity of a payload at a position in the frame of the last link [m].
  /** @type {(place: Vector3) => void} */
  addPayload(place) {
    const { size } = this;
    const ball = this.paints.part(new SphereGeometry(0.25 * size, 20, 14), "load");
    ball.position.copy(place);
    this.arm.links[this.arm.joints.length].add(ball);
    this.layers.payload.push(ball);
    this.labels.add("centre of gravity", ball, new Vector3(0, 0, 0.6 * size), "payload");
  }

  // Show the path of the tool as points in the base frame [m].
  /** @type {(places: number[][]) => void} */
  showPath(places) {
    if (this.removePath()) this.frame(this.corners);
    if (places.length === 0) {
      this.draw();
      return;
    }
    const points = places.map(vectorOf);
    const line = new Line(new BufferGeometry().setFromPoints(points), new LineBasicMaterial({ color: this.paints.colour("path"), depthTest: false, transparent: true }));
    line.material.name = "path";
    this.paints.known.set("path line", line.material);
    line.renderOrder = 1;
    this.layers.path = [line];
    line.visible = !this.hidden.has("path");
    this.world.add(line);
    this.include(points.map((each) => each.clone().applyMatrix4(this.world.matrixWorld)));
    this.draw();
  }

  // Remove the path of the tool; return true if a path was shown.
  removePath() {
    const [line] = /** @type {Line<BufferGeometry, LineBasicMaterial>[]} */ (this.layers?.path ?? []);
    if (line === undefined) return false;
    line.removeFromParent();
    line.geometry.dispose();
    line.material.dispose();
    this.layers.path = [];
    return true;
  }

  // Show a pose, and a second pose as a translucent robot (null: no second pose).
  /** @type {(position: number[], target: number[] | null) => void} */
  show(position, target) {
    const { arm, ghost } = this;
    [this.position, this.target] = [position, target];
    arm.set(position);
    ghost.set(target ?? position);
    const moved = HARDLY_MOVED * arm.reach();
    ghost.meshes.forEach((mesh, link) => {
      mesh.visible = target !== null && mesh.geometry.index !== null && differ(mesh.matrixWorld, arm.meshes[link].matrixWorld, moved);
    });
    arm.joints.forEach(({ limits: [low, high] }, i) => {
      const room = Math.min(position[i] - low, high - position[i]) / (high - low);
      this.needles[i].material = this.paints.of(room < NEAR_LIMIT ? "needle-end" : "needle");
    });
    if (!this.camera.isMoved) this.include(this.placesOf(arm));
    this.draw();
  }

  // Show the measured wrench of the base on the robot; hide its arrows if it is null.
  /** @type {(wrench: LiveWrench | null | undefined) => void} */
  showWrench(wrench) {
    this.wrench?.show(wrench);
    this.draw();
  }

  // Show the positive direction of a joint (null: no joint).
  /** @type {(joint: number | null) => void} */
  choose(joint) {
    this.turns.forEach((sense, i) => {
      sense.visible = i === joint;
    });
    this.draw();
  }

  /** @type {(name: string) => boolean} */
  isLayerUsed(name) {
    return this.layers[name].length > 0;
  }

  /** @type {(name: string, isOn: boolean) => void} */
  setLayer(name, isOn) {
    if (isOn) this.hidden.delete(name);
    else this.hidden.add(name);
    for (const each of this.layers[name]) each.visible = isOn;
    this.draw();
  }

  // Return the bounding box of a group and all its children, in the upright frame.
  /** @type {(group: import("three").Object3D) => Box3} */
  measure(group) {
    group.updateWorldMatrix(true, true);
    return new Box3().setFromObject(group);
  }

  // Return the positions of an arm's joints and of its tool, and the tips of the tool's arrows, in the upright frame.
  /** @type {(arm: RobotArm) => Vector3[]} */
  placesOf(arm) {
    const far = FRAME_SHARE * this.size;
    const tips = [[far, 0, 0], [0, far, 0], [0, 0, far]].map((tip) => new Vector3(...tip).applyMatrix4(arm.tool.matrixWorld));
    return [...[...arm.links, arm.tool].map((each) => new Vector3().setFromMatrixPosition(each.matrixWorld)), ...tips];
  }

  // Keep these points inside the picture too, in addition to earlier points.
  /** @type {(places: Vector3[]) => void} */
  include(places) {
    if (this.box.containsBox(new Box3().setFromPoints(places))) return;
    this.frame([...this.seen, ...places]);
  }

  // Move the camera so that these points are inside the picture.
  /** @type {(places: Vector3[]) => void} */
  frame(places) {
    this.seen = places;
    this.box = new Box3().setFromPoints(places);
    this.camera.frame(places, 0.5 * this.size);
  }

  // Return the corners of the bounding boxes of the links and of the gravity arrow, in the upright frame.
  cornersOfAll() {
    const corners = [];
    const all = [...this.arm.meshes, ...(this.gravity?.children ?? [])];
    for (const mesh of all) {
      if (!(mesh instanceof Mesh) || !mesh.visible) continue;
      mesh.updateWorldMatrix(true, false);
      mesh.geometry.computeBoundingBox();
      const { min, max } = /** @type {Box3} */ (mesh.geometry.boundingBox);
      for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z])
        corners.push(new Vector3(x, y, z).applyMatrix4(mesh.matrixWorld));
    }
    const around = this.wrench ? this.wrench.length : 0; // space for the arrows in any horizontal direction
    for (const [x, y] of [[-around, 0], [around, 0], [0, -around], [0, around]]) corners.push(new Vector3(x, y, 0).applyMatrix4(this.arm.base.matrixWorld));
    return corners;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.resize(width, height);
  }

  repaint() {
    this.paints.renew();
    this.renderer.setClearColor(new Color(this.paints.colour("ground")));
    this.draw();
  }

  // Redraw with the next frame of the screen; several calls before it cause only one redraw.
  draw() {
    if (this.isWaiting || !this.renderer) return;
    this.isWaiting = true;
    requestAnimationFrame(() => this.drawNext());
  }

  // Draw once the previous picture is complete: otherwise pictures queue on a slow computer and are shown much too late.
  drawNext() {
    const gl = /** @type {WebGL2RenderingContext} */ (this.renderer.getContext());
    const { last, canvas } = this;
    if (last && gl.getSyncParameter(last, gl.SYNC_STATUS) === gl.UNSIGNALED && performance.now() < this.patience) {
      requestAnimationFrame(() => this.drawNext());
      return;
    }
    this.isWaiting = false;
    if (!this.world || gl.isContextLost()) return;
    this.renderer.render(this.stage, this.camera.eye);
    this.frames += 1;
    gl.deleteSync(last);
    this.last = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.patience = performance.now() + PATIENCE_MS;
    this.labels.arrange(this.camera.eye, canvas.clientWidth, canvas.clientHeight, (layer) => !this.hidden.has(layer));
  }
}

// Return true if the two transforms move any point of a link to places further apart than `limit`.
/** @type {(one: import("three").Matrix4, other: import("three").Matrix4, limit: number) => boolean} */
function differ(one, other, limit) {
  return one.elements.some((value, i) => Math.abs(value - other.elements[i]) > limit);
}
