"""The ESP32 layer as far as it can be shown without the chip: it compiles, its tick is in IRAM, its source is clean."""

from __future__ import annotations

import configparser
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from machine_code import Function, functions, reached

from gemelo.firmware.platform.esp32.check_linked import INSIDE, IRAM
from gemelo.firmware.platform.esp32.check_linked import functions as functions_in
from gemelo.firmware.platform.esp32.ram import MOST_VARIABLES, measured
from gemelo.firmware.platform.host.image import source_version
from tests.optional import need

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "firmware"
LAYER = FIRMWARE / "platform/esp32"
CHIPS = ("esp32", "esp32s3", "esp32c3")
INTERRUPT = "_ZN6gemelo4Tick8on_alarmEP9gptimer_tPK26gptimer_alarm_event_data_tPv"
# Of ESP-IDF, and in IRAM there.
ALLOWED = {"esp_timer_get_time", "vTaskNotifyGiveFromISR"}
DIVIDES = re.compile(r"^(div|rem)u?$")

SECRETS = {
    "a value for a password or a key": r"(?i)(ssid|passw|secret|token|api_?key)\w*\s*(\[\w*\])?\s*[=:(]\s*R?\"[^\"\s]",
    "a broker's address": r"(?i)mqtts?://(?!host\b)[\w.]",
    "an address of a network": r"\b(?!127\.0\.0\.1|0\.0\.0\.0)\d{1,3}(\.\d{1,3}){3}\b",
    "a certificate or a private key": r"-----BEGIN",
}


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("esp32")
    done = subprocess.run([LAYER / "check", folder], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def interrupt_code(objects: Path) -> dict[str, Function]:
    """The layer's interrupt and what of the core is mapped into IRAM, for the C3, as ESP-IDF would compile it."""
    need("riscv")
    folder = objects / "core"
    folder.mkdir()
    mapped = []
    for name in _mapped(LAYER / "gemelo_core/linker.lf"):
        mapped.append(folder / f"{name}.o")
        subprocess.run(
            ["riscv64-unknown-elf-g++", "-std=c++17", "-O2", "-march=rv32imc", "-mabi=ilp32", "-ffreestanding",
             "-fno-exceptions", "-fno-rtti", f"-I{LAYER}/stubs/bare", f"-I{FIRMWARE}/core",
             "-c", FIRMWARE / f"core/{name}.cpp", "-o", mapped[-1]],
            check=True,
        )  # fmt: skip
    return functions([objects / "esp32c3/tick.o", *mapped])


def _mapped(fragment: Path) -> list[str]:
    return re.findall(r"^\s+(\w+) \(noflash\)$", fragment.read_text(), re.MULTILINE)


def _sources() -> list[Path]:
    return sorted((LAYER / "main").glob("*.cpp")) + sorted((LAYER / "main").glob("*.h"))


def test_the_layer_compiles_for_every_chip_with_all_warnings_as_errors(objects: Path) -> None:
    expected = {source.stem for source in (LAYER / "main").glob("*.cpp")}
    for chip in CHIPS:
        assert {path.stem for path in (objects / chip).glob("*.o")} == expected


def test_the_tick_never_leaves_iram(interrupt_code: dict[str, Function]) -> None:
    inside, outside = reached(interrupt_code, INTERRUPT)
    assert outside <= ALLOWED
    assert len(inside) > 3
    assert interrupt_code[INTERRUPT].section.startswith(".iram1")
    # A weak function, one of a header, may be taken from another object: from one that lies in flash.
    assert {name for name in inside if interrupt_code[name].is_weak} == set()


def test_the_tick_neither_divides_nor_calls_through_a_pointer(interrupt_code: dict[str, Function]) -> None:
    inside, _ = reached(interrupt_code, INTERRUPT)
    for name in inside:
        assert not {m for m in interrupt_code[name].mnemonics if DIVIDES.match(m)}, name


def test_objects_with_interrupt_code_are_mapped_out_of_the_flash() -> None:
    assert {"stepper", "input_watch"} <= set(_mapped(LAYER / "gemelo_core/linker.lf"))
    assert _mapped(LAYER / "main/linker.lf") == ["tick"]
    settings = (LAYER / "sdkconfig.defaults").read_text()
    assert "CONFIG_GPTIMER_ISR_IRAM_SAFE=y" in settings


@pytest.mark.parametrize(("place", "message"), [(0x4038_0000, ""), (0x4200_0000, "not in the IRAM of esp32c3")])
def test_what_was_linked_is_looked_at(
    objects: Path, interrupt_code: dict[str, Function], tmp_path: Path, place: int, message: str
) -> None:
    """The layer's tick and the core's two objects, linked for the C3 into its IRAM, or into its flash."""
    core = [objects / "core" / f"{name}.o" for name in _mapped(LAYER / "gemelo_core/linker.lf")]
    elf = tmp_path / "firmware.elf"
    link = ["riscv64-unknown-elf-ld", "-m", "elf32lriscv", "--unresolved-symbols=ignore-all", "--no-relax", "-e", "0"]
    link.append(f"--section-start={interrupt_code[INTERRUPT].section}=0x40390000")
    parts = [objects / "esp32c3/tick.o", *core]
    subprocess.run([*link, f"-Ttext={place:#x}", "-o", elf, *parts], check=True, capture_output=True)
    command = [sys.executable, LAYER / "check_linked.py", "esp32c3", elf]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == (1 if message else 0), done.stderr
    assert message in done.stderr
    inside, _ = reached(interrupt_code, INTERRUPT)
    named = functions_in(elf.read_bytes())
    assert all(name in named and any(part in name for part in INSIDE) for name in inside), inside


def test_every_chip_is_built_for_the_smallest_flash_and_its_link_is_looked_at() -> None:
    settings = configparser.ConfigParser(inline_comment_prefixes=(";",))
    settings.read(FIRMWARE / "platformio.ini")
    assert settings["env:esp32s3"]["board_upload.flash_size"] == "4MB"  # the board named there has 8
    assert "CONFIG_ESPTOOLPY_FLASHSIZE_4MB=y" in (LAYER / "sdkconfig.defaults").read_text()
    kind, _, script = settings["env"]["extra_scripts"].partition(":")
    assert kind == "post"
    assert FIRMWARE / script == LAYER / "check_linked.py"
    assert set(IRAM) == set(CHIPS)


def test_tasks_share_no_lock_and_allocate_nothing() -> None:
    lock = re.compile(r"Semaphore|Mutex|mutex|CRITICAL|xQueue|\bnew \w|malloc|calloc|printf|\bfloat\b|\bdouble\b")
    found = {f"{path.name}: {line.strip()}" for path in _sources() for line in path.read_text().splitlines()
             if lock.search(line.split("//")[0])}  # fmt: skip
    assert found == set()


def test_no_source_holds_credentials() -> None:
    need("git")
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "firmware"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    files = [ROOT / name for name in listed if not name.endswith((".md", ".svg")) and "/tests/" not in name]
    assert len(files) > 80
    found = [f"{path}: {what}" for path in files if path.exists() for what in _secrets_in(path.read_text())]
    assert found == []


def _secrets_in(text: str) -> list[str]:
    return [what for what, pattern in SECRETS.items() if re.search(pattern, text)]


@pytest.mark.parametrize(
    "planted",
    [
        'const char* WIFI_PASSWORD = "hunter2";',
        'char wifi_ssid[] = "lab";',
        '#define MQTT_TOKEN ("abc")',
        'config.uri = "mqtt://broker.lan";',
        'connect("192.168.1.7");',
        'R"(-----BEGIN CERTIFICATE-----',
    ],
)
def test_credentials_would_be_found(planted: str) -> None:
    assert _secrets_in(planted)


def test_every_stand_in_declares_only_what_the_layer_uses() -> None:
    code = "".join(path.read_text() for path in _sources())
    unused = []
    for header in sorted((LAYER / "stubs").rglob("*.h")):
        name = str(header.relative_to(LAYER / "stubs"))
        if name.startswith("bare/"):
            continue
        text = re.sub(r"#define(?:.*\\\n)*.*", "", header.read_text())
        includers = code + "".join(h.read_text() for h in (LAYER / "stubs").rglob("*.h") if h != header)
        assert f'#include "{name}"' in includers, name
        declared = set(
            re.findall(
                r"\b(\w+)\([^;{}()]*(?:\([^()]*\)\([^()]*\)[^;{}()]*)?\)(?: __attribute__\(\(noreturn\)\))?;", text
            )
        )
        unused += [f"{name}: {function}" for function in declared if not re.search(rf"\b{function}\b", code)]
    assert unused == []


def test_platformio_builds_the_three_chips_from_what_is_there() -> None:
    settings = configparser.ConfigParser()
    settings.read(FIRMWARE / "platformio.ini")
    envs = {f"env:{chip}{kind}" for chip in CHIPS for kind in ("", "-debug")}
    envs |= {f"env:{chip}-usb" for chip in ("esp32s3", "esp32c3")}  # an ESP32 has no USB of its own
    assert envs == {section for section in settings if section.startswith("env:")}
    assert re.fullmatch(r"espressif32@\d+\.\d+\.\d+", settings["env"]["platform"])
    assert settings["env"]["framework"] == "espidf"
    assert (FIRMWARE / settings["platformio"]["src_dir"] / "CMakeLists.txt").exists()
    assert (FIRMWARE / settings["env"]["board_build.partitions"]).exists()
    project = (FIRMWARE / "CMakeLists.txt").read_text()
    for named in re.findall(r"\$\{CMAKE_CURRENT_LIST_DIR\}/(platform/esp32/\S+?)\)", project):
        assert (FIRMWARE / named).exists(), named


@pytest.mark.parametrize("chip", CHIPS)
def test_a_debug_build_speaks_on_a_console_that_is_not_the_serial_wire(chip: str) -> None:
    silent = (LAYER / "sdkconfig.defaults").read_text()
    speaks = (LAYER / "sdkconfig.debug").read_text() + (LAYER / f"sdkconfig.debug.{chip}").read_text()
    for off in re.findall(r"^(CONFIG_\w+)=n$", speaks, re.MULTILINE):
        assert f"{off}=y" in silent, "what is switched off there was on"
    consoles = {"esp32": "CONFIG_ESP_CONSOLE_UART_CUSTOM_NUM_1=y"}
    assert consoles.get(chip, "CONFIG_ESP_CONSOLE_USB_SERIAL_JTAG=y") in speaks
    assert "CUSTOM_NUM_0" not in speaks
    assert "UART_DEFAULT" not in speaks
    project = (FIRMWARE / "CMakeLists.txt").read_text()
    assert "platform/esp32/sdkconfig.debug" in project
    assert "-DGEMELO_DEBUG=1" in (FIRMWARE / "platformio.ini").read_text()


@pytest.mark.parametrize("chip", ["esp32s3", "esp32c3"])
def test_a_wire_over_the_chips_usb_has_that_socket_for_itself(objects: Path, chip: str) -> None:
    settings = configparser.ConfigParser()
    settings.read(FIRMWARE / "platformio.ini")
    assert settings[f"env:{chip}-usb"]["extends"] == f"env:{chip}, usb"
    assert settings["usb"]["board_build.cmake_extra_args"] == "-DGEMELO_USB_WIRE=1"
    assert "platform/esp32/sdkconfig.usb" in (FIRMWARE / "CMakeLists.txt").read_text()
    assert "CONFIG_ESP_CONSOLE_SECONDARY_NONE=y" in (LAYER / "sdkconfig.usb").read_text()
    assert "GEMELO_USB_WIRE=1" in (LAYER / "main/CMakeLists.txt").read_text()
    assert {"usb_port", "uart_port", "wire"} <= {path.stem for path in (objects / f"{chip}-usb").glob("*.o")}
    driver = (objects / f"{chip}-usb/usb_port.o").read_bytes()
    assert b"usb_serial_jtag_driver_install" in driver
    assert b"uart_driver_install" not in (objects / f"{chip}-usb/uart_port.o").read_bytes()


def test_the_ram_of_every_build_is_what_the_readme_says_and_below_its_bound(objects: Path) -> None:
    need("riscv")
    found = measured(objects)
    rows = re.findall(r"^\| (esp32\w*) \| ([\d, |]+) \|$", (FIRMWARE / "README.md").read_text(), re.MULTILINE)
    said = {chip: [int(value.replace(",", "")) for value in values.split("|")] for chip, values in rows}
    assert said.keys() == set(CHIPS)
    for chip, ram in found.items():
        # A compiler lays out a few constants in its own way.
        assert said[chip] == pytest.approx([*ram, ram.together], abs=64), (
            "run python -m gemelo.firmware.platform.esp32.ram"
        )
        assert ram.variables < MOST_VARIABLES, chip


def test_a_wire_and_tls_are_configured_for_little_ram_and_a_flash_that_is_written() -> None:
    settings = (LAYER / "sdkconfig.defaults").read_text()
    assert {"CONFIG_UART_ISR_IN_IRAM=y", "CONFIG_MBEDTLS_DYNAMIC_BUFFER=y"} <= set(settings.splitlines())


def test_the_image_has_the_version_that_the_firmware_says(tmp_path: Path) -> None:
    """By it the board tells an older image; ESP-IDF's own choice would be what git says."""
    project = (FIRMWARE / "CMakeLists.txt").read_text()
    included, begun = project.index("/version.cmake)"), project.index("project(gemelo)")
    assert included < project.index("project.cmake)") < begun
    script = tmp_path / "script.cmake"
    script.write_text(f'include("{FIRMWARE}/version.cmake")\nmessage(STATUS "it is ${{PROJECT_VER}}.")\n')
    done = subprocess.run(
        [Path(sys.executable).with_name("cmake"), "-P", script], capture_output=True, text=True, check=True
    )
    assert f"it is {source_version()}." in done.stdout


def test_the_partitions_do_not_overlap_and_fit_the_flash() -> None:
    rows = [line.split(",") for line in (LAYER / "partitions.csv").read_text().splitlines() if line[:1] not in "#"]
    places = [(int(row[3], 16), int(row[3], 16) + int(row[4], 16)) for row in rows]
    assert places[0][0] >= 0x9000
    for (_, end), (begin, _) in pairwise(places):
        assert end <= begin
    assert places[-1][1] <= 4 << 20


def test_there_are_two_slots_of_the_same_size_and_a_new_firmware_is_on_trial() -> None:
    rows = [line.split(",") for line in (LAYER / "partitions.csv").read_text().splitlines() if line[:1] not in "#"]
    kinds = {row[2].strip(): (int(row[3], 16), int(row[4], 16)) for row in rows}
    assert "factory" not in kinds  # the boot loader would fall back to it, not to the firmware before
    assert kinds["ota_0"][1] == kinds["ota_1"][1] >= 0x180000
    assert all(kinds[slot][0] % 0x10000 == 0 for slot in ("ota_0", "ota_1"))  # of what the chip maps
    assert kinds["ota"][1] == 0x2000
    assert "CONFIG_BOOTLOADER_APP_ROLLBACK_ENABLE=y" in (LAYER / "sdkconfig.defaults").read_text()
    assert kinds["ota_0"][0] == 0x20000
    readme = (FIRMWARE / "README.md").read_text()
    assert f"erase-region {kinds['ota'][0]:#x} {kinds['ota'][1]:#x}" in readme
