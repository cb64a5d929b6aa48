"""Show what this installation has: versions, threads, vector units, graphics, extras; what is missing, how to get it.

Fails (exit 1) if something that every user needs is missing or does not work.
"""

from __future__ import annotations

import argparse

from viscera.cli.output import DONE, FAILED, Outcome, Output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera doctor`."""


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Look, print."""
    from viscera.doctor import BESIDE, examine

    facts = examine()
    output.say(f"viscera {facts['version']}, Python {facts['python']}, {facts['platform']}")
    output.say(f"  processor     {facts['processor']}, {facts['cores']} cores, {facts['threads']} threads in use")
    output.say(f"  vector units  {', '.join(facts['vector_units']) or 'not known on this system'}")
    output.say(f"  graphics      {', '.join(facts['gpus']) or 'none found'}")
    output.say(f"  solver gpu    {facts['gpu'] or facts['gpu_fault']}")
    output.say(f"  packages      {facts['packages_fault'] or _listed(facts['packages'])}")
    for extra, packages in facts["extras"].items():
        missing = [name for name, version in packages.items() if version is None]
        advice = f"; pip install {' '.join(missing)}" if missing else ""
        output.say(f"  [{extra}]".ljust(16) + f"{_listed(packages)}{advice}")
    for name, version in facts["beside"].items():
        output.say(f"  {name:14}" + (version or f"missing; pip install {name} {BESIDE[name]}"))
    for problem in facts["problems"]:
        output.say(f"  problem       {problem}")
    return Outcome("problems", FAILED, facts) if facts["problems"] else Outcome("sound", DONE, facts)


def _listed(packages: dict[str, str | None]) -> str:
    return ", ".join(f"{name} {version}" for name, version in packages.items() if version) or "none"
