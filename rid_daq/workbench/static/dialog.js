// Dialogs. While a dialog is open, nothing behind it can be used, except the stop button.
import { element, find } from "./dom.js";
import { now, page } from "./service.js";

const behind = find("behind");
/** @type {((value: any) => void) | null} */
let open = null;

// Show a dialog. The promise resolves with the result of `read` when the user submits the form, and with null when the
// user cancels.
/** @template Value @param {string} title @param {Node[]} content @param {string} actionText @param {{ danger?: boolean, read?: () => Value }} [options] @returns {Promise<Value | null>} */
export function dialog(title, content, actionText, { danger = false, read = () => /** @type {Value} */ (/** @type {unknown} */ (true)) } = {}) {
  open?.(null);
  const before = document.activeElement;
  return new Promise((resolve) => {
    const problem = element("p", { class: "problem", role: "alert" });
    const heading = element("h2", { id: "dialog-title" }, title);
    const action = element("button", { type: "submit", class: danger ? "danger" : "main" }, actionText);
    const cancel = element("button", { type: "button", onclick: () => leave(null) }, "Cancel");
    const form = element("form", {}, heading, ...content, problem, element("div", { class: "actions" }, cancel, action));
    const shown = element("div", { class: "dialog", role: "dialog", "aria-labelledby": "dialog-title" }, form);
    /** @type {(event: KeyboardEvent) => unknown} */
    const escape = (event) => event.key === "Escape" && leave(null);
    /** @type {(value: Value | null) => void} */
    const leave = (value) => {
      shown.remove();
      behind.inert = false;
      open = null;
      window.removeEventListener("keydown", escape);
      if (before instanceof HTMLElement) before.focus();
      resolve(value);
    };
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      try {
        leave(read());
      } catch (error) {
        problem.textContent = error.message;
      }
    });
    window.addEventListener("keydown", escape);
    open = leave;
    behind.inert = true;
    find("dialogs").append(shown);
    (/** @type {HTMLElement | null} */ (shown.querySelector("input, textarea")) ?? action).focus();
  });
}

// Ask before a motion whether the cell is clear, and what the robot shall do if the connection to this page is lost. The promise
// resolves with the user's choice, "stop" or "finish", or with null if the user cancels. A motion that needs a held key
// always stops if the connection is lost, so the dialog then offers no choice.
/** @type {(what: string, options?: { held?: boolean }) => Promise<Api.JobCreation["on_lost_client"] | null>} */
export function confirmClear(what, { held = false } = {}) {
  const words = page.simulated
    ? "This cell is simulated: no real robot moves. On a real cell you would now check:"
    : "The robot will move. Check now:";
  const list = element(
    "ul",
    { class: "clear" },
    element("li", {}, "No one is in the cell, and nothing is in the robot's way."),
    element("li", {}, "The emergency stop is within reach."),
  );
  const name = now.status?.robot ?? page.cell;
  const lost = element(
    "select",
    { id: "on-lost" },
    element("option", { value: "stop" }, "stop the motion"),
    element("option", { value: "finish" }, "continue the motion to its end"),
  );
  const label = element("label", { for: "on-lost" }, "If the connection to this page is lost:");
  const content = [element("p", {}, words), list, ...(held ? [] : [label, lost])];
  return dialog(`Is the cell clear? ${what}`, content, `${name} is clear: start`, { read: () => /** @type {Api.JobCreation["on_lost_client"]} */ (lost.value) });
}
