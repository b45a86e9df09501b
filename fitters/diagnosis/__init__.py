"""Diagnosis of a misfit: missing physics, its probability, and the measurements that would decide."""
