"""Reads exported policies: safetensors files with a description in their metadata."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

_TYPES = {"F32": "<f4", "U32": "<u4"}


class PolicyError(ValueError):
    """A file is not an exported policy, or lacks what is asked of it."""


def read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Returns the description of an exported policy and its arrays by name.

    Raises OSError if the file cannot be read, and PolicyError if it is no exported policy.
    """
    with open(path, "rb") as file:
        data = file.read()
    start = 8 + int.from_bytes(data[:8], "little")
    try:
        if not 8 < start <= len(data):
            raise ValueError("it is no safetensors file, or cut off")
        header = json.loads(data[8:start])
        texts = header.pop("__metadata__", {})
        if "policy" not in texts:
            raise ValueError("write one by gdg-tui export-policy CHECKPOINT")
        numbers = memoryview(data)[start:]
        arrays = {name: _array(numbers, entry) for name, entry in header.items()}
        return json.loads(texts["policy"]), arrays
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise PolicyError(f"{os.fspath(path)} is not an exported policy: {error}") from error


def _array(numbers: memoryview, entry: dict[str, Any]) -> np.ndarray:
    first, end = entry["data_offsets"]
    if not 0 <= first <= end <= len(numbers):
        raise ValueError("it is cut off")
    return np.frombuffer(numbers[first:end], _TYPES[entry["dtype"]]).reshape(entry["shape"])
