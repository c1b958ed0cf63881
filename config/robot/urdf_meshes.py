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
"""Limits of a link's size, relative to the reach: beyond them the unit of its mesh is wrong."""


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
class RefusedMesh:
    """A mesh that was not read: its address in the URDF, and the reason with the remedy."""

    address: str
    reason: str


@dataclass(frozen=True)
class LinkMeshes:
    """Meshes of a URDF's links, and meshes that were not read.

    Attributes:
        by_link: The meshes of each link, by the name of the URDF's link; links without meshes have
            no entry.
        refused: The meshes that were not read, by the name of the URDF's link. The other meshes of
            such a link are in `by_link`.
    """

    by_link: dict[str, tuple[LinkMesh, ...]]
    refused: dict[str, tuple[RefusedMesh, ...]]


def read_link_meshes(
    tree: UrdfTree,
    packages: PackageFolders,
    reach_m: float,
    *,
    links: Iterable[str] | None = None,
    largest: float = LARGEST,
    purpose: Literal["solid", "visual"] = "solid",
) -> LinkMeshes:
    """Read the meshes of a URDF's links, in metres, in the frames of the URDF's links.

    Poses of these frames in the base are those of `tree.placements`. A file that several links name
    is read once. Nothing is raised for a mesh that is missing, damaged or in another unit:
    `refused` contains the reason.

    Args:
        tree: The URDF.
        packages: Places in which the files are searched.
        reach_m: Length of the stretched arm.
        links: Names of the links (default: all).
        largest: A mesh larger than this multiple of `reach_m`, or smaller than 0.2 % of `reach_m`,
            is refused, because its unit is probably wrong.
        purpose: `solid` for collision checks: the meshes of <collision> or, if a link has no
            <collision>, of <visual>. `visual` for drawings: the meshes of <visual> or, if a link
            has no <visual>, of <collision>.
    """
    files: dict[Path, Mesh] = {}
    by_link: dict[str, tuple[LinkMesh, ...]] = {}
    refused: dict[str, tuple[RefusedMesh, ...]] = {}
    for name in tree.links if links is None else links:
        made: list[LinkMesh] = []
        failed: list[RefusedMesh] = []
        for stated in _meshes_of(tree.links[name], purpose):
            try:
                file = packages.locate(stated.address)
                if file not in files:
                    files[file] = read_mesh(file)
                mesh = files[file].scaled(stated.scale)
                _refuse_size(stated, file, mesh, (SMALLEST * reach_m, largest * reach_m))
                made.append(LinkMesh(file, mesh.placed(stated.placement)))
            except ConfigError as error:
                failed.append(RefusedMesh(stated.address, str(error)))
        if made:
            by_link[name] = tuple(made)
        if failed:
            refused[name] = tuple(failed)
    return LinkMeshes(by_link, refused)


def _meshes_of(link: UrdfLink, purpose: Literal["solid", "visual"]) -> tuple[UrdfMesh, ...]:
    if purpose == "solid":
        return link.solid.meshes
    return (link.collision if link.visual.is_empty else link.visual).meshes


def _refuse_size(
    stated: UrdfMesh, file: Path, mesh: Mesh, plausible_m: tuple[float, float]
) -> None:
    """Raise an error if a mesh is too small or too large for the robot."""
    low_m, high_m = plausible_m
    if low_m <= mesh.size_m <= high_m:
        return
    raise ConfigError(
        f"{file}: the mesh is {mesh.size_m:.3g} m long; for this robot, {low_m:.2g} to {high_m:.2g}"
        f" m is plausible: correct `scale` of <mesh> ({stated.where}); for a mesh in mm it is"
        ' "0.001 0.001 0.001"',
        code=CODE,
    )
