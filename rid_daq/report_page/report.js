
// Replaces the drawings of a report by interactive figures, each when it becomes visible.
// Printed pages, and browsers without JavaScript, show the drawings.

async function decompress(element) {
  const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

// Return the drawings of a figure, one above the other, as one SVG file with its own colours.
function joinDrawings(still, colours) {
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const whole = document.createElementNS(NAMESPACE, "svg");
  let [width, height] = [0, 0];
  for (const drawing of still.querySelectorAll("svg")) {
    const part = drawing.cloneNode(true);
    const { width: partWidth, height: partHeight } = drawing.viewBox.baseVal;
    for (const [name, value] of Object.entries({ x: 0, y: height, width: partWidth, height: partHeight })) part.setAttribute(name, value);
    whole.append(part);
    width = Math.max(width, partWidth);
    height += partHeight;
  }
  whole.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const text = new XMLSerializer().serializeToString(whole);
  return text.replace(/var\(--(\w+)\)/g, (_, name) => colours[name]);
}

function show(plot) {
  const packed = document.querySelector(`script[data-item="${plot.dataset.plot}"]`);
  showFigure(plot.querySelector(".live"), {
    item: async () => JSON.parse(await decompress(packed)),
    svg: (colours) => joinDrawings(plot.querySelector(".still"), colours),
  });
}

if ("DecompressionStream" in globalThis) {
  const seen = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        seen.unobserve(target);
        show(target);
      }
    },
    { rootMargin: "400px" },
  );
  for (const plot of document.querySelectorAll("[data-plot]")) seen.observe(plot);
}
