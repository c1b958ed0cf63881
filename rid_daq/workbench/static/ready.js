// The last script of every page: whoever listens to clicks and forms listens now, so they may come.
import { find } from "./dom.js";

for (const part of ["bar", "main"]) find(part).inert = false;
