// Keeps the screen on while this page holds the cell and a job can move it: a sleeping device cannot renew the lease.
import { lease, now, on } from "./service.js";

/** @type {WakeLockSentinel | null} */
let lock = null;
let asking = false;

const wanted = () => lease.key !== null && now.status?.job != null && document.visibilityState === "visible";

async function keep() {
  if (asking || !navigator.wakeLock) return;
  asking = true;
  try {
    if (wanted() && (lock === null || lock.released)) lock = await navigator.wakeLock.request("screen");
    else if (!wanted() && lock !== null) {
      await lock.release();
      lock = null;
    }
  } catch {
    // the browser refuses this, for example in battery saver mode: the screen may turn off
  }
  asking = false;
}

on("cell", keep);
document.addEventListener("visibilitychange", keep);
