// The stack to scale with the places of the findings marked, and the history of one constant; both as SVG.

import { withUncertainty } from "./numbers.js";

const NS = "http://www.w3.org/2000/svg";
const SMALLEST = 0.07; // smallest share of the width, so that a glue line of 10 µm is visible beside a disk of 0.5 mm

function make(name, attributes, text) {
  const node = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

// The place of each of the `findings` is marked in the stack and named below it.
export function stack(home, build, step, findings) {
  const marked = findings.map((finding) => finding.where);
  const present = build.steps.find((one) => one.name === step)?.layers ?? build.layers.map((layer) => layer.name);
  const layers = build.layers.filter((layer) => present.includes(layer.name));
  const total = layers.reduce((sum, layer) => sum + layer.thickness, 0);
  const wide = layers.map((layer) => Math.max(layer.thickness / total, SMALLEST));
  const sum = wide.reduce((a, b) => a + b, 0);
  const svg = make("svg", { viewBox: `0 0 400 ${176 + 20 * findings.length}`, role: "img",
    "aria-label": `layers back to front: ${present.join(", ")}${marked.length ? `; mismatch at ${marked.join(", ")}` : ""}` });
  let x = 10;
  const front = {};
  layers.forEach((layer, k) => {
    const w = (380 * wide[k]) / sum, bad = marked.includes(`layer:${layer.name}`);
    svg.append(make("rect", { x, y: 8, width: w, height: 130, fill: bad ? "var(--warn)" : `var(--${layer.kind})`, stroke: "var(--faint)", class: bad ? "marked" : "" }));
    const middle = x + w / 2;
    svg.append(make("text", { x: middle, y: 73, "text-anchor": "middle", "dominant-baseline": "middle", "font-size": 15, transform: `rotate(-90 ${middle} 73)` }, `${layer.name} ${(layer.thickness * 1e6).toPrecision(3)} µm`));
    if (layer.poling) svg.append(make("text", { x: middle, y: 130, "text-anchor": "middle", "font-size": 15 }, layer.poling));
    x += w;
    front[layer.name] = x;
  });
  for (const where of marked) {
    const at = where === "face:back" ? 10 : where === "face:front" ? x : where.startsWith("interface:") ? front[where.slice(10).split("|")[0]] : undefined;
    if (at !== undefined) svg.append(make("line", { x1: at, x2: at, y1: 0, y2: 146, stroke: "var(--warn)", "stroke-width": 7, class: "marked" }));
    if (where === "terminals" || where === "sweep") wires(svg);
  }
  svg.append(make("text", { x: 10, y: 162, "font-size": 15 }, `back: ${build.back}`));
  svg.append(make("text", { x: 390, y: 162, "font-size": 15, "text-anchor": "end" }, `front: ${build.front}`));
  findings.forEach((finding, k) => svg.append(make("text", { x: 10, y: 186 + 20 * k, "font-size": 15, "font-weight": 700 }, `▲ ${finding.effect}: ${finding.where}`)));
  home.replaceChildren(svg);
}

// The leads from disk to analyzer, marked.
function wires(svg) {
  svg.append(make("path", { d: "M190 138 v12 h20 v-12", fill: "none", stroke: "var(--warn)", "stroke-width": 6, class: "marked" }));
}

const short = (value) => withUncertainty(Number(value.toPrecision(4)), 0);

export function history(home, points) {
  const svg = make("svg", { viewBox: "0 0 480 210", role: "img", "aria-label": "history of the constant" });
  if (points.length) {
    const low = Math.min(...points.map((p) => p.re - (p.u ?? 0))), high = Math.max(...points.map((p) => p.re + (p.u ?? 0)));
    const span = high - low || Math.abs(high) || 1;
    const y = (value) => 150 - (130 * (value - low)) / span;
    const x = (k) => 80 + (370 * (k + 0.5)) / points.length;
    points.forEach((p, k) => {
      svg.append(make("line", { x1: x(k), x2: x(k), y1: y(p.re - (p.u ?? 0)), y2: y(p.re + (p.u ?? 0)), stroke: "var(--phase)", "stroke-width": 3 }));
      const dot = make("circle", { cx: x(k), cy: y(p.re), r: 6, fill: "var(--phase)" });
      dot.append(make("title", {}, `${p.sample} ${p.step}: ${p.re}`));
      svg.append(dot);
      if (points.length < 9) svg.append(make("text", { x: x(k), y: 178, "font-size": 15, "text-anchor": "middle" }, p.step));
      if (points.length < 9 && (k === 0 || points[k - 1].sample !== p.sample)) svg.append(make("text", { x: x(k), y: 200, "font-size": 15 , "text-anchor": "middle"}, p.sample));
    });
    svg.append(make("text", { x: 4, y: 26, "font-size": 15 }, short(high)));
    svg.append(make("text", { x: 4, y: 152, "font-size": 15 }, short(low)));
    const unit = points[0].unit === "1" ? "" : points[0].unit;
    svg.append(make("text", { x: 4, y: 89, "font-size": 15 }, unit));
  }
  home.replaceChildren(svg);
}
