"""Workers: fitters and diagnoses, each in a process of its own."""
