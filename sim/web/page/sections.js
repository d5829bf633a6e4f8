// Sections of a report as the engine gives them: their HTML, and the figures in it when they come into view.

import { element } from "./element.js";

// The library for figures is loaded while the first log is read.
const loaded = new Promise((resolve) => {
  if (document.readyState === "complete") resolve();
  else addEventListener("load", resolve, { once: true });
});

const undrawn = new Map();
const drawn = new WeakSet();
const inView = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) if (isIntersecting) draw(target);
}, { rootMargin: "600px" });

async function draw(host) {
  await loaded;
  const plots = undrawn.get(host);
  if (!plots || !host.isConnected) return;
  undrawn.delete(host);
  inView.unobserve(host);
  drawFigures(host, plots);
  drawn.add(host);
}

/** Shows a section in an element. Where the same figures stand in it already they are drawn anew as they are: zoomed, with cursors. */
export function showSection(host, { html, plots }) {
  const fresh = element("div", { innerHTML: html });
  if (drawn.has(host) && shape(host) === shape(fresh)) {
    texts(host).forEach((text, place) => replaceText(text, texts(fresh)[place]));
    drawFigures.update(host, plots);
  } else {
    host.replaceChildren(...fresh.childNodes);
    drawn.delete(host);
    undrawn.set(host, plots);
    if (plots.length) inView.observe(host);
  }
  listTables(host);
}

/** An element with a section in it. */
export function sectionOf(section) {
  const host = element("div", { className: "part" });
  showSection(host, section);
  return host;
}

/** What is in a figure, by which it can be drawn anew. */
function shape(root) {
  const figures = [...root.querySelectorAll("figure")].map((figure) => [
    figure.id,
    figure.querySelectorAll("button.series").length,
    ...[...figure.querySelectorAll(".plot")].map((plot) => plot.dataset.x),
  ]);
  return JSON.stringify([texts(root).map(({ tagName }) => tagName), figures]);
}

/** All that is no figure, in its order, and the words of figures and their legends. */
function texts(root) {
  return [...root.querySelectorAll(":scope > section > :not(figure), figure > h3, figure > .panel, figure > figcaption, button.series")];
}

function replaceText(old, fresh) {
  if (old.innerHTML !== fresh.innerHTML) old.innerHTML = fresh.innerHTML;
  if (fresh.dataset.series) old.dataset.series = fresh.dataset.series;
}

/** Fits what stands in an element to its width, which may have changed while it was out of the page. */
export function refit(root) {
  for (const plot of root.querySelectorAll(".plot.js-plotly-plot")) Plotly.Plots.resize(plot);
  listTables(root);
}

/** Lets go of what is not drawn in an element that is shown no more. */
export function forget(root) {
  for (const host of [...undrawn.keys()]) {
    if (!root.contains(host)) continue;
    undrawn.delete(host);
    inView.unobserve(host);
  }
}

addEventListener("resize", () => listTables(document));
// Paper has its own width, and shows what was not looked at yet.
const SHEET = 680;
addEventListener("beforeprint", async () => {
  await Promise.all([...undrawn.keys()].map(draw));
  for (const plot of document.querySelectorAll(".plot.js-plotly-plot")) Plotly.relayout(plot, { width: SHEET });
});
addEventListener("afterprint", () => {
  for (const plot of document.querySelectorAll(".plot.js-plotly-plot")) Plotly.relayout(plot, { width: null, autosize: true });
});
