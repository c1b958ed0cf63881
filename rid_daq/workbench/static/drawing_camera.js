// Camera of the 3-D view. It turns about a target point and keeps the z axis upright. Keys, mouse and touch move the
// camera.
import { PerspectiveCamera, Vector3 } from "./three.js";

/** @type {Record<string, [number, number]>} */
export const VIEWS = { "3-D": [-0.86, 0.42], Front: [0, 0.05], Side: [-Math.PI / 2, 0.05], Top: [-Math.PI / 2, 1.5533] };
const FIELD_DEG = 28;
const INSIDE = 0.94; // of the picture
const MOST_ELEVATION = 1.5533; // 89 degrees
const STEP = Math.PI / 24;
const ZOOM = 1.2;
/** @type {Record<string, (camera: DrawingCamera) => void>} */
const KEYS = {
  ArrowLeft: (camera) => camera.turn(-STEP, 0),
  ArrowRight: (camera) => camera.turn(STEP, 0),
  ArrowUp: (camera) => camera.turn(0, STEP),
  ArrowDown: (camera) => camera.turn(0, -STEP),
  "+": (camera) => camera.zoom(1 / ZOOM),
  "-": (camera) => camera.zoom(ZOOM),
  Home: (camera) => camera.look("3-D"),
};

export class DrawingCamera {
  azimuth = 0;
  elevation = 0;
  points = [new Vector3()]; // what is visible
  margin = 1;

  // `changed()` is called after every movement of the camera.
  /** @param {HTMLCanvasElement} canvas @param {() => void} changed */
  constructor(canvas, changed) {
    this.eye = new PerspectiveCamera(FIELD_DEG, 1, 0.02, 100);
    this.eye.up.set(0, 0, 1);
    this.target = new Vector3();
    [this.azimuth, this.elevation] = VIEWS["3-D"];
    this.distance = 5; // distance from which the visible points fill the picture
    this.share = 1; // of this distance
    this.isMoved = false; // true once the user has zoomed
    this.changed = changed;
    this.listen(canvas);
  }

  // Move the camera so that all points, and everything within `margin` around them, are visible.
  /** @type {(points: Vector3[], margin: number) => void} */
  frame(points, margin) {
    [this.points, this.margin] = [points, margin];
    this.fit();
    this.update();
  }

  // Find the target and the distance from which all points are inside the picture.
  fit() {
    const back = this.direction();
    const right = new Vector3(-Math.sin(this.azimuth), Math.cos(this.azimuth), 0);
    const up = back.clone().cross(right);
    /** @type {(axis: Vector3) => number[]} */
    const along = (axis) => this.points.map((point) => point.dot(axis));
    /** @type {(values: number[]) => number} */
    const middle = (values) => (Math.min(...values) + Math.max(...values)) / 2;
    const [x, y, z] = [right, up, back].map(along);
    const [midX, midY, midZ] = [x, y, z].map(middle);
    this.target.set(0, 0, 0).addScaledVector(right, midX).addScaledVector(up, midY).addScaledVector(back, midZ);
    const high = INSIDE * Math.tan((FIELD_DEG * Math.PI) / 360);
    this.distance = Math.max(...this.points.map((_, i) => {
      const aside = Math.max((Math.abs(x[i] - midX) + this.margin) / this.eye.aspect, Math.abs(y[i] - midY) + this.margin);
      return aside / high + (z[i] - midZ);
    }));
  }

  // Direction from the target to the eye.
  direction() {
    const flat = Math.cos(this.elevation);
    return new Vector3(flat * Math.cos(this.azimuth), flat * Math.sin(this.azimuth), Math.sin(this.elevation));
  }

  /** @type {(name: string) => void} */
  look(name) {
    [this.azimuth, this.elevation] = VIEWS[name];
    [this.share, this.isMoved] = [1, false];
    this.fit();
    this.update();
  }

  /** @type {(left: number, up: number) => void} */
  turn(left, up) {
    this.azimuth += left;
    this.elevation = Math.min(MOST_ELEVATION, Math.max(-MOST_ELEVATION, this.elevation + up));
    this.update();
  }

  /** @type {(factor: number) => void} */
  zoom(factor) {
    this.share = Math.min(3, Math.max(0.15, this.share * factor));
    this.isMoved = true;
    this.update();
  }

  /** @type {(width: number, height: number) => void} */
  resize(width, height) {
    this.eye.aspect = width / height;
    this.fit();
    this.update();
  }

  update() {
    const distance = this.share * this.distance;
    this.eye.position.copy(this.target).addScaledVector(this.direction(), distance);
    [this.eye.near, this.eye.far] = [distance / 100, 20 * distance];
    this.eye.lookAt(this.target);
    this.eye.updateProjectionMatrix();
    this.eye.updateMatrixWorld(true);
    this.changed();
  }

  /** @type {(canvas: HTMLCanvasElement) => void} */
  listen(canvas) {
    /** @type {Map<number, { x: number, y: number }>} */
    const fingers = new Map();
    const spread = () => {
      const [one, other] = [...fingers.values()];
      return Math.hypot(one.x - other.x, one.y - other.y);
    };
    /** @type {(event: PointerEvent) => void} */
    const release = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    for (const type of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) canvas.addEventListener(type, release);
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const wide = fingers.size === 2 ? spread() : null;
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      const scale = Math.PI / canvas.clientHeight;
      if (wide) this.zoom(wide / Math.max(1, spread()));
      else if (fingers.size === 1) this.turn(-scale * (event.clientX - before.x), scale * (event.clientY - before.y));
    });
    // the wheel scrolls the page, unless the picture has the focus or the gesture is a pinch on a touch pad
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? ZOOM : 1 / ZOOM);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const action = KEYS[event.key === "=" ? "+" : event.key];
      if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      action(this);
    });
  }
}
