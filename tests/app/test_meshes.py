"""The robot's shape as pages get it."""

from __future__ import annotations

import json

import numpy as np

from app.outputs.geometry import Look
from app.outputs.meshes import packed


def test_what_is_packed_can_be_read_back() -> None:
    rng = np.random.default_rng(0)
    looks = [Look(body, (10 * body, 0, 255), rng.normal(size=(body + 3, 3)), rng.integers(0, 3, (body, 3))) for body in (1, 4)]
    data = packed(looks)
    length = int(np.frombuffer(data, "<u4", 1)[0])
    heads, at = json.loads(data[4 : 4 + length]), 4 + length
    assert at % 4 == 0
    for head, look in zip(heads, looks, strict=True):
        assert (head["body"], head["rgb"]) == (look.body - 1, list(look.rgb))
        vertices = np.frombuffer(data, "<f4", 3 * head["vertices"], at).reshape(-1, 3)
        at += vertices.nbytes
        faces = np.frombuffer(data, "<u4", 3 * head["faces"], at).reshape(-1, 3)
        at += faces.nbytes
        np.testing.assert_allclose(vertices, look.vertices, atol=1e-6)
        np.testing.assert_array_equal(faces, look.faces)
    assert at == len(data)
