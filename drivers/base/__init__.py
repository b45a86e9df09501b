"""The interface of analyzers: driver, capabilities, measurement and compensation."""
