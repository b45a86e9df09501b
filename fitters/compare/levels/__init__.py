"""Two recordings at different drive levels: resonances that bend with their own amplitude."""
