// Parts that a page shows while something loads, and if it cannot be loaded.
import { linked } from "./commands.js";
import { html, render } from "./lit.js";

/** @type {(what: string) => Part} */
export const loadingPart = (what) => html`<p class="soft" role="status">Loading the ${what} …</p>`;

/** @type {(error: Error & { original?: string }) => Part} */
export const problemOf = (error) => html`<p class="problem">${linked(error.original ?? error.message)}</p>`;

// Return an error with a button that calls `again`.
/** @type {(error: Error, again: () => unknown) => Part} */
export const failedPart = (error, again) => html`<div role="alert">${problemOf(error)}</div>
  <p><button type="button" @click=${() => again()}>Try again</button></p>`;

// Return what `load` promises. Meanwhile `place` says that it loads; after an error, a button there tries again.
/** @template Found @param {HTMLElement} place @param {string} what @param {() => Promise<Found>} load @returns {Promise<Found>} */
export async function loadInto(place, what, load) {
  render(loadingPart(what), place);
  try {
    return await load();
  } catch (error) {
    return new Promise((resolve) => render(failedPart(error, () => resolve(loadInto(place, what, load))), place));
  }
}
