// Numbers such as 1.514(3)e11, with the uncertainty in units of the last digit, as in daemon/report/tables/numbers.py.

export function withUncertainty(value, u) {
  if (value === null || value === undefined) return "–";
  if (!u) {
    const short = Number(value.toPrecision(6)), size = Math.abs(short);
    return short && (size >= 1e5 || size < 1e-3) ? short.toExponential().replace("e+", "e") : String(short);
  }
  const digits = /^[1]/.test(u.toExponential(0)) || /^1/.test(u.toExponential(1)) ? 2 : 1;
  const exponent = Math.max(value ? Math.floor(Math.log10(Math.abs(value))) : 0, Math.floor(Math.log10(u)));
  const last = Math.floor(Math.log10(u)) - digits + 1;
  const shown = exponent >= -3 && exponent <= 4 ? 0 : exponent;
  const decimals = Math.max(0, shown - last);
  const bracket = Math.round(u / 10 ** Math.min(last, shown));
  return `${(value / 10 ** shown).toFixed(decimals)}(${bracket})${shown ? `e${shown}` : ""}`;
}

export function complexWithUncertainty(c) {
  if (!c.im && !c.u_im) return withUncertainty(c.re, c.u_re ?? c.u);
  return `${withUncertainty(c.re, c.u_re ?? c.u)} ${c.im < 0 ? "−" : "+"} ${withUncertainty(Math.abs(c.im), c.u_im)} j`;
}
