"""`LinkMesh`: a mesh of a URDF's link, in the frame of the link."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from config.errors import ConfigError
from config.formats.urdf import UrdfLink, UrdfMesh, UrdfTree
from config.meshes.mesh import Mesh
from config.meshes.mesh_file import CODE, read_mesh
from config.meshes.package_folders import PackageFolders

LARGEST: Final = 2.0
SMALLEST: Final = 2e-3
"""Limits of a mesh's size, relative to the reach: beyond them its unit is wrong."""


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A mesh of a link.

    Attributes:
        file: The mesh's file.
        mesh: The mesh in the frame of the URDF's link, scaled as <mesh scale> says [m].
    """

    file: Path
    mesh: Mesh


@dataclass(frozen=True)
class LinkMeshes:
    """Meshes of a URDF's links, and reasons why others were not read.

    Attributes:
        by_link: The meshes of each link, by the name of the URDF's link; links without meshes have
            no entry.
        refused: Reasons, with file and remedy, by the name of the URDF's link. The other meshes of
            such a link are in `by_link`.
    """

    by_link: dict[str, tuple[LinkMesh, ...]]
    refused: dict[str, tuple[str, ...]]


def read_link_meshes(
    tree: UrdfTree,
    packages: PackageFolders,
    reach_m: float,
    *,
    links: Iterable[str] | None = None,
    purpose: Literal["solid", "visual"] = "solid",
) -> LinkMeshes:
    """Read the meshes of a URDF's links, in metres, in the frames of the URDF's links.

    Poses of these frames in the base are those of `tree.placements`. A file that several links name
    is read once. Nothing is raised for a mesh that is missing, damaged or in another unit:
    `refused` contains the reason.

    Args:
        tree: The URDF.
        packages: Places in which the files are searched.
        reach_m: Length of the stretched arm. A mesh larger than twice this length, or smaller than
            0.2 % of it, is refused, because its unit is probably wrong.
        links: Names of the links (default: all).
        purpose: `solid` for collision checks: the meshes of <collision> or, if a link has no
            <collision>, of <visual>. `visual` for drawings: the meshes of <visual> or, if a link
            has no <visual>, of <collision>.
    """
    files: dict[Path, Mesh] = {}
    by_link: dict[str, tuple[LinkMesh, ...]] = {}
    refused: dict[str, tuple[str, ...]] = {}
    for name in tree.links if links is None else links:
        made: list[LinkMesh] = []
        reasons: list[str] = []
        for stated in _meshes_of(tree.links[name], purpose):
            try:
                file = packages.locate(stated.address)
                if file not in files:
                    files[file] = read_mesh(file)
                mesh = files[file].scaled(stated.scale)
                _refuse_size(stated, file, mesh, reach_m)
                made.append(LinkMesh(file, mesh.placed(stated.placement)))
            except ConfigError as error:
                reasons.append(str(error))
        if made:
            by_link[name] = tuple(made)
        if reasons:
            refused[name] = tuple(reasons)
    return LinkMeshes(by_link, refused)


def _meshes_of(link: UrdfLink, purpose: Literal["solid", "visual"]) -> tuple[UrdfMesh, ...]:
    if purpose == "solid":
        return link.solid.meshes
    return (link.collision if link.visual.is_empty else link.visual).meshes


def _refuse_size(stated: UrdfMesh, file: Path, mesh: Mesh, reach_m: float) -> None:
    """Raise an error if a mesh is too large or too small for the robot."""
    size_m = mesh.size_m
    if SMALLEST * reach_m <= size_m <= LARGEST * reach_m:
        return
    raise ConfigError(
        f"{file}: the mesh is {size_m:.4g} m long, and the stretched arm {reach_m:.4g} m: probably"
        f" a wrong unit. Correct `scale` of <mesh> ({stated.where}); for a mesh in mm it is"
        ' "0.001 0.001 0.001"',
        code=CODE,
    )
