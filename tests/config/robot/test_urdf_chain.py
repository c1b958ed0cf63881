"""Selection of the robot's chain in a URDF with grippers, linkages or several arms."""

from __future__ import annotations

from config.errors import ConfigError
from config.formats.urdf_file import read_urdf
from config.robot.urdf_chain import SeveralArmsError, UrdfArm, arm_between
from tests.builders.raised_codes import raises_code


def arm(*joints: str, tip: str | None = None, base: str | None = None) -> UrdfArm:
    """Return the arm of a URDF whose joints are given as `parent>child` or `parent>child:kind`.

    The kind is a joint type, or `mimic`.
    """
    links: dict[str, None] = {}
    parts = []
    for text in joints:
        ends, _, kind = text.partition(":")
        parent, child = ends.split(">")
        links |= {parent: None, child: None}
        mimic = '<mimic joint="ab"/>' if kind == "mimic" else ""
        parts.append(
            f'<joint name="{parent}{child}" type="{kind if kind and not mimic else "revolute"}">'
            f'<parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0.1 0"/>{mimic}</joint>'
        )
    named = "".join(f'<link name="{link}"/>' for link in links)
    data = f'<robot name="r">{named}{"".join(parts)}</robot>'.encode()
    return arm_between(read_urdf(data, "r.urdf"), base, tip)


ARM = ("a>b", "b>c", "c>d", "d>e")


def names(found: UrdfArm) -> list[str]:
    return [joint.name for joint in found.joints]


def test_a_chain_is_the_arm() -> None:
    found = arm(*ARM, "e>tool:fixed")
    assert names(found) == ["ab", "bc", "cd", "de"]
    assert (found.base, found.tip, found.notes) == ("a", "e", ())


def test_the_arm_ends_before_the_fingers() -> None:
    found = arm(*ARM, "e>hand:fixed", "hand>f:prismatic", "hand>g:mimic")
    assert names(found) == ["ab", "bc", "cd", "de"]
    assert found.notes == (
        "the arm ends at 'e', because a gripper begins there; --tip chooses another end",
    )
    assert len(arm(*ARM, "e>hand:fixed", "hand>f", "hand>g:mimic", tip="f").joints) == 5


def test_a_linkage_in_parallel_to_the_arm_is_ignored() -> None:
    found = arm(*ARM, "b>rod", "c>piston")
    assert names(found) == ["ab", "bc", "cd", "de"]
    assert found.notes == (
        "the arm to 'e' was chosen; piston, rod count as fixed; --tip chooses another arm",
    )


def test_several_arms_are_listed_longest_first() -> None:
    left, right = (tuple(j.replace("a>", f"{s}a>") for j in ARM) for s in "lr")
    both = [f"{side}{p}>{side}{c}" for side in "lr" for p, c in ("ab", "bc", "cd")]
    with raises_code(SeveralArmsError, "RID-URDF-ARM", "--tip") as e:
        arm("t>x", "x>la:fixed", "x>ra:fixed", *both, "rd>re", "t>head")
    assert [found.tip for found in e.value.arms] == ["re", "ld"]
    assert left != right


def test_a_missing_link_or_one_above_the_base_is_refused() -> None:
    for base, tip in (("leg", None), ("a", "hand"), ("c", "b")):
        with raises_code(ConfigError, "RID-URDF-LINK", f"'{tip or base}'"):
            arm(*ARM, base=base, tip=tip)


def test_a_floating_base_is_fixed_and_the_longer_of_two_trees_is_used() -> None:
    assert names(arm("world>a:floating", *ARM)) == ["ab", "bc", "cd", "de"]
    assert names(arm("x>y", *ARM)) == ["ab", "bc", "cd", "de"]
    assert names(arm("x>y", *ARM, base="x")) == ["xy"]


def test_an_arm_that_ends_at_a_mimic_joint_is_refused() -> None:
    with raises_code(ConfigError, "RID-URDF-MIMIC", "'cd'", "'ab'", "--tip"):
        arm("a>b", "b>c", "c>d:mimic", "d>e", "e>f")


def test_a_mimic_joint_within_the_arm_is_refused_with_a_remedy() -> None:
    with raises_code(ConfigError, "RID-URDF-MIMIC", "'cd'", "'ab'", "--tip", "--parallelogram cd"):
        arm("a>b", "b>c", "c>d:mimic", "d>e", tip="e")


def test_an_arm_of_too_many_joints_is_refused_with_the_last_link_that_is_possible() -> None:
    long = [f"l{i}>l{i + 1}" for i in range(33)]
    with raises_code(ConfigError, "RID-URDF-ARM", "33 joints", "--tip l32"):
        arm(*long)
    assert len(arm(*long, tip="l32").joints) == 32
