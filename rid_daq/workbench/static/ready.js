// Last script of every page: all listeners are installed, so the page accepts input from here on.
import { find } from "./dom.js";

for (const part of ["bar", "main"]) find(part).inert = false;
