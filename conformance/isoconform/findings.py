"""Findings as they are shown and saved: the file, what was expected, what came, and an annotated dump."""

from __future__ import annotations

from pathlib import Path

from .explain import explanation
from .fuzz import Finding


def described(finding: Finding, place: Path | None) -> dict[str, object]:
    """A finding for programs."""
    return {
        "sort": finding.sort, "reason": finding.reason, "case": finding.trial.case, "asked": finding.trial.kind,
        "seconds": round(finding.seconds, 1), "bytes": len(finding.data), "bytes_before": len(finding.trial.there),
        "hex": finding.data.hex(), "file": None if place is None else str(place),
    }


def saved(finding: Finding, seed: int, folder: Path, number: int) -> Path:
    """Save a finding as a candidate for a vector: the file, the reference's text, and a report beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"finding_{number:02}.iso"
    path.write_bytes(finding.data)
    path.with_suffix(".txt").write_text(finding.expected.text, encoding="ascii", newline="\n")
    trial = finding.trial
    lines = [
        f"# {finding.sort}", "", finding.reason, "",
        f"Seed {seed}, case {trial.case}, asked {trial.kind}; {len(trial.there)} bytes, shrunk to {len(finding.data)}:",
        "", f"    {finding.data.hex()}", "",
        f"Expected: exit code {finding.expected.exit_code} and the text of {path.with_suffix('.txt').name}.",
        f"The decoder: {finding.answer.trouble or f'exit code {finding.answer.code} and this text.'}", "",
        *(f"    {line}" for line in finding.answer.text.splitlines()), "",
        *(f"    {line}".rstrip() for line in explanation(path).splitlines()),
    ]
    path.with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return path
