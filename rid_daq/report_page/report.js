
// Replaces the drawings of a report by interactive figures, each when it becomes visible.
// Printed pages, and browsers without JavaScript, show the drawings.

/** @type {(element: Element) => Promise<string>} */
async function decompress(element) {
  const bytes = Uint8Array.from(atob(element.textContent ?? ""), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

// Return the drawings of a figure, one above the other, as one SVG file with its own colours.
/** @type {(still: Element, colours: Record<string, string>) => string} */
function joinDrawings(still, colours) {
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const whole = document.createElementNS(NAMESPACE, "svg");
  let [width, height] = [0, 0];
  for (const drawing of still.querySelectorAll("svg")) {
    const part = /** @type {SVGSVGElement} */ (drawing.cloneNode(true));
    const { width: partWidth, height: partHeight } = drawing.viewBox.baseVal;
    for (const [name, value] of Object.entries({ x: 0, y: height, width: partWidth, height: partHeight })) part.setAttribute(name, String(value));
    whole.append(part);
    width = Math.max(width, partWidth);
    height += partHeight;
  }
  whole.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const text = new XMLSerializer().serializeToString(whole);
  return text.replace(/var\(--(\w+)\)/g, (_, name) => colours[name]);
}

/** @type {(plot: HTMLElement) => void} */
function show(plot) {
  const packed = /** @type {Element} */ (document.querySelector(`script[data-item="${plot.dataset.plot}"]`));
  showFigure(/** @type {HTMLElement} */ (plot.querySelector(".live")), {
    item: async () => JSON.parse(await decompress(packed)),
    svg: (colours) => joinDrawings(/** @type {Element} */ (plot.querySelector(".still")), colours),
  });
}

if ("DecompressionStream" in globalThis) {
  const seen = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        seen.unobserve(target);
        show(/** @type {HTMLElement} */ (target));
      }
    },
    { rootMargin: "400px" },
  );
  for (const plot of document.querySelectorAll("[data-plot]")) seen.observe(plot);
}
