"use strict";
(async () => {
  // What is drawn, in the order of the page: JSON that is compressed. A browser that cannot read it shows the pictures.
  const plots = async () => {
    const packed = document.getElementById("plots");
    if (!packed || !window.DecompressionStream) return [];
    const bytes = Uint8Array.from(atob(packed.textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"))).json();
  };
  const drawn = await plots();
  if (drawn.length) drawFigures(document, drawn);
  listTables(document);
  addEventListener("resize", () => listTables(document));
  document.documentElement.dataset.drawn = "true";
})();
