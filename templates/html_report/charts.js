"use strict";
// Charts draw the results that the page embeds, at the width that they have.
const DATA = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const COLOURS = 8, DASHES = ["", "7 4", "2 3", "9 3 2 3"], MARKS = ["circle", "square", "diamond", "triangle", "cross"];
const tip = document.getElementById("tip");

function element(name, attributes = {}, text = "", space = null) {
  const made = space ? document.createElementNS(space, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  return made;
}
const shape = (name, attributes, text) => element(name, attributes, text, SVG);
const digits = {"-": "⁻", "0": "⁰", "1": "¹", "2": "²", "3": "³", "4": "⁴", "5": "⁵", "6": "⁶", "7": "⁷", "8": "⁸", "9": "⁹"};
const power = exponent => "10" + [...String(exponent)].map(digit => digits[digit]).join("");
const figure = value => value === null ? "–" : value === 0 ? "0" : Math.abs(value) >= 1e-3 && Math.abs(value) < 1e5
  ? String(Number(value.toPrecision(4))) : value.toExponential(2);
const kernels = name => Object.entries(DATA.results).filter(([kernel, of]) => kernel && of[name])
  .map(([kernel, of]) => [kernel, of[name].data]);

// Axes: a scale from values to pixels, with ticks and their labels.
function scale(values, log, from, to) {
  const wide = Math.abs(to - from);
  if (log) {
    let low = Math.log10(Math.min(...values)), high = Math.log10(Math.max(...values));
    if (high - low < 1) { low = (low + high - 1) / 2; high = low + 1; }
    const room = (high - low) * 0.03, ticks = [];
    low -= room; high += room;
    const every = Math.max(1, Math.ceil((high - low) / (wide / 55)));
    for (let k = Math.ceil(low / every) * every; k <= high; k += every) ticks.push([10 ** k, power(k)]);
    if (ticks.length < 3) {
      ticks.length = 0;
      for (let k = Math.floor(low); k <= high; k++) for (const m of [1, 2, 5]) {
        const place = k + Math.log10(m);
        if (place >= low && place <= high) ticks.push([m * 10 ** k, String(Number((m * 10 ** k).toPrecision(2)))]);
      }
    }
    return {ticks, at: value => from + (Math.log10(value) - low) / (high - low) * (to - from)};
  }
  let low = Math.min(0, ...values), high = Math.max(...values);
  if (low === high) high = low + 1;
  const rough = (high - low) / Math.max(2, wide / 90), unit = 10 ** Math.floor(Math.log10(rough));
  const every = unit * [1, 2, 5, 10].find(m => m * unit >= rough), ticks = [];
  for (let k = Math.ceil(low / every); k * every <= high * (1 + 1e-9); k++) ticks.push([k * every, figure(k * every)]);
  return {ticks, at: value => from + (value - low) / (high - low) * (to - from)};
}

function mark(kind, x, y, size, attributes) {
  const s = size;
  const paths = {square: `M${x - s} ${y - s}h${2 * s}v${2 * s}h${-2 * s}z`, diamond: `M${x} ${y - 1.35 * s}L${x + 1.35 * s} ${y}L${x} ${y + 1.35 * s}L${x - 1.35 * s} ${y}z`,
    triangle: `M${x} ${y - 1.3 * s}L${x + 1.3 * s} ${y + s}H${x - 1.3 * s}z`, cross: `M${x - s} ${y - s}L${x + s} ${y + s}M${x - s} ${y + s}L${x + s} ${y - s}`};
  return kind === "circle" ? shape("circle", {cx: x, cy: y, r: s, ...attributes}) : shape("path", {d: paths[kind], ...attributes});
}

function frame(box, title, height, margin, x, y) {
  const width = Math.max(280, box.clientWidth);
  const svg = shape("svg", {viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": title});
  const [left, right, top, bottom] = [margin.left, width - margin.right, margin.top, height - margin.bottom];
  const across = scale(x.values, x.log, left, right), up = y ? scale(y.values, y.log, bottom, top) : null;
  for (const [value, label] of across.ticks) {
    svg.append(shape("line", {class: "grid", x1: across.at(value), x2: across.at(value), y1: top, y2: bottom}));
    svg.append(shape("text", {class: "tick", x: across.at(value), y: bottom + 17, "text-anchor": across.at(value) < 22 ? "start" : across.at(value) > width - 22 ? "end" : "middle"}, label));
  }
  for (const [value, label] of up ? up.ticks : []) {
    svg.append(shape("line", {class: "grid", x1: left, x2: right, y1: up.at(value), y2: up.at(value)}));
    svg.append(shape("text", {class: "tick", x: left - 7, y: up.at(value) + 4, "text-anchor": "end"}, label));
  }
  svg.append(shape("line", {class: "axis", x1: left, x2: right, y1: bottom, y2: bottom}));
  svg.append(shape("text", {class: "label", x: (left + right) / 2, y: height - 6, "text-anchor": "middle"}, x.label));
  if (y) svg.append(shape("text", {class: "label", x: 2, y: 13}, y.label));
  return {svg, across, up, left, right, top, bottom, width};
}

// What the pointer is near: the point of the chart, with its words.
function pointed(plot, points, highlight) {
  const show = event => {
    const bounds = plot.svg.getBoundingClientRect(), ratio = plot.width / bounds.width;
    const px = (event.clientX - bounds.left) * ratio, py = (event.clientY - bounds.top) * ratio;
    let best = null, least = 40;
    for (const point of points) {
      const distance = Math.hypot(point.px - px, point.py - py);
      if (distance < least) { least = distance; best = point; }
    }
    highlight(best);
    if (!best) { tip.hidden = true; return; }
    tip.replaceChildren(...best.words.map((line, k) => element(k ? "div" : "strong", {}, line)));
    tip.hidden = false;
    const size = tip.getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - size.width - 8))}px`;
    tip.style.top = `${event.clientY + 18 + size.height > innerHeight ? event.clientY - size.height - 12 : event.clientY + 18}px`;
  };
  plot.svg.addEventListener("pointermove", show);
  plot.svg.addEventListener("pointerdown", show);
  plot.svg.addEventListener("pointerleave", () => { tip.hidden = true; highlight(null); });
}

// Lines: a legend whose entries turn lines on and off, and labels at the ends of lines where there is room.
function styled(names) {
  if (names.length <= COLOURS) return names.map((name, k) => ({colour: k, dash: "", mark: MARKS[k % MARKS.length]}));
  const groups = [...new Set(names.map(name => name.replace(/-[a-z]*\d.*/, "")))];
  const counts = {};
  return names.map(name => {
    const group = groups.indexOf(name.replace(/-[a-z]*\d.*/, ""));
    counts[group] = (counts[group] ?? -1) + 1;
    return {colour: group % COLOURS, dash: DASHES[group % DASHES.length], mark: MARKS[counts[group] % MARKS.length]};
  });
}
function legend(box, series, hidden, draw) {
  const list = element("div", {class: "legend"});
  const entry = (text, pressed, act, style) => {
    const button = element("button", {type: "button", "aria-pressed": pressed});
    if (style) {
      const key = shape("svg", {width: 26, height: 12, "aria-hidden": "true"});
      if (style.line) key.append(shape("line", {class: `line c${style.colour}`, x1: 0, x2: 26, y1: 6, y2: 6, "stroke-dasharray": style.dash}));
      key.append(mark(style.mark, 13, 6, 3.4, {class: `dot c${style.colour}`}));
      button.append(key);
    }
    button.append(text);
    button.addEventListener("click", () => { act(); draw(); });
    list.append(button);
  };
  for (const one of series) entry(one.name, !hidden.has(one.name), () => hidden.delete(one.name) || hidden.add(one.name), one);
  if (series.length > 3) {
    const all = hidden.size === 0;
    entry(all ? "Hide all" : "Show all", "false", () => { series.forEach(one => all ? hidden.add(one.name) : hidden.delete(one.name)); }, null);
  }
  box.append(list);
}

function lines(box, title, series, x, y) {
  const hidden = new Set(), styles = styled(series.map(one => one.name));
  series.forEach((one, k) => Object.assign(one, styles[k], {line: true}));
  const draw = () => {
    box.replaceChildren();
    const shown = series.filter(one => !hidden.has(one.name) && one.points.length);
    const all = series.flatMap(one => one.points);
    if (!all.length) { box.append(element("p", {class: "none"}, "Nothing is above zero here.")); return; }
    const roomy = box.clientWidth > 700;
    const last = one => one.points.reduce((a, b) => b[0] > a[0] ? b : a);
    const named = new Map();
    for (const one of shown) {
      const key = last(one).map(value => value.toPrecision(3)).join();
      named.set(key, [...(named.get(key) || []), one]);
    }
    const labels = [...named.values()].map(several => ({text: several.map(one => one.name).join(", "), of: several[0]}));
    const right = roomy ? Math.min(270, 24 + 6.5 * Math.max(0, ...labels.map(label => label.text.length))) : 14;
    const plot = frame(box, title, roomy ? 420 : 330, {left: 54, right, top: 26, bottom: 46},
      {values: all.map(p => p[0]), ...x}, {values: all.map(p => p[1]), ...y});
    const points = [], groups = new Map();
    for (const one of shown) {
      const group = shape("g"), at = one.points.map(p => [plot.across.at(p[0]), plot.up.at(p[1])]);
      group.append(shape("path", {class: `line c${one.colour}`, "stroke-dasharray": one.dash, d: "M" + at.map(p => `${p[0].toFixed(1)} ${p[1].toFixed(1)}`).join("L")}));
      if (at.length < 30) at.forEach(p => group.append(mark(one.mark, p[0], p[1], 3.2, {class: `dot c${one.colour}`})));
      one.points.forEach((p, k) => points.push({px: at[k][0], py: at[k][1], of: one.name, words: [one.name, `${x.name} ${figure(p[0])} ${x.unit}`, `${y.name} ${figure(p[1])} ${y.unit}`, ...(one.words || [])]}));
      groups.set(one.name, group);
      plot.svg.append(group);
    }
    if (roomy) {
      const ends = labels.map(({text, of}) => {
        const from = [plot.across.at(last(of)[0]), plot.up.at(last(of)[1])];
        return {text, from, y: from[1]};
      }).sort((a, b) => a.y - b.y);
      ends.forEach((end, k) => { end.y = Math.max(end.y, k ? ends[k - 1].y + 14 : plot.top); });
      for (let k = ends.length - 1, most = plot.bottom; k >= 0; k--, most = ends[k + 1].y - 14) ends[k].y = Math.min(ends[k].y, most);
      for (const end of ends) {
        plot.svg.append(shape("path", {class: "leader", d: `M${end.from[0] + 3} ${end.from[1]}L${plot.right + 12} ${end.y}`}));
        plot.svg.append(shape("text", {class: "end", x: plot.right + 15, y: end.y + 4}, end.text));
      }
    }
    pointed(plot, points, best => groups.forEach((group, name) => group.classList.toggle("faint", best !== null && best.of !== name)));
    box.append(plot.svg);
    if (series.length > 1) legend(box, series, hidden, draw);
  };
  return draw;
}

// Dots in rows: how far each back end is from exact arithmetic, and its certified bound.
function rows(box, title) {
  const results = kernels("compare"), names = [...new Set(results.flatMap(([, data]) => data.map(row => row.backend)))], hidden = new Set();
  const series = names.map((name, k) => ({name, colour: k % COLOURS, mark: MARKS[k % MARKS.length], line: false}));
  const draw = () => {
    box.replaceChildren();
    const roomy = box.clientWidth > 700, height = roomy ? 26 : 40;
    const all = results.flatMap(([, data]) => data.flatMap(row => [row.max_abs_rad, row.bound_rad])).filter(value => value > 0);
    if (!all.length) { box.append(element("p", {class: "none"}, "All back ends agree with exact arithmetic here.")); return; }
    const plot = frame(box, title, results.length * height + 70, {left: roomy ? 190 : 10, right: 14, top: 14, bottom: 46},
      {values: all, log: true, label: "largest angle from exact arithmetic, rad"}, null);
    const points = [];
    results.forEach(([kernel, data], k) => {
      const py = plot.top + (k + 0.5) * height + (roomy ? 0 : 8);
      plot.svg.append(shape("line", {class: "grid", x1: plot.left, x2: plot.right, y1: py, y2: py}));
      plot.svg.append(shape("text", {class: "row", x: roomy ? plot.left - 10 : plot.left, y: roomy ? py + 4 : py - 11, "text-anchor": roomy ? "end" : "start"}, kernel));
      for (const one of series.filter(one => !hidden.has(one.name))) {
        const row = data.find(other => other.backend === one.name);
        if (!row) continue;
        const words = [`${kernel}, ${one.name}`, `largest angle ${figure(row.max_abs_rad)} rad`, `rms ${figure(row.rms_rad)} rad`];
        if (row.bound_rad !== null) words.push(`certified bound ${figure(row.bound_rad)} rad`);
        if (row.bound_rad > 0 && row.max_abs_rad > 0) {
          plot.svg.append(shape("line", {class: `span c${one.colour}`, x1: plot.across.at(row.max_abs_rad), x2: plot.across.at(row.bound_rad), y1: py, y2: py}));
          plot.svg.append(shape("path", {class: `bar c${one.colour}`, d: `M${plot.across.at(row.bound_rad)} ${py - 6}v12`}));
          points.push({px: plot.across.at(row.bound_rad), py, words});
        }
        if (row.max_abs_rad > 0) {
          plot.svg.append(mark(one.mark, plot.across.at(row.max_abs_rad), py, 4.2, {class: `dot c${one.colour}`}));
          points.push({px: plot.across.at(row.max_abs_rad), py, words});
        }
      }
    });
    pointed(plot, points, () => {});
    box.append(plot.svg);
    legend(box, series, hidden, draw);
  };
  return draw;
}

// Cost against drift: all algorithms, the front, and those of this page.
function cloud(box, title) {
  const result = DATA.results[""].frontier.data, front = new Set(DATA.front);
  const all = result.algorithms.map(one => ({...one, drift: one.drift_deg_h[DATA.motion]})).filter(one => one.drift > 0 && one.multiply_per_sample > 0);
  return () => {
    box.replaceChildren();
    if (!all.length) { box.append(element("p", {class: "none"}, "No algorithm drifts on this motion.")); return; }
    const roomy = box.clientWidth > 700;
    const plot = frame(box, title, roomy ? 460 : 360, {left: 54, right: 20, top: 26, bottom: 46},
      {values: all.map(one => one.multiply_per_sample), log: true, label: "multiplications for each sample"},
      {values: all.map(one => one.drift), log: true, label: "drift, deg/h"});
    const at = one => [plot.across.at(one.multiply_per_sample), plot.up.at(one.drift)];
    const stairs = DATA.front.map(name => all.find(one => one.algorithm === name)).filter(Boolean).map(at);
    plot.svg.append(shape("path", {class: "front", d: stairs.map((p, k) => k ? `H${p[0]}V${p[1]}` : `M${p[0]} ${p[1]}`).join("") + (stairs.length ? `H${plot.right}` : "")}));
    const points = [], labels = [];
    for (const one of [...all].sort((a, b) => (a.algorithm in DATA.chosen) - (b.algorithm in DATA.chosen))) {
      const [px, py] = at(one), chosen = DATA.chosen[one.algorithm];
      plot.svg.append(mark(chosen ? "diamond" : "circle", px, py, chosen ? 5.5 : 4, {class: chosen ? "dot chosen" : front.has(one.algorithm) ? "dot onfront" : "dot other"}));
      points.push({px, py, words: [one.algorithm, one.title, ...(chosen ? [`on this page: ${chosen.join(", ")}`] : []), `${figure(one.multiply_per_sample)} multiplications, ${figure(one.add_per_sample)} additions`, `drift ${figure(one.drift)} deg/h`]});
      if (chosen || (roomy && front.has(one.algorithm))) labels.push({px, py, text: one.algorithm, chosen});
    }
    const taken = points.map(p => ({x: p.px - 5, y: p.py - 5, w: 10, h: 10}));
    for (const label of labels.sort((a, b) => Boolean(b.chosen) - Boolean(a.chosen))) {
      const w = label.text.length * 6.6 + 4, h = 13;
      const places = [[9, -5, 0], [9, 13, 0], [-9, -5, 1], [-9, 13, 1], [9, -18, 0], [-9, 26, 1], [9, 26, 0]];
      for (const [dx, dy, end] of places) {
        const spot = {x: label.px + dx - (end ? w : 0), y: label.py + dy - 11, w, h};
        if (spot.x < plot.left || spot.x + w > plot.width - 2 || spot.y < 16 || spot.y + h > plot.bottom) continue;
        if (taken.some(other => spot.x < other.x + other.w && other.x < spot.x + w && spot.y < other.y + other.h && other.y < spot.y + h)) continue;
        taken.push(spot);
        plot.svg.append(shape("text", {class: label.chosen ? "name strong" : "name", x: end ? spot.x + w : spot.x, y: label.py + dy, "text-anchor": end ? "end" : "start"}, label.text));
        break;
      }
    }
    pointed(plot, points, () => {});
    box.append(plot.svg);
  };
}

const norm = vector => Math.hypot(...vector);
const MAKERS = {
  drift: (box, title) => lines(box, title, kernels("simulate").map(([name, run]) => ({name, points: run.time_s.map((t, k) => [t, norm(run.drift_deg[k])]).filter(p => p[1] > 0)})),
    {label: "time, s", name: "time", unit: "s", log: false}, {label: "drift, deg", name: "drift", unit: "deg", log: true}),
  converge: (box, title) => lines(box, title, kernels("converge").map(([name, [ladder]]) => ({name, points: ladder.rungs.filter(rung => rung.error_rad > 0).map(rung => [rung.step_s, rung.error_rad]),
    words: [`observed order ${figure(ladder.observed_order)}, predicted ${figure(ladder.predicted_order)}`]})),
    {label: "step, s", name: "step", unit: "s", log: true}, {label: "largest error, rad", name: "error", unit: "rad", log: true}),
  compare: rows,
  frontier: cloud,
};
const charts = [...document.querySelectorAll("[data-chart]")].map(box => ({box, draw: MAKERS[box.dataset.chart](box, box.dataset.title), width: 0}));
const redraw = () => { for (const chart of charts) if (chart.box.clientWidth !== chart.width) { chart.width = chart.box.clientWidth; chart.draw(); } };
redraw();
addEventListener("resize", redraw);
