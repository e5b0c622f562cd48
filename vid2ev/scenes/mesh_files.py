"""Meshes from OBJ, PLY, STL, glTF and GLB files, read by trimesh.

All of a file's geometries become one mesh, in the file's own coordinates and units, taken for metres.  Its picture,
(u, v) and colours of vertices come along (codes are sRGB).  A mesh is smooth if the file has normals of vertices, or
if of its neighbouring triangles nine in ten meet at less than 30 degrees; otherwise it is flat.

Source: the formats as trimesh reads them; its (u, v) count from the lower border of the picture, ours from the upper.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vid2ev.errors import DataError, UsageError
from vid2ev.light.pictures import PictureReader
from vid2ev.scenes.snapshot import Mesh, Texture
from vid2ev.untrusted import PATHS, check_bytes, first_line, json_of

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".obj", ".ply", ".stl", ".gltf", ".glb")
SMOOTH_RAD = np.radians(30.0)
MOST = 0.9
MOST_OF_AN_ENTRY = 16  # bytes


def load_mesh(path: Path | str) -> Mesh:
    """The mesh of a file.

    Raises UsageError without the package that reads it or for another suffix, DataError for a file that cannot be
    read or holds no triangles.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: a mesh must be one of {', '.join(SUFFIXES)}")
    try:
        parts = [_part(part) for part in _geometries(path)]
    except (UsageError, DataError):
        raise
    except Exception as error:  # (pictures within can be damaged, or larger than Pillow allows)
        raise DataError(f"{path}: not a mesh that can be read ({first_line(error)}); export it anew") from error
    if not parts:
        raise DataError(f"{path}: holds no triangles; export it anew as a mesh with faces")
    mesh = parts[0] if len(parts) == 1 else _joined(parts)
    if not mesh.size_m.max() > 0:
        raise DataError(f"{path}: all its triangles are in one place; export it anew with its size")
    return mesh


def named_by(path: Path) -> dict[str, Path]:
    """The files that a mesh file names, by the names under which a copy of it finds them, as seen from its folder.

    Raises as `load_mesh` does, and UsageError where two of them have one name.
    """
    opened: list[tuple[str, Path]] = []
    _geometries(path, opened)
    found = dict(opened)
    two = next((name for name, file in opened if file != found[name]), None)
    if two is not None:
        raise UsageError(f"{path} names two files {two} in other folders; give each a name of its own")
    return found


def opened_by(path: Path) -> list[Path]:
    """The files that a mesh file names and that are there.  Raises as `load_mesh` does."""
    opened: list[tuple[str, Path]] = []
    _geometries(path, opened)
    return sorted({file for _, file in opened})


