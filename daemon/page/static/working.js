// A sign that something is being worked on: what, and for how many seconds already. What is done at once shows none.

const SOON = 300; // milliseconds
const clocks = {};

export function working(id, what) {
  rested(id);
  const begun = Date.now(), place = document.getElementById(id), seconds = document.createElement("span");
  seconds.ariaHidden = "true"; // a screen reader says what is done, once
  const show = () => {
    seconds.textContent = `, ${Math.round((Date.now() - begun) / 1000)} s`;
    if (place.hidden) { place.replaceChildren(what, seconds); place.hidden = false; }
  };
  clocks[id] = [setTimeout(show, SOON), setInterval(show, 1000)];
}

export function rested(id) {
  for (const clock of clocks[id] ?? []) clearInterval(clock);
  document.getElementById(id).hidden = true;
}
