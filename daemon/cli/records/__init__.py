"""Commands for what was measured: samples, reports, exports, the journal itself."""
