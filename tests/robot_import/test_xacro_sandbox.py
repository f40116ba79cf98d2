"""A foreign xacro is a program: what attacks it may try, first without our lock, and what honest ones do, with it.

The open lock is the package `xacro` by itself; the attacks do nothing worse than write a file in the test's folder.
"""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import xacro

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.source import find_source
from gemelo.libraries.robot_import.xacro_sandbox.expressions import ExpressionRefused, Interpreter
from gemelo.libraries.robot_import.xacro_sandbox.keeper import Confined, command, expand, namespaces
from gemelo.libraries.robot_import.xacro_sandbox.symbols import functions, symbols
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.test_xacro_files import xacro_file

OPENED = (
    "[c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close']"
    "[0].__init__.__globals__['system']('touch {file}')"
)
RUNS_A_PROGRAM = {
    "a lambda": f"(lambda: {OPENED})()",
    "a comprehension": "[{0} for _ in [1]][0]".replace("{0}", OPENED),
    "a generator": f"list(({OPENED} for _ in [1]))",
    "a lambda as a key": f"sorted([1], key=lambda _: {OPENED})",
    "map over a lambda": f"list(map(lambda _: {OPENED}, [1]))",
}
REACHES_PYTHON = {
    "a format with attributes": "('%c0.__class__.__base__%c' % (123, 125)).format(1)",
    "a format with subscripts": "('%c0[0]%c' % (123, 125)).format([1])",
    "a generator's frame": "(x for x in [1]).gi_frame",
    "a generator's code": "(x for x in [1]).gi_code",
    "type": "python.type(1)",
    "a class made": "python.type('A', (), dict(a=1))",
    "vars": "python.vars(python)",
    "a method as a value": "[].append",
    "a namespace's insides": "python.unevaluated",
    "a function's name as a value": "math.sqrt.real if False else [1].copy()",
    "a walrus": "(secret := 1)",
    "an f-string": "f'1'",
    "bytes": "b'a'.hex()",
    "spread arguments": "max(*[1, 2])",
    "a complex number": "1j",
}
GROWS = (
    "9**9**9", "1 << 10**9", "'a' * 10**9", "10**9 * [0]", "'%999999999d' % 1", "'a'.replace('a', 'a' * 99999 * 2)",
    "'ab'.replace('', 'a' * 99999)", "[x for x in range(10**9)]", "'a'.join(['b' * 9999] * 999)",
    "('%c:999999999%c' % (123, 125)).format(1)", "int('9' * 4000)",
)  # fmt: skip
NAMES = symbols(list, str, str, print)
INTERPRETER = Interpreter(functions(NAMES))


def find_nothing(package: str) -> Path:
    """A search for packages where none is."""
    raise DescriptionError(package)


def by_itself(path: Path) -> str:
    """What the package `xacro` makes of a file, without us; "" where it fails with it."""
    try:
        return str(xacro.process_file(str(path)).toprettyxml(indent="  "))
    except Exception:
        return ""


@pytest.mark.parametrize("how", RUNS_A_PROGRAM)
def test_an_expression_runs_no_program(how: str, tmp_path: Path):
    ran = tmp_path / "ran"
    text = RUNS_A_PROGRAM[how].replace("{file}", str(ran))
    xacro.safe_eval(text, xacro.create_global_symbols())
    assert ran.exists(), "the open lock lets it through"
    ran.unlink()
    with pytest.raises(ExpressionRefused, match="not admitted"):
        INTERPRETER.evaluate(text, NAMES)
    assert not ran.exists()


@pytest.mark.parametrize("how", REACHES_PYTHON)
def test_an_expression_reaches_plain_data_alone(how: str):
    xacro.safe_eval(REACHES_PYTHON[how], xacro.create_global_symbols())  # raises nothing
    with pytest.raises((ExpressionRefused, NameError), match=r"not admitted|is not defined"):
        INTERPRETER.evaluate(REACHES_PYTHON[how], NAMES)


