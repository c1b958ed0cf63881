// Parts of lit-html for the pages: templates that update only what has changed.
export { html, nothing, render } from "lit-html";
export { keyed } from "lit-html/directives/keyed.js";
export { live } from "lit-html/directives/live.js";
export { repeat } from "lit-html/directives/repeat.js";
