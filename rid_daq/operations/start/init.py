"""`init`: write commented example files: cell, robot and motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request
from rid_daq.terminal.console import as_command

ROBOT_PICTURE: Final = "robot.png"
ROBOT_MESHES: Final = "robot.meshes"
URDF_FILES: Final = (
    *("robot.yaml", "plant.yaml", "cell.yaml", "validation.yaml"),
    *(ROBOT_PICTURE, ROBOT_MESHES),
)
FROM_URDF: Final = "URDF"
NOT_REHEARSED: Final = (
    "the cell is not rehearsed, because simulated cells need Linux: call `rid-daq check` on a Linux"
    " computer before the first motion"
)


class InitRequest(Request):
    """Write a commented cell, a robot and two motions as a starting point.

    The files can be used unchanged, on a simulated cell. Change them step by step to describe your
    own robot. With --urdf the robot, its limits and its links come from that file, and only one
    motion is written: design the excitation with `rid-daq design`. --range, --velocity,
    --acceleration and --effort set limits that the URDF does not state: one number for all joints,
    or one per joint, separated by commas. Without these options, missing limits follow from the
    robot's size. Limits that the motors could not keep are changed, with a note.

    The meshes of the URDF become convex bodies for collision checks. Their files are searched in
    the folders of --packages, in the folders above the URDF, and in the packages of a ROS
    installation (AMENT_PREFIX_PATH, ROS_PACKAGE_PATH).

    The cell of a URDF is rehearsed in simulated time: it is checked and moved for some seconds,
    with lower speeds if the motion is stopped. The exit code is 1 if the rehearsal fails.
    """

    folder: Annotated[
        Path,
        Field(description="Folder to write to; it can exist already."),
        Option(positional=True, metavar="DIR"),
    ]
    urdf: Annotated[
        Path | None,
        Field(description="Make robot and cell from this URDF."),
        Option(group=FROM_URDF, metavar="FILE"),
    ] = None
    base: Annotated[
        str | None,
        Field(description="Fixed base link of the arm in the URDF."),
        Option(group=FROM_URDF, metavar="LINK", needs="urdf"),
    ] = None
    tip: Annotated[
        str | None,
        Field(description="Link of the arm's tool point in the URDF."),
        Option(group=FROM_URDF, metavar="LINK", needs="urdf"),
    ] = None
    packages: Annotated[
        tuple[Path, ...],
        Field(description="Folder with the ROS packages that contain the meshes of the URDF."),
        Option(group=FROM_URDF, metavar="DIR", needs="urdf"),
    ] = ()
    parallelograms: Annotated[
        tuple[str, ...],
        Field(
            description="Joint with <mimic> that its own motor turns through a parallelogram: the"
            " motor's motion adds to that of the mimicked joint."
        ),
        Option(group=FROM_URDF, flag="parallelogram", metavar="JOINT", needs="urdf"),
    ] = ()
    position: Annotated[
        str | None,
        Field(
            description="Position limit of the joints, symmetric about 0, if the URDF states none."
        ),
        Option(group=FROM_URDF, flag="range", metavar="RAD", unit="rad or m", needs="urdf"),
    ] = None
    velocity: Annotated[
        str | None,
        Field(description="Speed limit, if the URDF states none."),
        Option(group=FROM_URDF, metavar="RAD/S", unit="rad/s or m/s", needs="urdf"),
    ] = None
    acceleration: Annotated[
        str | None,
        Field(description="Acceleration limit, if the URDF states none."),
        Option(group=FROM_URDF, metavar="RAD/S2", unit="rad/s² or m/s²", needs="urdf"),
    ] = None
    effort: Annotated[
        str | None,
        Field(description="Torque limit, if the URDF states none."),
        Option(group=FROM_URDF, metavar="NM", unit="N m or N", needs="urdf"),
    ] = None
    rehearsal: Annotated[
        bool,
        Field(
            description="Rehearse the cell of a URDF in simulation before its files are written."
        ),
        Option(group=FROM_URDF, negatable=True),
    ] = True


@dataclass(frozen=True)
class InitResult:
    """Files that were written.

    Attributes:
        folder: Folder of the files.
        files: Names of the files.
        notes: Assumptions about the robot, one sentence each.
        rehearsed: True if the cell was rehearsed.
        obstacle: Reason why the rehearsal failed; empty if it passed.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...] = ()
    rehearsed: bool = False
    obstacle: str = ""

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the rehearsal failed."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.VERDICT_FAILED if self.obstacle else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return the files and the outcome of the rehearsal."""
        return {
            "folder": str(self.folder),
            "files": list(self.files),
            "notes": list(self.notes),
            "rehearsed": self.rehearsed and not self.obstacle,
            "obstacle": self.obstacle,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the files, the notes, the outcome of the rehearsal and the next commands."""
        yield Text(text=f"{self.folder}: wrote {', '.join(self.files)}.")
        for note in self.notes:
            yield Text(text=f"  {note}")
        if ROBOT_PICTURE in self.files:
            yield Text(
                text=f"Compare {self.folder / ROBOT_PICTURE} with the robot: the axes and their"
                " positive directions, gravity, and the tool frame."
            )
        if self.obstacle:
            text = f"The rehearsal of the simulated cell failed: {self.obstacle}"
            yield Verdict(passed=False, text=text)
            return
        if self.rehearsed:
            yield Verdict(
                passed=True, text="Rehearsal passed: the simulated cell was checked and moved."
            )
        cell, motion = self.folder / "cell.yaml", self.folder / "motion.yaml"
        if "motion.yaml" in self.files:
            yield Text(text="Next, on the simulated cell of these files:")
            yield Text(text=f"  {as_command('check', cell)}")
        else:
            yield Text(text="Next, after you have checked limits and rotors in robot.yaml:")
            yield Text(text=f"  {as_command('design', cell, '-o', motion)}")
        yield Text(text=f"  {as_command('record', cell, motion)}")
        yield Text(text=f"Or in the browser, with all further steps: {as_command('serve', cell)}")


def run(request: InitRequest, _context: Context) -> InitResult:
    """Make the files, rehearse the cell of a URDF, and write the files."""
    from rid_daq.runs.output_file import write_new_files

    files, made = (
        _starter_files(request) if request.urdf is None else _urdf_files(request, request.urdf)
    )
    write_new_files(request.folder, files)
    return made


def _starter_files(request: InitRequest) -> tuple[Mapping[str, bytes], InitResult]:
    """Return the bundled files by name, and the result."""
    folder = resources.files("rid_daq") / "starter"
    names = ("cell.yaml", "robot.yaml", "motion.yaml", "validation.yaml")
    files = {name: (folder / name).read_bytes() for name in names}
    return files, InitResult(request.folder, names)


def _urdf_files(request: InitRequest, urdf: Path) -> tuple[Mapping[str, bytes], InitResult]:
    """Return the files for a URDF by name, and the result."""
    from config.process.linux import has_linux
    from rid_daq.operations.start.drawn_robot import files_with_drawing
    from rid_daq.operations.start.urdf_starter import starting_robot
    from rid_daq.runs.output_file import refuse_present

    robot = starting_robot(request, urdf)
    refuse_present(request.folder, URDF_FILES)
    if not request.rehearsal or not has_linux():
        files = files_with_drawing(urdf, robot)
        notes = (*robot.notes, *((NOT_REHEARSED,) if request.rehearsal else ()))
        return files, InitResult(request.folder, tuple(files), notes)
    from rid_daq.operations.start.starter_rehearsal import rehearse_cell

    tried = rehearse_cell(urdf, robot)
    files = files_with_drawing(urdf, tried.made)
    made = InitResult(request.folder, tuple(files), tried.made.notes, True, tried.obstacle)
    return files, made


OPERATION: Final = Operation(
    name="init",
    label="Write example files",
    request=InitRequest,
    run=run,
    examples=("init my-cell --json", "init arm --urdf arm.urdf --base base_link --tip tool0"),
)
