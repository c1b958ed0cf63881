// Arrows of the wrench that the base exerts on the robot, as a force plate measures it.
import { Group, Vector3 } from "./three.js";
import { threeDigits } from "./dom.js";
import { arrow, momentArrow } from "./drawing_marks.js";
import { vectorOf } from "./robot_arm.js";

const FULL_LENGTH = 4; // length of an arrow with the full value, as a multiple of `size`
const LEAST_SHARE = 0.02; // fraction of FULL_LENGTH; shorter arrows are not drawn
const KINDS = [["force", "force_n", "N", arrow], ["moment", "moment_nm", "N m", momentArrow]];

export class WrenchArrows {
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

function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((factor) => factor * power).find((each) => each >= value);
}
