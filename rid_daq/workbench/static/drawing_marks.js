// Marks of the 3-D view: arrows, frames, joint limits. Marks of the kinds in ON_TOP are drawn in front of the links, so
// that a link does not hide them.
import {
  BoxGeometry, Color, ConeGeometry, CylinderGeometry, DoubleSide, FrontSide, Group, Matrix4, Mesh, MeshLambertMaterial,
  RingGeometry, TorusGeometry, Vector3,
} from "./three.js";
import { threeDigits } from "./dom.js";
import { vectorOf } from "./robot_arm.js";

const ON_TOP = ["axis", "chosen", "load", "x", "y", "z", "needle", "needle-end", "path", "force", "moment"];
const Y = new Vector3(0, 1, 0);
const Z = new Vector3(0, 0, 1);
const FULL_TURN = 2 * Math.PI;
/** @typedef {Group & { aim(direction: Vector3, length: number): Arrow }} Arrow */
const SLIDE_WIDTH = 0.12;

// Materials by the name of their colour: the colour NAME is the property `--view-NAME` of the style sheet.
export class Paints {
  /** @param {HTMLElement} section */
  constructor(section) {
    this.section = section;
    /** @type {Map<string, MeshLambertMaterial | import("three").LineBasicMaterial>} */
    this.known = new Map();
  }

  /** @type {(name: string) => string} */
  colour(name) {
    return getComputedStyle(this.section).getPropertyValue(`--view-${name}`).trim();
  }

  /** @type {(name: string, opacity?: number) => MeshLambertMaterial} */
  of(name, opacity = 1) {
    const key = `${name} ${opacity}`;
    if (!this.known.has(key)) {
      const above = ON_TOP.includes(name);
      const material = new MeshLambertMaterial({
        color: this.colour(name),
        emissive: above ? this.colour(name) : "#000000",
        emissiveIntensity: 0.55,
        opacity,
        transparent: opacity < 1 || above,
        depthTest: !above,
        side: name === "limit" ? DoubleSide : FrontSide,
        polygonOffset: name === "ghost",
        polygonOffsetFactor: 2,
        polygonOffsetUnits: 8,
      });
      this.known.set(key, Object.assign(material, { name }));
    }
    return /** @type {MeshLambertMaterial} */ (this.known.get(key));
  }

  // Read all colours again after the user has changed the theme.
  renew() {
    for (const material of this.known.values()) {
      const colour = new Color(this.colour(material.name));
      material.color.copy(colour);
      if (!material.depthTest && "emissive" in material) material.emissive.copy(colour); // the material of a line has no emissive colour
    }
  }

  /** @type {(geometry: import("three").BufferGeometry, name: string, opacity?: number) => Mesh} */
  part(geometry, name, opacity = 1) {
    const made = new Mesh(geometry, this.of(name, opacity));
    if (ON_TOP.includes(name)) made.renderOrder = 1;
    return made;
  }
}

// An arrow from the origin of its group. `aim(direction, length)` sets its direction and length.
/** @type {(paints: Paints, name: string, radius: number) => Arrow} */
export function arrow(paints, name, radius) {
  const shaft = paints.part(new CylinderGeometry(radius, radius, 1, 10), name);
  const head = paints.part(new ConeGeometry(2.6 * radius, 7 * radius, 14), name);
  const group = /** @type {Arrow} */ (new Group().add(shaft, head));
  /** @type {(direction: Vector3, length: number) => Arrow} */
  group.aim = (direction, length) => {
    group.quaternion.setFromUnitVectors(Y, direction.clone().normalize());
    shaft.scale.y = Math.max(length - 7 * radius, 1e-4);
    shaft.position.y = shaft.scale.y / 2;
    head.position.y = Math.max(length - 3.5 * radius, 3.5 * radius);
    return group;
  };
  return group;
}

// A curved arrow around the z axis in the positive direction of rotation.
/** @type {(paints: Paints, name: string, radius: number) => Group} */
export function turnArrow(paints, name, radius) {
  const end = 0.75 * FULL_TURN;
  const head = paints.part(new ConeGeometry(0.22 * radius, 0.5 * radius, 14), name);
  head.position.set(radius * Math.cos(end), radius * Math.sin(end), 0);
  head.rotation.z = end;
  return new Group().add(paints.part(new TorusGeometry(radius, 0.07 * radius, 8, 36, end), name), head);
}

// An arrow for a moment: along its axis, with a curved arrow in its direction of rotation.
/** @type {(paints: Paints, name: string, radius: number) => Arrow} */
export function momentArrow(paints, name, radius) {
  const group = arrow(paints, name, radius);
  const ring = turnArrow(paints, name, 9 * radius);
  ring.rotation.x = -Math.PI / 2; // the axis of the ring is z, but the arrow points along y
  ring.position.y = 12 * radius;
  return group.add(ring);
}

