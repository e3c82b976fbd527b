"""reports/accelerometers.md, from accelerometers.json."""

from __future__ import annotations

from collections.abc import Mapping

from tests.evidence.results.accelerometers import Accelerometers, Kind

SHOWN = 5.0  # sigmas, from which on the readings show that something is wrong
WORDS: Mapping[Kind, str] = {
    "link": "a coupler 0.5 to 3 % longer or shorter",
    "unbalance": "an unbalanced crank behind a springy drive: its centre of mass off, or a mass at a radius",
    "clearance": "clearance in a pin, which rattles",
}


def page(found: Accelerometers) -> str:
    """The page."""
    lines = [
        "# Diagnoses from accelerometers alone",
        "",
        "A slider-crank or a crank-rocker turns at three speeds under gravity. Two or three accelerometers at random"
        " places on its coupler and slider, or coupler and follower, are all that is read; their noise (one sigma) is"
        " 0.5 or 5 % of the largest reading without the fault. Exudyn makes the data,"
        " with contact where a pin has clearance; MuJoCo diagnoses, and may name any effect of the vocabulary. *right*:"
        " the true effect at its place is named, or tied with all that is; of an"
        " unbalanced crank com_offset and payload both are. *sigmas*: how far all readings of a set"
        " together are off the nominal rig's, over their noise: what the best search could see; from"
        f" {SHOWN:g} on they show that something is wrong. Written by `python -m"
        " tests.evidence.accelerometers`, which says how to make each row again.",
        "",
        "| what is wrong | noise | sets | right | wrong effect named | nothing named | right of those that show |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for kind, words in WORDS.items():
        for noise in sorted({r.noise for r in found.sets}):
            some = [r for r in found.sets if r.kind == kind and r.noise == noise]
            silent, right = sum(not r.named for r in some), sum(r.right for r in some)
            shown = [r.right for r in some if r.sigmas >= SHOWN]
            share = f"{right} ({100 * right / len(some):.0f} %)" if some else "-"
            lines.append(
                f"| {words} | {100 * noise:g} % | {len(some)} | {share} | {len(some) - right - silent} | {silent}"
                f" | {sum(shown)} of {len(shown)} |"
            )
    lines += ["", "| kind | set | case | noise | chips | missing | sigmas | free | named | verdict | right |"]
    lines.append("|---|--:|---|--:|--:|---|--:|--:|---|---|---|")
    for r in found.sets:
        named = "; ".join(" or ".join((key, *ties)) for key, ties in r.named.items()) or "nothing"
        rattles = f"{100 * r.free:.0f} %" if r.free else "-"
        lines.append(
            f"| {r.kind} | {r.set} | {r.case} | {100 * r.noise:g} % | {r.sensors} | {r.truth} | {r.sigmas:.3g}"
            f" | {rattles} | {named} | {r.verdict} | {'yes' if r.right else 'no'} |"
        )
    versions_ = ", ".join(f"{name} {version}" for name, version in found.versions.items())
    return "\n".join([*lines, "", f"Versions: {versions_}.", ""])
