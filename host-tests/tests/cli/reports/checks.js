// What a page must be like; `faults()` lists what it is not, one sentence each.
const tolerance = 1.5;
const name = (element) => `${element.tagName.toLowerCase()} "${(element.textContent || "").trim().slice(0, 40)}"`;
const isShown = (element) => {
  const box = element.getBoundingClientRect();
  return box.width > 0 && box.height > 0 && getComputedStyle(element).visibility !== "hidden";
};
const overlap = (a, b) =>
  Math.min(a.right, b.right) - Math.max(a.left, b.left) > tolerance &&
  Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > tolerance;
const within = (inner, outer) =>
  inner.left >= outer.left - tolerance && inner.right <= outer.right + tolerance &&
  inner.top >= outer.top - tolerance && inner.bottom <= outer.bottom + tolerance;

const pageFaults = () => {
  const found = [];
  const wide = document.documentElement.scrollWidth;
  if (wide > innerWidth) found.push(`the page scrolls sideways: ${wide} pixels in ${innerWidth}`);
  for (const element of document.querySelectorAll("h1,h2,h3,p,dt,dd,li,caption,figcaption,button,summary,pre,figure")) {
    if (!isShown(element) || element.closest(".table")) continue;
    const box = element.getBoundingClientRect();
    if (box.left < -tolerance || box.right > innerWidth + tolerance) found.push(`${name(element)} leaves the page`);
    if (element.scrollWidth > element.clientWidth + tolerance && element.clientWidth > 0) found.push(`${name(element)} is cut`);
  }
  for (const table of document.querySelectorAll(".table")) {
    if (table.scrollWidth > table.clientWidth) found.push(`${name(table)} is cut at the edge`);
    const isListed = table.classList.contains("listed");
    for (const cell of table.querySelectorAll(isListed ? "td" : "th,td")) {
      const heading = getComputedStyle(cell, "::before").content;
      if (isListed && cell.dataset.heading !== "" && (heading === "none" || heading === '""')) found.push(`${name(cell)} does not say what it is`);
      if (cell.scrollWidth > cell.clientWidth + tolerance) found.push(`${name(cell)} is cut`);
    }
  }
  return found;
};

// Numbers of curves, bars and maps that are drawn; a path without length cannot be seen.
const drawn = (plot) => {
  const parts = plot.querySelectorAll(
    ".scatterlayer .js-line, .scatterlayer .point, .scatterlayer .js-fill, .barlayer .point path, .heatmaplayer image",
  );
  return [...parts].filter((part) => !part.getTotalLength || part.getTotalLength() > 0).length;
};

const plotFaults = (plot, figure) => {
  const found = [];
  const where = `figure ${figure.id}, plot ${[...figure.querySelectorAll(".plot")].indexOf(plot) + 1}`;
  if (drawn(plot) === 0) found.push(`${where}: nothing is drawn`);
  for (const axis of ["xtitle", "ytitle"]) {
    const title = plot.querySelector(`.${axis}`);
    const isNamed = axis === "ytitle" && plot.layout.yaxis.tickvals;
    if (!isNamed && !(title && title.textContent.trim())) found.push(`${where}: no ${axis}`);
  }
  const outer = plot.getBoundingClientRect();
  const texts = [...plot.querySelectorAll("svg text")].filter((text) => text.textContent.trim() && isShown(text));
  if (texts.length < 4) found.push(`${where}: the axes have no numbers`);
  const boxes = texts.map((text) => [text, text.getBoundingClientRect()]);
  for (const [text, box] of boxes) {
    if (!within(box, outer)) found.push(`${where}: ${name(text)} is cut off`);
  }
  boxes.forEach(([text, box], index) => {
    for (const [other, second] of boxes.slice(index + 1)) {
      if (overlap(box, second)) found.push(`${where}: ${name(text)} and ${name(other)} overlap`);
    }
  });
  return found;
};

const faults = () => {
  const found = pageFaults();
  for (const figure of document.querySelectorAll("figure")) {
    const parts = [...figure.querySelectorAll("h3,.legend button,.panel,.plot,figcaption")].filter(isShown);
    const boxes = parts.map((part) => [part, part.getBoundingClientRect()]);
    boxes.forEach(([part, box], index) => {
      for (const [other, second] of boxes.slice(index + 1)) {
        if (overlap(box, second)) found.push(`figure ${figure.id}: ${name(part)} and ${name(other)} overlap`);
      }
    });
    const plots = [...figure.querySelectorAll(".plot")];
    if (plots.length === 0) found.push(`figure ${figure.id}: no plot`);
    for (const plot of plots) found.push(...plotFaults(plot, figure));
    if (isShown(figure.querySelector(".still"))) found.push(`figure ${figure.id}: the printed picture is on the screen`);
  }
  return found;
};

const figureAt = (index) => document.querySelectorAll("figure")[index];

