"""What can have changed: two-ports at the terminals, resonances in the device, another device altogether."""
