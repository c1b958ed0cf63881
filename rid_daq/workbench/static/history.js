// Page with the history of one quantity of a robot.
import { find } from "./dom.js";
import { CELL, go } from "./service.js";
import { blocksUrl, showBlocks } from "./work.js";

const quantity = find("quantity");

quantity.addEventListener("change", () => go(`?${new URLSearchParams({ quantity: quantity.value })}`));
showBlocks(find("history"), blocksUrl(`${CELL}/history`, { quantity: quantity.value }), { what: "history" });
