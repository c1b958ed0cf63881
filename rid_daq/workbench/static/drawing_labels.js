// Labels of the 3-D view: texts in front of the picture. A label that would cover an earlier label is moved or hidden.
import { Object3D, Vector3 } from "./three.js";
import { element } from "./dom.js";

const CHARACTER_PX = 7.2;
const PADDING_PX = 8;
const HEIGHT_PX = 18;
const SHIFTS_PX = [[0, 0], [0, -HEIGHT_PX], [0, HEIGHT_PX], [1, 0], [-1, 0]];

export class DrawingLabels {
  constructor(place) {
    this.place = place;
    this.labels = [];
  }

  // Add a label at the position `at` in the frame of a three.js group. The label is hidden while the layer `layer` of
  // the drawing is hidden.
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
  arrange(eye, width, height, isShown) {
    const taken = [];
    for (const { span, anchor, layer, text } of this.labels) {
      const at = new Vector3().setFromMatrixPosition(anchor.matrixWorld).project(eye);
      const wide = CHARACTER_PX * text.length + PADDING_PX;
      const box = (shift) => {
        const x = ((at.x + 1) / 2) * width + (shift[0] * wide) / 2;
        const y = ((1 - at.y) / 2) * height + shift[1];
        return { left: x - wide / 2, right: x + wide / 2, top: y - HEIGHT_PX / 2, bottom: y + HEIGHT_PX / 2 };
      };
      const isFree = (one) => one.left >= 0 && one.right <= width && one.top >= 0 && one.bottom <= height && !taken.some((other) => overlap(one, other));
      const found = isShown(layer) && shown(anchor) && at.z < 1 ? SHIFTS_PX.map(box).find(isFree) : undefined;
      span.hidden = found === undefined;
      if (!found) continue;
      taken.push(found);
      span.style.transform = `translate(${found.left.toFixed(1)}px, ${found.top.toFixed(1)}px)`;
    }
  }
}

const overlap = (one, other) => one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;

function shown(object) {
  for (let each = object; each; each = each.parent) if (!each.visible) return false;
  return true;
}
