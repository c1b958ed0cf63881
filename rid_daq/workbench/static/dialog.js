// Dialogs that leave STOP within reach: all else behind them is inert, the stop button is not.
import { element, find } from "./dom.js";
import { now, page } from "./service.js";

const behind = find("behind");
let open = null;

// Show a dialog; resolves with what `read` returns once its form is sent, with null where it is left.
export function dialog(title, content, actionText, { danger = false, read = () => true } = {}) {
  open?.(null);
  const before = document.activeElement;
  return new Promise((resolve) => {
    const problem = element("p", { class: "problem", role: "alert" });
    const heading = element("h2", { id: "dialog-title" }, title);
    const action = element("button", { type: "submit", class: danger ? "danger" : "main" }, actionText);
    const cancel = element("button", { type: "button", onclick: () => leave(null) }, "Cancel");
    const form = element("form", {}, heading, ...content, problem, element("div", { class: "actions" }, cancel, action));
    const shown = element("div", { class: "dialog", role: "dialog", "aria-labelledby": "dialog-title" }, form);
    const escape = (event) => event.key === "Escape" && leave(null);
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
    (shown.querySelector("input, textarea") ?? action).focus();
  });
}

// Ask, before each motion, whether the cell is clear; resolves with what is to happen where this page
// goes out of reach ("stop" or "finish"), or null. What moves only while it is held stops: no choice.
export function confirmClear(what, { held = false } = {}) {
  const words = page.simulated
    ? "This cell is simulated: nothing real moves. On a real cell you would now look:"
    : "The robot moves. Look now:";
  const list = element(
    "ul",
    { class: "clear" },
    element("li", {}, "Nobody is in the cell, and nothing stands in the robot's way."),
    element("li", {}, "The emergency stop is at hand."),
  );
  const name = now.status?.robot ?? page.cell;
  const lost = element(
    "select",
    { id: "on-lost" },
    element("option", { value: "stop" }, "stop the motion"),
    element("option", { value: "finish" }, "let it go on to its end"),
  );
  const label = element("label", { for: "on-lost" }, "If this page goes out of reach:");
  const content = [element("p", {}, words), list, ...(held ? [] : [label, lost])];
  return dialog(`Is the cell clear? ${what}`, content, `${name} is clear: begin`, { danger: true, read: () => lost.value });
}
