// The page's view and the actions of its buttons. Everything from outside is set as text, never as markup.

import { follow, wire } from "./byhand.js";
import { showChange } from "./change.js";
import { circle, clear, columns, draw, overlay, resampled, smith } from "./plots.js";
import { history, stack } from "./sketch.js";
import { complexWithUncertainty, withUncertainty } from "./numbers.js";
import { rested, working } from "./working.js";

const $ = (id) => document.getElementById(id);
const view = { build: null, step: null, sample: null, measurement: null, sweeps: [], fits: [], fit: null, diagnosis: null, segment: 0, running: null, samples: [], kept: null, compared: null, withdrawn: [] };

function element(tag, text, properties = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, properties);
}

async function ask(path, body) {
  const answer = await fetch(path, body === undefined ? {} : { method: "POST", body: JSON.stringify(body) });
  const found = await answer.json().catch(() => ({ error: answer.statusText }));
  if (!answer.ok) throw new Error(found.error);
  return found;
}

async function command(path, body) {
  $("problem").textContent = "";
  try { await ask(path, body); } catch (error) { $("problem").textContent = error.message; }
}

// What is typed under "Note with the next measurement"; the mass belongs to one measurement only.
function notes() {
  const metadata = {}, number = (id) => Number($(id).value.trim().replace(",", "."));
  for (const key of ["operator", "batch", "barcode"]) if ($(`note-${key}`).value.trim()) metadata[key] = $(`note-${key}`).value.trim();
  if ($("note-temperature_C").value.trim()) metadata.temperature_C = number("note-temperature_C");
  for (const pair of $("note-more").value.split(",").filter((one) => one.includes("="))) {
    const [key, ...rest] = pair.split("="), value = rest.join("=").trim();
    metadata[key.trim()] = value !== "" && Number.isFinite(Number(value)) ? Number(value) : value;
  }
  return { metadata, ...($("note-mass").value.trim() ? { mass_g: { value: number("note-mass"), u: number("note-mass-u") } } : {}) };
}

async function measure(step) {
  await command("/api/measure", { step, ...notes() });
  if (!$("problem").textContent) $("note-mass").value = "";
}

// ---- the view

function showSegments() {
  $("segments").replaceChildren(...view.sweeps.map((sweep, k) => {
    const label = `${(sweep.f[0] / 1e6).toPrecision(3)}–${(sweep.f.at(-1) / 1e6).toPrecision(3)} MHz`;
    const tab = element("button", label, { type: "button", onclick: () => { view.segment = k; showCurves(); showKept(); } });
    tab.setAttribute("aria-pressed", String(k === view.segment));
    return tab;
  }));
}

function showCurves() {
  showSegments();
  const sweep = view.sweeps[view.segment];
  if (!sweep) return;
  const x = sweep.f.map((f) => f / 1e6), measured = columns(sweep.z), fitted = overlay(sweep.f, view.fit?.curves ?? []);
  const other = keptAt(sweep.f);
  for (const [id, part, log] of [["plot-z", "size", true], ["plot-phase", "phase"], ["plot-g", "g", true], ["plot-b", "b"]]) {
    const lines = [["measured", "--measured", 4, measured[part]]];
    if (other) lines.push(["kept", "--good", 2, resampled(other.f, other[part], sweep.f)]);
    if (fitted) lines.push(["fitted", "--fitted", 1.5, fitted[part]]);
    draw(id, x, lines, log);
  }
  for (const [id, part, show] of [["plot-circle", "y", circle], ["plot-smith", "gamma", smith]]) {
    show(id, [["--measured", 4, measured[part]], ...(other ? [["--good", 2, other[part]]] : []), ...(fitted ? [["--fitted", 1.5, fitted[part]]] : [])]);
  }
  if (!fitted) { clear("plot-residual"); return; }
  const turn = fitted.phase.map((p, k) => { const d = p - measured.phase[k]; return p === null ? null : ((d - 360 * Math.round(d / 360)) * Math.PI) / 180; });
  const size = fitted.size.map((m, k) => (m === null ? null : Math.log(m / measured.size[k])));
  draw("plot-residual", x, [["magnitude", "--fitted", 1, size], ["phase", "--phase", 1, turn]]);
}

