"""The SRDF beside a URDF: its states, groups, allowed pairs of links and passive joints, used or named as left out."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.description import ROUNDING
from gemelo.libraries.arm.model.urdf import JointKind, UrdfModel
from gemelo.libraries.robot_import.joint_mending import stand_at
from gemelo.libraries.robot_import.mended import LEFT_OUT, Mended, Semantics, unreadable, with_remedy
from gemelo.libraries.robot_import.poses import zero_state
from gemelo.schemas.reasons import Reason, Value, because, remedy
from gemelo.schemas.text_file import NotUtf8, read_text

SUFFIX, XACRO = ".srdf", ".srdf.xacro"
OWN_GROUP = "arm"  # of the robot's folder
UNUSED = ("virtual_joint", "link_sphere_approximation", "disable_default_collisions", "enable_collisions")
MOST_NAMED = 3  # SRDFs of other robots
OF_SRDF = "of the SRDF: "  # before the reasons that it gives for its pairs


def semantics(mended: Mended) -> None:
    """Reads the SRDF that names this robot; makes its passive joints stand still."""
    name, root = mended.xml.root.get("name", ""), mended.xml.root
    found: list[tuple[Path, ET.Element]] = []
    others: list[tuple[Path, str]] = []
    for file in mended.source.beside(SUFFIX, XACRO):
        if file.name.endswith(XACRO):
            expand = remedy("left_out_expand", file=file.name, expanded=file.name.removesuffix(".xacro"))
            mended.warn(root, Subject(within=file.name), because("mend.srdf.xacro", expand))
            continue
        try:
            srdf = ET.fromstring(read_text(file))
        except (OSError, NotUtf8, ET.ParseError) as error:
            mended.warn(root, Subject(within=file.name), with_remedy(unreadable(error), LEFT_OUT))
            continue
        for element in srdf.iter():
            element.attrib.update({key: mended.renamed.get(text, text) for key, text in element.items()})
        if srdf.get("name") == name:
            found.append((file, srdf))
        else:
            others.append((file, srdf.get("name", "")))
    for file, other in [] if found else others[:MOST_NAMED]:
        strange = because("mend.srdf.other_robot", LEFT_OUT, other=other, robot=name)
        mended.warn(root, Subject(within=file.name), strange)
    for file, _ in found[1:]:
        another = because("mend.srdf.another", remedy("left_out_other_used", file=str(found[0][0])), file=str(file))
        mended.warn(root, Subject(within=file.name), another)
    if found:
        _Reader(mended, *found[0]).read()


class _Reader:
    """One SRDF, read into what is known of the robot."""

    def __init__(self, mended: Mended, file: Path, srdf: ET.Element) -> None:
        self.mended, self.srdf, self.file = mended, srdf, file.name
        self.model = mended.model
        self.known = Semantics(file.name)

    def read(self) -> None:
        for element in self.srdf.findall("group"):
            self._group(element)
        for element in self.srdf.findall("group_state"):
            self._state(element)
        self._passive()
        for element in self.srdf.findall("disable_collisions"):
            self._pair(element)
        for tag in UNUSED:
            count = len(self.srdf.findall(tag))
            if count:
                self._say(Subject(f"<{tag}>"), because("mend.unused", LEFT_OUT, count=count))
        self.mended.semantics = self.known
        known = self.known
        counts = {"groups": len(known.groups), "states": len(known.states), "pairs": len(known.pairs)}
        self._say(Subject("robot"), because("mend.srdf.taken", remedy("taken_into_srdf"), **counts))

    def _say(self, subject: Subject, what: Reason) -> None:
        self.mended.say(self.mended.xml.root, subject._replace(within=self.file), what)

    def _warn(self, subject: Subject, what: Reason) -> None:
        self.mended.warn(self.mended.xml.root, subject._replace(within=self.file), what)

    def _group(self, element: ET.Element) -> None:
        name = element.get("name", "")
        joints, strange = _joints_in(element, self.srdf, self.model, (name,))
        if strange:
            self._warn(Subject("group", name), because("mend.srdf.names", LEFT_OUT, names=tuple(strange)))
        if joints:
            self.known.groups[name] = joints
            tips = [chain.get("tip_link", "") for chain in element.findall("chain")]
            if len(tips) == 1 and tips[0] in self.model.link_names:
                self.known.tips[name] = tips[0]

    def _state(self, element: ET.Element) -> None:
        name, group = element.get("name", ""), element.get("group", "")
        values: dict[str, float] = {}
        subject = Subject("state", name)
        for joint in element.findall("joint"):
            key, text = joint.get("name", ""), joint.get("value", "")
            try:
                value = float(text)
            except ValueError:
                self._warn(subject, because("mend.srdf.number", LEFT_OUT, text=text, joint=key))
                return
            if key not in self.model.joint_names:
                self._warn(subject, because("mend.srdf.joint", LEFT_OUT, joint=key))
                return
            found = self.model.joint(key)
            if found.kind is JointKind.FIXED or found.mimic is not None:
                continue  # they follow
            limit = found.limit
            if limit is not None and found.kind is not JointKind.CONTINUOUS and limit.lower < limit.upper:
                nearest = min(max(value, limit.lower), limit.upper)
                if abs(nearest - value) > ROUNDING:
                    ends: dict[str, Value] = {"lower": limit.lower, "upper": limit.upper}
                    self._warn(subject, because("mend.srdf.limits", LEFT_OUT, joint=key, value=value, **ends))
                    return
                value = nearest
            values[key] = value
        if values and group in self.known.groups:
            self.known.states.append((name, group, values))
        elif values:
            self._warn(subject, because("mend.srdf.group", LEFT_OUT, group=group))

    def _passive(self) -> None:
        names = [each.get("name", "") for each in self.srdf.findall("passive_joint")]
        joints = [each for each in self.model.joints if each.name in names]
        moving = [each for each in joints if each.kind is not JointKind.FIXED and each.mimic is None]
        if moving:
            stand_at(self.mended, zero_state(moving))
            still = tuple(each.name for each in moving)
            passive = because("mend.srdf.passive", remedy("passive_stand_still"), joints=still)
            self._warn(Subject("passive_joint"), passive)

    def _pair(self, element: ET.Element) -> None:
        first, second = sorted((element.get("link1", ""), element.get("link2", "")))
        missing = [link for link in (first, second) if link not in self.model.link_names]
        if missing:
            self._warn(Subject("disable_collisions"), because("mend.srdf.link", LEFT_OUT, link=missing[0]))
        elif first != second:
            self.known.pairs[first, second] = element.get("reason", "")


def _joints_in(
    group: ET.Element, srdf: ET.Element, model: UrdfModel, seen: tuple[str, ...]
) -> tuple[tuple[str, ...], list[str]]:
    """The joints of a group that a motor moves, in the URDF's order, and names in it that there are not."""
    names: set[str] = set()
    strange: list[str] = []
    above = {joint.child: joint for joint in model.joints}
    for element in group:
        name = element.get("name", "")
        if element.tag == "joint":
            names.add(name)
        elif element.tag == "link" and name in above:
            names.add(above[name].name)
        elif element.tag == "chain":
            base, link = element.get("base_link", ""), element.get("tip_link", "")
            strange += [each for each in (base, link) if each not in model.link_names]
            while link != base and link in above:
                names.add(above[link].name)
                link = above[link].parent
        elif element.tag == "group" and name not in seen:
            for other in srdf.findall("group"):
                if other.get("name") == name:
                    inner, more = _joints_in(other, srdf, model, (*seen, name))
                    names |= set(inner)
                    strange += more
    strange += sorted(names - set(model.joint_names))
    driven = (j.name for j in model.joints if j.kind is not JointKind.FIXED and j.mimic is None)
    return tuple(name for name in driven if name in names), strange


