// 3-D view of a page on which a motion is chosen: its playback, or the live pose while the robot moves.
import { followPose } from "./live_pose.js";
import { MotionPlayer } from "./motion_player.js";
import { newest, request } from "./requests.js";
import { RobotView } from "./robot_view.js";
import { CELL, now, on } from "./service.js";

const PATIENCE_MS = 60000; // a long motion is planned, and its clearances are computed

// Show the motion of a selection in a section, now and after every change.
export function showPlans(section, select) {
  const view = new RobotView(section, { hidden: ["axes", "limits"] });
  const player = new MotionPlayer(view);
  const replacing = newest();

  let last = null; // the newest live or resting pose
  let shownFile = ""; // file of the motion that is shown
  let filesHash = ""; // of the cell's files for which the motion was requested

  // a live pose replaces the planned one; without live data, the planned motion remains
  followPose({
    show(pose) {
      last = pose;
      if (pose.kind === "live") player.pause();
      player.controls.hidden = pose.kind === "live" || player.motion === null;
      player.nearest.hidden = pose.kind === "live";
      if (pose.kind === "live" || player.motion === null) view.show(pose);
      else if (view.state.dataset.kind === "live") player.seek(player.time);
    },
  });

  function close() {
    player.open(null);
    shownFile = "";
    if (last !== null) view.show(last);
  }

  async function load() {
    const file = select.value;
    const signal = replacing();
    if (file !== shownFile) close();
    filesHash = now.status?.files_hash ?? "";
    if (!file) return;
    try {
      const found = await request(`/view${CELL}/motion?${new URLSearchParams({ file })}`, {}, { patienceMs: PATIENCE_MS, signal });
      [shownFile, filesHash] = [file, found.files_hash];
      player.open(found);
    } catch (error) {
      if (signal.aborted) return;
      close();
      player.refuse(`The motion cannot be shown: ${error.message}`);
    }
  }

  view.seen.then(() => {
    select.addEventListener("change", load);
    on("again", load);
    on("job", (job) => job.ended_s && (job.run || job.kind === "check") && load()); // the approach begins at another pose
    on("cell", ({ files_hash: present }) => {
      if (filesHash === "" || filesHash === present) return;
      close();
      load();
    });
    load();
  });
}