// The sweep of the kept measurement that shares most of this band.
function keptAt(f) {
  const best = keptFor(f);
  return best ? { f: best.f, ...columns(best.z) } : null;
}

function keptFor(f) {
  const shared = (one) => Math.min(one.f.at(-1), f.at(-1)) - Math.max(one.f[0], f[0]);
  const best = [...(view.kept?.sweeps ?? [])].sort((a, b) => shared(b) - shared(a))[0];
  return best && shared(best) > 0 ? best : null;
}

// Ask what changed from the kept sweep to this one; the answer belongs to this pair alone.
async function compareKept() {
  const sweep = view.sweeps[view.segment], before = keptFor(sweep.f);
  const pair = pairShown();
  view.compared = { pair };
  $("problem").textContent = "";
  showKept();
  try {
    const found = await ask("/api/compare", {
      before: { measurement: view.kept.measurement, segment: view.kept.sweeps.indexOf(before) + 1 },
      after: { measurement: view.measurement, segment: view.segment + 1 },
    });
    if (view.compared?.pair === pair) view.compared.found = found;
  } catch (error) {
    view.compared = null;
    $("problem").textContent = error.message;
  }
  showKept();
}

function pairShown() {
  const sweep = view.sweeps[view.segment], before = sweep && keptFor(sweep.f);
  return before && view.kept.measurement !== view.measurement ? `${view.kept.measurement}/${before.id} ${view.measurement}/${sweep.id}` : null;
}

function showKept() {
  $("keep").disabled = !view.sweeps.length;
  $("keep").textContent = view.kept ? "Stop comparing" : "Keep for comparison";
  $("kept-key").hidden = !view.kept;
  $("kept-name").textContent = view.kept?.name ?? "";
  const pair = pairShown(), known = pair && view.compared?.pair === pair ? view.compared : null;
  $("compare").hidden = !pair;
  $("compare").disabled = Boolean(known);
  $("compare").textContent = known && !known.found ? "comparing …" : "What changed?";
  showChange(known?.found ?? null);
}

function showStack() {
  stack($("stack"), view.build, view.step, view.diagnosis?.findings ?? []);
}

function showFit() {
  const fit = view.fit, body = $("constants").tBodies[0];
  $("diagnose").disabled = !view.measurement || view.diagnosing === view.measurement;
  if (view.diagnosing !== view.measurement) rested("diagnosing");
  $("fitter").textContent = fit ? `fitter ${fit.fitter}, ${fit.seconds.toFixed(2)} s` : "";
  $("chi2").textContent = fit ? `χ²/dof ${fit.chi2_per_dof?.toPrecision(3) ?? "–"}` : "no fit yet";
  const judged = fit?.verdict, limitsOf = (name) => (judged?.limits ?? []).filter((one) => one.constant.replace(/\.im$/, "") === name);
  $("noted").textContent = Object.entries(view.metadata ?? {}).map(([key, value]) => `${key} ${value}`).join(", ");
  $("verdict").hidden = !judged;
  Object.assign($("verdict"), { textContent: judged ? `limits: ${judged.verdict}` : "", className: `verdict ${judged?.verdict ?? ""}` });
  $("chi2").className = `big ${!fit ? "" : fit.chi2_per_dof < 1.5 ? "good" : "bad"}`;
  const found = view.diagnosis?.findings?.length > 0;
  const agrees = found ? "This fit agrees with the recording to within the noise: it has what the diagnosis has found, or its constants absorb it." : "Model and recording agree to within the noise.";
  const meaning = !fit ? [] : [fit.chi2_per_dof < 1.5 ? agrees : "The recording shows an effect that the model lacks."];
  const words = [...view.withdrawn, ...meaning, ...(fit?.says ?? []), ...(view.diagnosis?.says ?? []), ...(judged?.limits ?? []).filter((one) => one.says).map((one) => `${one.constant}: ${one.says}`)];
  $("words").replaceChildren(...words.map((word) => element("p", word)));
  const derived = Object.entries(fit?.derived ?? {}).filter(([name]) => limitsOf(name).length);
  body.replaceChildren(...[...Object.entries(fit?.constants ?? {}), ...derived].map(([name, c]) => {
    const row = element("tr", "", { className: c.free ? "" : "held" }), sheet = view.build.sheet[name];
    const known = !fit.undetermined.includes(name), compared = known && c.free;
    const percent = compared && sheet?.re ? ` (${(Math.round(1000 * (c.re / sheet.re - 1)) / 10 || 0).toFixed(1)} %)` : "";
    const far = compared && sheet && Math.abs(c.re - sheet.re) > 2 * Math.hypot(c.u_re ?? 0, sheet.u);
    row.append(element("td", name), element("td", known ? complexWithUncertainty(c) : "not determined"), element("td", c.unit),
      element("td", sheet ? complexWithUncertainty(sheet) + percent : "", { className: far ? "off" : "" }), limitsCell(limitsOf(name)));
    return row;
  }));
}

