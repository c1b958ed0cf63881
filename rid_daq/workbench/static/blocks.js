// Templates of the blocks of a result, one for each kind of block.
import { linked } from "./commands.js";
import { html, keyed } from "./lit.js";

/** @type {Record<string, [string, string]>} */
const MARKS = { true: ["good", "✓ "], false: ["bad", "✗ "], null: ["", ""] };
const RUNS = `/cells/${encodeURIComponent(document.body.dataset.cell ?? "")}/runs/`;

/** @type {(verdict: { passed: boolean | null, text: string }) => Part} */
export function verdictOf({ passed, text }) {
  const [kind, mark] = MARKS[String(passed)];
  return html`<p class="verdict ${kind}">${mark}${linked(text)}</p>`;
}

// Return a table. Cells are texts or templates; `red` marks rows; a column without a title has no head.
/** @type {(columns: string[], rows: unknown[][], red?: boolean[] | null, caption?: string) => Part} */
export function table(columns, rows, red = null, caption = "table") {
  /** @type {(text: string) => Part} */
  const head = (text) => (text ? html`<th scope="col">${text}</th>` : html`<td></td>`);
  /** @type {(cells: Part[], i: number) => Part} */
  const row = (cells, i) => html`<tr class=${red?.[i] ? "red" : ""}>${cells.map((cell) => html`<td>${cell}</td>`)}</tr>`;
  return html`<div class="scroll" tabindex="0" role="group" aria-label=${caption}>
    <table><thead><tr>${columns.map(head)}</tr></thead><tbody>${rows.map(row)}</tbody></table></div>`;
}

// Return the templates of blocks. `figure` creates the container of a plot; without it, plots are left out.
// `imageUrl` returns the address of an image by its number; without it, only the caption of a picture is shown.
// A table with more than `mostRows` rows is collapsed, unless it has a red row; its title replaces the heading above it.
/** @type {(blocks: PageBlock[], figure?: ((plot: PlotBlock) => Element) | null, mostRows?: number, imageUrl?: ((number: number) => string) | null) => Part[]} */
export function blockParts(blocks, figure = null, mostRows = 15, imageUrl = null) {
  let title = "table";
  return blocks.map((block, i) => {
    switch (block.kind) {
      case "heading":
        title = block.text.trim();
        return isCollapsible(blocks[i + 1], mostRows) ? "" : html`<h3>${title}</h3>`;
      case "verdict": return verdictOf(block);
      case "text": return block.text && !block.is_for_terminal ? html`<p class=${block.is_note ? "soft" : ""}>${linked(block.text)}</p>` : "";
      case "table": return tablePart(block, title, isCollapsible(block, mostRows));
      case "plot": return figure ? html`${figure(block)}<p class="soft">${block.caption}</p>` : "";
      case "picture": return html`${imageUrl ? imagesPart(block, imageUrl) : ""}<p class="soft">${block.caption}</p>`;
      case "next": return ""; // a command; pages have links and buttons instead
    }
  });
}

/** @type {(picture: PictureBlock, url: (number: number) => string) => Part} */
function imagesPart({ images }, url) {
  const shown = images.map(({ text, width, height, number }) =>
    html`<img src=${url(number)} alt=${text} width=${width} height=${height} loading="lazy">`);
  return html`<div class="images">${shown}</div>`;
}

/** @type {(block: PageBlock | undefined, mostRows: number) => boolean} */
const isCollapsible = (block, mostRows) => block?.kind === "table" && block.rows.length > mostRows;

/** @type {(block: Api.Table, title: string, isCollapsed: boolean) => Part} */
function tablePart({ columns, rows, failed }, title, isCollapsed) {
  /** @type {(text: any, column: Api.Column) => Part} */
  const cell = (text, column) => (column.is_run ? html`<a href="${RUNS}${encodeURIComponent(text)}">${text}</a>` : linked(text));
  const heads = columns.map((each) => (each.unit ? `${each.title} [${each.unit}]` : each.title));
  const shown = table(heads, rows.map((row) => row.map((text, i) => cell(text, columns[i]))), failed, title);
  if (!isCollapsed) return shown;
  // each result gets a new element: a table with failed rows is open even if the user closed that of the previous result
  return keyed(rows, html`<details ?open=${failed?.includes(true) ?? false}><summary>${title}: ${rows.length} rows</summary>${shown}</details>`);
}
