// 3-D view of a page on which a motion is chosen: its playback, or the live pose while the robot moves.
import { followPose } from "./live_pose.js";
import { MotionPlayer } from "./motion_player.js";
import { newest, request } from "./requests.js";
import { RobotView } from "./robot_view.js";
import { CELL, on } from "./service.js";

const PATIENCE_MS = 60000; // a long motion is planned, and its clearances are computed

// Show the motion of a selection in a section, now and after every change.
export function showPlans(section, select) {
  const view = new RobotView(section, { hidden: ["axes", "limits"] });
  const player = new MotionPlayer(view);
  const replacing = newest();

  // a live pose replaces the planned one; without live data, the planned motion remains
  followPose({
    show(pose) {
      if (pose.kind === "live") player.pause();
      if (pose.kind === "live" || player.motion === null) view.show(pose);
      else if (view.state.dataset.kind === "live") player.seek(player.time);
    },
  });

  async function load() {
    const file = select.value;
    const signal = replacing();
    if (!file) {
      player.open(null);
      return;
    }
    try {
      const found = await request(`/view${CELL}/motion?${new URLSearchParams({ file })}`, {}, { patienceMs: PATIENCE_MS, signal });
      player.open(found);
    } catch (error) {
      if (signal.aborted) return;
      player.open(null);
      player.refuse(`The motion cannot be shown: ${error.message}`);
    }
  }

  view.seen.then(() => {
    select.addEventListener("change", load);
    on("again", load);
    load();
  });
}
