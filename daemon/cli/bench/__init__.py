"""Commands used while measuring: measure, watch, the live page, a new build file."""
