"""The curve of sRGB: numbers from 0 to 1 as colours are shown and stored, and the light that they stand for."""

from typing import Any

import numpy as np


def encoded(light: Any) -> Any:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def light(encoded: Any) -> Any:
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
