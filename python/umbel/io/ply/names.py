"""The names of the properties that a mesh is made of; where there are several, the first choice of
which a file has all."""

from __future__ import annotations

POSITION = [("x", "y", "z")]
NORMAL = [("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z")]
UV = [("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t")]
COLOR = [("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green",
          "diffuse_blue")]  # fmt: skip
ALPHA = [("alpha",), ("a",), ("diffuse_alpha",)]
TANGENT = [("tx", "ty", "tz", "tw")]
INDEX_LISTS = ("vertex_indices", "vertex_index")
MATERIAL_ID = ("material_index", "material_id", "material")
CORNER_UVS = "texcoord"
