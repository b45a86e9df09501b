"""A glued stack in two dimensions: round layers of equal diameter in r and z, waves along r solved exactly."""
