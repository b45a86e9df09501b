"""From a fast sweep to a plan with its points where the resonances are."""
