
// Replaces the drawings of a report by interactive figures, each when it becomes visible.
// Printed pages, and browsers without JavaScript, show the drawings.

const darkOf = new Map(Object.entries(JSON.parse(document.getElementById("plot-dark").textContent)));
let library;

async function decompress(element) {
  const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

async function load() {
  const script = document.createElement("script");
  script.textContent = await decompress(document.getElementById("plot-library"));
  document.head.append(script);
}

function toDark(value) {
  if (typeof value === "string") return darkOf.get(value) ?? value;
  if (Array.isArray(value)) return value.map(toDark);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, child]) => [key, toDark(child)]));
}

function show(plot) {
  const packed = document.querySelector(`script[data-item="${plot.dataset.plot}"]`);
  showFigure(plot.querySelector(".live"), {
    async item(isDark) {
      library ??= load();
      await library;
      const item = JSON.parse(await decompress(packed));
      return isDark ? toDark(item) : item;
    },
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
