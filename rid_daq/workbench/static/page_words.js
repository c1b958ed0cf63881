// Words of a page for terminal commands and options. Messages are the same in the terminal and on the pages; they name
// commands as `rid-daq COMMAND`, options as --OPTION, and runs by their ids.
import { LINKS } from "./command_links.js";

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

// Return the parts of a text: sentences, links (a page with the command's button, or a run) and code.
/** @type {(text: string) => PageWords[]} */
export function pageWords(text) {
  /** @type {PageWords[]} */
  const parts = [];
  let end = 0;
  for (const found of text.matchAll(PART)) {
    const [whole, code, run] = found;
    parts.push({ words: withFields(text.slice(end, found.index)) });
    end = found.index + whole.length;
    const [, words, word] = COMMAND.exec(code) ?? [];
    const link = run ? [`/runs/${run}`, "the run"] : LINKS[words] ?? LINKS[word];
    if (link) parts.push({ words: link[1], address: link[0] });
    else parts.push({ words: words ? code : withFields(code), isCode: true });
  }
  return [...parts, { words: withFields(text.slice(end)) }];
}

// Return a text in the words of the page, without links.
/** @type {(text: string) => string} */
export const inPageWords = (text) => pageWords(text).map(({ words }) => words).join("");
