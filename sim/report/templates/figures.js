"use strict";
// Tables that are wider than their place become lists.
const listTables = (root) => {
  for (const holder of root.querySelectorAll(".table")) {
    holder.classList.remove("listed");
    holder.classList.toggle("listed", holder.scrollWidth > holder.clientWidth);
  }
};
// Draws plots, as data, in the figures of an element in their order, with their legends and cursors. `drawFigures.update` draws others in
// the same figures: what is hidden, zoomed or read at a cursor stays so.
const drawFigures = (() => {
  // Along a logarithmic axis 1, 2 and 5 of each decade are named in full, or the ones alone, or what suits a close view.
  const ticks = (range, narrow) => {
    const [low, high] = [Math.min(...range), Math.max(...range)];
    if (high - low < 0.7) return { tickmode: "auto" };
    if (high - low > (narrow ? 1.6 : 4)) return { tickmode: "linear", tick0: 0, dtick: narrow && high - low > 4 ? 2 : 1 };
    const tickvals = [];
    for (let decade = Math.floor(low); decade <= high; decade += 1) {
      for (const part of [1, 2, 5]) {
        const at = decade + Math.log10(part);
        if (at >= low - 1e-9 && at <= high + 1e-9) tickvals.push(Number(`${part}e${decade}`));
      }
    }
    return { tickmode: "array", tickvals, ticktext: tickvals.map(String) };
  };
  // A title in as many lines as it needs along so many pixels, about equally long.
  const broken = (text, pixels, size) => {
    const within = (most) => {
      const lines = [""];
      for (const word of text.split(" ")) {
        const last = lines[lines.length - 1];
        if (last && last.length + 1 + word.length > most) lines.push(word);
        else lines[lines.length - 1] = last ? `${last} ${word}` : word;
      }
      return lines;
    };
    let most = Math.max(12, Math.floor(pixels / (0.56 * size)));
    const { length } = within(most);
    while (most > 1 && within(most - 1).length === length) most -= 1;
    return within(most).join("<br>");
  };
  // A long name in two lines, broken at the space or underscore that is nearest to its middle.
  const folded = (name) => {
    const places = [...name].flatMap((letter, index) => (letter === " " || letter === "_" ? [index + 1] : []));
    if (name.length <= 18 || places.length === 0) return name;
    const off = (place) => Math.abs(place - name.length / 2);
    const at = places.reduce((best, place) => (off(place) < off(best) ? place : best));
    return `${name.slice(0, at)}<br>${name.slice(at)}`;
  };
  // Narrow screens have room for fewer numbers along an axis, and for their names in less width.
  const fit = (layout, width) => {
    // Numbers without letters and without a sign between thousands.
    layout.separators = ".";
    for (const axis of [layout.xaxis, layout.xaxis2, layout.yaxis, layout.yaxis2]) {
      if (axis) axis.exponentformat = "none";
      if (axis && axis.type === "log") Object.assign(axis, ticks(axis.range, width < 520));
    }
    if (width < 520) {
      layout.font = { ...layout.font, size: 11 };
      layout.margin = { ...layout.margin, l: 46, r: layout.yaxis2 ? 46 : 10 };
      for (const axis of [layout.xaxis, layout.xaxis2]) if (axis && axis.type === "linear" && !axis.tickvals) axis.nticks = 5;
    }
    if (width < 520 && layout.yaxis.ticktext) {
      const { ticktext } = layout.yaxis;
      layout.yaxis.ticktext = ticktext.map(folded);
      if (layout.yaxis.ticktext.some((name, index) => name !== ticktext[index])) layout.height += 14 * ticktext.length;
    }
    const { r, t, b } = layout.margin;
    // Names along an axis take their room from what is drawn.
    const names = (layout.yaxis.ticktext || []).flatMap((name) => name.split("<br>")).map((line) => line.length);
    const l = Math.max(layout.margin.l, 0.6 * layout.font.size * Math.max(0, ...names) + 24);
    const [across, upward] = [width - l - r, layout.height - t - b];
    for (const [name, pixels] of Object.entries({ xaxis: across, xaxis2: across, yaxis: upward, yaxis2: upward })) {
      const title = layout[name] && layout[name].title;
      if (!title) continue;
      title.text = broken(title.text, 0.95 * pixels, layout.font.size + 2);
      // Room between an upright name and the numbers.
      if (name.startsWith("yaxis")) title.standoff = 8;
    }
    if (matchMedia("(pointer: coarse)").matches) layout.dragmode = false;
    return layout;
  };
  const axes = (plot) => [plot.layout.xaxis.range.slice(), plot.layout.yaxis.range.slice()];
  const shown = (plot, name, range) => {
    const update = { [`${name}.range`]: range.slice() };
    if (plot.layout[name].type === "log") {
      for (const [key, value] of Object.entries(ticks(range, plot.clientWidth < 520))) update[`${name}.${key}`] = value;
    }
    return update;
  };
  // A second axis reads the same places in another unit: farther along a logarithmic axis, and times a factor along an even one.
  const beside = (first, second) => {
    if (first.type === "log") {
      const beyond = second.range[0] - first.range[0];
      return (end) => end + beyond;
    }
    const factor = (second.range[1] - second.range[0]) / (first.range[1] - first.range[0]);
    return (end) => end * factor;
  };
  const moved = (plot, name, range) => ({
    ...shown(plot, name, range),
    ...(plot.beside[name] ? shown(plot, `${name}2`, range.map(plot.beside[name])) : {}),
  });
  const apart = (a, b) => Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) > 1e-9 * Math.abs(a[1] - a[0]);
  const isOff = (plot, name, range) => {
    const second = plot.beside[name] && range.map(plot.beside[name]);
    return apart(range, plot.layout[name].range) || (second && apart(second, plot.layout[`${name}2`].range));
  };

  // A number as a screen shows it.
  const read = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(4))) : "-");
  // A curve at a place between its points, along a logarithmic axis by the logarithm; nothing beyond its ends.
  const valueAt = ({ x, y }, at, scale) => {
    const after = x.findIndex((place) => place >= at);
    if (after < 0 || (after === 0 && x[0] > at)) return NaN;
    if (x[after] === at || after === 0) return y[after] ?? NaN;
    const [low, high] = [y[after - 1], y[after]];
    if (low === null || high === null) return NaN;
    const part = (scale(at) - scale(x[after - 1])) / (scale(x[after]) - scale(x[after - 1]));
    return low + part * (high - low);
  };
  const element = (name, properties, ...children) => {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  };
  // What sets a plot apart from the others of its figure.
  const titles = ({ previousElementSibling: above }) => (above && above.matches(".panel") ? [above.textContent] : []);
  // Two upright lines across the plots of a figure, and a table of what its curves are there. Says how to draw both anew.
  const cursors = (figure, plots) => {
    const button = figure.querySelector("button.cursors");
    const { type, title } = plots[0].layout.xaxis;
    const curves = () => plots.flatMap((plot) => plot.data
      .filter((trace) => trace.mode && trace.fill !== "toself" && trace.x.length > 2 && !trace.xaxis && !trace.yaxis)
      .map((trace) => ({ trace, what: [...titles(plot), plot.layout.yaxis.title.text.replaceAll("<br>", " ")].join(", ") })));
    const drawn = curves();
    const rises = drawn.every(({ trace: { x } }) => x.every((place, index) => index === 0 || place >= x[index - 1]));
    if (!drawn.length || !rises || plots.some((plot) => plot.dataset.x !== plots[0].dataset.x)) {
      button.remove();
      return () => {};
    }
    const isLog = type === "log";
    const [scale, place] = isLog ? [Math.log10, (part) => 10 ** part] : [(value) => value, (value) => value];
    const second = plots[0].layout.xaxis2;
    const factor = second && isLog ? 10 ** (second.range[0] - plots[0].layout.xaxis.range[0]) : 1;
    const what = title.text.replaceAll("<br>", " ");
    const unit = what.split(", ").pop();
    // Parts of what is in view, so that they are finer in a close one.
    const places = () => {
      const [from, to] = plots[0].layout.xaxis.range;
      return sliders.map((slider) => place(from + (slider.value / 1000) * (to - from)));
    };
    const rows = element("tbody");
    const headings = ["curve", "at A", "at B", "B - A"];
    const row = (kind, ...texts) => element("tr", {}, ...texts.map((text, column) => {
      const cell = element(kind, { textContent: text, className: column ? "number" : "" });
      cell.dataset.heading = headings[column];
      return cell;
    }));
    const table = element("table", {}, element("thead", {}, row("th", ...headings)), rows);
    const draw = () => {
      const isOn = button.getAttribute("aria-pressed") === "true";
      panel.hidden = !isOn;
      const at = isOn ? places() : [];
      const shapes = at.map((x, index) => ({
        type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1,
        line: { color: "#808080", width: 1.5, dash: index ? "dot" : "solid" },
        label: { text: "AB"[index], textposition: "end", textangle: 0, xanchor: "left", yanchor: "top" },
      }));
      for (const plot of plots) Plotly.relayout(plot, { shapes });
      if (!isOn) return;
      const [a, b] = at;
      sliders.forEach((slider, index) => slider.setAttribute("aria-valuetext", `${read(at[index])} ${unit}`));
      const between = isLog ? `${read(b - a)} (${read(b / a)} times)` : read(b - a);
      const beside = factor === 1 ? [] : [row("td", second.title.text.replaceAll("<br>", " "), read(a * factor), read(b * factor), read((b - a) * factor))];
      const shown = curves().filter(({ trace }) => trace.visible !== false).map(({ trace, what: y }) => {
        const [from, to] = at.map((x) => valueAt(trace, x, scale));
        return row("td", `${trace.name}: ${y}`, read(from), read(to), read(to - from));
      });
      rows.replaceChildren(row("td", what, read(a), read(b), between), ...beside, ...shown);
      listTables(panel);
    };
    const sliders = [350, 650].map((value, index) => {
      const slider = element("input", { type: "range", min: 0, max: 1000, step: 1, ariaLabel: `Cursor ${"AB"[index]}` });
      slider.value = value;
      let waits = false;
      slider.addEventListener("input", () => {
        if (waits) return;
        waits = true;
        requestAnimationFrame(() => { waits = false; draw(); });
      });
      return slider;
    });
    const labeled = sliders.map((slider, index) => element("label", {}, `Cursor ${"AB"[index]} `, slider));
    const panel = element("div", { className: "cursors", hidden: true }, ...labeled, element("div", { className: "table" }, table));
    plots[plots.length - 1].after(panel);
    button.addEventListener("click", () => {
      button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
      draw();
    });
    return () => { if (!panel.hidden) draw(); };
  };

  // What a plot is drawn with: its spec fitted to the width that it has.
  const fitted = (plot, spec) => {
    const { place, factor } = spec.beside || {};
    for (const trace of spec.data) if (place) trace.customdata = trace[place].map((value) => value * factor);
    const layout = fit(spec.layout, plot.clientWidth);
    plot.style.height = `${layout.height}px`;
    return layout;
  };
  // Which second axes a plot has.
  const seconds = (plot) => {
    plot.beside = {};
    for (const name of ["xaxis", "yaxis"]) {
      const second = plot.layout[`${name}2`];
      if (second) plot.beside[name] = beside(plot.layout[name], second);
    }
  };
  // One above the other, what is at the same place of an axis stands at the same place of the page.
  const align = (plots) => {
    const room = (side) => Math.max(...plots.map((plot) => plot._fullLayout._size[side]));
    const margins = { "margin.l": room("l"), "margin.r": room("r") };
    const isOut = ({ _fullLayout: { _size: size } }) => size.l < margins["margin.l"] || size.r < margins["margin.r"];
    if (plots.some(isOut)) for (const plot of plots) Plotly.relayout(plot, margins);
  };

  // The plots of a figure, the ranges that they were drawn with, and what draws its cursors anew.
  const figures = new WeakMap();
  const drawFigure = (figure, specs) => {
    const plots = [...figure.querySelectorAll(".plot")];
    const first = new Map();
    let busy = false;
    for (const plot of plots) {
      const spec = specs.shift();
      Plotly.newPlot(plot, spec.data, fitted(plot, spec), spec.config);
      first.set(plot, axes(plot));
      seconds(plot);
    }
    const redraw = cursors(figure, plots);
    figures.set(figure, { plots, first, redraw });
    align(plots);
    for (const plot of plots) {
      plot.on("plotly_relayout", (change) => {
        if (busy) return;
        busy = true;
        const x = plot.layout.xaxis.range;
        Promise.all(plots.map((other) => {
          const y = other.layout.yaxis.range;
          const follows = other.dataset.x === plot.dataset.x && isOff(other, "xaxis", x);
          const update = {
            ...(follows ? moved(other, "xaxis", x) : {}),
            ...(isOff(other, "yaxis", y) ? moved(other, "yaxis", y) : {}),
          };
          return Object.keys(update).length ? Plotly.relayout(other, update) : null;
        })).finally(() => {
          busy = false;
          if (Object.keys(change).some((key) => key.startsWith("xaxis"))) redraw();
        });
      });
    }
    for (const button of figure.querySelectorAll("button.series")) {
      button.addEventListener("click", () => {
        const shown = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(shown));
        for (const plot of plots) {
          const traces = plot.data.flatMap((trace, index) => (trace.legendgroup === button.dataset.series ? [index] : []));
          if (traces.length) Plotly.restyle(plot, { visible: shown }, traces);
        }
        redraw();
      });
    }
    figure.querySelector("button.reset").addEventListener("click", () => {
      for (const plot of plots) {
        const [x, y] = first.get(plot);
        Plotly.relayout(plot, { ...moved(plot, "xaxis", x), ...moved(plot, "yaxis", y) });
      }
    });
    const touch = figure.querySelector("button.touch");
    touch.addEventListener("click", () => {
      const zooms = touch.getAttribute("aria-pressed") !== "true";
      touch.setAttribute("aria-pressed", String(zooms));
      for (const plot of plots) Plotly.relayout(plot, { dragmode: zooms ? "zoom" : false });
    });
  };
  const updateFigure = (figure, specs) => {
    const { plots, first, redraw } = figures.get(figure);
    const off = [...figure.querySelectorAll('button.series[aria-pressed="false"]')].map((button) => button.dataset.series);
    for (const plot of plots) {
      const spec = specs.shift();
      for (const trace of spec.data) if (off.includes(trace.legendgroup)) trace.visible = false;
      const layout = fitted(plot, spec);
      const { margin, dragmode, shapes } = plot.layout;
      Object.assign(layout, { margin: { ...layout.margin, l: margin.l, r: margin.r }, dragmode, shapes });
      const zoomed = ["xaxis", "yaxis"].filter((name, index) => apart(plot.layout[name].range, first.get(plot)[index]));
      const ranges = zoomed.map((name) => [name, plot.layout[name].range.slice()]);
      first.set(plot, [layout.xaxis.range.slice(), layout.yaxis.range.slice()]);
      Plotly.react(plot, spec.data, layout, spec.config);
      seconds(plot);
      for (const [name, range] of ranges) Plotly.relayout(plot, moved(plot, name, range));
    }
    align(plots);
    redraw();
  };

  // What was drawn in an element, which is let go where other figures took its place.
  const plotsIn = new WeakMap();
  const draw = (root, specs) => {
    const rest = [...specs];
    for (const plot of plotsIn.get(root) ?? []) if (!root.contains(plot)) Plotly.purge(plot);
    for (const figure of root.querySelectorAll("figure")) drawFigure(figure, rest);
    plotsIn.set(root, [...root.querySelectorAll(".plot")]);
  };
  draw.update = (root, specs) => {
    const rest = [...specs];
    for (const figure of root.querySelectorAll("figure")) updateFigure(figure, rest);
  };
  return draw;
})();
