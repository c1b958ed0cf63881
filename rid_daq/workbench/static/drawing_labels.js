// Labels of the 3-D view: texts in front of the picture. A label that would cover an earlier label is moved or hidden.
import { Object3D, Vector3 } from "./three.js";
import { element } from "./dom.js";

const CHARACTER_PX = 7.2;
/** @typedef {{ span: HTMLElement, anchor: Object3D, layer: string, text: string }} DrawingLabel */
const PADDING_PX = 8;
const HEIGHT_PX = 18;
const SHIFTS_PX = [[0, 0], [0, -HEIGHT_PX], [0, HEIGHT_PX], [1, 0], [-1, 0]];

export class DrawingLabels {
  /** @param {HTMLElement} place */
  constructor(place) {
    this.place = place;
    /** @type {DrawingLabel[]} */
    this.labels = [];
  }

  // Add a label at the position `at` in the frame of a three.js group. The label is hidden while the layer `layer` of
  // the drawing is hidden.
  /** @type {(text: string, group: Object3D, at: Vector3, layer: string) => DrawingLabel} */
  add(text, group, at, layer) {
    const anchor = new Object3D();
    anchor.position.copy(at);
    group.add(anchor);
    const span = element("span", {}, text);
    this.place.append(span);
    const made = { span, anchor, layer, text };
    this.labels.push(made);
    return made;
  }

  /** @type {(label: DrawingLabel, text: string) => void} */
  rename(label, text) {
    label.text = text;
    label.span.textContent = text;
  }

  clear() {
    for (const { anchor } of this.labels) anchor.removeFromParent();
    this.labels = [];
    this.place.replaceChildren();
  }

  // Move each label to its place in the picture. `isShown(layer)` returns true if a layer is visible.
  /** @type {(eye: import("three").Camera, width: number, height: number, isShown: (layer: string) => boolean) => void} */
  arrange(eye, width, height, isShown) {
    /** @type {Box[]} */
    const taken = [];
    for (const { span, anchor, layer, text } of this.labels) {
      const at = new Vector3().setFromMatrixPosition(anchor.matrixWorld).project(eye);
      const wide = CHARACTER_PX * text.length + PADDING_PX;
      /** @type {(shift: number[]) => Box} */
      const box = (shift) => {
        const x = ((at.x + 1) / 2) * width + (shift[0] * wide) / 2;
        const y = ((1 - at.y) / 2) * height + shift[1];
        return { left: x - wide / 2, right: x + wide / 2, top: y - HEIGHT_PX / 2, bottom: y + HEIGHT_PX / 2 };
      };
      /** @type {(one: Box) => boolean} */
      const isFree = (one) => one.left >= 0 && one.right <= width && one.top >= 0 && one.bottom <= height && !taken.some((other) => overlap(one, other));
      const found = isShown(layer) && shown(anchor) && at.z < 1 ? SHIFTS_PX.map(box).find(isFree) : undefined;
      span.hidden = found === undefined;
      if (!found) continue;
      taken.push(found);
      span.style.transform = `translate(${found.left.toFixed(1)}px, ${found.top.toFixed(1)}px)`;
    }
  }
}

/** @type {(one: Box, other: Box) => boolean} */
const overlap = (one, other) => one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;

/** @type {(object: Object3D) => boolean} */
function shown(object) {
  for (let each = /** @type {Object3D | null} */ (object); each; each = each.parent) if (!each.visible) return false;
  return true;
}
