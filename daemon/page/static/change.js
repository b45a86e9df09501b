// What changed between the kept sweep and the one shown: sentences, table and picture.

import { withUncertainty } from "./numbers.js";
import { clear, columns, draw } from "./plots.js";

const $ = (id) => document.getElementById(id);

function row(finding) {
  const made = document.createElement("tr");
  const sizes = Object.entries(finding.parameters).map(([name, size]) => `${name} ${withUncertainty(size.value, size.u)}${size.unit === "1" ? "" : ` ${size.unit}`}`);
  const alike = finding.same_as.length ? ` (or ${finding.same_as.map((one) => one.effect).join(", ")})` : "";
  for (const text of [`${finding.effect}${finding.removed ? " gone" : ""}${alike}`, finding.where, finding.probability_text, sizes.join("; ")]) {
    made.append(Object.assign(document.createElement("td"), { textContent: text }));
  }
  return made;
}

// |ln(a/b)| at each frequency.
function apart(a, b) {
  return a.size.map((size, k) => {
    const turn = a.phase[k] - b.phase[k], phase = ((turn - 360 * Math.round(turn / 360)) * Math.PI) / 180;
    return Math.max(Math.hypot(Math.log(size / b.size[k]), phase), 1e-7);
  });
}

export function showChange(found) {
  $("changed").hidden = !found;
  if (!found) { clear("changed-z"); clear("changed-left"); return; }
  $("changed-words").replaceChildren(...found.says.map((word, k) => Object.assign(document.createElement("p"), { textContent: word, className: k ? "" : "big" })));
  $("changed-table").hidden = !found.findings.length;
  $("changed-table").tBodies[0].replaceChildren(...found.findings.map(row));
  const { f, ...curves } = found.curve, x = f.map((one) => one / 1e6);
  const [before, after, explained] = [columns(curves.before), columns(curves.after), columns(curves.explained)];
  const named = found.findings.length > 0;
  draw("changed-z", x, [["kept", "--good", 3, before.size], ["this one", "--measured", 3, after.size], ...(named ? [["found", "--fitted", 1.5, explained.size]] : [])], true);
  draw("changed-left", x, [["changed", "--measured", 2, apart(after, before)], ...(named ? [["left", "--fitted", 1.5, apart(after, explained)]] : [])], true);
}
