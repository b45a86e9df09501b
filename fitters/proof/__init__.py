"""Diagnoses judged against sealed truths: scores, metrics, and the page of them."""
