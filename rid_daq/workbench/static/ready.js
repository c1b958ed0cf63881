// Last script of every page. When it runs, all event listeners are installed and the page accepts input.
import { find } from "./dom.js";

for (const part of [find("bar"), find("main")]) part.inert = false;
