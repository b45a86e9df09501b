"""Commands used while measuring: measure, watch, status, the live page, a new build file."""