function limitsCell(of) {
  const worst = ["fail", "undecided", "pass"].find((verdict) => of.some((one) => one.verdict === verdict)) ?? "";
  const range = (one) => [one.min === null ? "" : `≥ ${withUncertainty(one.min)}`, one.max === null ? "" : `≤ ${withUncertainty(one.max)}`].join(" ").trim();
  return element("td", of.map((one) => `${range(one)}: ${one.verdict}`).join("; "), { className: worst });
}

// One button for each fitter that answered, if there are several; that of a manual fit names the person.
function showFits() {
  const whose = view.fits.length > 1 ? view.fits : [];
  $("fits").replaceChildren(...whose.map((fit) => {
    const one = element("button", fit.chosen ? `${byHand(fit)} · ${fit.chosen.by}` : fit.fitter, { type: "button", onclick: () => { view.fit = fit; showAll(); } });
    one.setAttribute("aria-pressed", String(fit === view.fit));
    return one;
  }));
}

const byHand = (fit) => ((fit.chosen.model ?? "mason") === "mason" ? fit.fitter : `${fit.fitter} (${fit.chosen.model})`);

function showControls() {
  const steps = view.build.steps.map((step) => step.name);
  $("steps").replaceChildren(...steps.map((step) => {
    const button = element("button", step, { type: "button", disabled: Boolean(view.running), onclick: () => measure(step) });
    button.setAttribute("aria-pressed", String(step === view.step));
    return button;
  }));
  const next = nextStep();
  $("next").textContent = next ? `Measure ${next}` : "All steps measured";
  $("next").disabled = Boolean(view.running) || !next;
  $("stop").disabled = !view.running;
}

function nextStep() {
  const steps = view.build.steps.map((step) => step.name), done = view.samples.find((one) => one.name === view.build.name)?.steps ?? [];
  return steps.find((step) => !done.some((one) => one.step === step));
}

function showDownloads() {
  const links = view.sweeps.map((_, k) => element("a", `sweep ${k + 1} (CSV)`, { href: `/download/${view.measurement}/${k + 1}.csv` }));
  if (view.sample) links.push(element("a", "report (PDF)", { href: `/pdf/${encodeURIComponent(view.sample)}`, target: "_blank" }));
  if (view.sample) links.push(element("a", "report", { href: `/report/${encodeURIComponent(view.sample)}`, target: "_blank" }));
  $("downloads").replaceChildren("Download: ", ...links.flatMap((link, k) => (k ? [" · ", link] : [link])));
}