@pytest.mark.parametrize(
    "text", ["getattr(1, 'real')", "open('/etc/passwd')", "__import__('os')", "eval('1')", "exec('1')"]
)
def test_pythons_own_functions_are_not_there(text: str):
    with pytest.raises(NameError, match="is not defined"):
        INTERPRETER.evaluate(text, NAMES)


@pytest.mark.parametrize("text", GROWS)
def test_a_value_does_not_grow_without_bound(text: str):
    with pytest.raises(ExpressionRefused, match=r"limit|more than|three digits"):
        INTERPRETER.evaluate(text, NAMES)


PLACES: dict[str, Callable[[str], tuple[str, ...]]] = {
    "an attribute": lambda text: (f'<link name="${{{text}}}"/>',),
    "a text": lambda text: (f"<link>${{{text}}}</link>",),
    "a property": lambda text: (f'<xacro:property name="p" value="${{{text}}}"/>', '<link name="${p}"/>'),
    "a condition": lambda text: (f'<xacro:if value="${{{text}}}"><link name="a"/></xacro:if>',),
    "a macro's default": lambda text: (
        f'<xacro:macro name="m" params="p:=${{{text}}}"><link name="$' + '{p}"/></xacro:macro>',
        "<xacro:m/>",
    ),
    "a macro's argument": lambda text: (
        '<xacro:macro name="m" params="p"><link name="${p}"/></xacro:macro>',
        f'<xacro:m p="${{{text}}}"/>',
    ),
    "the name of a call": lambda text: (f'<xacro:call macro="${{{text}}}"/>',),
    "an argument's default": lambda text: (f'<xacro:arg name="a" default="${{{text}}}"/>', '<link name="$(arg a)"/>'),
    "an element's name": lambda text: (f'<xacro:element xacro:name="${{{text}}}"/>',),
    "an include": lambda text: (f'<xacro:include filename="${{{text}}}"/>',),
}


@pytest.mark.parametrize("where", PLACES)
def test_every_place_of_an_expression_has_the_lock(where: str, tmp_path: Path):
    ran = tmp_path / "ran"
    text = RUNS_A_PROGRAM["a lambda"].replace("{file}", str(ran))
    path = xacro_file(tmp_path / "arm.xacro", "\n\n", *PLACES[where](text))
    by_itself(path)
    assert ran.exists(), "the open lock lets it through"
    ran.unlink()
    with pytest.raises(DescriptionError) as refused:
        find_source(path)
    assert not ran.exists()
    assert str(refused.value).startswith(f"{path}, line 3: `(lambda: ")
    assert "Lambda is not admitted" in str(refused.value)
    assert "expand it where ROS is" in str(refused.value)


def test_an_eval_command_and_a_unit_in_yaml_have_the_lock_too(tmp_path: Path):
    ran = tmp_path / "ran"
    text = RUNS_A_PROGRAM["a lambda"].replace("{file}", str(ran))
    (tmp_path / "a.yaml").write_text(f'angle: !degrees "{text}"\n')
    loads = xacro_file(tmp_path / "loads.xacro", "<link name=\"${xacro.load_yaml('a.yaml')}\"/>")
    by_itself(loads)
    assert ran.exists(), "the open lock lets it through"
    with pytest.raises(DescriptionError, match=r"a\.yaml, line 1: .*Lambda is not admitted"):
        find_source(loads)
    evaluates = xacro_file(tmp_path / "evaluates.xacro", '<link name="$(eval [x.real for x in [1]])"/>')
    assert "[1]" in by_itself(evaluates)
    with pytest.raises(DescriptionError, match=r'line 1: .*the attribute "real" of int is not admitted'):
        find_source(evaluates)


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A file outside of what is imported."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "secret.xacro").write_text("<robot><link name='SECRET'/></robot>")
    (tmp_path / "mine" / "secret.yaml").write_text("key: SECRET")
    return tmp_path / "mine"


