"""Pictures of fits, diagnoses and devices."""
