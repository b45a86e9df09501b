"""Recordings played as an analyzer."""
