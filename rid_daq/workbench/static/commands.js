// Links and fields instead of terminal commands and options. Messages are the same in the terminal and on the pages; they
// name commands as `rid-daq COMMAND` and options as --OPTION. On a page, the command becomes a link to the page with its
// button, and the option becomes the label of its field.
import { LINKS } from "./command_links.js";
import { html } from "./lit.js";
import { CELL } from "./service.js";

const CODE = /`([^`]+)`/g;
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

// Return a text as parts for a template: commands that a page can do are links, other code has its own font.
/** @type {(text: any) => any} */
export function linked(text) {
  if (typeof text !== "string" || !/`|--/.test(text)) return text;
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(CODE)) {
    const [, words, word] = COMMAND.exec(found[1]) ?? [];
    const link = LINKS[words] ?? LINKS[word];
    parts.push(withFields(text.slice(end, found.index)));
    parts.push(link ? html`<a href="${CELL}${link[0]}">${link[1]}</a>` : html`<code>${words ? found[1] : withFields(found[1])}</code>`);
    end = found.index + found[0].length;
  }
  return [...parts, withFields(text.slice(end))];
}
