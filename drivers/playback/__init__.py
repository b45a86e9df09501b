"""Playback of recordings as an analyzer."""
