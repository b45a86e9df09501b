// Manual fit: sliders move the model's curve, which the server computes; at most one request is under way.

import { columns, draw, overlay } from "./plots.js";
import { withUncertainty } from "./numbers.js";
import { rested, working } from "./working.js";

const $ = (id) => document.getElementById(id);
const STEPS = 1000;
let state = null; // measurement, fitter, step, steps, handles, free, values, effects, model
let subject = null; // the measurement of the manual fit, once it was requested
let busy = false, wanted = null;

const toSlider = (h, value) => Math.round(STEPS * (h.scale === "log" ? Math.log(Math.max(value, h.low) / h.low) / Math.log(h.high / h.low) : (value - h.low) / (h.high - h.low)));
const fromSlider = (h, k) => (h.scale === "log" ? h.low * (h.high / h.low) ** (k / STEPS) : h.low + ((h.high - h.low) * k) / STEPS);

function element(tag, text, properties = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, properties);
}

function bands() {
  const text = $("hand-bands").value.trim(), found = {};
  if (text) {
    found[state.step] = text.split(",").map((part) => {
      const ends = part.split(/-|–|to/).map((word) => Number(word.trim()) * 1e6);
      if (ends.length !== 2 || ends.some((end) => !Number.isFinite(end))) throw new Error(`“${part.trim()}” is not a band; write it like 1-6`);
      return ends;
    });
  }
  if (!$("hand-earlier").checked) for (const step of state.steps.slice(0, -1)) found[step] = [];
  return found;
}

function wish() {
  return { measurement: state.measurement, fitter: state.fitter, free: [...state.free], values: state.values, bands: bands(), effects: state.effects };
}

// Send a request. While one is under way, only the newest of the later ones is kept and sent after it.
async function ask(path, made, then) {
  wanted = [path, made, then];
  if (busy) return;
  busy = true;
  working("hand-working", path === "/api/fit" ? "Fitting" : "Computing the model");
  try {
    while (wanted) {
      const [where, body, done] = wanted;
      wanted = null;
      $("hand").dataset.busy = where;
      try {
        const answer = await fetch(where, { method: "POST", body: JSON.stringify(body) });
        const found = await answer.json().catch(() => ({ error: answer.statusText }));
        if (!answer.ok) throw new Error(found.error);
        if (body.measurement === subject) { $("hand-problem").textContent = ""; done(found); }
      } catch (error) { $("hand-problem").textContent = error.message; showModels(); }
    }
  } finally { busy = false; rested("hand-working"); delete $("hand").dataset.busy; }
}

function send(path, then) {
  let made;
  try { made = wish(); } catch (error) { $("hand-problem").textContent = error.message; return; }
  ask(path, made, then);
}

function take(found) {
  const known = new Set(state.handles.map((h) => h.name));
  // Keep the range of each slider, so that it does not jump while it is dragged.
  state.handles = found.handles.map((h) => state.handles.find((old) => old.name === h.name) ?? h);
  for (const h of found.handles) {
    state.values[h.name] = h.value;
    if (!known.has(h.name) && h.free) state.free.add(h.name);
  }
  Object.assign(state, { fitter: found.fitter, models: found.models, says: found.says, steps: found.steps, places: found.places, model: found.curves, chi2: found.chi2_per_dof });
}

function showHandles() {
  $("hand-handles").replaceChildren(...state.handles.map((h) => {
    const row = element("div", "", { className: "handle" }), shown = element("output", "");
    const tick = element("input", "", { type: "checkbox", checked: state.free.has(h.name), title: "free in a fit" });
    const slider = element("input", "", { type: "range", min: 0, max: STEPS, value: toSlider(h, state.values[h.name]) });
    slider.setAttribute("aria-label", h.name); tick.setAttribute("aria-label", `free ${h.name}`);
    slider.dataset.handle = h.name;
    const show = () => {
      shown.textContent = `${withUncertainty(state.values[h.name], h.u)} ${h.unit === "1" ? "" : h.unit}`;
      slider.setAttribute("aria-valuetext", shown.textContent);
      row.classList.toggle("held", !tick.checked);
    };
    tick.onchange = () => { tick.checked ? state.free.add(h.name) : state.free.delete(h.name); show(); };
    slider.oninput = () => { state.values[h.name] = fromSlider(h, Number(slider.value)); show(); send("/api/look", moved); };
    show();
    row.append(tick, element("span", h.name), slider, shown);
    return row;
  }));
}

// The choice of the model, since several fitters have one of a bare round disk.
function showModels() {
  const models = state?.models ?? [];
  $("hand-models").hidden = models.length < 2;
  $("hand-model").replaceChildren(...models.map((name) => element("option", name, { value: name, selected: name === state.fitter })));
  $("hand-says").textContent = (state?.says ?? []).join(" ");
  $("hand-earlier").parentElement.hidden = (state?.steps.length ?? 0) < 2;
}