// Switches every series of a figure off and on again with the mouse's event; lists those that stay, or do not come back.
const toggleFaults = (index) => {
  const found = [];
  const figure = figureAt(index);
  const plots = [...figure.querySelectorAll(".plot")];
  const count = () => plots.reduce((sum, plot) => sum + drawn(plot), 0);
  const buttons = figure.querySelectorAll("button.series");
  // A map is all that its figure has.
  const isMap = plots.some((plot) => plot.data.some((trace) => trace.type === "heatmap"));
  if (buttons.length === 0 && !isMap) found.push(`${figure.id}: no series can be switched off`);
  for (const button of buttons) {
    const before = count();
    button.click();
    const without = count();
    if (button.getAttribute("aria-pressed") !== "false") found.push(`${figure.id}: ${name(button)} does not say that it is off`);
    if (without >= before) found.push(`${figure.id}: ${name(button)} takes nothing away, ${before} to ${without}`);
    button.click();
    if (count() !== before) found.push(`${figure.id}: ${name(button)} does not come back`);
  }
  return found;
};

// The place of one point of a figure on the screen, with the figure scrolled into view.
const pointOf = (index) => {
  const figure = figureAt(index);
  const plot = figure.querySelector(".plot");
  const trace = plot.data.findIndex((trace) => trace.hoverinfo !== "skip" && trace.x && trace.x.length > 0);
  const { x, y, type } = plot.data[trace];
  plot.scrollIntoView({ block: "center", behavior: "instant" });
  const full = plot._fullLayout;
  const box = plot.getBoundingClientRect();
  const middle = type === "heatmap" ? 0 : Math.floor(x.length / 2);
  const at = (axis, value) => axis._offset + axis.c2p(axis.d2c ? axis.d2c(value) : value);
  const across = type === "heatmap" ? Math.sqrt(x[0] * x[1]) : type === "bar" ? x[middle] * 0.999 : x[middle];
  const up = type === "heatmap" ? (y[0] + y[1]) / 2 : y[middle];
  // What has to be read there: a place of the series. The values of a map are colors, what it says of them stands in its words.
  const values = type === "heatmap" ? [] : [x[middle], y[middle]];
  return { x: box.left + at(full.xaxis, across), y: box.top + at(full.yaxis, up), name: figure.id, values };
};
const said = (index) => {
  const texts = figureAt(index).querySelectorAll(".hoverlayer text");
  return [...texts].map((text) => text.textContent).join(" | ");
};

// Zooms one plot and lists the plots of its figure that do not follow, or do not return.
const zoomFaults = async (index) => {
  const found = [];
  const rest = () => new Promise((done) => setTimeout(done, 120));
  const figure = figureAt(index);
  const plots = [...figure.querySelectorAll(".plot")];
  const first = plots.map((plot) => plot.layout.xaxis.range.slice());
  const [low, high] = first[0];
  const near = [low + 0.3 * (high - low), low + 0.6 * (high - low)];
  await Plotly.relayout(plots[0], { "xaxis.range": near });
  await rest();
  for (const plot of plots.filter((plot) => plot.dataset.x === plots[0].dataset.x)) {
    if (Math.abs(plot.layout.xaxis.range[0] - near[0]) > 1e-6) found.push(`${figure.id}: a plot does not follow`);
    const second = plot.layout.xaxis2;
    const off = second && second.range[1] - second.range[0] - (near[1] - near[0]);
    if (Math.abs(off || 0) > 1e-6) found.push(`${figure.id}: the second axis does not follow`);
  }
  // Upward it reads hertz where the first reads rad/s.
  const inUnits = (axis) => (axis.type === "log" ? axis.range.map((end) => 10 ** end) : axis.range);
  for (const plot of plots.filter((plot) => plot.layout.yaxis2)) {
    const [from, to] = plot.layout.yaxis.range;
    await Plotly.relayout(plot, { "yaxis.range": [from + 0.2 * (to - from), from + 0.7 * (to - from)] });
    await rest();
    const [first, second] = [inUnits(plot.layout.yaxis), inUnits(plot.layout.yaxis2)];
    const isOff = first.some((end, index) => Math.abs(second[index] / end - 1 / (2 * Math.PI)) > 1e-4);
    if (isOff) found.push(`${figure.id}: the second axis upward does not follow`);
  }
  figure.querySelector("button.reset").click();
  await rest();
  plots.forEach((plot, index) => {
    if (Math.abs(plot.layout.xaxis.range[1] - first[index][1]) > 1e-6) found.push(`${figure.id}: a plot does not return`);
  });
  return found;
};

