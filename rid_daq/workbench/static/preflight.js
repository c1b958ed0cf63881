// Shows the newest preflight: a summary, and the checks of each device.
import { blockParts } from "./blocks.js";
import { timeOf } from "./dom.js";
import { render } from "./lit.js";
import { request } from "./requests.js";
import { CELL, ask } from "./service.js";

// Show the newest preflight. The promise resolves with its lines, if there has been a preflight.
/** @type {(section: HTMLElement, words: HTMLElement) => Promise<Api.CheckLine[] | undefined>} */
export async function loadPreflight(section, words) {
  let found, blocks;
  try {
    found = await ask("GET", `${CELL}/preflight`);
    blocks = found === null ? [] : await request(`/blocks${CELL}/preflight`, {}, { patienceMs: 10000 });
  } catch (error) {
    words.textContent = error.message;
    return;
  }
  render(blockParts(blocks, null, 1), section);
  if (found === null) {
    words.textContent = "This cell has had no preflight yet. Next: Check.";
    return;
  }
  const { lines } = found;
  const red = lines.filter((line) => line.verdict === "red");
  const voided = found.void_because ? ` It is void: ${found.void_because}` : "";
  words.textContent = `${found.passed ? "Green" : "Red"}: ${lines.length} lines, ${red.length} red, made ${timeOf(found.at_s)}.${voided} ${found.problem ?? ""}`;
  words.className = `verdict ${found.passed && !found.void_because ? "good" : "bad"}`;
  return lines;
}
