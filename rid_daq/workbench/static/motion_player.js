// Playback of a planned motion in the 3-D view: play button, time slider, strip of the clearance.
import { element } from "./dom.js";

const STRIP_PX = 40; // height of the strip's drawing
const WIDE = 3; // clearances up to this multiple of the margin are marked
const LEAST_MARGIN = 0.01; // for the scale of the strip [m]
const PATH_POINTS = 200;

export class MotionPlayer {
  // Add the controls of the playback below the picture of a view.
  constructor(view) {
    this.view = view;
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
    this.controls = element("div", { class: "player", hidden: true }, this.button, this.slider, this.clock, this.strip);
    view.picture.after(this.controls, this.nearest);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.drawStrip());
  }

  // Show a motion of the service (null: none).
  open(motion) {
    this.pause();
    this.motion = motion;
    this.controls.hidden = motion === null;
    this.nearest.textContent = "";
    this.nearest.classList.remove("problem");
    this.view.showPath(motion === null ? [] : thinned(motion.position));
    if (motion === null) return;
    this.slider.max = String(motion.times_s.at(-1));
    this.strip.hidden = motion.clearance_m === null;
    this.drawStrip();
    this.seek(0);
  }

  // Say why there is no motion.
  refuse(text) {
    this.nearest.textContent = text;
    this.nearest.classList.add("problem");
  }

  play() {
    if (!this.motion) return;
    const end = this.motion.times_s.at(-1);
    let before = performance.now();
    this.isPlaying = true;
    this.button.textContent = "Pause";
    if (this.time >= end) this.time = 0;
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
  seek(time) {
    const { times_s: times, position, phases, periods } = this.motion;
    const end = times.at(-1);
    this.time = time;
    const next = Math.max(1, times.findIndex((each) => each >= time));
    const share = Math.min(1, Math.max(0, (time - times[next - 1]) / (times[next] - times[next - 1])));
    const pose = position[next].map((value, i) => (1 - share) * position[next - 1][i] + share * value);
    const row = share < 0.5 ? next - 1 : next;
    if (Number(this.slider.value) !== time) this.slider.value = String(time);
    this.clock.textContent = `${time.toFixed(1)} of ${end.toFixed(1)} s${periods > 1 ? `, with 1 of ${periods} periods` : ""}`;
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s, ${phases[row]}`);
    this.view.show({ position: pose, words: `PLANNED MOTION, NO LIVE DATA: ${phases[row]}.`, kind: "planned" });
    this.describe(row);
  }

  // Show the clearance in a pose, and the smallest one of the motion.
  describe(row) {
    const { clearance_m: clearance, pairs, times_s: times, margin_m: margin } = this.motion;
    if (clearance === null) {
      this.nearest.textContent = "Clearance: unknown, because the robot file has no bodies.";
      return;
    }
    const least = smallest(clearance);
    const of = (i) => `${(1000 * clearance[i]).toFixed(0)} mm between ${pairs[i]}`;
    const verdict = clearance[least] < margin ? ` This is less than the allowed ${(1000 * margin).toFixed(0)} mm.` : "";
    this.nearest.textContent = `Clearance now: ${of(row)}. Smallest of the poses shown: ${of(least)}, at ${times[least].toFixed(1)} s.${verdict}`;
    this.nearest.classList.toggle("problem", clearance[least] < margin);
  }

  // Draw the clearance over the time; the line is the allowed distance.
  drawStrip() {
    const { clearance_m: clearance, margin_m: margin } = this.motion ?? { clearance_m: null };
    if (clearance === null || clearance === undefined) return;
    const pen = this.strip.getContext("2d");
    if (pen === null) return;
    const style = getComputedStyle(this.strip);
    const colour = (value) => style.getPropertyValue(value < margin ? "--bad" : value < WIDE * margin ? "--wait" : "--good");
    const most = 2 * WIDE * Math.max(margin, LEAST_MARGIN); // larger clearances have the full height
    const height = (value) => (STRIP_PX * Math.min(most, Math.max(0.02 * most, value))) / most;
    this.strip.width = clearance.length;
    clearance.forEach((value, i) => {
      pen.fillStyle = colour(value);
      pen.fillRect(i, STRIP_PX - height(value), 1, height(value));
    });
    pen.fillStyle = style.getPropertyValue("--ink");
    pen.fillRect(0, STRIP_PX - height(margin), clearance.length, 1);
    const least = smallest(clearance);
    this.strip.setAttribute("aria-label", `clearance over time: at least ${(1000 * clearance[least]).toFixed(0)} mm`);
  }
}

const smallest = (values) => values.reduce((best, value, i) => (value < values[best] ? i : best), 0);

function thinned(rows) {
  const step = Math.max(1, Math.ceil(rows.length / PATH_POINTS));
  return rows.filter((_, i) => i % step === 0 || i === rows.length - 1);
}