READS = {
    "an include by its path": '<xacro:include filename="{mine}/secret.xacro"/>',
    "an include from above": '<xacro:include filename="../mine/secret.xacro"/>',
    "an include by a pattern": '<xacro:include filename="../mine/*.xacro"/>',
    "an include by a pattern within": '<xacro:include filename="*/secret.xacro"/>',
    "an include by a link": '<xacro:include filename="link.xacro"/>',
    "yaml by its path": "<link name=\"${{xacro.load_yaml('{mine}/secret.yaml')['key']}}\"/>",
    "yaml by a link": "<link name=\"${{load_yaml('link.yaml')['key']}}\"/>",
    "a hidden file": '<xacro:include filename=".ssh/secret.xacro"/>',
}


@pytest.mark.parametrize("how", READS)
def test_no_file_outside_of_the_folder_is_read(how: str, tmp_path: Path, secret: Path):
    path = xacro_file(tmp_path / "theirs" / "arm.xacro", READS[how].format(mine=secret))
    for name, target in (("link.xacro", "secret.xacro"), ("link.yaml", "secret.yaml"), ("linked", "."), (".ssh", ".")):
        (path.parent / name).symlink_to(secret / target)
    assert "SECRET" in by_itself(path), "the open lock lets it through"
    with pytest.raises(
        DescriptionError, match=r"outside of what is imported .* or hidden: copy the file there"
    ) as refused:
        find_source(path)
    assert str(refused.value).startswith(f"{path}: it reads ")


@pytest.mark.parametrize("package", ["..", "../mine", "mine", "/etc"])
def test_a_package_is_one_by_its_name_and_its_content(package: str, tmp_path: Path, secret: Path):
    text = f"<link name=\"${{load_yaml('$(find {package})/secret.yaml')['key']}}\"/>"
    path = xacro_file(tmp_path / "theirs" / "arm.xacro", text)
    with pytest.raises(
        DescriptionError, match=r"is no name of a package|is no package, as it has none of package\.xml"
    ):
        find_source(path)
    (secret / "package.xml").write_text("<package><name>mine</name></package>")
    if package == "mine":
        assert "SECRET" in find_source(path).text


def test_the_environment_is_not_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TOKEN", "SECRET")
    path = xacro_file(tmp_path / "arm.xacro", '<link name="$(env TOKEN)"/>')
    assert "SECRET" in by_itself(path)
    with pytest.raises(
        DescriptionError, match=r"\$\(env TOKEN\): the environment is not given .* --xacro TOKEN:=VALUE"
    ):
        find_source(path)
    assert 'name="none"' in find_source(xacro_file(path, '<link name="$(optenv TOKEN none)"/>')).text


def test_entities_and_pythons_yaml_are_refused(tmp_path: Path):
    path = tmp_path / "arm.xacro"
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
    path.write_text(f'{bomb}<robot name="r" xmlns:xacro="http://x"><link name="&b;"/></robot>')
    assert "a" * 40 in by_itself(path)
    with pytest.raises(DescriptionError, match="the entity &a; is defined in it: write its text where it is used"):
        find_source(path)
    (tmp_path / "a.yaml").write_text(f"a: !!python/object/apply:os.system ['touch {tmp_path}/ran']\n")
    with pytest.raises(DescriptionError, match="could not determine a constructor for the tag"):
        find_source(xacro_file(path, "<link name=\"${xacro.load_yaml('a.yaml')}\"/>"))
    assert not (tmp_path / "ran").exists()


def test_a_macro_that_calls_itself_and_a_file_that_multiplies_end(tmp_path: Path):
    endless = '<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>'
    with pytest.raises(DescriptionError, match="nested too deep for xacro"):
        find_source(xacro_file(tmp_path / "arm.xacro", endless))
    doubling = "".join(
        f'<xacro:macro name="m{n}" params=""><xacro:m{n + 1}/><xacro:m{n + 1}/></xacro:macro>' for n in range(40)
    )
    last = '<xacro:macro name="m40" params=""><link name="a"/></xacro:macro><xacro:m0/>'
    path = xacro_file(tmp_path / "arm.xacro", doubling, last)
    program = "import sys, xacro; xacro.process_file(sys.argv[1])"
    with pytest.raises(subprocess.TimeoutExpired):
        subprocess.run([sys.executable, "-c", program, str(path)], timeout=2.0)
    with pytest.raises(
        DescriptionError, match=r"its expansion was ended: it took more than .*a macro that calls itself"
    ):
        expand(path, {}, Confined(path, tmp_path, find_nothing), seconds=2.0)


