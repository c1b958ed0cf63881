// Links and fields instead of terminal commands and options.
import { html } from "./lit.js";
import { pageWords } from "./page_words.js";
import { CELL } from "./service.js";

// Return a text as parts for a template: commands that a page can do and runs are links, other code has its own font.
/** @type {(text: any) => any} */
export function linked(text) {
  if (typeof text !== "string") return text;
  return pageWords(text).map(({ words, address, isCode }) =>
    address !== undefined ? html`<a href="${CELL}${address}">${words}</a>` : isCode ? html`<code>${words}</code>` : words);
}
