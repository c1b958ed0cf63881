// Converts blocks of a result to HTML elements.
import { element, table } from "./dom.js";

const MARKS = { true: ["good", "✓ "], false: ["bad", "✗ "], null: ["", ""] };
const RUNS = `/cells/${encodeURIComponent(document.body.dataset.cell)}/runs/`;

export function verdictOf({ passed, text }) {
  const [kind, mark] = MARKS[passed];
  return element("p", { class: `verdict ${kind}` }, mark + text);
}

// Return the elements of blocks. `figure` creates the container of a plot; without it, plots are left out.
// `imageUrl` returns the address of an image by its number; without it, a picture is its caption.
// A table with more than `mostRows` rows is collapsed, unless it has a red row.
export function blockParts(blocks, figure = null, mostRows = 15, imageUrl = null) {
  let title = "table";
  return blocks.flatMap((block) => {
    switch (block.kind) {
      case "heading": return [element("h3", {}, (title = block.text.trim()))];
      case "verdict": return [verdictOf(block)];
      case "text": return block.text ? [element("p", { class: block.is_note ? "soft" : null }, block.text)] : [];
      case "table": return [tablePart(block, title, mostRows)];
      case "plot": return figure ? [figure(block), element("p", { class: "soft" }, block.caption)] : [];
      case "picture": return [...(imageUrl ? [imagesPart(block, imageUrl)] : []), element("p", { class: "soft" }, block.caption)];
      case "next": return [element("p", {}, `${block.lead}: rid-daq ${block.words.join(" ")}`)];
    }
  });
}

function imagesPart({ images }, url) {
  const shown = images.map(({ text, width, height, number }) =>
    element("img", { src: url(number), alt: text, width, height, loading: "lazy" }));
  return element("div", { class: "images" }, ...shown);
}

function tablePart({ columns, rows, failed }, title, mostRows) {
  const cell = (text, column) => (column.is_run ? element("a", { href: RUNS + encodeURIComponent(text) }, text) : text);
  const heads = columns.map((each) => (each.unit ? `${each.title} [${each.unit}]` : each.title));
  const shown = table(heads, rows.map((row) => row.map((text, i) => cell(text, columns[i]))), failed, title);
  if (rows.length <= mostRows) return shown;
  return element("details", { open: failed?.includes(true) ?? false }, element("summary", {}, `${title}: ${rows.length} rows`), shown);
}