HONEST = (
    '<xacro:arg name="name" default="ur5e"/><xacro:arg name="sim" default="false"/>',
    '<xacro:property name="prefix" value="left_"/><xacro:property name="r" value="0.06"/>',
    '<xacro:property name="d" value="${xacro.load_yaml(\'$(find arm_description)/config/limits.yaml\')}"/>',
    '<xacro:property name="limits" value="${d[\'joint_limits\']}"/>',
    '<xacro:include filename="$(find arm_description)/urdf/parts.xacro" ns="parts"/>',
    '<xacro:include filename="missing.xacro" optional="true"/>',
    '<xacro:if value="$(arg sim)"><link name="sim"/></xacro:if>',
    "<xacro:unless value=\"${'ur' in '$(arg name)' and not False}\"><link name=\"other\"/></xacro:unless>",
    '<xacro:macro name="cylinder" params="name mass:=1.5 radius:=${r} xyz:=\'0 0 1\' prefix:=^|x_ *origin **rest">',
    '<link name="${prefix}${name}"><inertial><xacro:insert_block name="origin"/><mass value="${mass}"/>',
    '<inertia ixx="${1./12 * mass * (3 * radius**2 + 0.4**2)}" izz="${0.5 * mass * radius * radius}"/></inertial>',
    '<xacro:insert_block name="rest"/>',
    "<origin xyz=\"${xyz.split(' ')[2]} ${-pi/2} ${radians(90)}\"/></link></xacro:macro>",
    '<xacro:cylinder name="upper" mass="2.5"><origin xyz="0 0 ${r}"/><rest><visual/></rest></xacro:cylinder>',
    '<xacro:call macro="cylinder" name="fore"><origin/><rest/></xacro:call><xacro:parts.hand/>',
    "<a v=\"${limits['pan']['max']} ${limits.pan.max} ${limits['pan'].get('min', 7)} ${d.angle} ${d.length}\"/>",
    "<a v=\"${'pan' in limits} ${'x' if prefix == 'left_' else 'y'} ${not prefix} ${prefix != '' and r &lt; 1}\"/>",
    "<a v=\"${[1, 2, 3][1]} ${(1, 2)[0]} ${dict(a=1)['a']} ${len('abc')}\"/>",
    '<a v="${max(1, 2.5)} ${min(3, 1)} ${python.abs(-1)}"/>',
    '<a v="${sin(pi / 3)} ${math.cos(0.1)} ${sqrt(2)} ${atan2(1, 2)}"/>',
    "<a v=\"${round(2.675, 2)} ${int('7') // 2} ${7 % 4} ${2e-3}\"/>",
    "<a v=\"${' '.join(map(str, [1, 2]))} ${' '.join([str(2 * x) for x in d.list if x &gt; 1])}\"/>",
    '<a v="${python.sum(d.list)}"/>',
    "<a v=\"${'%0.3f_%s' % (pi, 'a')} ${prefix.upper()} ${prefix.rstrip('_')} ${'a,b'.split(',')} ${prefix[0:2]}\"/>",
    "<a v=\"${xacro.arg('name')} ${xacro.tokenize('a,b;c')} ${str(1.0) + 'm'} ${bool(0)}\"/>",
    "<a v=\"${float('1e3')} ${parts.size}\"/>",
    '<a v="${list(python.range(3))} ${python.sorted(d.list)} ${python.list(python.zip([1], [2]))}"/>',
    '<a v="$(eval 1 + 2)" w="$${kept}"/>',
    '<b>text ${r} and ${\'more\'}</b><xacro:property name="lazy" value="${later + 1}"/>',
    '<xacro:property name="later" value="4" scope="global"/><a v="${lazy}"/>',
    "<c>${xacro.message('hello')}</c><xacro:element xacro:name=\"e${1 + 1}\">",
    '<xacro:attribute name="n" value="a${r}"/></xacro:element>',
)


