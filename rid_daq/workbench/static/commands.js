// Links and fields instead of terminal commands and options. Messages are the same in the terminal and on the pages; they
// name commands as `rid-daq COMMAND` and options as --OPTION. On a page, the command becomes a link to the page with its
// button, and the option becomes the label of its field.
import { LINKS } from "./command_links.js";
import { html } from "./lit.js";
import { CELL } from "./service.js";

const PART = /`([^`]+)`|(?:runs\/|\brun )([0-9A-Z]{26})\b/g; // code, or a run by its id
const COMMAND = /^rid-daq (([a-z]+)(?: [a-z-]+)?)/;
const OPTION = /(?<![\w-])--([a-z][a-z-]*)/g;

// Return a text whose options are named as on this page: by the label of the field, or without hyphens if the page has no
// such field.
/** @type {(text: string) => string} */
const withFields = (text) => text.replace(OPTION, (_, option) => `“${labelOf(option) ?? option.replaceAll("-", " ")}”`);

/** @type {(option: string) => string | undefined} */
function labelOf(option) {
  const field = /** @type {HTMLInputElement | null} */ (document.querySelector(`main :is(#${option}, [data-option~=${option}])`));
  return [...(field?.labels?.[0]?.childNodes ?? [])].map((each) => (each instanceof Text ? each.data.trim() : "")).find(Boolean);
}

// Return a text as parts for a template: commands that a page can do and runs are links, other code has its own font.
/** @type {(text: any) => any} */
export function linked(text) {
  if (typeof text !== "string" || !/`|--|[0-9A-Z]{26}/.test(text)) return text;
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(PART)) {
    const [whole, code, run] = found;
    parts.push(withFields(text.slice(end, found.index)));
    end = found.index + whole.length;
    if (run) {
      parts.push(html`<a href="${CELL}/runs/${run}">the run</a>`);
      continue;
    }
    const [, words, word] = COMMAND.exec(code) ?? [];
    const link = LINKS[words] ?? LINKS[word];
    parts.push(link ? html`<a href="${CELL}${link[0]}">${link[1]}</a>` : html`<code>${words ? code : withFields(code)}</code>`);
  }
  return [...parts, withFields(text.slice(end))];
}