def srdf_lines(known: Semantics, joints: Sequence[str], states: Iterable[str]) -> list[str]:
    """The groups and states of an SRDF as lines of robot.srdf, but those whose joints are all `joints`, in order: these
    are `OWN_GROUP`, and the `states` of that group are there already."""
    lines: list[str] = []
    there = set(states)
    names: Mapping[str, str] = {
        name: OWN_GROUP if set(of) == set(joints) else f"{name}_of_srdf" if name == OWN_GROUP else name
        for name, of in known.groups.items()
    }
    for name, of in known.groups.items():
        kept = [joint for joint in of if joint in joints]
        if names[name] != OWN_GROUP and kept:
            lines.append(f"  <group name={quoteattr(names[name])}>")
            lines += [f"    <joint name={quoteattr(joint)}/>" for joint in kept]
            lines.append("  </group>")
    for state, group, values in known.states:
        kept = [joint for joint in joints if joint in values]
        is_whole = names[group] == OWN_GROUP
        if not kept or (is_whole and len(kept) < len(joints)) or (state in there and len(kept) < len(joints)):
            continue
        if is_whole and state in there:
            continue
        lines.append(f"  <group_state name={quoteattr(state)} group={quoteattr(names[group])}>")
        lines += [f'    <joint name={quoteattr(joint)} value="{values[joint]:.9g}"/>' for joint in kept]
        lines.append("  </group_state>")
    return lines
