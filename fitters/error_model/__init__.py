"""What keeps a model and a recording apart besides the constants: noise, instrument, fixture, the model's own error."""
