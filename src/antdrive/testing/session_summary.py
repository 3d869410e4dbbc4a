"""Summary of a test run's drives for the terminal, Markdown and JUnit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.atomic import atomic_write
from antdrive.base.files import without_waiting
from antdrive.base.tables import markdown_text
from antdrive.testing.evaluation import CheckResult

#: Metrics in test reports.
SHOWN = ("min_clearance_m", "duration_s", "driven_length_m")


def properties(result: CheckResult) -> list[tuple[str, str]]:
    """Return a drive's properties in test reports and JUnit files, as names and texts."""
    facts = {
        "test": result.address,
        "case": result.case,
        "passed": str(result.passed).lower(),
        "outcome": result.outcome,
        "certified": str(result.certified).lower(),
        **{name: f"{result.metrics[name]:.6g}" for name in SHOWN if name in result.metrics},
        "digest": result.digest,
        "fault": result.faults[0] if result.faults else "",
        "gains": "; ".join(result.gains),
        "notes": "; ".join(result.notes),
        "baseline": result.accepted,
        "results": str(Path(next(iter(result.files.values()))).parent) if result.files else "",
        "command": result.commands[0] if result.commands else "",
    }
    return [(f"drive.{key}", text) for key, text in facts.items() if text]


def drives_in(properties: Iterable[tuple[str, Any]]) -> Iterator[dict[str, str]]:
    """Yield the drives in a test report's properties; each begins with its test."""
    drive: dict[str, str] = {}
    for name, value in properties:
        if name == "drive.test":
            if drive:
                yield drive
            drive = {}
        if name.startswith("drive."):
            drive[name.removeprefix("drive.")] = str(value)
    if drive:
        yield drive


def lines(drives: Sequence[Mapping[str, str]], unused: Sequence[str], strict: bool) -> Iterator[str]:
    """Yield the terminal's lines: written baselines, improvements, results, unused baselines."""
    failed = sum(drive["passed"] == "false" for drive in drives)
    if drives:
        yield f"{len(drives) - failed} of {len(drives)} drives passed"
    for drive in drives:
        if drive.get("baseline") in ("written", "renewed"):
            yield f"baseline {drive['baseline']}: {drive['test']}"
        if drive.get("gains") and drive["passed"] == "true":
            yield f"better than its baseline: {drive['test']} ({drive['gains']}); renew it with antdrive accept"
        if drive.get("notes"):
            yield f"{drive['test']}: {drive['notes']}"
        if drive.get("results") and drive["passed"] == "false":
            yield f"results: {drive['results']}"
    yield from unused_lines(unused, strict)


def summary_lines(results: Sequence[CheckResult], unused: Sequence[str], strict: bool) -> Iterator[str]:
    """Yield the unused baselines and the number of passed tests, as lines."""
    yield from unused_lines(unused, strict)
    passed = [result for result in results if result.passed]
    better = sum(bool(result.gains) for result in passed)
    gained = f"; {better} better than the baseline: renew it with antdrive accept" if better else ""
    yield f"{len(passed)} of {len(results)} passed{gained}"


def unused_lines(unused: Sequence[str], strict: bool) -> Iterator[str]:
    """Return one line per unused baseline."""
    return (f"{'FAILED: ' if strict else ''}unused baseline: {path}; remove it" for path in unused)


def markdown(drives: Sequence[Mapping[str, str]], unused: Sequence[str]) -> str:
    """Return a Markdown summary for a CI run."""
    failed = [drive for drive in drives if drive["passed"] == "false"]
    text = [f"### Drives: {len(drives) - len(failed)} of {len(drives)} passed", ""]
    if failed:
        text += ["| test | outcome | minimum clearance [m] | time [s] | fault |", "|---|---|---|---|---|"]
        text += [
            "| "
            + " | ".join(
                markdown_text(_plain(drive.get(key, "")))
                for key in ("test", "outcome", "min_clearance_m", "duration_s", "fault")
            )
            + " |"
            for drive in failed
        ]
        text += ["", *(f"    {_plain(drive.get('command', ''))}" for drive in failed), ""]
    better = [drive for drive in drives if drive.get("gains") and drive["passed"] == "true"]
    if better:
        text += [
            f"{len(better)} better than their baselines: "
            + ", ".join(markdown_text(_plain(drive["test"])) for drive in better),
            "",
        ]
    if unused:
        text += ["Unused baselines: " + ", ".join(markdown_text(_plain(path)) for path in unused), ""]
    return "\n".join(text) + "\n"


def save_junit(results: Sequence[CheckResult], path: Path) -> None:
    """Write results as JUnit XML, with the same properties as pytest."""
    import xml.etree.ElementTree as ET

    failed = sum(not result.passed for result in results)
    whole = sum(result.wall_s for result in results)
    counts = {"tests": str(len(results)), "failures": str(failed), "errors": "0", "time": f"{whole:.3f}"}
    tree = ET.Element("testsuites")
    suite = ET.SubElement(tree, "testsuite", {"name": "antdrive", **counts})
    for result in results:
        file, _, name = result.address.rpartition("::")
        words = {"classname": file.replace("/", "."), "name": name, "time": f"{result.wall_s:.3f}"}
        test = ET.SubElement(suite, "testcase", words)
        entries = ET.SubElement(test, "properties")
        for key, value in properties(result):
            ET.SubElement(entries, "property", {"name": key, "value": _plain(value)})
        if not result.passed:
            failure = ET.SubElement(test, "failure", {"message": _plain(result.faults[0])})
            failure.text = "\n".join(map(_plain, result.message.splitlines()))
    with atomic_write(path) as part:
        ET.ElementTree(tree).write(part, encoding="utf-8", xml_declaration=True)


def add_to_page(drives: Iterable[Mapping[str, str]], unused: Sequence[str], say: Callable[[str], None]) -> None:
    """Append the summary to the file named by GITHUB_STEP_SUMMARY, if any. `say` reports write errors."""
    if page := os.environ.get("GITHUB_STEP_SUMMARY"):
        try:
            with open(page, "a", encoding="utf-8", opener=without_waiting) as file:
                file.write(markdown(list(drives), unused))
        except (OSError, ValueError) as error:
            say(f"GITHUB_STEP_SUMMARY: {page}: cannot be written ({getattr(error, 'strerror', None) or error})")


def _plain(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