// Sets both cursors of a figure, and lists what its table says otherwise than the curves; a figure whose curves have no common axis of
// numbers has none.
const cursorFaults = async (index) => {
  const found = [];
  const figure = figureAt(index);
  const button = figure.querySelector("button.cursors");
  const plots = [...figure.querySelectorAll(".plot")];
  const isBode = plots.length === 2 && plots.every((plot) => /magnitude|phase/.test(plot.layout.yaxis.title.text));
  if (!button) return isBode ? [`${figure.id}: no cursors`] : [];
  button.click();
  const [a, b] = figure.querySelectorAll(".cursors input");
  for (const [slider, value] of [[a, 400], [b, 600]]) {
    slider.value = value;
    slider.dispatchEvent(new Event("input"));
  }
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)));
  const rows = [...figure.querySelectorAll(".cursors tbody tr")].map((row) => [...row.cells].map((cell) => cell.textContent));
  const axis = plots[0].layout.xaxis;
  const isLog = axis.type === "log";
  const expected = [0.4, 0.6].map((part) => axis.range[0] + part * (axis.range[1] - axis.range[0])).map((at) => (isLog ? 10 ** at : at));
  const isNear = (text, value) => Math.abs(Number(text) - value) <= 1e-3 * Math.max(Math.abs(value), 1e-6);
  if (!isNear(rows[0][1], expected[0]) || !isNear(rows[0][2], expected[1])) found.push(`${figure.id}: cursors at ${rows[0]}, not ${expected}`);
  for (const plot of plots) {
    const lines = plot.querySelectorAll(".shapelayer path");
    const size = plot._fullLayout._size.w;
    const starts = [...lines].map((line) => line.getBBox().x - plot._fullLayout._size.l);
    if (lines.length !== 2 || Math.abs(starts[0] / size - 0.4) > 0.01 || Math.abs(starts[1] / size - 0.6) > 0.01) {
      found.push(`${figure.id}: lines at ${starts} of ${size} pixels`);
    }
  }
  // A model's curve has a point every percent or two: its nearest point is nearly what is read there.
  const readings = rows.filter(([name]) => name.includes(": "));
  if (readings.length === 0) found.push(`${figure.id}: no curve is read`);
  for (const plot of plots) {
    for (const trace of plot.data.filter(({ x, fill, mode }) => mode === "lines" && fill !== "toself" && x.length > 100)) {
      const above = plot.previousElementSibling;
      const title = above && above.matches(".panel") ? `${above.textContent}, ` : "";
      const what = `${trace.name}: ${title}${plot.layout.yaxis.title.text.replaceAll("<br>", " ")}`;
      const row = readings.find(([name]) => name === what);
      const after = trace.x.findIndex((x) => x >= expected[0]);
      if (after < 1 || trace.y[after - 1] === null || trace.y[after] === null) continue;
      const [low, high] = [trace.y[after - 1], trace.y[after]].sort((one, other) => one - other);
      const slack = 1e-3 * Math.max(Math.abs(low), Math.abs(high), 1e-9);
      if (!row || Number(row[1]) < low - slack || Number(row[1]) > high + slack) {
        found.push(`${figure.id}: ${trace.name} is ${row && row[1]} at A, between ${low} and ${high}`);
      }
      if (row && row[2] !== "-" && row[1] !== "-" && Math.abs(row[3] - (row[2] - row[1])) > 1e-3 * (Math.abs(row[1]) + Math.abs(row[2]))) {
        found.push(`${figure.id}: ${row[3]} is not the difference of ${row[2]} and ${row[1]}`);
      }
    }
  }
  found.push(...pageFaults());
  button.click();
  if (isShown(figure.querySelector(".cursors input")) || figure.querySelector(".shapelayer path")) found.push(`${figure.id}: cursors stay`);
  return found;
};

// What a page that is to be printed must be like, as it is laid out for a sheet so many pixels wide.
const printFaults = (width) => {
  const found = [];
  const wide = document.documentElement.scrollWidth;
  if (wide > width) found.push(`the page is ${wide} pixels wide, the sheet ${width}`);
  for (const element of document.querySelectorAll("h1,h2,h3,p,dt,dd,li,caption,th,td,pre,figure,figcaption,.still svg")) {
    const box = element.getBoundingClientRect();
    if (box.width > 0 && (box.left < -tolerance || box.right > width + tolerance)) found.push(`${name(element)} leaves the sheet`);
  }
  const needed = [...document.querySelectorAll("h1, h2, .verdict p, table, figcaption, dt, .warnings li")];
  for (const element of needed.filter((element) => !element.closest(".cursors"))) {
    if (element.textContent.trim() && !isShown(element)) found.push(`${name(element)} is not printed`);
  }
  for (const figure of document.querySelectorAll("figure")) {
    const still = figure.querySelector(".still svg");
    if (!isShown(still)) found.push(`figure ${figure.id} has no picture`);
    const flowing = (element) => element.textContent.replace(/\s+/g, "");
    if (!flowing(still).includes(flowing(figure.querySelector("h3")))) found.push(`figure ${figure.id}: the picture has no title`);
    if (still.querySelectorAll("text").length < 8) found.push(`figure ${figure.id}: the axes have no numbers`);
    if (still.querySelectorAll("path,polyline,circle,line,rect").length < 5) found.push(`figure ${figure.id}: the picture is empty`);
  }
  for (const useless of document.querySelectorAll(".plot, button, nav")) {
    if (isShown(useless)) found.push(`${name(useless)} is printed`);
  }
  return found;
};
