"""The report of one sample as one HTML file or PDF."""
