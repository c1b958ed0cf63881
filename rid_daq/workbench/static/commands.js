// Links instead of terminal commands. Messages are the same in the terminal and on the pages; they name commands as
// `rid-daq COMMAND`. On a page, the command becomes a link to the page with its button.
import { LINKS } from "./command_links.js";
import { html } from "./lit.js";
import { CELL } from "./service.js";

const CODE = /`([^`]+)`/g;
const COMMAND = /^rid-daq (([a-z]+)(?: [a-z-]+)?)/;

// Return a text as parts for a template: commands that a page can do are links, other code has its own font.
/** @type {(text: any) => any} */
export function linked(text) {
  if (typeof text !== "string" || !text.includes("`")) return text;
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(CODE)) {
    const [, words, word] = COMMAND.exec(found[1]) ?? [];
    const link = LINKS[words] ?? LINKS[word];
    parts.push(text.slice(end, found.index));
    parts.push(link ? html`<a href="${CELL}${link[0]}">${link[1]}</a>` : html`<code>${found[1]}</code>`);
    end = found.index + found[0].length;
  }
  return [...parts, text.slice(end)];
}