def honest(folder: Path) -> Path:
    """A package with the idioms of AR4, UR and Franka descriptions: its robot's file."""
    (folder / "config").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>arm_description</name></package>")
    (folder / "config" / "limits.yaml").write_text(
        'joint_limits: {pan: {max: 6.28, has: true}}\nangle: !degrees 180\nlength: !millimeters "2 * 5"\n'
        "list: [3, 1, 2]\n"
    )
    xacro_file(
        folder / "urdf" / "parts.xacro", '<xacro:property name="size" value="3"/>',
        '<xacro:macro name="hand" params="n:=${1 + 2}"><link name="hand${n}"/></xacro:macro>',
    )  # fmt: skip
    return xacro_file(folder / "urdf" / "arm.xacro", "\n", "\n".join(HONEST))


def test_what_honest_files_do_is_expanded_as_xacro_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    path = honest(tmp_path / "arm_description")
    ours = find_source(path).text
    assert "arm.xacro says: hello" in capfd.readouterr().out
    ros = ModuleType("ament_index_python.packages")
    ros.__dict__["get_package_share_directory"] = lambda package: str(tmp_path / package)
    monkeypatch.setitem(sys.modules, "ament_index_python", ModuleType("ament_index_python"))
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", ros)
    assert ours == by_itself(path)
    assert "left_upper" in ours


class Terminal(io.StringIO):
    """A person's answers, line by line."""

    def isatty(self) -> bool:
        return True


def test_a_person_is_asked_before_a_xacro_file_is_expanded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    path = xacro_file(tmp_path / "arm.xacro", "<link name=\"${xacro.fatal('expanded')}\"/>")
    monkeypatch.setattr("sys.stdin", Terminal("no\n"))
    assert run(["import", str(path), "--output", str(tmp_path / "urdf")]) is not ExitCode.OK
    said = capsys.readouterr()
    assert "arm.xacro is a xacro file, which is a program: expand it, in a sandbox? [yes]" in said.out
    assert "it was not expanded, and nothing was imported" in said.err
    monkeypatch.setattr("sys.stdin", Terminal("yes\n"))
    assert run(["import", str(path), "--output", str(tmp_path / "urdf")]) is not ExitCode.OK
    assert "xacro cannot expand it: expanded" in capsys.readouterr().err
    assert run(["import", str(path), "--yes", "--output", str(tmp_path / "urdf")]) is not ExitCode.OK
    said = capsys.readouterr()
    assert "which is a program" not in said.out
    assert "xacro cannot expand it: expanded" in said.err


def test_the_process_has_namespaces_where_bwrap_is_installed(tmp_path: Path):
    """Without network, other processes, or any file but the interpreter's."""
    arguments = namespaces(tmp_path)
    assert arguments[:2] == ["--unshare-all", "--die-with-parent"]
    binds = {arguments[place + 1] for place, each in enumerate(arguments) if each == "--ro-bind-try"}
    assert binds >= {"/usr", sys.prefix, str(tmp_path)}
    assert not {"/", "/home", "/root", str(Path.home())} & binds
    assert command()[-2:] == ["-m", "gemelo.libraries.robot_import.xacro_sandbox.process"]


def test_the_process_itself_opens_imports_and_runs_nothing():
    """What would go past the interpreter meets this."""
    program = (
        "from gemelo.libraries.robot_import.xacro_sandbox import process; process.limit(); process.shut()\n"
        "import os, sys\n"
        "for each in (lambda: open('/etc/passwd'), lambda: os.system('true'), lambda: exec('1'), lambda: os.fork(),\n"
        "             lambda: __import__('wave'), lambda: os.listdir('/'), lambda: os.open('/etc/passwd', 0)):\n"
        "    try: each()\n"
        "    except PermissionError: sys.__stdout__.write('refused ')\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["refused"] * 7
