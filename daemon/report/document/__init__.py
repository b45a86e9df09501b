"""The report of one sample as one HTML or PDF file."""
