"""Our structures are the kernel's: a C program that includes its header prints all numbers."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cornertouchd.devices import v4l2_abi
from cornertouchd.devices.v4l2_abi import fourcc, fourcc_name

STRUCTURES = {
    name: re.match(r"struct (\w+)\.", value.__doc__ or "")[1]
    for name, value in vars(v4l2_abi).items()
    if isinstance(value, type) and issubclass(value, ctypes.Structure) and name != "Structure"
}
OUR_OWN_FIELDS = {("Format", "fmt"), ("FrameSizeEnum", "size"), ("FrameIntervalEnum", "interval")}
OUR_OWN_FIELDS |= {("QueryMenu", "item"), ("ExtendedControl", "content")}
"""Unions that have no name in the kernel."""
NUMBERS = [
    name
    for name, value in vars(v4l2_abi).items()
    if name.isupper() and not name.startswith("_") and isinstance(value, int)
]


def c_name(number: str) -> str:
    return number if number.startswith("VIDIOC_") else f"V4L2_{number}"


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> dict[str, int]:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not Path("/usr/include/linux/videodev2.h").exists():
        pytest.skip("no C compiler, or no kernel headers")
    asked = {f"sizeof(struct {c})": f"sizeof {ours}" for ours, c in STRUCTURES.items()}
    for ours, c in STRUCTURES.items():
        for field in (entry[0] for entry in getattr(v4l2_abi, ours)._fields_):
            if (ours, field) not in OUR_OWN_FIELDS:
                asked[f"offsetof(struct {c}, {field})"] = f"{ours}.{field}"
    asked["offsetof(struct v4l2_format, fmt)"] = "Format.fmt"
    asked["offsetof(struct v4l2_querymenu, name)"] = "QueryMenu.item"
    asked["offsetof(struct v4l2_ext_control, value64)"] = "ExtendedControl.content"
    asked["offsetof(struct v4l2_frmsizeenum, stepwise)"] = "FrameSizeEnum.size"
    asked["offsetof(struct v4l2_frmivalenum, stepwise)"] = "FrameIntervalEnum.interval"
    asked |= {c_name(number): number for number in NUMBERS}
    directory = tmp_path_factory.mktemp("abi")
    source = directory / "abi.c"
    prints = "\n".join(
        f'printf("%s=%lld\\n", "{key}", (long long)(unsigned long)({expression}));'
        for expression, key in asked.items()
    )
    source.write_text(
        "#include <stddef.h>\n#include <stdio.h>\n#include <sys/time.h>\n"
        f"#include <linux/videodev2.h>\nint main(void) {{\n{prints}\nreturn 0; }}\n"
    )
    program = directory / "abi"
    subprocess.run([compiler, "-o", program, source], check=True, timeout=60)
    output = subprocess.run([program], check=True, capture_output=True, text=True, timeout=60)
    pairs = (line.rsplit("=", 1) for line in output.stdout.splitlines())
    return {key: int(value) for key, value in pairs}


def test_structures_have_the_size_and_offsets_of_the_kernel(kernel: dict[str, int]) -> None:
    assert len(STRUCTURES) > 15
    ours = {}
    for name in STRUCTURES:
        structure = getattr(v4l2_abi, name)
        ours[f"sizeof {name}"] = ctypes.sizeof(structure)
        for field in structure._fields_:
            ours[f"{name}.{field[0]}"] = getattr(structure, field[0]).offset
    assert ours == {key: value for key, value in kernel.items() if key not in NUMBERS}


def test_requests_and_constants_have_the_numbers_of_the_kernel(kernel: dict[str, int]) -> None:
    assert len(NUMBERS) > 50
    assert {name: getattr(v4l2_abi, name) for name in NUMBERS} == {
        name: kernel[name] & 0xFFFF_FFFF for name in NUMBERS
    }


def test_names_of_pixel_formats_are_those_of_v4l2_ctl() -> None:
    assert fourcc("YUYV") == 0x56595559
    assert fourcc("Y10") == 0x20303159
    assert [fourcc_name(fourcc(name)) for name in ("GREY", "Y16", "MJPG")] == [
        "GREY",
        "Y16",
        "MJPG",
    ]
    assert fourcc_name(fourcc("Y16") | 1 << 31) == "Y16-BE"
    assert fourcc_name(0x0000_0001) == "????"