function showHistory() {
  const names = [...new Set(view.samples.flatMap((one) => one.steps.flatMap((step) => Object.keys(step.constants))))];
  const kept = $("which").value || "disk.c33D";
  $("which").replaceChildren(...names.map((name) => element("option", name, { value: name, selected: name === kept })));
  const chosen = $("which").value;
  history($("history"), view.samples.flatMap((one) => one.steps.filter((step) => step.constants[chosen]).map((step) => ({ sample: one.name, step: step.step, ...step.constants[chosen] }))));
  $("samples").replaceChildren(...view.samples.flatMap((one) => one.steps.map((step) => {
    const item = document.createElement("li");
    item.append(element("button", `${one.name} · ${step.step} · ${step.time.slice(0, 16).replace("T", " ")} UTC`, { type: "button", className: step.verdict?.verdict ?? "", onclick: () => open(one.name, step.step) }));
    return item;
  })));
}

function showAll() {
  $("sample").textContent = view.sample ?? view.build.name;
  $("when").textContent = view.sweeps[0] ? `recorded ${view.sweeps[0].time.slice(0, 19).replace("T", " ")} UTC` : "";
  for (const show of [showControls, showStack, showFit, showFits, showCurves, showKept, showDownloads]) show();
  follow(view);
}

function showDaemon(daemon) {
  $("daemon-light").className = `light ${daemon.there ? "on" : "off"}`;
  $("instrument-light").className = `light ${daemon.instrument ? "on" : "off"}`;
  $("device").textContent = daemon.there ? `${daemon.instrument} at ${daemon.resource}` : daemon.says ?? "no daemon";
  view.running = daemon.measuring ?? null;
  say(daemon.there ? (view.running ? `measuring ${daemon.step}` : "ready") : "no daemon");
}

// A user with the right to read only sees no command buttons; a name known to the server is used for manual fits.
function showUser(user) {
  document.body.classList.toggle("looks-only", user.right !== "act");
  if (user.name) Object.assign($("hand-by"), { value: user.name, readOnly: true });
}

function say(text, fraction = 0, left = "") {
  $("state").textContent = text; $("progress").value = fraction; $("left").textContent = left;
}

// Milliseconds from the time of a sweep's event until it is on the screen.
function painted(time) {
  requestAnimationFrame(() => setTimeout(() => { document.body.dataset.lag = String(Date.now() - Date.parse(time)); }));
}

// ---- events and actions

function diagnosed() {
  view.diagnosing = null;
  rested("diagnosing");
  $("diagnose").disabled = !view.measurement;
}

let opened = 0; // the record asked for last is the one shown, whichever answer comes last

async function open(sample, step) {
  const mine = ++opened;
  const record = await ask(`/api/record/${encodeURIComponent(sample)}`);
  const one = record.steps.find((found) => found.step === step) ?? record.steps.at(-1);
  if (mine !== opened) return;
  Object.assign(view, { build: record.build, sample, step: one.step, measurement: one.measurement, sweeps: one.sweeps, segment: 0, diagnosis: one.diagnosis, metadata: one.metadata, fits: one.fits, fit: one.fits[0] ?? null, withdrawn: record.withdrawn });
  showAll();
}

async function refresh() {
  view.samples = (await ask("/api/history")).samples;
  showHistory();
  if (view.build) showControls();
}

async function begin() {
  const now = await ask("/api/now");
  showDaemon(now.daemon);
  showUser(now.user);
  view.build ??= now.build;
  await refresh();
  const known = view.samples.find((one) => one.name === now.build.name);
  if (!view.measurement && !opened && known) await open(known.name); else showAll();
}

// A fit's event comes without the build's limits; its record has the verdict.
async function judge(measurement, fitter) {
  const record = await ask(`/api/record/${measurement}`);
  const verdict = record.steps[0].fits.find((one) => one.fitter === fitter)?.verdict;
  const fit = view.fits.find((one) => one.fitter === fitter);
  if (fit && measurement === view.measurement) { fit.verdict = verdict; showFit(); }
}

