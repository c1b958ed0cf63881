// Links in place of terminal commands. Messages are the same in the terminal and on the pages; they name commands as
// `rid-daq COMMAND`. On a page, the command becomes a link to the page with its button.
import { html } from "./lit.js";
import { CELL } from "./service.js";

const PLACES = {
  axes: ["", "Axis test"],
  check: ["", "Check"],
  compensate: ["/compensation", "Compensation"],
  design: ["/experiment", "Design a motion"],
  friction: ["/friction", "Friction"],
  identify: ["/identify", "Identify"],
  jog: ["", "Jog"],
  loop: ["/compensation", "Measure the velocity loops"],
  payload: ["/payload", "Payload"],
  plate: ["", "Zero the plate"],
  record: ["/experiment", "Record"],
  recover: ["/runs", "Recover"],
  refine: ["/compensation", "Refine"],
  reset: ["", "Reset"],
  retime: ["/compensation", "Compensation"],
  runs: ["/runs", "Runs"],
  stiffness: ["/operations/stiffness", "Stiffness"],
  stream: ["/compensation", "Compensation"],
  validate: ["/identify", "Validate"],
};
const CODE = /`([^`]+)`/g;
const COMMAND = /^rid-daq ([a-z]+)/;

// Return a text as parts for a template: commands that a page can do are links, other code has its own font.
export function linked(text) {
  if (typeof text !== "string" || !text.includes("`")) return text;
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(CODE)) {
    const place = PLACES[COMMAND.exec(found[1])?.[1]];
    parts.push(text.slice(end, found.index));
    parts.push(place ? html`<a href="${CELL}${place[0]}">${place[1]}</a>` : html`<code>${found[1]}</code>`);
    end = found.index + found[0].length;
  }
  return [...parts, text.slice(end)];
}