def _geometries(path: Path, opened: list[tuple[str, Path]] | None = None) -> list[trimesh.Trimesh]:
    """What in the file has triangles, each where it stands; the files that it names go into `opened`."""
    try:
        import trimesh
    except ImportError as error:
        raise UsageError(
            f"{path}: meshes need a package that is not installed; pip install 'vid2ev[scenes]'"
        ) from error
    if not path.is_file():
        raise DataError(f"{path}: no such file; give the path of a mesh")
    try:
        _check_claims(path)
        found = trimesh.load_scene(path, process=False, resolver=_resolver(path, opened)).dump(concatenate=False)
        meshes = [part for part in found if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    except (UsageError, DataError):
        raise
    except Exception as error:  # (the package raises whatever its parsers come across)
        raise DataError(f"{path}: not a mesh that can be read; export it anew") from error
    if any(part.faces.min() < 0 or part.faces.max() >= len(part.vertices) for part in meshes):
        raise DataError(f"{path}: has triangles between vertices that are not there; export it anew")
    if any(not np.isfinite(part.vertices).all() for part in meshes):
        raise DataError(f"{path}: has vertices that are not finite numbers; export it anew")
    return meshes


def _resolver(path: Path, opened: list[tuple[str, Path]] | None) -> trimesh.resolvers.FilePathResolver:
    """What finds pictures and buffers that a file names: in its folder and below, nowhere else."""
    import trimesh

    class Resolver(trimesh.resolvers.FilePathResolver):
        def absolute(self, name: str) -> Path:
            place = super().absolute(name)
            if opened is not None and place.is_file():
                opened.append((_own_name(name.strip()), place))
            return place

    return Resolver(str(path), allow_anywhere=os.environ.get(PATHS) == "anywhere")


def _own_name(name: str) -> str:
    """A name in the file's folder or below; what is elsewhere is looked for under its last part as well."""
    plain = os.path.normpath(name)
    return os.path.basename(plain) if os.path.isabs(plain) or plain.startswith("..") else plain


def _check_claims(path: Path) -> None:
    """Raise DataError for a glTF file whose arrays would take more memory than they may: of those without content the
    file has nothing but the length."""
    if path.suffix.lower() not in (".gltf", ".glb"):
        return
    content = path.read_bytes()
    if content.startswith(b"glTF"):
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    arrays = json_of(content).get("accessors", [])
    check_bytes(path, sum(max(int(array["count"]), 0) for array in arrays) * MOST_OF_AN_ENTRY, "its arrays")


def _part(part: trimesh.Trimesh) -> Mesh:
    uv, colours, texture = _look(part.visual)
    return Mesh(part.vertices, part.faces, uv, _normals(part), colours, texture)


def _normals(part: trimesh.Trimesh) -> np.ndarray | None:
    """Normals of the vertices if the mesh is smooth."""
    if "vertex_normals" in part._cache:  # (they came with the file: nothing has been computed yet)
        return np.nan_to_num(part.vertex_normals)
    # (vertices at one place may be several, as in every STL: neighbours are found by place)
    places, number = np.unique(part.vertices, axis=0, return_inverse=True)
    whole = type(part)(places, number.reshape(-1)[part.faces], process=False)
    angles = whole.face_adjacency_angles
    if len(angles) == 0 or (angles < SMOOTH_RAD).mean() < MOST:
        return None
    return np.nan_to_num(whole.vertex_normals[number.reshape(-1)])


def _look(visual: Any) -> tuple[np.ndarray | None, np.ndarray | None, Texture | None]:
    """(u, v), colours of vertices, and the picture, as far as there are any."""
    if visual.kind == "texture" and visual.uv is not None:
        image = getattr(visual.material, "baseColorTexture", None) or getattr(visual.material, "image", None)
        texture = None if image is None else Texture(_light(np.asarray(image.convert("RGB"))))
        return np.nan_to_num(visual.uv) * (1, -1) + (0, 1), None, texture
    if visual.kind in ("vertex", "face"):
        return None, _light(np.asarray(visual.vertex_colors)[None, :, :3])[0], None
    return None, None, None


def _light(codes: np.ndarray) -> np.ndarray:
    return PictureReader("srgb", "rgb").light(np.ascontiguousarray(codes))


def _joined(parts: list[Mesh]) -> Mesh:
    """One mesh of several; where only some have normals, the others are flat; the first picture is that of all."""
    smooth = any(part.normals is not None for part in parts)
    parts = [_with_own_corners(part) if smooth and part.normals is None else part for part in parts]
    firsts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    pictures = [part.texture for part in parts if part.texture is not None]
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=True)]),
        _all(parts, "uv", np.zeros(2)),
        _all(parts, "normals", np.zeros(3)),
        _all(parts, "colours", np.ones(3)),
        pictures[0] if pictures else None,
    )


def _all(parts: list[Mesh], name: str, otherwise: np.ndarray) -> np.ndarray | None:
    """A field of all parts; None if none has it."""
    values = [getattr(part, name) for part in parts]
    if all(value is None for value in values):
        return None
    filled = [
        np.tile(otherwise, (len(part.vertices), 1)) if value is None else value
        for part, value in zip(parts, values, strict=True)
    ]
    return np.concatenate(filled)


def _with_own_corners(part: Mesh) -> Mesh:
    """The same mesh with the normal of its triangle at each corner."""
    spots = part.vertices[part.triangles]
    across = np.cross(spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0])
    corners = part.triangles.reshape(-1)
    return Mesh(
        part.vertices[corners],
        np.arange(len(corners)).reshape(-1, 3),
        None if part.uv is None else part.uv[corners],
        np.repeat(across, 3, axis=0),
        None if part.colours is None else part.colours[corners],
        part.texture,
    )