async function showChart() {
  $("problem").textContent = "";
  const name = encodeURIComponent($("which").value);
  try {
    const chart = await ask(`/chart/${name}.json`);
    const says = chart.left.length ? `Out of control at ${chart.left.join(", ")}.` : "In control.";
    const capable = chart.capability ? ` Cpk ${chart.capability.cpk.toFixed(2)}, Ppk ${chart.capability.ppk.toFixed(2)}.` : "";
    const picture = element("img", "", { src: `/chart/${name}?${Date.now()}`, alt: `control charts of ${$("which").value}` });
    $("chart-place").replaceChildren(element("p", says + capable, { className: chart.left.length ? "fail" : "pass" }), picture);
  } catch (error) { $("chart-place").replaceChildren(element("p", error.message)); }
}

const heard = {
  daemon: (event) => (event.there ? begin() : showDaemon(event)),
  missing: (event) => { $("problem").textContent = event.says; },
  progress: (event) => { view.running = event.measurement; say(`measuring ${event.sample.step}`, event.fraction, `${event.what}, ${Math.ceil(event.seconds_left)} s left`); showControls(); },
  state: (event) => {
    if (event.state === "backup-failed") $("problem").textContent = `Backup ${event.says}`;
    if (!event.measurement) return;
    const ended = ["measured", "measured-aside", "failed", "cancelled", "abandoned", "withdrawn"].includes(event.state);
    view.running = ended ? null : event.measurement;
    say(ended ? `${event.sample.step} ${event.state}` : `${event.state} ${event.sample.step}`, event.state === "measured" ? 1 : 0, event.state === "measured" ? "" : event.says);
    if (event.state === "failed") $("problem").textContent = event.says;
    if (ended) refresh(); else showControls();
  },
  sweep: (event) => {
    if (event.decides) return; // a further measurement for a diagnosis is not shown as the step's own
    if (event.measurement !== view.measurement) Object.assign(view, { measurement: event.measurement, sample: event.sample.name, step: event.sample.step, sweeps: [], fits: [], fit: null, diagnosis: null, segment: 0, withdrawn: [], metadata: event.metadata });
    view.sweeps.push(event.sweep);
    showAll();
    painted(event.time);
  },
  fit: (event) => {
    if (event.fitter === "diagnosis" && event.measurement === view.diagnosing) diagnosed(); // it gave no answer
    if (event.measurement !== view.measurement) return;
    if (event.fit) {
      view.fits = [...view.fits.filter((one) => one.fitter !== event.fit.fitter), event.fit];
      if (!view.fit || event.fit.chosen || event.fit.fitter === "mason" || view.fit.fitter !== "mason") view.fit = event.fit;
      showAll();
      refresh();
      if (view.build.limits) judge(event.measurement, event.fit.fitter);
    }
    if (event.error) $("words").append(element("p", `${event.fitter}: ${event.error}`));
  },
  diagnosis: (event) => {
    if (event.measurement === view.diagnosing) diagnosed();
    if (event.measurement === view.measurement) { view.diagnosis = event.diagnosis; showAll(); }
  },
};

const stream = new EventSource("/api/events");
stream.onmessage = (message) => { const event = JSON.parse(message.data); heard[event.kind]?.(event); };
stream.onerror = () => say("connection lost");
stream.onopen = () => begin();

$("next").onclick = () => { const step = nextStep(); if (step) measure(step); };
$("stop").onclick = () => command("/api/cancel", {});
$("diagnose").onclick = async () => {
  view.diagnosing = view.measurement;
  $("diagnose").disabled = true;
  working("diagnosing", "Diagnosing: effects that the model may lack are fitted one by one");
  await command("/api/diagnose", { measurement: view.measurement });
  if ($("problem").textContent) diagnosed(); // refused
};
$("which").onchange = () => { showHistory(); $("chart-place").replaceChildren(); };
$("chart").onclick = showChart;
$("keep").onclick = () => { view.kept = view.kept ? null : { name: `${view.sample} · ${view.step}`, sweeps: view.sweeps, measurement: view.measurement }; showCurves(); showKept(); };
$("compare").onclick = compareKept;
view.changed = showAll;
wire(view);
$("theme").onclick = () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  if (view.build) showAll();
}

let resized;
addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(() => view.build && showCurves(), 150); });
setTheme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
