// STOP: everybody's, always there, also while a dialog is open; by a click, or Escape twice.
import { find } from "./dom.js";
import { page } from "./service.js";

const PATIENCE_MS = 2000;
const TWICE_MS = 1000;
const SHOWN_MS = 8000;
const button = find("stop");
const words = find("stop-words");
let shown = null;

export async function stop() {
  say("Asking for the stop…", "wait");
  try {
    const answer = await fetch(`/api/v1/cells/${encodeURIComponent(page.cell)}/stop`, {
      method: "POST",
      headers: { "x-rid-daq": "stop", "content-type": "application/json" },
      signal: AbortSignal.timeout(PATIENCE_MS),
      keepalive: true,
    });
    const told = await answer.json();
    if (answer.ok) say(told.sentence, "good");
    else say(`The service refuses to stop: use the emergency stop. ${told.message}`, "bad");
  } catch {
    say("The service does not answer: use the emergency stop.", "bad");
  }
}

function say(text, kind) {
  clearTimeout(shown);
  words.textContent = text;
  words.className = `banner ${kind}`;
  if (kind === "good") shown = setTimeout(() => ((words.textContent = ""), (words.className = "")), SHOWN_MS);
}

export function watchStop() {
  // the press itself stops, not its release: nobody waits for a finger to lift
  let pressed = -Infinity;
  const press = (event) => {
    if (event.button !== 0 || event.timeStamp - pressed < TWICE_MS) return;
    pressed = event.timeStamp;
    stop();
  };
  button.addEventListener("pointerdown", press);
  button.addEventListener("click", press);
  let escaped = -Infinity;
  const key = (event) => {
    if (event.key !== "Escape" || event.repeat) return;
    const at = performance.now();
    if (at - escaped < TWICE_MS) {
      escaped = -Infinity;
      stop();
    } else {
      escaped = at;
    }
  };
  window.addEventListener("keydown", key, { capture: true });
  button.disabled = false;
}