function showEffects() {
  const places = Object.entries(state.places ?? {}).flatMap(([name, where]) => where.map((place) => [name, place]));
  $("hand-effect").replaceChildren(...places.map(([name, place]) => element("option", `${name} · ${place}`, { value: JSON.stringify([name, place]) })));
  $("hand-effects").replaceChildren(...state.effects.map(([name, place], k) => {
    const item = element("li", `${name} · ${place} `);
    item.append(element("button", "Remove", { type: "button", onclick: () => {
      state.effects.splice(k, 1);
      const prefix = `${name}@${place}.`, own = (one) => one.startsWith(prefix);
      state.handles = state.handles.filter((h) => !own(h.name));
      for (const one of Object.keys(state.values).filter(own)) { delete state.values[one]; state.free.delete(one); }
      send("/api/look", whole);
    } }));
    return item;
  }));
}

function showCurve() {
  $("hand-chi2").textContent = `χ²/dof ${state.chi2.toPrecision(3)}`;
  $("hand-chi2").className = `big ${state.chi2 < 1.5 ? "good" : "bad"}`;
  const k = Math.min(state.view().segment, state.model.length - 1), sweep = state.view().sweeps[k];
  const model = state.model[k]?.fitted;
  if (!sweep || !model || model.re.length !== sweep.f.length) return;
  const x = sweep.f.map((f) => f / 1e6), measured = columns(sweep.z), hand = columns(model);
  const fitted = overlay(sweep.f, state.view().fit?.curves ?? []);
  for (const [id, part, log] of [["hand-z", "size", true], ["hand-phase", "phase", false]]) {
    const lines = [["measured", "--measured", 4, measured[part]]];
    if (fitted) lines.push(["fitted", "--fitted", 1.5, fitted[part]]);
    draw(id, x, [...lines, ["manual", "--phase", 2, hand[part]]], log);
  }
}

const moved = (found) => { state.model = found.curves; state.chi2 = found.chi2_per_dof; showCurve(); };
const whole = (found) => { take(found); showModels(); showEffects(); showHandles(); showCurve(); };

// A fit can be kept once, after a name was entered.
function offer() {
  $("hand-keep-it").disabled = !state?.fitted || !$("hand-by").value.trim();
  $("hand-kept").textContent = state?.fitted ? "not kept yet" : "";
}

function begin(view, fitter) {
  const measurement = view.measurement;
  subject = measurement;
  const fresh = { measurement, fitter, models: [], step: view.step, steps: [], handles: [], free: new Set(), values: {}, effects: [], places: {}, model: [], chi2: 0, view: () => view };
  ask("/api/look", { measurement, fitter }, (found) => {
    state = fresh;
    for (const h of found.handles) if (h.free) state.free.add(h.name);
    $("hand-bands").value = "";
    offer();
    $("hand-board").hidden = false;
    whole(found);
  });
}

// The model of the fit shown, or mason if that has none for manual fits.
function shown(view) {
  const name = view.fit?.chosen?.model ?? view.fit?.fitter;
  return ["radial", "disk"].includes(name) ? name : "mason";
}

export function wire(view) {
  $("hand-open").onclick = () => begin(view, shown(view));
  $("hand-reset").onclick = () => begin(view, state.fitter);
  $("hand-model").onchange = () => begin(view, $("hand-model").value);
  $("hand-fit").onclick = () => {
    let made;
    try { made = wish(); } catch (error) { $("hand-problem").textContent = error.message; return; }
    made = structuredClone(made);
    ask("/api/fit", made, (found) => { state.fitted = made; view.fit = found.fit; view.changed(); whole(found); offer(); });
  };
  $("hand-by").value = localStorage.getItem("by") ?? "";
  $("hand-by").oninput = offer;
  $("hand-keep").onsubmit = (event) => {
    event.preventDefault();
    const by = $("hand-by").value.trim();
    localStorage.setItem("by", by);
    ask("/api/keep", { ...state.fitted, by }, (found) => {
      state.fitted = null;
      offer();
      $("hand-kept").textContent = `kept by ${found.fit.chosen.by}`;
    });
  };
  $("hand-bands").onchange = () => send("/api/look", moved);
  $("hand-earlier").onchange = () => send("/api/look", moved);
  $("hand-add").onclick = () => {
    const chosen = JSON.parse($("hand-effect").value);
    if (state.effects.some((one) => String(one) === String(chosen))) return;
    state.effects.push(chosen);
    // The constants of the new effect are free; the server returns their names.
    ask("/api/look", { ...wish(), free: null }, whole);
  };
  $("hand-all").onclick = () => { state.handles.forEach((h) => state.free.add(h.name)); showHandles(); };
  $("hand-none").onclick = () => { state.free.clear(); showHandles(); };
}

// Called when the page shows another measurement, or the same one again.
export function follow(view) {
  $("hand-open").disabled = !view.measurement;
  if (subject !== view.measurement) subject = null;
  if (!state) return;
  if (state.measurement !== view.measurement) { state = null; $("hand-board").hidden = true; $("hand-problem").textContent = ""; } else if (state.model.length) showCurve();
}
