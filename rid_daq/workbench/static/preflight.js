// The newest preflight: by device, red first, each with what to do.
import { duration, element } from "./dom.js";
import { ask, page } from "./service.js";

const GREEN = ["ok", "shown"];

// Show the preflight; resolves with its lines, where there is one.
export async function loadPreflight(section, words) {
  let found;
  try {
    found = await ask("GET", `/cells/${encodeURIComponent(page.cell)}/preflight`);
  } catch (error) {
    words.textContent = error.message;
    return;
  }
  if (found === null) {
    words.textContent = "This cell was not checked yet. Next: Check.";
    section.replaceChildren();
    return;
  }
  const age = found.age_s === null ? "before the service was started" : `${duration(found.age_s)} ago`;
  const red = found.lines.filter((line) => !GREEN.includes(line.verdict));
  const count = `${found.lines.length} lines, ${red.length} red`;
  const voided = found.void_because ? ` It does not count: ${found.void_because}` : "";
  words.textContent = `${found.passed ? "Green" : "Red"}: ${count}, ${age}.${voided} ${found.problem ?? ""}`;
  words.className = `verdict ${found.passed && !found.void_because ? "good" : "bad"}`;
  const devices = Map.groupBy ? Map.groupBy(found.lines, (line) => line.where) : grouped(found.lines);
  const parts = [...devices].map(([where, lines]) => device(where, lines));
  parts.sort((a, b) => b.red - a.red);
  section.replaceChildren(...parts.map((part) => part.shown));
  return found.lines;
}

function grouped(lines) {
  const found = new Map();
  for (const line of lines) found.set(line.where, [...(found.get(line.where) ?? []), line]);
  return found;
}

function device(where, lines) {
  const bad = (line) => !GREEN.includes(line.verdict);
  const sorted = [...lines.filter(bad), ...lines.filter((line) => !bad(line))];
  const red = lines.filter(bad).length;
  const warm = lines.find((line) => line.what.includes("temperature"));
  const head = `${where}: ${red ? `${red} red of ${lines.length}` : `green, ${lines.length}`}`;
  const summary = element("summary", { class: red ? "bad" : "" }, warm ? `${head}; ${warm.found} °C` : head);
  const row = (line) =>
    element(
      "tr",
      { class: bad(line) ? "red" : null },
      element("td", {}, bad(line) ? "✗ red" : line.verdict === "ok" ? "✓ ok" : "·"),
      element("td", {}, line.what, bad(line) && line.next_action ? element("p", {}, `Next: ${line.next_action}`) : null),
      element("td", {}, line.required),
      element("td", {}, line.found),
    );
  const heads = ["", "what", "required", "found"].map((text) =>
    text ? element("th", { scope: "col" }, text) : element("th", { scope: "col" }, element("span", { class: "hidden" }, "verdict")),
  );
  const shown = element(
    "details",
    { class: "card device", open: red > 0 },
    summary,
    element(
      "div",
      { class: "scroll", tabindex: "0", role: "group", "aria-label": where },
      element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...sorted.map(row))),
    ),
  );
  return { red, shown };
}
