"""deploy/local.toml as a person edits it."""

from __future__ import annotations

import tomllib

import msgspec

from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.services.logger.disk import LoggerParameters


def test_the_example_of_a_parameter_is_one_that_the_logger_has(tmp_path):
    lines = (project_root() / "deploy/local.toml").read_text(encoding="utf-8").splitlines()
    begin = lines.index("# [parameters.logger]")
    lines[begin:] = [line.removeprefix("# ") for line in lines[begin:]]
    edited = tmp_path / "local.toml"
    edited.write_text("\n".join(lines), encoding="utf-8")
    load_deployment(edited, {})
    given = tomllib.loads(edited.read_text(encoding="utf-8"))["parameters"]["logger"]
    assert set(given) <= {field.name for field in msgspec.structs.fields(LoggerParameters)}
    msgspec.convert(given, LoggerParameters)