// Draw a frame as three arrows along x, y and z.
/** @type {(paints: Paints, length: number, radius: number) => Group} */
export function frameArrows(paints, length, radius) {
  const axes = ["x", "y", "z"].map((name, i) => arrow(paints, name, radius).aim(new Vector3().setComponent(i, 1), length));
  return new Group().add(...axes);
}

// Draw the limits of a joint: a sector (a bar for a prismatic joint) in the fixed frame, and a needle in the frame of
// the moving link. `outward` is a direction in the frame of the joint; the needle points in this direction.
/** @type {(paints: Paints, joint: Api.JointDocument, outward: Vector3, size: number) => { dial: Group, pointer: Group, needle: Mesh }} */
export function limitMarks(paints, joint, outward, size) {
  const axis = vectorOf(joint.axis);
  const [low, high] = joint.limits;
  const needle = paints.part(new BoxGeometry(0.42 * size, 0.06 * size, 0.06 * size), "needle");
  const dial = new Group();
  const pointer = new Group().add(needle);
  const out = perpendicular(outward, axis, size);
  const frame = new Matrix4().makeBasis(out, axis.clone().cross(out), axis);
  dial.setRotationFromMatrix(frame);
  pointer.setRotationFromMatrix(frame);
  if (joint.kind === "prismatic") {
    const bar = paints.part(new BoxGeometry(SLIDE_WIDTH * size, SLIDE_WIDTH * size, high - low), "limit", 0.55);
    bar.position.set(size, 0, (high + low) / 2);
    dial.add(bar);
  } else {
    const sector = Math.min(high - low, FULL_TURN);
    dial.add(paints.part(new RingGeometry(0.95 * size, 1.1 * size, 56, 1, low, sector), "limit", 0.6));
  }
  needle.position.x = 1.02 * size;
  return { dial, pointer, needle };
}

// Turn a group so that its z axis points in the direction `axis`.
/** @type {(group: Group, axis: Vector3) => Group} */
export const alongAxis = (group, axis) => {
  group.quaternion.setFromUnitVectors(Z, axis.clone().normalize());
  return group;
};

// Return the unit vector along the part of `vector` that is perpendicular to `axis`. If this part is small, return any
// unit vector perpendicular to `axis`.
/** @type {(vector: Vector3, axis: Vector3, size: number) => Vector3} */
function perpendicular(vector, axis, size) {
  /** @type {(of: Vector3) => Vector3} */
  const across = (of) => of.clone().addScaledVector(axis, -of.dot(axis));
  let found = across(vector);
  if (found.length() < 0.05 * size) found = across(new Vector3(axis.y, axis.z, axis.x));
  if (found.length() < 1e-3) found = across(new Vector3(1, 0, 0));
  return found.normalize();
}

// ---- wrench of the base on the robot, as a force plate measures it
const FULL_LENGTH = 4; // length of an arrow at full scale (see `show`), as a multiple of `size`
const LEAST_SHARE = 0.02; // fraction of FULL_LENGTH; shorter arrows are not drawn
/** @type {[string, "force_n" | "moment_nm", string, typeof arrow][]} */
const KINDS = [["force", "force_n", "N", arrow], ["moment", "moment_nm", "N m", momentArrow]];

export class WrenchArrows {
  /** @param {{ paints: Paints, labels: import("./drawing_labels.js").DrawingLabels, size: number }} drawing */
  constructor({ paints, labels, size }) {
    this.labels = labels;
    this.length = FULL_LENGTH * size;
    this.group = new Group(); // in the base frame
    this.parts = KINDS.map(([name, key, unit, draw]) => {
      const mark = draw(paints, name, 0.08 * size);
      const tip = new Group();
      this.group.add(mark, tip);
      const label = labels.add(name, tip, new Vector3(), "wrench");
      return { name, key, unit, mark, tip, label, most: 0 };
    });
    this.show(null);
  }

  // Show force [N] and moment [N m] in the base frame. An arrow at full length shows the largest value so far, rounded
  // up to 1, 2 or 5 times a power of ten.
  /** @type {(wrench: LiveWrench | null | undefined) => void} */
  show(wrench) {
    for (const part of this.parts) {
      const vector = wrench ? vectorOf(wrench[part.key]) : new Vector3();
      const value = vector.length();
      if (value > part.most) part.most = roundUp(value);
      const share = part.most > 0 ? value / part.most : 0;
      part.mark.visible = part.tip.visible = share >= LEAST_SHARE;
      if (!part.mark.visible) continue;
      const length = share * this.length;
      part.mark.aim(vector, length);
      part.tip.position.copy(vector.setLength(length + 0.15 * this.length));
      this.labels.rename(part.label, `${part.name} ${threeDigits(value)} ${part.unit}`);
    }
  }
}

/** @type {(value: number) => number} */
function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= value) ?? value;
}
