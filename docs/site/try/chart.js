// Draws the drift on coning over frequency, both in equal ratios, as SVG in the colours of the page.
"use strict";

const DEGREES_AN_HOUR = (180 / Math.PI) * 3600;
const DECADES = 12; // as many powers of ten as the drift's axis has at most

const svg = (name, attributes = {}, text = "") => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  return element;
};

/** Writes a number with two digits, and a power of ten where it is far from one. */
function number(value) {
  if (value === 0) return "0";
  if (value >= 0.01 && value < 10000) return String(Number(value.toPrecision(2)));
  const [digits, power] = value.toExponential(1).split("e");
  return `${digits}·10${superscript(Number(power))}`;
}
const superscript = (power) => [...String(power)].map((sign) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign] ?? "⁻").join("");
const power = (exponent) => (exponent >= -2 && exponent <= 3 ? String(Number(`1e${exponent}`)) : `10${superscript(exponent)}`);

/** Returns the points of a curve, [Hz, degrees an hour], for a half-angle in degrees and a time between samples in s. */
function points(ratios, drifts, angle, sampling) {
  const scale = ((angle * Math.PI) / 180) ** 2 / sampling;
  return ratios.map((ratio, k) => [ratio / sampling, drifts[k] * scale * DEGREES_AN_HOUR]);
}

/** Draws curves, {name, points, style}, into a box, and returns a function that marks the point of a number. */
function drawChart(box, curves) {
  const width = Math.max(box.clientWidth, 260);
  const height = Math.round(Math.min(440, Math.max(260, width * 0.55)));
  const edge = { left: 62, right: 14, top: 12, bottom: 46 };
  const every = curves.flatMap((curve) => curve.points);
  const positive = every.filter(([, y]) => y > 0);
  const xs = every.map(([x]) => Math.log10(x));
  const ys = positive.map(([, y]) => Math.log10(y));
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const highest = Math.ceil(Math.max(...ys));
  const lowest = Math.max(Math.floor(Math.min(...ys)), highest - DECADES);
  const x = (value) => edge.left + ((Math.log10(value) - left) / (right - left)) * (width - edge.left - edge.right);
  const y = (value) => edge.top + ((highest - Math.log10(value)) / (highest - lowest)) * (height - edge.top - edge.bottom);
  const bottom = height - edge.bottom;

  const label = `Drift by coning frequency. ${curves.map(summary).join(" ")}`;
  const picture = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
  const stride = Math.ceil((highest - lowest) / (height / 34));
  for (let k = lowest; k <= highest; k += 1) {
    if ((highest - k) % stride) continue;
    const place = y(10 ** k);
    picture.append(svg("line", { class: "grid", x1: edge.left, x2: width - edge.right, y1: place, y2: place }));
    picture.append(svg("text", { x: edge.left - 8, y: place + 4, "text-anchor": "end" }, power(k)));
  }
  const steps = width > 560 ? [1, 2, 5] : [1];
  for (let k = Math.floor(left); k <= right; k += 1) {
    for (const step of steps) {
      const value = step * 10 ** k;
      if (value < 10 ** left || value > 10 ** right) continue;
      const place = x(value);
      picture.append(svg("line", { class: "grid", x1: place, x2: place, y1: edge.top, y2: bottom }));
      picture.append(svg("text", { x: place, y: bottom + 18, "text-anchor": "middle" }, step === 1 ? power(k) : number(value)));
    }
  }
  picture.append(svg("text", { x: (edge.left + width - edge.right) / 2, y: height - 8, "text-anchor": "middle" }, "coning frequency in Hz"));
  const middle = (edge.top + bottom) / 2;
  picture.append(svg("text", { x: 14, y: middle, "text-anchor": "middle", transform: `rotate(-90 14 ${middle})` }, "drift in °/h"));
  for (const curve of curves) {
    const shown = curve.points.filter(([, value]) => value >= 10 ** lowest);
    const path = shown.map(([a, b], k) => `${k ? "L" : "M"}${x(a).toFixed(1)} ${y(b).toFixed(1)}`).join("");
    picture.append(svg("path", { class: `curve ${curve.style}`, d: path }));
  }
  const line = svg("line", { class: "mark", y1: edge.top, y2: bottom });
  const dot = svg("circle", { class: "mark", r: 4.5 });
  picture.append(line, dot);
  box.replaceChildren(picture);

  const main = curves[0].points;
  const mark = (k) => {
    const [a, b] = main[k];
    const inside = b >= 10 ** lowest;
    dot.style.display = inside ? "" : "none";
    if (inside) dot.setAttribute("cy", y(b));
    dot.setAttribute("cx", x(a));
    line.setAttribute("x1", x(a));
    line.setAttribute("x2", x(a));
  };
  const nearest = (event) => {
    const place = event.clientX - picture.getBoundingClientRect().left;
    const share = (place - edge.left) / (width - edge.left - edge.right);
    return Math.round(Math.min(1, Math.max(0, share)) * (main.length - 1));
  };
  return { picture, mark, nearest };
}

/** Says in words where a curve runs. */
function summary(curve) {
  const [first, last] = [curve.points[0], curve.points[curve.points.length - 1]];
  return `${curve.name}: ${number(first[1])} degrees an hour at ${number(first[0])} hertz, ${number(last[1])} at ${number(last[0])} hertz.`;
}
