"""Writes THIRD-PARTY-NOTICES.txt: whose code is linked into what the package ships, and under which terms.

    python scripts/notices.py

That is the compiled core, the library of graphics processors, the two WebAssembly modules of the viewer's page, and the
page's script. The crates and their
texts come from `cargo metadata`, for every platform that gets a wheel; where a crate offers several licences, MIT is
taken. Needs Cargo, and `viewer/node_modules`.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections import defaultdict
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
NOTICES = ROOT / "THIRD-PARTY-NOTICES.txt"
APACHE = ROOT / "LICENSE-APACHE"
SHIPPED = {"Cargo.toml": ("viscera-python", "viscera-wasm"), "gpu/Cargo.toml": ("viscera-gpu",)}
"""By the workspace that they are built in."""
PLATFORMS = (  # those of .github/workflows/wheels.yml, and the page
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "aarch64-apple-darwin",
    "x86_64-apple-darwin",
    "x86_64-pc-windows-msvc",
    "wasm32-unknown-unknown",
)
BUNDLED = ("three",)
"""What the page's script has in it; the other packages of viewer/package.json are tools."""
TEXTS = re.compile(r"(licen[cs]e|copying|notice)", re.IGNORECASE)
ALTERNATIVES = re.compile(r"(licen[cs]e-(apache|zlib|bsd|unlicense).*|unlicense|copying)", re.IGNORECASE)
"""Texts of the licences that are not taken where one of several is."""

HEAD = """Third-party notices of Viscera
==============================

Viscera's own terms stand in LICENSE-MIT and LICENSE-APACHE. Its binaries, which
are the compiled core, the library of graphics processors, and the scripts and
WebAssembly modules of the viewer's page, hold code of the projects below.

Written by scripts/notices.py; packages locked: {digest}
"""
BY_HAND = {
    "FDLIBM (method and constants of the logarithm in crates/number/src/elementary.rs)": """\
Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.

Developed at SunPro, a Sun Microsystems, Inc. business.
Permission to use, copy, modify, and distribute this
software is freely granted, provided that this notice
is preserved.""",
    "The Rust standard library": """\
Copyright (c) The Rust Project Contributors

Taken under the MIT licence, of which the text follows under "MIT".""",
}
MIT = """\
Permission is hereby granted, free of charge, to any person obtaining a copy of
this software and associated documentation files (the "Software"), to deal in
the Software without restriction, including without limitation the rights to
use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of
the Software, and to permit persons to whom the Software is furnished to do so,
subject to the following conditions:

The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS
FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER
IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE."""


def digest(root: Path = ROOT) -> str:
    """Of names and versions of all packages locked for Cargo, and of those that the page's script holds."""
    locks = [(root / manifest).with_suffix(".lock").read_text(encoding="utf-8") for manifest in SHIPPED]
    crates = list(set(re.findall(r'name = "(.+)"\nversion = "(.+)"\nsource = ', "".join(locks))))
    locked = json.loads((root / "viewer" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    scripts = [(name, locked[f"node_modules/{name}"]["version"]) for name in BUNDLED]
    return sha256("\n".join(f"{name} {version}" for name, version in sorted(crates + scripts)).encode()).hexdigest()


def linked() -> list[dict[str, Any]]:
    """The packages of Cargo that are linked in on any platform, by name and version."""
    found: dict[str, dict[str, Any]] = {}
    for (manifest, shipped), platform in product(SHIPPED.items(), PLATFORMS):
        command = ["cargo", "metadata", "--manifest-path", manifest, "--format-version", "1", "--locked"]
        command += ["--filter-platform", platform]
        told = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout)
        packages = {package["id"]: package for package in told["packages"]}
        needs = {
            node["id"]: [
                need["pkg"] for need in node["deps"] if any(kind["kind"] is None for kind in need["dep_kinds"])
            ]
            for node in told["resolve"]["nodes"]
        }
        ahead = [name for name, package in packages.items() if package["name"] in shipped]
        seen = set()
        while ahead:
            name = ahead.pop()
            if name in seen or any("proc-macro" in target["kind"] for target in packages[name]["targets"]):
                continue  # a macro runs in the compiler, and is not linked
            seen.add(name)
            ahead += needs[name]
        found |= {name: packages[name] for name in seen if packages[name]["source"]}
    return sorted(found.values(), key=lambda package: (package["name"], package["version"]))


def terms(package: dict[str, Any]) -> list[str]:
    """The texts that a crate asks to be kept with it."""
    folder = Path(package["manifest_path"]).parent
    files = sorted(file for file in folder.iterdir() if file.is_file() and TEXTS.match(file.name))
    if "MIT" in package["license"] and any("mit" in file.name.lower() for file in files):
        files = [file for file in files if not ALTERNATIVES.fullmatch(file.name)]
    texts = [tidy(file.read_text(encoding="utf-8")) for file in files]
    if all(file.name.upper().startswith("COPYING.") for file in files):  # of others, whose code it has taken over
        offered = re.split(" OR |/", package["license"])
        assert {"MIT", "Apache-2.0"} & set(offered), f"{package['name']} brings no text of {package['license']}"
        authors = ", ".join(re.sub(r" <.*>", "", author) for author in package["authors"])
        whose = f"Copyright (c) {authors or 'the authors of ' + package['name']}"
        texts.insert(0, f"{whose}\n\n{MIT}" if "MIT" in offered else tidy(APACHE.read_text(encoding="utf-8")))
    return texts


def tidy(text: str) -> str:
    """Without blanks at the ends of lines, so that equal texts are seen to be equal."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def notices() -> str:
    """The whole file; packages with the same text share it."""
    owners: dict[str, list[str]] = defaultdict(list)
    for package in linked():
        for text in terms(package):
            owners[text].append(f"{package['name']} {package['version']} ({package['license']})")
    for name in BUNDLED:
        folder = ROOT / "viewer" / "node_modules" / name
        about = json.loads((folder / "package.json").read_text(encoding="utf-8"))
        owners[tidy((folder / "LICENSE").read_text(encoding="utf-8"))].append(
            f"{name} {about['version']} ({about['license']})"
        )
    for owner, text in BY_HAND.items():
        owners[text].append(owner)
    owners[MIT].append("MIT")
    sections = [f"{'=' * 80}\n" + "\n".join(names) + f"\n{'-' * 80}\n\n{text}\n" for text, names in owners.items()]
    return "\n".join([HEAD.format(digest=digest()), *sections])


if __name__ == "__main__":
    NOTICES.write_text(notices(), encoding="utf-8")
    print(f"wrote {NOTICES.name}")
