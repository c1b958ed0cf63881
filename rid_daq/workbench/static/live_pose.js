// Pose of the cell's robot in the 3-D view: live while a job reads the drives, otherwise the newest known pose.
import { timeOf } from "./dom.js";
import { request } from "./requests.js";
import { CELL, OLD_MS, on, reach } from "./service.js";

const OLD_S = 0.5; // live values that are older than this at the service count as old
const WATCH_MS = 500;
const PATIENCE_MS = 10000;

// Return the base wrench of a live sample; null without a force plate, or if its values are old.
/** @type {(picture: LivePicture) => LiveWrench | null} */
function freshWrench({ base_wrench: wrench }) {
  return wrench && wrench.age_s !== null && wrench.age_s <= OLD_S ? wrench : null;
}

// Show the pose of the cell's robot in a view, now and after every change.
/** @type {(view: { show(pose: ShownPose): void }) => void} */
export function followPose(view) {
  /** @type {number[] | null} */
  let position = null;
  let words = "";
  let receivedAt = -Infinity;
  let isLive = false;

  // Mark the pose as old if live values no longer arrive.
  function watch() {
    if (isLive && (performance.now() - receivedAt >= OLD_MS || !reach.values)) rest();
  }

  function rest() {
    isLive = false;
    const source = words || "no pose is known; the picture shows the zero pose";
    view.show({ position, words: `NO LIVE DATA: ${source}.`, kind: "old" });
  }

  async function ask() {
    try {
      const found = await request(`/view${CELL}/pose`, {}, { patienceMs: PATIENCE_MS });
      if (receivedAt > -Infinity) return; // live values of a motion have arrived meanwhile
      position = found.position ?? null;
      words = position === null ? "" : `pose of ${found.source}, ${timeOf(found.at_s)}`;
    } catch (error) {
      if (position === null) words = error.message; // if a pose is already known, keep it with its source and time
    }
    rest();
  }

  on("samples", (picture) => {
    const values = picture.joints.map((joint) => joint.position).filter((value) => value !== null);
    if (values.length === 0 || values.length < picture.joints.length) return;
    const silent = picture.joints.filter((joint) => joint.answers === false).map((joint) => joint.name);
    isLive = picture.age_s !== null && picture.age_s <= OLD_S && !picture.over && silent.length === 0;
    position = values;
    words = `last measured pose, ${timeOf(Date.now() / 1000)}`;
    if (!isLive) {
      if (silent.length > 0) words = `no answer from ${silent.join(", ")}`;
      rest();
      return;
    }
    receivedAt = performance.now();
    view.show({ position, words: "LIVE: measured pose", kind: "live", wrench: freshWrench(picture) });
  });
  on("job", (job) => {
    if (!job.ended_s || job.kind !== "check") return;
    receivedAt = -Infinity;
    ask();
  });
  on("reach", watch);
  on("again", ask);
  setInterval(watch, WATCH_MS);
  ask();
}
