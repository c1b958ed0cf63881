// Pose of the cell's robot in the 3-D view: live during a motion, otherwise the newest known pose.
import { timeOf } from "./dom.js";
import { request } from "./requests.js";
import { CELL, on, reach } from "./service.js";

const OLD_MS = 1500; // values count as old if no new ones arrive for this time
const OLD_S = 0.5; // greatest age of live values at the service
const WATCH_MS = 500;
const PATIENCE_MS = 10000;

// Show the pose in a view, now and after every change.
export function followPose(view) {
  let position = null;
  let words = "";
  let receivedAt = -Infinity;
  let isLive = false;

  // Mark the pose as old once no live values arrive any more.
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
      if (receivedAt > -Infinity) return; // a motion has begun meanwhile
      position = found.position ?? null;
      words = position === null ? "" : `pose of ${found.source}, ${timeOf(found.at_s)}`;
    } catch (error) {
      if (position === null) words = error.message; // a known pose keeps its source and time
    }
    rest();
  }

  on("samples", (picture) => {
    const values = picture.joints.map((joint) => joint.position);
    if (values.length === 0 || values.some((value) => value === null || value === undefined)) return;
    const silent = picture.joints.filter((joint) => joint.answers === false).map((joint) => joint.name);
    isLive = picture.age_s !== null && picture.age_s <= OLD_S && !picture.over && silent.length === 0;
    position = values;
    words = `last pose of the motion ${timeOf(Date.now() / 1000)}`;
    if (!isLive) {
      if (silent.length > 0) words = `no answer from ${silent.join(", ")}`;
      rest();
      return;
    }
    receivedAt = performance.now();
    view.show({ position, words: "LIVE: measured pose", kind: "live" });
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
