"""Error model: differences of model and recording beside the constants: noise, instrument, fixture, model error."""
