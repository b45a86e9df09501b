"""`pzctl prove`: diagnoses sealed cases, scores the answers, plants effects in real recordings, runs the oracle."""
