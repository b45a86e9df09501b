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
