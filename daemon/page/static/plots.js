// The curves: uPlot for what goes over frequency, a canvas for the admittance circle.
/* global uPlot */

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const charts = new Map();

const tick = (value) => (value === null ? "" : value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5) ? value.toExponential().replace(/(\.\d\d)\d+/, "$1") : String(Number(value.toPrecision(6))));

function options(width, lines, log) {
  const axis = { stroke: css("--faint"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line") }, font: "15px system-ui" };
  return {
    width, height: 230, legend: { show: false }, cursor: { drag: { x: true, y: false } },
    scales: { x: { time: false }, y: log ? { distr: 3 } : {} },
    axes: [{ ...axis, label: "MHz", labelFont: "15px system-ui", labelSize: 20 }, { ...axis, size: 84, values: (_, ticks) => ticks.map(tick) }],
    series: [{}, ...lines.map(([name, colour, thick]) => ({ label: name, stroke: css(colour), width: thick, points: { show: false } }))],
  };
}

export function draw(id, x, lines, log = false) {
  const home = document.getElementById(id);
  const width = Math.max(200, home.clientWidth);
  charts.get(id)?.destroy();
  const plot = new uPlot(options(width, lines, log), [x, ...lines.map((line) => line[3])], home);
  charts.set(id, plot);
  home.dataset.points = String(x.length);
}

export function clear(id) {
  charts.get(id)?.destroy();
  charts.delete(id);
  document.getElementById(id).dataset.points = "0";
}

export function circle(id, sets) {
  const home = document.getElementById(id);
  const width = Math.max(200, home.clientWidth), height = 230, pixel = window.devicePixelRatio || 1;
  const canvas = document.createElement("canvas");
  canvas.width = width * pixel; canvas.height = height * pixel;
  canvas.style.width = `${width}px`; canvas.style.height = `${height}px`;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "B over G");
  home.replaceChildren(canvas);
  const all = sets.flatMap(([, , y]) => y);
  if (!all.length) return;
  const [g0, g1, b0, b1] = [0, 1].flatMap((k) => [Math.min(...all.map((p) => p[k])), Math.max(...all.map((p) => p[k]))]);
  const scale = Math.min((width - 80) / (g1 - g0 || 1), (height - 50) / (b1 - b0 || 1));
  const at = ([g, b]) => [60 + (g - g0) * scale, height - 28 - (b - b0) * scale];
  const pen = canvas.getContext("2d");
  pen.scale(pixel, pixel);
  pen.font = "15px system-ui"; pen.fillStyle = css("--faint"); pen.strokeStyle = css("--line");
  pen.strokeRect(60, height - 28 - (b1 - b0) * scale, (g1 - g0) * scale, (b1 - b0) * scale);
  pen.fillText(`G ${g0.toPrecision(2)} … ${g1.toPrecision(3)}`, 60, height - 8);
  pen.fillText(b1.toPrecision(3), 4, height - 16 - (b1 - b0) * scale);
  pen.fillText(b0.toPrecision(3), 4, height - 28);
  for (const [colour, thick, y] of sets) {
    pen.beginPath(); pen.strokeStyle = css(colour); pen.lineWidth = thick;
    y.forEach((p, k) => (k ? pen.lineTo(...at(p)) : pen.moveTo(...at(p))));
    pen.stroke();
  }
}
