"""Commands that look up what was measured: samples, reports, exports, the journal itself."""
