"""Prints what a wheel requires, less what must not be installed beside a torch without CUDA."""

import re
import sys
import zipfile

LEFT_OUT = {"torch", "torchvision", "torchaudio", "torchcodec"}

with zipfile.ZipFile(sys.argv[1]) as wheel:
    metadata = wheel.read(next(name for name in wheel.namelist() if name.endswith("METADATA"))).decode()
for requirement in re.findall(r"^Requires-Dist: (.*)", metadata, re.MULTILINE):
    name = re.split(r"[^A-Za-z0-9_.-]", requirement, maxsplit=1)[0].lower()
    if name not in LEFT_OUT and "extra ==" not in requirement:
        sys.stdout.write(requirement + "\n")
