// The plots: uPlot for curves over frequency, a canvas for the admittance circle and the Smith chart.
/* global uPlot */

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const charts = new Map();
const HEIGHT = 230, FONT = "15px system-ui";

const tick = (value) => (value === null ? "" : value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5) ? value.toExponential().replace(/(\.\d\d)\d+/, "$1") : String(Number(value.toPrecision(6))));

// The quantities to draw of an impedance; z has `re` and `im` in ohm.
export function columns(z) {
  const y = z.re.map((re, k) => { const m = re * re + z.im[k] * z.im[k]; return [re / m, -z.im[k] / m]; });
  return {
    size: z.re.map((re, k) => Math.hypot(re, z.im[k])),
    phase: z.re.map((re, k) => (Math.atan2(z.im[k], re) * 180) / Math.PI),
    g: y.map((p) => Math.max(p[0], 1e-12)), b: y.map((p) => p[1]), y: y.map((p) => [p[0] * 1e3, p[1] * 1e3]),
    gamma: z.re.map((re, k) => { // (Z - 50)/(Z + 50)
      const x = z.im[k], m = (re + 50) ** 2 + x * x;
      return [(re * re - 2500 + x * x) / m, (100 * x) / m];
    }),
  };
}

// A curve interpolated linearly to the frequencies `at`; null outside its range.
export function resampled(f, values, at) {
  let k = 0;
  return at.map((x) => {
    while (k < f.length - 2 && f[k + 1] < x) k++;
    if (x < f[0] || x > f.at(-1)) return null;
    const part = (x - f[k]) / (f[k + 1] - f[k]);
    return values[k] + part * (values[k + 1] - values[k]);
  });
}

// A fit's curves at the frequencies of a sweep, with null outside its bands, or null if it has none there: not every
// fitter uses the whole recording, and some combine repeats.
export function overlay(f, curves) {
  const same = curves.find((one) => one.f.length === f.length && one.f[0] === f[0] && one.f.at(-1) === f.at(-1));
  if (same) return columns(same.fitted);
  const parts = curves.filter((one) => one.f[0] < f.at(-1) && one.f.at(-1) > f[0]).sort((a, b) => a.f[0] - b.f[0]).map((one) => ({ f: one.f, ...columns(one.fitted) }));
  if (!parts.length) return null;
  const within = (key) => parts.flatMap((one) => one[key].filter((_, k) => one.f[k] >= f[0] && one.f[k] <= f.at(-1)));
  const over = (key) => parts.map((one) => resampled(one.f, one[key], f)).reduce((all, one) => all.map((value, k) => value ?? one[k]));
  return { size: over("size"), phase: over("phase"), g: over("g"), b: over("b"), y: within("y"), gamma: within("gamma") };
}

