"""The linkage as a drawing that moves by itself (SVG with SMIL): for a report, a slide or a README, no script."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from compare.report.figure import Series
from compare.report.linkage import Moved, Pose, both_poses, configuration, displaced_by, exaggeration, pose_at
from compare.report.peaks import over
from compare.report.svg import COLOURS, INK, PAPER, Scale, label, picture

WIDTH, MARGIN, TALLEST = 480.0, 34.0, 420.0  # px
SECONDS = 4.0  # of one way through the motion
FRAMES = 120  # at most


class Pictured(Moved, Protocol):
    """What moves, with the name of its case."""

    @property
    def case(self) -> str: ...


def moving_picture(result: Pictured) -> str:
    """The SVG text; empty where the poses of the bodies are not known at two samples."""
    m, x = result.mechanism, over(result)
    ideal, displaced = both_poses(result)
    times = exaggeration(m, result) if ideal else 1
    poses: list[Pose] = []
    for k in np.unique(np.linspace(0, len(x.values) - 1, min(FRAMES, len(x.values))).astype(int)):
        pose = displaced_by(pose_at(ideal, k), pose_at(displaced, k), times)
        if pose:
            poses.append(pose)
    if len(poses) < 2:
        return ""
    poses = poses if over(result).around else [*poses, *reversed(poses)]
    gaps = {joint: times * size for joint, size in result.clearance.items()}
    frames = [configuration(m, pose, "", "analytic", gaps) for pose in poses]
    across, up, height = _scales(frames)
    body = [_moving([frame[k] for frame in frames], across, up) for k in range(len(frames[0]))]
    if times > 1:
        body.append(label(f"gaps drawn {times} times as large", WIDTH / 2, height + 2, "middle"))
        height += 14.0
    title = f"{result.case}, moving over {x.at(0)} to {x.at(-1)}"
    title += f", gaps drawn {times} times as large" if times > 1 else ""
    return picture(WIDTH, height, title, body)


def _scales(frames: Sequence[Sequence[Series]]) -> tuple[Scale, Scale, float]:
    xs, ys = ([v for f in frames for s in f for v in getattr(s, axis) if v is not None] for axis in "xy")
    wide, tall = (max(v) - min(v) or 1.0 for v in (xs, ys))
    per_unit = min((WIDTH - 2 * MARGIN) / wide, (TALLEST - 2 * MARGIN) / tall)
    height = per_unit * tall + 2 * MARGIN
    left = (WIDTH - per_unit * wide) / 2
    return (
        Scale(min(xs), max(xs), left, left + per_unit * wide),
        Scale(min(ys), max(ys), height - MARGIN, MARGIN),
        height,
    )


def _moving(series: Sequence[Series], x: Scale, y: Scale) -> str:
    """One part of the drawing over all frames, with the names of its joints."""
    first = series[0]
    colour = COLOURS.get(first.role, INK)
    r = {"joint": 4.5, "pivot": 10.0}.get(first.mark, 0.0)
    paths = [_path(s, x, y, r, first.mark) for s in series]
    style = {"link": 'stroke-width="7" stroke-opacity="0.4"', "dashed": 'stroke-width="1.4" stroke-dasharray="6 4"'}
    fill = PAPER if r else "none"
    same = all(path == paths[0] for path in paths)
    moves = "" if same else _animated("d", paths)
    stroke = style.get(first.mark, 'stroke-width="1.8"')
    out = (
        f'<path d="{paths[0]}" fill="{fill}" stroke="{colour}" {stroke}'
        f' stroke-linejoin="round" stroke-linecap="round">{moves}</path>'
    )
    for k, name in enumerate(first.labels):
        places = [(x(s.x[k] or 0.0) - 10, y(s.y[k] or 0.0) - 9) for s in series]
        text = label(name, *places[0], "end", 13, "600")
        moved = "".join(_animated(a, [f"{p[i]:.1f}" for p in places]) for i, a in enumerate("xy"))
        out += text.replace("</text>", ("" if len(set(places)) == 1 else moved) + "</text>")
    return out


def _animated(attribute: str, values: Sequence[str]) -> str:
    listed = ";".join([*values, values[0]])
    return f'<animate attributeName="{attribute}" values="{listed}" dur="{SECONDS:g}s" repeatCount="indefinite"/>'


def _path(series: Series, x: Scale, y: Scale, r: float, mark: str) -> str:
    out, pen = [], "M"
    for a, b in zip(series.x, series.y, strict=True):
        if a is None or b is None:
            pen = "M"
        elif mark == "pivot":
            out.append(f"M{x(a):.1f} {y(b):.1f}l{r:g} {1.5 * r:g}h-{2 * r:g}z")
        elif mark == "joint":
            out.append(f"M{x(a):.1f} {y(b):.1f}m{r} 0a{r} {r} 0 1 0 -{2 * r} 0a{r} {r} 0 1 0 {2 * r} 0")
        else:
            out.append(f"{pen}{x(a):.1f} {y(b):.1f}")
            pen = "L"
    return "".join(out)
