"""The source of GoogleTest on a machine that does not have it."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from tests.optional import need

FIRMWARE = project_root() / "firmware"
TOOLS = ["c++", "cc", "ninja", "sh", "uname", "ld", "as", "ar", "ranlib", "dpkg-deb", "tar", "cp"]
STAND_IN = """cmake_minimum_required(VERSION 3.10)
project(googletest)
add_library(gtest_main INTERFACE)
add_library(GTest::gtest_main ALIAS gtest_main)
"""
APT = """#!/bin/sh
[ "$1" = download ] && cp {deb} .
"""


class Computer:
    """A PATH of symbolic links, for a CMake that finds no GoogleTest and no other programs."""

    def __init__(self, folder: Path) -> None:
        self.bin, self.build, self.folder = folder / "bin", folder / "build", folder
        self.bin.mkdir()
        for name in TOOLS:
            found = shutil.which(name, path=f"{Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin")
            if found is not None:
                (self.bin / name).symlink_to(found)

    def configure(self, *options: str) -> subprocess.CompletedProcess[str]:
        cmake = Path(sys.executable).with_name("cmake")
        hidden = ("-DCMAKE_DISABLE_FIND_PACKAGE_GTest=ON", "-DCMAKE_FIND_USE_CMAKE_SYSTEM_PATH=OFF")
        return subprocess.run(
            [cmake, "-S", FIRMWARE, "-B", self.build, "-G", "Ninja", f"-DPython3_EXECUTABLE={sys.executable}",
             *hidden, *options],
            env={"PATH": str(self.bin), "HOME": str(self.folder)}, capture_output=True, text=True, timeout=100,
        )  # fmt: skip

    def sources(self, below: str) -> Path:
        """A stand-in for GoogleTest's sources."""
        made = self.folder / "tree" / below
        made.mkdir(parents=True)
        (made / "CMakeLists.txt").write_text(STAND_IN)
        return self.folder / "tree"


@pytest.fixture
def computer(tmp_path: Path) -> Computer:
    return Computer(tmp_path)


def test_without_googletest_its_package_is_unpacked_into_the_build_folder(computer: Computer):
    need("dpkg")
    tree = computer.sources("usr/src/googletest")
    (tree / "DEBIAN").mkdir()
    (tree / "DEBIAN/control").write_text(
        "Package: googletest\nVersion: 1\nArchitecture: all\nMaintainer: nobody\nDescription: a stand-in\n"
    )
    deb = computer.folder / "googletest_1_all.deb"
    subprocess.run(["dpkg-deb", "--root-owner-group", "--build", tree, deb], check=True, capture_output=True)
    (computer.bin / "apt-get").write_text(APT.format(deb=deb))
    (computer.bin / "apt-get").chmod(0o755)
    done = computer.configure()
    assert done.returncode == 0, done.stderr
    assert (computer.build / "googletest/usr/src/googletest/CMakeLists.txt").exists()


def test_without_apt_a_release_of_another_hash_is_refused_and_the_remedy_is_said(computer: Computer):
    archive = computer.folder / "release.tar.gz"
    with tarfile.open(archive, "w:gz") as packed:
        packed.add(
            computer.sources("googletest-release-1.12.1") / "googletest-release-1.12.1", "googletest-release-1.12.1"
        )
    failed = computer.configure(f"-DGEMELO_GOOGLETEST_URL=file://{archive}")
    assert failed.returncode != 0
    assert "81964fe578e9bd7c94dfdb09c8e4d6e6759e19967e397dbea48d1c10e45d0df2" in failed.stdout + failed.stderr
    assert "sudo apt-get install libgtest-dev" in failed.stdout