function options(width, lines, log) {
  const axis = { stroke: css("--faint"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line") }, font: FONT };
  return {
    width, height: HEIGHT, legend: { show: false }, cursor: { drag: { x: true, y: false } },
    scales: { x: { time: false }, y: log ? { distr: 3 } : {} },
    axes: [{ ...axis, label: "MHz", labelFont: FONT, labelSize: 20 }, { ...axis, size: 84, values: (_, ticks) => ticks.map(tick) }],
    series: [{}, ...lines.map(([name, colour, thick]) => ({ label: name, stroke: css(colour), width: thick, points: { show: false } }))],
  };
}

export function draw(id, x, lines, log = false) {
  const home = document.getElementById(id);
  const width = Math.max(200, home.clientWidth);
  const made = JSON.stringify([width, x.length, x[0], x.at(-1), css("--ink"), lines.map((line) => line.slice(0, 3))]);
  const data = [x, ...lines.map((line) => line[3])], known = charts.get(id);
  if (known?.made === made) {
    known.plot.setData(data, false); // a zoom stays
    known.plot.redraw(true, false);
  } else {
    known?.plot.destroy();
    charts.set(id, { made, plot: new uPlot(options(width, lines, log), data, home) });
  }
  home.dataset.points = String(x.length);
}

export function clear(id) {
  charts.get(id)?.plot.destroy();
  charts.delete(id);
  document.getElementById(id).dataset.points = "0";
}

function paper(id, label) {
  const home = document.getElementById(id);
  const width = Math.max(200, home.clientWidth), pixel = window.devicePixelRatio || 1;
  const canvas = document.createElement("canvas");
  canvas.width = width * pixel; canvas.height = HEIGHT * pixel;
  canvas.style.width = `${width}px`; canvas.style.height = `${HEIGHT}px`;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", label);
  home.replaceChildren(canvas);
  const pen = canvas.getContext("2d");
  pen.scale(pixel, pixel);
  pen.font = FONT; pen.fillStyle = css("--faint"); pen.strokeStyle = css("--line");
  return [pen, width];
}

function trace(pen, sets, at) {
  for (const [colour, thick, points] of sets) {
    pen.beginPath(); pen.strokeStyle = css(colour); pen.lineWidth = thick;
    points.forEach((p, k) => (k ? pen.lineTo(...at(p)) : pen.moveTo(...at(p))));
    pen.stroke();
  }
}

// B over G, both to the same scale.
export function circle(id, sets) {
  const [pen, width] = paper(id, "B over G"), all = sets.flatMap(([, , y]) => y);
  if (!all.length) return;
  const [g0, g1, b0, b1] = [0, 1].flatMap((k) => [Math.min(...all.map((p) => p[k])), Math.max(...all.map((p) => p[k]))]);
  const scale = Math.min((width - 80) / (g1 - g0 || 1), (HEIGHT - 50) / (b1 - b0 || 1));
  const at = ([g, b]) => [60 + (g - g0) * scale, HEIGHT - 28 - (b - b0) * scale];
  pen.strokeRect(60, HEIGHT - 28 - (b1 - b0) * scale, (g1 - g0) * scale, (b1 - b0) * scale);
  const short = (value) => String(Number(value.toPrecision(3)));
  pen.fillText(`G ${short(g0)} … ${short(g1)}`, 60, HEIGHT - 8);
  pen.fillText(short(b1), 4, HEIGHT - 16 - (b1 - b0) * scale);
  pen.fillText("B", 34, HEIGHT - 24 - ((b1 - b0) * scale) / 2);
  pen.fillText(short(b0), 4, HEIGHT - 28);
  trace(pen, sets, at);
}

// Reflection at 50 ohm: circles of constant R and X, and the curves.
export function smith(id, sets) {
  const [pen, width] = paper(id, "Smith chart at 50 ohm"), radius = HEIGHT / 2 - 6;
  const [x0, y0] = [width / 2, HEIGHT / 2], at = ([re, im]) => [x0 + re * radius, y0 - im * radius];
  pen.save();
  pen.beginPath(); pen.arc(x0, y0, radius, 0, 2 * Math.PI); pen.stroke(); pen.clip();
  for (const r of [0.2, 0.5, 1, 2, 5]) { pen.beginPath(); pen.arc(x0 + (radius * r) / (r + 1), y0, radius / (r + 1), 0, 2 * Math.PI); pen.stroke(); }
  for (const x of [0.2, 0.5, 1, 2, 5]) for (const sign of [1, -1]) { pen.beginPath(); pen.arc(x0 + radius, y0 - (sign * radius) / x, radius / x, 0, 2 * Math.PI); pen.stroke(); }
  pen.beginPath(); pen.moveTo(x0 - radius, y0); pen.lineTo(x0 + radius, y0); pen.stroke();
  trace(pen, sets, at);
  pen.restore();
  for (const [text, re] of [["0", -1], ["50 Ω", 0], ["∞", 1]]) pen.fillText(text, at([re, 0])[0] + (re === 1 ? 6 : re ? -16 : 4), y0 - 5);
}
