// The screen stays on while we have the cell and it moves: a device that sleeps is out of reach.
import { lease, now, on } from "./service.js";

let lock = null;
let asking = false;

const wanted = () => lease.key !== null && now.status?.state === "moving" && document.visibilityState === "visible";

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
    // a device that saves its battery refuses: the words beside the lease say what that means
  }
  asking = false;
}

on("cell", keep);
document.addEventListener("visibilitychange", keep);
