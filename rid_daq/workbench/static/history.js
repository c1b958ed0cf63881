// The history of a robot: its figure; another quantity is another page.
import { find } from "./dom.js";
import { go, page } from "./service.js";
import { figureIn } from "./work.js";

const quantity = find("quantity");

quantity.addEventListener("change", () => {
  go(`?${new URLSearchParams({ quantity: quantity.value })}`);
});
const wanted = new URLSearchParams({ quantity: quantity.value });
figureIn(find("figure"), `/figures/cells/${encodeURIComponent(page.cell)}/history?${wanted}`);
