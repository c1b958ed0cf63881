// Shows what is wrong or doubtful with an entry directly below its field.

// Show an error below a field until the entry is changed, move the focus there, and return the error for the caller.
export function refuseField(input, text) {
  note(input, "problem", text);
  input.setAttribute("aria-invalid", "true");
  input.closest("details")?.setAttribute("open", "");
  input.focus();
  input.addEventListener("input", () => acceptField(input), { once: true });
  return Object.assign(new Error(text), { isShown: true });
}

export function acceptField(input) {
  note(input, "problem", "");
  input.removeAttribute("aria-invalid");
}

// Show a doubt about an entry, which does not prevent its use; an empty text removes it.
export const doubtField = (input, text) => note(input, "doubt", text);

function note(input, kind, text) {
  const id = `${input.id || input.name}-${kind}`;
  const place = input.closest("label") ?? input.parentElement;
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
