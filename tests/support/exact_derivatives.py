"""Derivatives of ln Z by the parameters of a model compared with central differences."""

import numpy as np


def assert_exact(model, f, names, within):
    """Fail unless each derivative differs by less than this part of its largest value."""
    for name, row in zip(names, model.jacobian(f, names)[1], strict=True):
        value = model.parameters()[name]
        step = 1e-5 * abs(value if not name.endswith(".im") else model.parameters()[name.replace(".im", ".re")])
        up, down = (model.replace({name: value + side * step}).impedance(f) for side in (1, -1))
        expected = np.log(up / down) / (2 * step)
        assert np.abs(row - expected).max() < within * np.abs(expected).max(), name


def assert_exact_by_fourth_order(model, f, names, least):
    """Fail unless each derivative, times its parameter, is within 1e-4 of its largest value, or of `least` if larger.

    By differences of fourth order, for curves with rounding of 3e-8. A part of a complex constant counts with the
    absolute value of the whole.
    """
    Z, J = model.jacobian(f, names)
    np.testing.assert_allclose(Z, model.impedance(f), rtol=1e-9)
    for row, name in zip(J, names, strict=True):
        value = model.parameters()[name]
        whole = name[:-3] if name.endswith((".re", ".im")) else None
        scale = abs(complex(*(model.parameters()[f"{whole}.{part}"] for part in ("re", "im"))) if whole else value)

        def moved(times, name=name, value=value, scale=scale):
            return np.log(model.replace({name: value + times * 1e-3 * scale}).impedance(f) / Z)

        numeric = (8 * (moved(1) - moved(-1)) - (moved(2) - moved(-2))) / 12e-3
        np.testing.assert_allclose(row * scale, numeric, atol=1e-4 * max(least, np.abs(numeric).max()), err_msg=name)
