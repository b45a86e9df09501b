"""Commands that work on recordings: fit, diagnose, and the catalogues behind them."""
