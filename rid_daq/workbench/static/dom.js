// Creates and finds elements; texts are never interpreted as markup.

/** @template {keyof PageElements} Id @param {Id} id @returns {PageElements[Id]} */
export const find = (id) => /** @type {PageElements[typeof id]} */ (document.getElementById(id));

// element("p", { class: "soft", onclick: f, hidden: true }, "text", child, ...)
/** @template {keyof HTMLElementTagNameMap} Tag @param {Tag} tag @param {Attributes} attributes @param {...(Node | string | null | undefined)} children @returns {HTMLElementTagNameMap[Tag]} */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") made.toggleAttribute(name, value);
    else if (value !== undefined && value !== null) made.setAttribute(name, String(value));
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

// Return a name as parts of a text that can break after each underscore.
/** @type {(name: string) => (Node | string)[]} */
export const breakable = (name) => name.split(/(?<=_)/).flatMap((part, i) => (i ? [element("wbr"), part] : [part]));

// Return the part of an address that names a file of the service's folder.
/** @type {(file: string) => string} */
export const addressOf = (file) => file.split("/").map(encodeURIComponent).join("/");

// Return a duration as text.
/** @type {(seconds: number) => string} */
export function duration(seconds) {
  if (seconds < 90) return `${Math.max(0, Math.round(seconds))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

// Return a time in the service's time zone, with the zone's name: the device may be in another zone.
// The argument is a number of seconds since 1970, or a time in ISO 8601.
/** @type {(time: number | string) => string} */
export function timeOf(time) {
  const at = typeof time === "number" ? 1000 * time : Date.parse(time);
  return Number.isNaN(at) ? String(time) : zoned.format(at); // an edited manifest may contain a text that is no date: show it unchanged
}

// Return the time of day with seconds in the service's time zone. The argument is a number of seconds since 1970.
/** @type {(time: number) => string} */
export const clockOf = (time) => zonedClock.format(1000 * time);

const two = /** @type {const} */ ("2-digit");
/** @type {Intl.DateTimeFormatOptions} */
const DATE = { year: "numeric", month: two, day: two, hour: two, minute: two, timeZoneName: "short" }; // year-month-day hour:minute
const zoned = inZone(DATE);
const zonedClock = inZone({ hour: two, minute: two, second: two });

// Return the format of times in the service's zone; in UTC if the browser does not know the zone.
/** @type {(parts: Intl.DateTimeFormatOptions) => Intl.DateTimeFormat} */
function inZone(parts) {
  /** @type {(timeZone: string | undefined) => Intl.DateTimeFormat} */
  const format = (timeZone) => new Intl.DateTimeFormat("sv-SE", { ...parts, timeZone });
  try {
    return format(document.body.dataset.zone);
  } catch {
    return format("UTC");
  }
}

// Parse a number with a decimal point or a decimal comma; return NaN for any other text.
// The result is also NaN if a comma may separate thousands, as in "1,234".
/** @type {(text: string) => number} */
export function parseNumber(text) {
  const words = text.trim();
  if (!/^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(words)) return NaN;
  if (/^[-+]?[1-9]\d{0,2},\d{3}$/.test(words)) return NaN;
  const value = Number(words.replace(",", "."));
  return Number.isFinite(value) ? value : NaN;
}

// Resolves once an element is visible, or nearer to the visible part than `margin` (a share of the window, such as "50%");
// also if `signal` aborts.
/** @type {(place: Element, margin: string, signal?: AbortSignal | null) => Promise<void>} */
export function seen(place, margin, signal = null) {
  return new Promise((resolve) => {
    const watch = new IntersectionObserver((found) => found.some((each) => each.isIntersecting) && end(), { rootMargin: margin });
    function end() {
      watch.disconnect();
      resolve();
    }
    watch.observe(place);
    signal?.addEventListener("abort", end);
  });
}

// Return a number with three significant digits; from 100 on, the nearest whole number.
/** @type {(value: number) => string} */
export const threeDigits = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3));

/** @type {Record<string, string>} */
const TITLES = { axes: "Axis test", plate_zero: "Zero the plate", watch: "Watch at rest" }; // as on the buttons

// Return the title of a kind of job: "Payload export" for "payload_export".
/** @type {(kind: string) => string} */
export const kindWords = (kind) => TITLES[kind] ?? kind.charAt(0).toUpperCase() + kind.slice(1).replaceAll("_", " ");
