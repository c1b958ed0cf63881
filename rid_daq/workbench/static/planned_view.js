// 3-D view of a page on which the user chooses a motion. It plays the chosen motion; while the robot moves, it shows
// the live pose.
import { followPose } from "./live_pose.js";
import { MotionPlayer } from "./motion_player.js";
import { newest, post, request } from "./requests.js";
import { RobotView } from "./robot_view.js";
import { CELL, now, on } from "./service.js";

const PATIENCE_MS = 60000; // timeout: the service needs time to plan a long motion and to compute its clearances
const MOTION = `/view${CELL}/motion`;

// Show the motion that is chosen in `select` in a section, now and whenever another motion is chosen.
/** @type {(section: HTMLElement, select: HTMLSelectElement) => void} */
export function showChosenPlan(section, select) {
  const { reload } = showPlan(section, (signal) =>
    select.value ? request(`${MOTION}?${new URLSearchParams({ file: select.value })}`, {}, { patienceMs: PATIENCE_MS, signal }) : null);
  select.addEventListener("change", () => reload());
}

// Show the motion of a text that is not saved yet. Returns `reload`, which shows the present text, `refuse`, which shows
// a sentence instead, `showPose`, which shows a single pose, and `knownPose`, which returns the robot's newest known pose.
/** @type {(section: HTMLElement, file: string, text: () => string) => PlannedView} */
export function showUnsavedPlan(section, file, text) {
  return showPlan(section, (signal) => (text().trim() ? post(MOTION, { file, text: text() }, { patienceMs: PATIENCE_MS, signal }) : null));
}

// Show the motion that `getMotion(signal)` requests; it returns null if there is none.
/** @type {(section: HTMLElement, getMotion: (signal: AbortSignal) => Promise<MotionPlayback> | null) => PlannedView} */
function showPlan(section, getMotion) {
  const view = new RobotView(section, { hidden: ["axes", "limits"] });
  const player = new MotionPlayer(view);
  const replacing = newest();

  /** @type {ShownPose | null} */
  let last = null; // the newest live pose, or the newest pose at rest
  /** @type {ShownPose | null} */
  let chosen = null; // the pose chosen by the user, shown until there is a motion or a live pose
  let filesHash = ""; // hash of the cell's files for which the motion was requested

  // a live pose replaces the planned one; without live data, the planned motion remains
  followPose({
    /** @type {(pose: ShownPose) => void} */
    show(pose) {
      last = pose;
      if (pose.kind === "live") {
        player.pause();
        chosen = null;
      }
      player.controls.hidden = pose.kind === "live" || player.motion === null;
      player.nearest.hidden = pose.kind === "live";
      if (pose.kind === "live" || player.motion === null) view.show(chosen ?? pose);
      else if (view.state.dataset.kind === "live") player.seek(player.time);
    },
  });

  function close() {
    player.open(null);
    const pose = chosen ?? last;
    if (pose) view.show(pose);
  }

  // Load and show the motion. The present picture is removed at once, or, if the motion is the same, when the answer arrives.
  /** @type {(how?: { isSame?: boolean }) => Promise<void>} */
  async function load({ isSame = false } = {}) {
    const signal = replacing();
    if (!isSame) close();
    filesHash = now.status?.files_hash ?? "";
    try {
      const asked = getMotion(signal);
      if (asked === null) return;
      if (!isSame) player.nearest.textContent = "The motion is being prepared …";
      const found = await asked;
      filesHash = found.files_hash;
      chosen = null;
      player.open(found);
    } catch (error) {
      if (!signal.aborted) refuse(`The motion cannot be shown: ${error.message}`);
    }
  }

  /** @type {(words: string) => void} */
  function refuse(words) {
    close();
    player.refuse(words);
  }

  /** @type {(how?: { isSame?: boolean }) => Promise<void>} */
  const reload = (how) => view.seen.then(() => load(how));

  view.seen.then(() => {
    on("again", () => load({ isSame: true }));
    on("job", (job) => job.ended_s && (job.run || job.kind === "check") && load({ isSame: true })); // the approach begins at the robot's new pose
    on("cell", ({ files_hash: present }) => {
      if (filesHash === "" || filesHash === present) return;
      close();
      load();
    });
    load();
  });
  /** @type {(position: number[]) => void} */
  const showPose = (position) => {
    player.pause();
    chosen = { position, words: "CHOSEN POSE, NO LIVE DATA", kind: "planned" };
    view.show(chosen);
  };
  return { reload, refuse, showPose, side: view.side, knownPose: () => last?.position ?? null };
}
