// Shows errors and warnings directly below the field of an entry.

// Show an error below a field until the entry is changed, move the focus there, and return the error for the caller.
/** @type {(input: Control, text: string) => Error & { isShown: true }} */
export function refuseField(input, text) {
  note(input, "problem", text);
  input.setAttribute("aria-invalid", "true");
  input.closest("details")?.setAttribute("open", "");
  input.focus();
  input.addEventListener("input", () => acceptField(input), { once: true });
  return Object.assign(new Error(text), { isShown: /** @type {const} */ (true) });
}

/** @type {(input: Control) => void} */
function acceptField(input) {
  note(input, "problem", "");
  input.removeAttribute("aria-invalid");
}

// Show a warning below a field; the entry can still be used. An empty text removes the warning.
/** @type {(input: Control, text: string) => void} */
export const doubtField = (input, text) => note(input, "doubt", text);

/** @type {(input: Control, kind: "problem" | "doubt", text: string) => void} */
function note(input, kind, text) {
  const id = `${input.id || input.name}-${kind}`;
  const place = /** @type {HTMLElement} */ (input.closest("label") ?? input.parentElement);
  let shown = document.getElementById(id);
  if (!shown && text) {
    shown = document.createElement("span");
    shown.id = id;
    shown.className = kind;
    shown.setAttribute("role", "alert");
    place.append(shown);
    input.setAttribute("aria-describedby", `${input.getAttribute("aria-describedby") ?? ""} ${id}`.trim());
  }
  if (shown) shown.textContent = text;
}
