// Playback of a planned motion in the 3-D view: play button, time slider, and a chart of the clearance over time.
import { element, timeOf } from "./dom.js";

const STRIP_PX = 40; // height of the clearance chart
const FINENESS = 4; // pixels per interval; with fewer, bars of unequal width would leave gaps
const WIDE = 3; // clearances below this multiple of the allowed distance are coloured as a warning
const LEAST_MARGIN = 0.01; // a smaller allowed distance is replaced by this one in the chart's scale [m]
const DEGREES = 180 / Math.PI;

export class MotionPlayer {
  // Add the controls of the playback below the picture of a view.
  /** @param {import("./robot_view.js").RobotView} view */
  constructor(view) {
    this.view = view;
    /** @type {MotionPlayback | null} */
    this.motion = null;
    this.time = 0;
    this.isPlaying = false;
    this.button = element("button", { type: "button", onclick: () => (this.isPlaying ? this.pause() : this.play()) }, "Play");
    this.slider = element("input", { type: "range", min: "0", max: "1", step: "any", value: "0", "aria-label": "time of the planned motion" });
    this.slider.addEventListener("input", () => {
      this.pause();
      this.seek(Number(this.slider.value));
    });
    this.clock = element("output", { class: "number" });
    this.strip = element("canvas", { role: "img", height: String(STRIP_PX) });
    this.nearest = element("p", { class: "clearance" });
    this.accuracy = element("p", { class: "problem" });
    this.start = element("p", { class: "soft" });
    this.controls = element("div", { class: "player", hidden: true }, this.button, this.slider, this.clock, this.strip, this.start, this.accuracy);
    view.picture.after(this.controls, this.nearest);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.drawStrip());
  }

  // Show a motion that the service has sent (null: no motion).
  /** @type {(motion: MotionPlayback | null) => void} */
  open(motion) {
    this.pause();
    this.motion = motion;
    this.controls.hidden = motion === null;
    this.nearest.textContent = "";
    this.nearest.classList.remove("problem");
    this.view.showPath(motion?.path_m ?? []);
    if (motion === null) return;
    [this.slider.min, this.slider.max] = [motion.times_s[0], motion.times_s.at(-1)].map(String);
    this.strip.hidden = motion.clearance === null;
    this.accuracy.textContent = motion.is_accurate ? "" : accuracyOf(motion);
    this.start.textContent = startOf(motion.approach);
    this.drawStrip();
    this.seek(motion.times_s[0]);
  }

  // Show the reason why there is no motion.
  /** @type {(text: string) => void} */
  refuse(text) {
    this.nearest.textContent = text;
    this.nearest.classList.add("problem");
  }

  play() {
    if (!this.motion) return;
    const { times_s: times } = this.motion;
    const end = lastOf(times);
    let before = performance.now();
    this.isPlaying = true;
    this.button.textContent = "Pause";
    if (this.time >= end) this.time = times[0];
    const step = () => {
      if (!this.isPlaying) return;
      const at = performance.now();
      const time = Math.min(end, this.time + (at - before) / 1000);
      before = at;
      this.seek(time);
      if (time < end) requestAnimationFrame(step);
      else this.pause();
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.isPlaying = false;
    this.button.textContent = "Play";
  }

  // Show the pose at a time of the motion [s].
  /** @type {(time: number) => void} */
  seek(time) {
    if (!this.motion) return;
    const { times_s: times, position, phases, periods } = this.motion;
    const end = lastOf(times);
    this.time = time;
    const before = intervalOf(times, time);
    const share = Math.min(1, Math.max(0, (time - times[before]) / (times[before + 1] - times[before])));
    const pose = position[before + 1].map((value, i) => (1 - share) * position[before][i] + share * value);
    const phase = phases.findLast(({ start_s }) => start_s <= time) ?? phases[0];
    if (Number(this.slider.value) !== time) this.slider.value = String(time);
    this.clock.textContent = `${time.toFixed(1)} of ${end.toFixed(1)} s${periods > 1 ? `; 1 of ${periods} periods is shown` : ""}`;
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s, ${phase.name}`);
    this.view.show({ position: pose, words: `PLANNED MOTION, NO LIVE DATA: ${phase.name}.`, kind: "planned" });
    this.describe();
  }

  // Show the clearance at the selected time, and the smallest clearance of the motion.
  describe() {
    const clearance = this.motion?.clearance;
    if (!clearance) {
      this.nearest.textContent = "Clearance: not computed, because the robot file has no bodies, or no distance is required between them.";
      return;
    }
    const { times_s: times, distance_m: distances, pairs, least_at_s: at, margin_m: margin } = clearance;
    const least = smallest(distances);
    /** @type {(i: number) => string} */
    const of = (i) => `${(1000 * distances[i]).toFixed(0)} mm between ${pairs[i]}`;
    const verdict = distances[least] < margin ? ` The smallest clearance is less than the allowed ${(1000 * margin).toFixed(0)} mm.` : "";
    this.nearest.textContent = `Clearance now: ${of(intervalOf(times, this.time))}. Smallest of the motion: ${of(least)}, at ${at.toFixed(1)} s.${verdict}`;
    this.nearest.classList.toggle("problem", distances[least] < margin);
  }

  // Draw the clearance over the time, with a line at the allowed distance.
  drawStrip() {
    const clearance = this.motion?.clearance;
    const pen = this.strip.getContext("2d");
    if (!clearance || pen === null) return;
    const { times_s: times, distance_m: distances, margin_m: margin } = clearance;
    const style = getComputedStyle(this.strip);
    /** @type {(value: number) => string} */
    const colour = (value) => style.getPropertyValue(value < margin ? "--bad" : value < WIDE * margin ? "--wait" : "--good");
    const most = 2 * WIDE * Math.max(margin, LEAST_MARGIN); // larger clearances are drawn with the full height
    /** @type {(value: number) => number} */
    const height = (value) => (STRIP_PX * Math.min(most, Math.max(0.02 * most, value))) / most;
    this.strip.width = FINENESS * distances.length;
    /** @type {(time: number) => number} */
    const place = (time) => Math.round((this.strip.width * (time - times[0])) / (lastOf(times) - times[0]));
    distances.forEach((value, i) => {
      pen.fillStyle = colour(value);
      pen.fillRect(place(times[i]), STRIP_PX - height(value), place(times[i + 1]) - place(times[i]), height(value));
    });
    pen.fillStyle = style.getPropertyValue("--ink");
    pen.fillRect(0, STRIP_PX - height(margin), this.strip.width, 1);
    this.strip.setAttribute("aria-label", `clearance over time: at least ${(1000 * Math.min(...distances)).toFixed(0)} mm`);
  }
}

/** @type {(times: number[]) => number} */
const lastOf = (times) => times[times.length - 1];

/** @type {(values: number[]) => number} */
const smallest = (values) => values.reduce((best, value, i) => (value < values[best] ? i : best), 0);

// Return the index of the interval in `times` that contains `time`.
/** @type {(times: number[], time: number) => number} */
function intervalOf(times, time) {
  const next = times.findIndex((each) => each > time);
  return next < 0 ? times.length - 2 : Math.max(0, next - 1);
}

/** @type {(approach: MotionPlayback["approach"]) => string} */
const startOf = ({ source, at_s: at, problem }) =>
  problem ? `The approach is not shown: ${problem}.` : `Times below 0 are the approach, from the pose of ${source}, ${timeOf(at ?? NaN)}.`;

/** @type {(motion: MotionPlayback) => string} */
function accuracyOf({ deviation_rad: angle, deviation_m: length }) {
  const parts = [angle > 0 && `${(DEGREES * angle).toFixed(1)}°`, length > 0 && `${(1000 * length).toFixed(1)} mm`];
  return `The motion is too long to be drawn exactly: joints are up to ${parts.filter(Boolean).join(" or ")} away from the shown poses.`;
}
