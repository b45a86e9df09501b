"""The fitter of a glued stack of finite diameter, in two dimensions."""
