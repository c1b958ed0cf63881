// Hold-to-run buttons: while a button is pressed, its key is sent to the service; on release, the page sends the
// release at once.
import { element } from "./dom.js";
import { hold, letGo, on, tap } from "./service.js";

const JOG_KEYS = [["−", "-"], ["+", "+"]];

// Tell other parts of the page the index of the joint that the buttons move; null if the buttons were removed.
/** @type {(joint: number | null) => void} */
const tellJoint = (joint) => document.dispatchEvent(new CustomEvent("joint-chosen", { detail: joint }));

/** @type {{ job: string, problem: HTMLElement } | null} */
let shown = null; // { job, problem }: id of the job to which the buttons belong, and the element for their error messages
on("key", (job, text) => {
  if (shown?.job === job) shown.problem.textContent = text;
});

// Return the element with the buttons for a job that requires a held key, and a function that removes its listeners.
/** @type {(job: Api.Job, joints: string[]) => HoldPad} */
export function holdPad(job, joints) {
  const abort = new AbortController();
  const { signal } = abort;
  /** @type {(target: EventTarget, types: string[], listener: (event: any) => void) => void} */
  const listen = (target, types, listener) => {
    for (const type of types) target.addEventListener(type, listener, { signal });
  };
  /** @type {HTMLElement[]} */
  const buttons = [];
  const problem = element("p", { class: "problem", role: "alert" });
  shown = { job: job.id, problem };

  const release = () => {
    letGo();
    for (const each of buttons) each.classList.remove("held");
  };

  // `key()` returns the key that the button sends at present.
  /** @type {(text: string, key: () => string, label?: string | null) => HTMLElement} */
  function holder(text, key, label = null) {
    const button = element("button", { type: "button", class: "hold", "aria-label": label }, text);
    const press = () => {
      problem.textContent = "";
      button.classList.add("held");
      hold(job.id, key());
    };
    listen(button, ["pointerdown"], (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      event.preventDefault();
      button.focus();
      press();
    });
    listen(button, ["pointerup", "pointercancel", "lostpointercapture", "blur"], release);
    listen(button, ["contextmenu"], (event) => event.preventDefault());
    listen(button, ["keydown"], (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) press();
    });
    listen(button, ["keyup"], release);
    buttons.push(button);
    return button;
  }
  listen(window, ["blur", "pagehide"], release);
  listen(document, ["visibilitychange"], release);

  const free = job.kind === "jog" && !job.request.home;
  const rows = [];
  if (free) {
    let chosen = 1; // number of the joint, from 1. It is sent with each press, so that a press cannot move the previous joint
    const choices = joints.slice(0, 9).map((joint, i) => {
      const choice = element("button", { type: "button", class: "joint", "aria-pressed": String(i === 0) }, joint);
      choice.addEventListener("click", () => {
        release();
        chosen = i + 1;
        tap(job.id, String(chosen));
        tellJoint(i);
        for (const each of choices) each.setAttribute("aria-pressed", String(each === choice));
      });
      return choice;
    });
    tellJoint(0);
    rows.push(element("div", { class: "joints", role: "group", "aria-label": "joint" }, ...choices));
    /** @type {Record<string, string>} */
    const hints = { "-": "hold to move in negative direction", "+": "hold to move in positive direction" };
    rows.push(element("div", { class: "holds" }, ...JOG_KEYS.map(([text, key]) => holder(text, () => chosen + key, hints[key]))));
    if (document.querySelector("[data-home=yes]"))
      rows.push(element("div", { class: "holds" }, holder("Hold to move to the home pose", () => "h")));
  } else {
    rows.push(element("div", { class: "holds" }, holder("Hold to move", () => " ")));
  }
  const end = element("button", { type: "button", onclick: () => tap(job.id, "q") }, "Finish");
  rows.push(element("div", { class: "actions" }, end));
  rows.unshift(element("p", { class: "question" }, "The robot moves while you hold the button, and stops when you release it."));
  rows.push(problem);

  const leave = () => {
    release();
    abort.abort();
    if (free) tellJoint(null);
  };
  return { pad: element("div", { class: "pad" }, ...rows), leave };
}
